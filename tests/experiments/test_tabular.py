"""Grid tasks, the cells in which episodes begin, corridors, relations: all that is not compiled. Compiled learners:
the exact check against following the policy, Q-learning against a plain loop, what converges. The experiment
`curriculum`: what is run, how it is kept, its tables. The learners have tests of their own.
"""

import dataclasses
import json
import math
import threading
import time
from itertools import chain

import numpy as np
import pytest

from experiments.cache import Cache
from experiments.curricula import runs as module
from experiments.curricula import tables
from experiments.curricula.bars import bars
from experiments.curricula.cases import MODEL, beyond, figure5, sensitivity, strategies
from experiments.curricula.runs import Record, Runner
from experiments.curriculum import _panels
from experiments.figures.episodes import episodes
from experiments.tabular import choose as how
from experiments.tabular.check import ANY, FIRST, distances, solved
from experiments.tabular.choose import LINEAR, LINES, SELF_PACED, UNIFORM, Curriculum
from experiments.tabular.features import by_relations
from experiments.tabular.grid import FREE, GOAL, OFF, ORDER, grid_task
from experiments.tabular.lines import NO_LINES, corridors
from experiments.tabular.model import ANYWHERE, HARDEST, NEW, Explorer, train_map
from experiments.tabular.play import Scenes, play
from experiments.tabular.qlearning import NEVER, Learner, Stop, stepwise, train
from experiments.tabular.rng import below, bits, seeded, share
from experiments.tabular.starts import every_cell, of_scenes
from scenegen.api.spec import parse
from scenegen.errors import RequestError
from scenegen.play.strategies.levels import SelfPaced, Uniform
from scenegen.play.tasks import Outcome, PhiBox

A = "object mug\nobject plate at (0.5, 0.5, 0)\ntask: closeTo(mug, plate, 0)\n"
B = "object spoon\nobject plate at (0.5, 0.5, 0)\ntask: leftOf(spoon, plate) & belowOf(spoon, plate)\n"


def offsets(task):
    """(x, y) of every cell of the board, in cells from the middle of the table."""
    column, row = np.divmod(np.arange(len(task.phi)), task.deep + 2)
    return column - (task.across + 1) // 2, row - (task.deep + 1) // 2


@pytest.mark.parametrize("size", [1, 3, 10])
def test_task_a_is_the_paper_s(size):
    task = grid_task(parse(A), 2 * size + 1)
    x, y = offsets(task)
    inside = (abs(x) <= size) & (abs(y) <= size)
    assert ((task.board.kind == OFF) == ~inside).all()
    assert ((task.board.kind == GOAL) == ((x == 0) & (y == 0))).all()
    distance = np.sqrt(x * x + y * y)
    assert np.allclose(task.phi[inside] / task.edge, -distance[inside])
    assert (task.level[inside] == np.ceil(distance[inside] - 1e-9)).all() and (task.level[~inside] == -1).all()
    assert task.levels == math.ceil(math.sqrt(2) * size)


def test_task_b_is_the_paper_s():
    task = grid_task(parse(B), 21)
    x, y = offsets(task)
    free = task.board.kind == FREE
    assert (free == ((np.maximum(x, y) > 0) & (abs(x) <= 10) & (abs(y) <= 10))).all()
    assert (task.level[free] == np.maximum(x, y)[free]).all()


def test_actions_lead_where_their_names_say():
    task = grid_task(parse(A), 7, order=("up", "left", "down", "right"))
    middle = np.flatnonzero(task.board.kind == GOAL)
    moved = (task.place_of(middle + task.board.moves) - task.place_of(middle)) / task.edge
    assert np.allclose(moved, [(0, 1), (-1, 0), (0, -1), (1, 0)])


def test_a_table_that_is_not_square_and_objects_that_are_held():
    spec = parse("workspace [0, 2] x [-1, 0]\nobject a, b\ntask: leftOf(a, b)\n")
    task = grid_task(spec, 8, moved="b", held={"a": (0.8, -0.5)})
    assert (task.across, task.deep, task.edge) == (8, 4, 0.25)
    inside = task.board.kind != OFF
    assert np.allclose(task.phi[inside], task.place_of(np.flatnonzero(inside))[:, 0] - 0.8)
    poses = np.zeros((1, 2, 3))
    for cell in np.flatnonzero(inside):
        poses[0, 1, :2] = task.place_of(np.array([cell]))
        assert task.cell_of(poses) == cell


