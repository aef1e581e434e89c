"""Compiled learners: the exact check against following the policy, Q-learning against a plain loop, what converges."""

import numpy as np
import pytest

from experiments.tabular import choose as how
from experiments.tabular.check import ANY, FIRST, distances, solved
from experiments.tabular.choose import LINEAR, LINES, SELF_PACED, UNIFORM, Curriculum
from experiments.tabular.features import by_relations
from experiments.tabular.grid import FREE, GOAL, OFF, grid_task
from experiments.tabular.lines import NO_LINES, corridors
from experiments.tabular.model import ANYWHERE, HARDEST, NEW, Explorer, train_map
from experiments.tabular.play import Scenes, play
from experiments.tabular.qlearning import NEVER, Learner, Stop, stepwise, train
from experiments.tabular.rng import below, bits, seeded, share
from experiments.tabular.starts import every_cell
from scenegen.api.spec import parse
from scenegen.learn.curriculum.strategies.levels import SelfPaced, Uniform
from scenegen.learn.curriculum.tasks import Outcome, PhiBox

A = "object mug\nobject plate at (0.5, 0.5, 0)\ntask: closeTo(mug, plate, 0)\n"
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