@pytest.mark.parametrize(
    "text, settings, words",
    [
        (A, {"across": 1}, "`across` is 1"),
        (A, {"across": 5000}, "5000 by 5000 cells"),
        (A, {"across": 8}, "no cell of a grid of 8 by 8"),
        (A, {"across": 7, "moved": "mgu"}, "the spec has no object `mgu`"),
        (A, {"across": 7, "order": ("up", "up", "down", "left")}, "the moves"),
        (A, {"across": 7, "held": {"mug": (0.1, 0.1)}}, "every object has its place"),
        ("object a, b\ntask: leftOf(a, b)\n", {"across": 7}, "`a` and `b` could move"),
        ("object a, b\ntask: leftOf(a, b)\n", {"across": 7, "moved": "a"}, "`b` has no place"),
        (f"{A}require farFrom(mug, plate, 0.1)\n", {"across": 7}, "requires something"),
        (A.replace("0)\n", "2)\n", 2).replace("0.5, 2)", "0.5, 0)"), {"across": 7}, "every cell"),
    ],
)
def test_what_cannot_be_is_refused(text, settings, words):
    with pytest.raises(RequestError) as caught:
        grid_task(parse(text), **settings)
    [diagnostic] = caught.value.diagnostics
    assert words in diagnostic.title and diagnostic.help


def test_starts_of_every_cell():
    task = grid_task(parse(A), 13)
    starts = every_cell(task)
    assert sorted(starts.cells) == sorted(starts.anywhere) == sorted(task.unsatisfied)
    for level in range(1, task.levels + 1):
        cells = starts.cells[starts.first[level] : starts.first[level + 1]]
        assert len(cells) and (task.level[cells] == level).all()
    assert starts.first[1] == 0 and starts.first[-1] == len(starts.cells)


def test_starts_of_verified_scenes_are_all_cells_about_as_often():
    task = grid_task(parse(B), 13)
    starts = of_scenes(task, task.spec, 40)
    assert set(starts.cells) == set(task.unsatisfied)
    assert (np.diff(task.level[starts.cells]) >= 0).all()
    counts = np.bincount(starts.anywhere, minlength=len(task.phi))[task.unsatisfied]
    # 40 in the mean: Poisson
    assert 0.9 < starts.anywhere.size / len(task.unsatisfied) / 40 < 1.0  # some lie in cells whose middle is satisfied
    assert counts.min() > 5 and counts.max() < 110
    again = of_scenes(task, task.spec, 40)
    assert all((a == b).all() for a, b in zip(starts, again, strict=True))


def test_levels_are_of_one_label():
    task = grid_task(
        parse("object mug\nobject plate at (0.5, 0.5, 0)\na: leftOf(mug, plate)\nb: belowOf(mug, plate)"), 5
    )
    with pytest.raises(RequestError, match=r"`a` and `b`(.|\n)*under one label"):
        of_scenes(task, task.spec, 4)


def test_corridors_hold_every_cell_once():
    task = grid_task(parse(A), 15)
    lines = corridors(task, 3)
    assert sorted(lines.cells) == sorted(task.unsatisfied)
    assert lines.group[0] == 0 and lines.group[-1] == len(lines.first) - 1 and lines.first[-1] == len(lines.cells)
    x, y = offsets(task)
    assert (lines.steps[task.unsatisfied] == (abs(x) + abs(y))[task.unsatisfied]).all()
    for line in range(len(lines.first) - 1):  # outwards, one step at a time
        cells = lines.cells[lines.first[line] : lines.first[line + 1]]
        assert (np.diff(lines.steps[cells]) == 1).all()


def test_corridors_want_a_single_goal():
    with pytest.raises(RequestError, match="cells satisfy"):
        corridors(grid_task(parse(B), 9), 3)


def test_relations_make_nine_rows():
    task = grid_task(parse(A), 9)
    rows, count = by_relations(
        task, parse(A.replace("task: closeTo(mug, plate, 0)", "l: leftOf(mug, plate)\nb: belowOf(mug, plate)"))
    )
    x, y = offsets(task)
    assert count == 9
    for kind in range(9):
        mine = (rows == kind) & (task.board.kind != OFF)
        assert len(set(zip(np.sign(x[mine]), np.sign(y[mine]), strict=True))) == 1
    with pytest.raises(RequestError, match="same objects"):
        by_relations(task, parse(B))


def test_scenes_of_a_box_of_phi():
    task = grid_task(parse(A), 13)
    scenes = Scenes(task, task.unsatisfied)
    assert scenes.space.low == (task.phi[task.unsatisfied].min(),)
    assert scenes.space.high == pytest.approx((-task.edge,))
    box = PhiBox((-3.01 * task.edge,), (-1.99 * task.edge,))
    drawn = {scenes.draw(box)[0] for _ in range(2000)}
    wanted = {cell for cell in task.unsatisfied if box.holds((task.phi[cell],))}
    assert drawn == wanted
    # none in the box: the nearest
    assert scenes.draw(PhiBox((-0.5 * task.edge,), (-0.4 * task.edge,)))[1] == scenes.space.high[0]
    assert scenes.draw(PhiBox((-9.0,), (-8.0,)))[1] == scenes.space.low[0]
    assert ORDER[0] == "right"
    two = grid_task(parse(A + "other: leftOf(mug, plate)\n"), 13)
    with pytest.raises(RequestError, match="2 labels"):
        Scenes(two, two.unsatisfied)


FAIR = Learner(0.5, 0.95, 0.1, True, 40)


def task_a(size=10):
    return grid_task(parse(A), 2 * size + 1)


def learn(task, learner=FAIR, curriculum=None, seed=0, stop=None, lines=NO_LINES):
    q = np.zeros((len(task.phi), 4))
    memory = how.memory(lines)
    curriculum = curriculum or Curriculum(UNIFORM)
    starts = every_cell(task)
    result = train(
        task.board, q, None, learner, curriculum, lines, memory, starts, stop or Stop(both=True), seeded(seed)
    )
    return result, q


def follow(task, q, cell, ties):
    """Steps to the goal from a cell, the most that ties allow; None where it may not arrive. By recursion."""

    def steps(cell, behind):
        if task.board.kind[cell] == GOAL:
            return 0
        if task.board.kind[cell] == OFF or cell in behind:
            return None
        best = np.flatnonzero(q[cell] == q[cell].max())
        found = [steps(cell + task.board.moves[a], behind | {cell}) for a in (best[:1] if ties == FIRST else best)]
        return None if None in found else 1 + max(found)

    return steps(cell, frozenset())


@pytest.mark.long
@pytest.mark.parametrize("ties", [FIRST, ANY])
def test_the_check_is_exact(ties):
    task = task_a(3)
    random = np.random.default_rng(0)
    some = set()
    for _ in range(20):
        # few values: many ties; now and then a value that leads towards the goal
        q = random.integers(0, 3, (len(task.phi), 4)).astype(float)
        towards = random.random(len(task.phi)) < 0.7
        x, y = np.divmod(np.arange(len(task.phi)), task.deep + 2)
        q[towards & (x < 4), 0] = q[towards & (x > 4), 1] = q[towards & (y > 4), 2] = q[towards & (y < 4), 3] = 5.0
        found = distances(task.board, q, None, ties)
        for cell in task.unsatisfied:
            wanted = follow(task, q, cell, ties)
            assert found[cell] == (-1 if wanted is None else wanted)
        some |= set(found.tolist())
        for within in (0, 3):
            good = [d >= 0 and (within == 0 or d <= within) for d in found[task.unsatisfied]]
            assert solved(task.board, q, None, ties, within) == np.mean(good)
    assert {-1, 0, 1, 2, 3, 4, 5} <= some


@pytest.mark.long
def test_q_learning_is_that_of_a_plain_loop():
    """The same random numbers, the textbook's update, no shortcuts."""
    task = task_a(5)
    learner = Learner(0.3, 0.9, 0.4, False, 30)
    q, mine = np.zeros((len(task.phi), 4)), np.zeros((len(task.phi), 4))
    rng, other = seeded(3), seeded(3)
    ends = set()
    for number in range(3000):
        cell = int(task.unsatisfied[number % len(task.unsatisfied)])
        where, steps = stepwise(task.board, q, None, learner, cell, rng)
        step = 0
        for _ in range(30):
            draw = int(bits(other))
            action = (draw >> 38) & 3 if draw >> 40 < int(0.4 * 2**24) else int(mine[cell].argmax())
            after = cell + task.board.moves[action]
            kind = task.board.kind[after]
            target = 10.0 if kind == GOAL else -10.0 if kind == OFF else 0.9 * mine[after].max()
            mine[cell, action] += 0.3 * (target - mine[cell, action])
            cell, step = after, step + 1
            if kind != FREE:
                break
        assert (where, steps) == (kind, step)
        ends.add(int(kind))
    assert ends == {FREE, GOAL, OFF} and np.array_equal(q, mine)


def test_random_numbers():
    rng = seeded(0)
    shares = np.array([share(rng) for _ in range(4000)])
    assert 0.0 <= shares.min() < 0.01 and 0.99 < shares.max() < 1.0 and abs(shares.mean() - 0.5) < 0.03
    counts = np.bincount([below(rng, 5) for _ in range(4000)], minlength=5)
    assert len(counts) == 5 and counts.min() > 650
    assert seeded(0)[0] != seeded(1)[0] and all(seeded(s)[0] for s in range(100))


@pytest.mark.long
def test_learning_converges_and_is_reproducible():
    task = task_a()
    result, q = learn(task)
    assert 0 < result.episodes <= result.any_episodes and 0 <= result.any_share <= 1.0
    assert solved(task.board, q, None, ANY, 40) >= 0.95 and (q[task.board.kind != FREE] == 0).all()
    assert np.abs(q).max() <= 10.0
    again, same = learn(task)
    assert again == result and np.array_equal(q, same)
    assert learn(task, seed=1)[0] != result


def test_it_gives_up():
    result, _ = learn(task_a(), stop=Stop(episodes=5))
    assert (result.episodes, result.any_episodes) == (NEVER, NEVER)


@pytest.mark.parametrize("curriculum", [Curriculum(LINEAR, length=2000, band=1), Curriculum(SELF_PACED, streak=10)])
def test_levels_go_up_and_it_converges(curriculum):
    task = task_a()
    result, _ = learn(task, curriculum=curriculum)
    assert result.any_episodes > 0 and 2 <= result.level <= task.levels + 1


def test_corridors_converge():
    task = task_a()
    lines = corridors(task, 3)
    result, _ = learn(task, curriculum=Curriculum(LINES), lines=lines)
    assert result.any_episodes > 0 and result.level >= 2


def test_backward_replay_needs_fewer_episodes():
    plain, _ = learn(task_a())
    replayed, q = learn(task_a(), FAIR._replace(replay=True))
    assert 0 < 2 * replayed.episodes < plain.episodes
    assert np.abs(q).max() <= 10.0


def test_the_compiled_self_paced_advances_as_the_strategy_does():
    """Window 7, rate 1 and no share, against a streak of 7: the same outcomes, the same level after each of them."""
    task = task_a()
    starts, random = every_cell(task), np.random.default_rng(5)
    mine, memory, rng = Curriculum(SELF_PACED, streak=7), how.memory(NO_LINES), seeded(0)
    space = PhiBox((-task.levels * task.edge,), (0.0,))
    settings = {"levels": task.levels, "window": 7, "rate": 1.0, "share": 0.0, "patience": 10**9, "band": 2}
    theirs = SelfPaced(space, np.random.default_rng(0), **settings)
    seen = set()
    while theirs.level < task.levels:
        cell = how.choose(mine, NO_LINES, memory, starts, len(seen), rng)
        box = theirs.next_task()
        success = bool(random.random() < 0.9)
        how.hear(mine, NO_LINES, memory, cell, success, 1)
        theirs.report(Outcome(box, ((box.low[0] + box.high[0]) / 2.0,), success, 0.0, 1))
        assert memory[how.LEVEL] == theirs.level + 1
        assert task.level[cell] in (memory[how.LEVEL], memory[how.LEVEL] - 1) or memory[how.STREAK] == 0
        seen.add(int(memory[how.LEVEL]))
    assert seen == set(range(1, task.levels + 2))


@pytest.mark.long
def test_any_strategy_can_teach_it():
    task = task_a()

    def of(strategy, seed=0, **settings):
        def make(space):
            return strategy(space, np.random.default_rng(seed), **settings)

        return play(task, Scenes(task, task.unsatisfied, seed), FAIR, make, Stop(both=True), seed)

    uniform = of(Uniform)
    assert 0 < uniform.episodes <= uniform.any_episodes and uniform == of(Uniform)
    # the same learner with the same scenes, only other random numbers: as in compiled code
    compiled = [learn(task, seed=seed)[0].any_episodes for seed in range(10)]
    played = [of(Uniform, seed).any_episodes for seed in range(10)]
    assert 0.8 < np.mean(played) / np.mean(compiled) < 1.25
    assert of(SelfPaced, levels=task.levels).any_episodes > 0


@pytest.mark.slow
@pytest.mark.parametrize("straight", [False, True])
@pytest.mark.parametrize("back", [False, True])
@pytest.mark.parametrize("where", [ANYWHERE, NEW, HARDEST])
def test_maps_converge(straight, back, where):
    task = task_a()
    result = train_map(
        task.board, Explorer(straight, back, 40, where), every_cell(task), Stop(both=True, episodes=4000), seeded(0)
    )
    bound = 0.95 * len(task.unsatisfied) / 40
    assert bound < result.any_episodes <= 40 * bound


@pytest.mark.slow
def test_relations_are_learned_in_a_few_episodes():
    task = task_a(30)
    rows, count = by_relations(
        task, parse(A.replace("task: closeTo(mug, plate, 0)", "l: leftOf(mug, plate)\nb: belowOf(mug, plate)"))
    )
    for replay in (False, True):
        q = np.zeros((count, 4))
        learner, curriculum = FAIR._replace(limit=120, replay=replay), Curriculum(SELF_PACED, streak=1)
        memory, starts, stop = how.memory(NO_LINES), every_cell(task), Stop(both=True)
        result = train(task.board, q, rows, learner, curriculum, NO_LINES, memory, starts, stop, seeded(0))
        assert 0 < result.any_episodes < 200
        assert solved(task.board, q, rows, ANY, 120) >= 0.95


SEEDS = (0, 1)


def cases(size=10):
    return list(
        chain(figure5((5, size), SEEDS), sensitivity(5, SEEDS), strategies(size, 15, SEEDS), beyond(size, SEEDS))
    )


def record(case):
    """Figures that differ with all that a case is; the first seed of one row never converges."""
    base = {"uniform": 9000, "linear": 5000}.get(case.name, 400) * case.size
    count = base + 100 * case.seed
    if case.name == "backward replay, uniform" and case.seed == 0:
        count = -1
    return Record(
        episodes=count, steps=40 * count, resets=count // 7, any_episodes=2 * count if case.both else -1,
        any_steps=80 * count, any_resets=count // 5, any_share=0.5, level=3, cpu=0.25,
    )  # fmt: skip


def found(size=10):
    return [(case, record(case)) for case in cases(size)]


@pytest.fixture
def cache(tmp_path):
    return Cache.beside(tmp_path)


@pytest.fixture(scope="module")
def every():
    return found()


def test_a_request_holds_all_that_a_run_follows_from(cache):
    runner, by_key = Runner(cache, True), {}
    for case in cases():
        by_key.setdefault(runner.key(case), []).append(case)
    for same in by_key.values():
        plain = {dataclasses.replace(case, group="", name="") for case in same}
        assert len(plain) == 1
    assert len(by_key) < len(cases())  # beyond repeats rows of Fig. 5, sensitivity the unchanged setting
    [case] = [case for case in cases() if case.name == "map, uniform" and case.seed == 0]
    assert runner.request(case)["learner"][0] == "Explorer"
    [drawn] = [case for case in cases() if case.source == MODEL and case.task == "A" and case.size == 5
               and case.seed == 0 and case.both]  # fmt: skip
    assert runner.request(drawn) != Runner(cache, False).request(drawn)  # another model


def test_what_was_found_is_kept_and_used_again(cache, monkeypatch):
    done = []
    monkeypatch.setattr(Runner, "draw", lambda self, case: None)
    monkeypatch.setattr(Runner, "perform", lambda self, case: done.append(case) or record(case))
    few = [case for case in cases() if case.source != MODEL][:40]
    first = Runner(cache, True)
    first.all(few[:30], 2, lambda text: None)
    assert {first.key(case) for case in few[:30]} <= {first.key(case) for case in done}
    done.clear()
    second, told = Runner(cache, True), []
    second.all(few, 2, told.append)
    kinds = {(type(case.learner), case.relations) for case in few}
    assert len(done) <= len({second.key(case) for case in few[30:]}) + len(kinds)  # one of each is run to compile it
    assert told and "from an earlier run" in told[0]
    assert all(second.of(case) == record(case) for case in few)


def test_what_fails_on_a_thread_is_raised(cache, monkeypatch):
    def fail(self, case):
        if case.most > 1:
            raise RequestError(module.__name__)

    monkeypatch.setattr(Runner, "draw", lambda self, case: None)
    monkeypatch.setattr(Runner, "perform", fail)
    with pytest.raises(RequestError):
        Runner(cache, True).all(cases()[:9], 2, lambda text: None)


def test_what_was_done_before_a_failure_is_kept(cache, monkeypatch):
    few = [case for case in cases() if case.source != MODEL][:12]
    drawn = []

    def draw(self, case):
        drawn.append(case)
        if len(drawn) > 8:
            deadline = time.monotonic() + 30.0
            while len(self.found) < 5 and time.monotonic() < deadline:
                time.sleep(0.01)
            raise RequestError(module.__name__)

    before = threading.active_count()
    monkeypatch.setattr(Runner, "draw", draw)
    monkeypatch.setattr(Runner, "perform", lambda self, case: record(case))
    with pytest.raises(RequestError):
        Runner(cache, True).all(few, 2, lambda text: None)
    assert len(drawn) == 9 and len(list(cache.folder.glob("*.json"))) >= 5
    deadline = time.monotonic() + 30.0
    while threading.active_count() > before and time.monotonic() < deadline:
        time.sleep(0.01)
    assert threading.active_count() == before


def test_tables(golden, every):
    made = tables.tables(every, (5, 10), 96) | {"bars": bars(every, 10)}
    golden("experiments/curriculum.md", "\n\n".join(f"## {name}\n\n{text}" for name, text in made.items()) + "\n")


def test_data_has_every_run(every):
    rows = tables.data(every)
    assert sum(len(row["seeds"]) for row in rows) == len(every)
    row = next(row for row in rows if row["name"] == "corridors" and row["M"] == 10)
    assert row["episodes"] == [4000, 4100] and row["any_episodes"] == [8000, 8200]
    assert row["learner"]["epsilon"] == 0.1 and row["scenes"] == "exact sampler"
    json.dumps(rows)


@pytest.mark.long
def test_the_figure_leaves_out_what_did_not_converge(every):
    panels = _panels(every)
    assert [panel.words.partition(":")[0] for panel in panels] == [
        "paper-like, task A", "fair, task A", "paper-like, task B", "fair, task B",
    ]  # fmt: skip
    assert set(panels[1].curves) == {"uniform", "linear", "self-paced", "self-paced, model", "corridors"}
    never = [(case, one.model_copy(update={"episodes": -1}) if case.name == "linear" else one) for case, one in every]
    assert _panels(never)[0].curves["linear"] == {5: [], 10: []}
    assert episodes(_panels(never), 2).startswith(b"\x89PNG")
