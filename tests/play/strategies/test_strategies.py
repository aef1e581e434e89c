"""What every entry of STRATEGIES keeps to. A new strategy is tested by being in the table. Difficulty, levels and
cells; the mixtures against scikit-learn's; what is said of bad requests. What each strategy promises beyond the
contract.
"""

import inspect
import itertools
import json
import math
import re
import subprocess
import sys

import numpy as np
import pytest

from scenegen.errors import DataError, RequestError
from scenegen.play.strategies import STRATEGIES, strategy
from scenegen.play.strategies.alp_gmm import fit
from scenegen.play.strategies.base import Base, DifficultyAxis, DifficultyGrid, Levels, draw_index, pick
from scenegen.play.tasks import Outcome, PhiBox

from .learners import Chain, draw, reach

SPACES = {
    "one label": PhiBox((-0.7,), (0.1,)),
    "two labels": PhiBox((-1.3, -0.2), (-0.01, 0.4)),
    "one of no width": PhiBox((-1.0, 0.25), (0.0, 0.25)),
    "a point": PhiBox((-0.5,), (-0.5,)),
    "three labels": PhiBox((-1.0, -1.0, -3.0), (0.0, 0.0, 0.0)),
}
BY_THE_CLOCK = {"uniform", "ordered", "linear"}
SHORT = {"linear": {"episodes": 400}, "ordered": {"scenes": 400}, "self_paced": {"patience": 50}}


@pytest.fixture(params=list(STRATEGIES))
def name_strategies(request):
    return request.param


def made(name, space=None, seed=0, **settings):
    return strategy(name, space or reach(), np.random.default_rng(seed), **settings)


def outcome(task, rng, success=None):
    success = bool(rng.random() < 0.5) if success is None else success
    return Outcome(task, draw(task, rng), success, 10.0 if success else -10.0, 3)


def inside(task, space):
    lows = all(low <= mine for low, mine in zip(space.low, task.low, strict=True))
    highs = all(mine <= high for mine, high in zip(task.high, space.high, strict=True))
    return lows and highs and all(low <= high for low, high in zip(task.low, task.high, strict=True))


def play(teacher, count, seed=9, success=None):
    """The tasks of some episodes, each reported before the next."""
    rng, tasks = np.random.default_rng(seed), []
    for _ in range(count):
        tasks.append(teacher.next_task())
        teacher.report(outcome(tasks[-1], rng, success))
    return tasks


def test_the_table_tells_what_is_there(name_strategies):
    kind = STRATEGIES[name_strategies]
    assert issubclass(kind, Base) and kind.name == name_strategies
    # every setting is explained to its reader, and every strategy says what becomes of several labels
    own = set(kind.settings_class.model_fields) - {"labels"}
    assert all(f"`{field}`" in kind.settings_class.__doc__ for field in own)
    assert "everal labels" in inspect.getdoc(kind)


def test_the_page_has_a_row_for_it(name_strategies, root):
    rows = [
        line
        for line in (root / "docs" / "curriculum.md").read_text().splitlines()
        if line.startswith(f"| `{name_strategies}`")
    ]
    source = inspect.getdoc(STRATEGIES[name_strategies])
    for word in re.findall(r"[A-Z]\w+ et al|\d{4}", rows[0]):
        assert word.removesuffix(" et al") in source


def test_the_room_does_without_torch_and_gymnasium():
    """The room above makes its environment known to gymnasium where that is installed; here it is not."""
    code = (
        "import sys; sys.modules['gymnasium'] = None; from scenegen.play.strategies import STRATEGIES\n"
        "sys.exit(', '.join({'torch', 'sklearn', 'scipy'} & set(sys.modules)) or None)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("space", SPACES.values(), ids=SPACES)
def test_tasks_lie_inside_the_space(name_strategies, space):
    tasks = play(made(name_strategies, space, **SHORT.get(name_strategies, {})), 300)
    assert all(inside(task, space) for task in tasks)
    assert all(type(value) is float for task in tasks for value in task.low + task.high)


def test_the_generator_alone_decides(name_strategies):
    space = SPACES["two labels"]
    assert play(made(name_strategies, space), 150) == play(made(name_strategies, space), 150)
    np.random.seed(0)
    before = np.random.get_state()[1].copy()
    made_once = made(name_strategies, space)
    play(made_once, 150)
    assert (np.random.get_state()[1] == before).all()
    if name_strategies not in BY_THE_CLOCK:
        assert play(made(name_strategies, space), 150) != play(made(name_strategies, space, seed=1), 150)


def test_outcomes_may_come_late_in_any_order_or_never(name_strategies):
    """64 episodes at once, as in a vector environment, reported in another order; every tenth never."""
    teacher, rng = made(name_strategies), np.random.default_rng(5)
    for _ in range(6):
        tasks = [teacher.next_task() for _ in range(64)]
        assert all(inside(task, teacher.space) for task in tasks)
        for index in rng.permutation(64):
            if index % 10:
                teacher.report(outcome(tasks[index], rng))


def test_outcomes_of_the_tasks_of_others_do_no_harm(name_strategies):
    """Boxes that nobody asked for, scenes out of the space, phi and rewards that are no numbers."""
    teacher, rng = made(name_strategies), np.random.default_rng(6)
    strange = [
        Outcome(PhiBox((-5.0,), (5.0,)), (-0.5,), True, 10.0, 1),
        Outcome(PhiBox((-5.0,), (5.0,)), (3.0,), True, 10.0, 1),
        Outcome(PhiBox((-0.3,), (-0.2,)), (math.nan,), False, 0.0, 1),
        Outcome(PhiBox((-0.3,), (-0.2,)), (-0.25,), False, math.nan, 1),
        Outcome(PhiBox((-0.3,), (-0.2,)), (-0.25,), False, math.inf, 0),
    ]
    for one in strange * 50:
        teacher.report(one)
        task = teacher.next_task()
        assert inside(task, teacher.space)
        teacher.report(outcome(task, rng))
    assert all(math.isfinite(value) for value in teacher.log().values())


@pytest.mark.parametrize("success", [False, True], ids=["never", "always"])
@pytest.mark.parametrize("labels", [1, 2])
def test_nobody_gets_stuck(name_strategies, labels, success):
    """Whether the learner never or always succeeds, every tenth of the difficulties is met. Wide boxes
    count as scenes draw_index evenly from them."""
    teacher, rng = made(name_strategies, reach(labels), **SHORT.get(name_strategies, {})), np.random.default_rng(3)
    met = set()
    for _ in range(800):
        task = teacher.next_task()
        heard = outcome(task, rng, success)
        met.add(min(int(-min(heard.phi) * 10), 9))
        teacher.report(heard)
    assert met >= set(range(10 if labels == 1 else 1, 10)) and len(met) >= 9
    if labels == 1:
        assert met == set(range(10))


def test_a_source_that_cannot_serve_all_of_the_space(name_strategies):
    """Nothing is harder than half of the reach, and what is asked for beyond is answered with the nearest there is: the
    strategy goes on, and does not ask for the rest alone."""
    teacher, rng = made(name_strategies, **SHORT.get(name_strategies, {})), np.random.default_rng(4)
    pupil, served = Chain(rng), 0
    for _ in range(800):
        task = teacher.next_task()
        there = PhiBox((max(task.low[0], -0.5),), (max(task.high[0], -0.5),))
        heard = pupil.play(there)
        served += task.high[0] > -0.5
        teacher.report(Outcome(task, heard.phi, heard.success, heard.total, heard.steps))
    assert served > 100


@pytest.mark.parametrize("generator", [np.random.PCG64, np.random.MT19937], ids=lambda kind: kind.__name__)
def test_a_saved_strategy_goes_on_as_if_nothing_had_happened(name_strategies, generator):
    space = SPACES["two labels"]
    first = strategy(name_strategies, space, np.random.Generator(generator(7)))
    play(first, 130)
    text = json.dumps(first.state(), allow_nan=False)
    second = strategy(name_strategies, space, np.random.Generator(generator(8)))
    second.restore(json.loads(text))
    assert second.state() == first.state()
    assert play(second, 130) == play(first, 130)
    assert second.log() == first.log()


def test_a_state_outlives_the_strategy_that_it_is_of(name_strategies):
    teacher = made(name_strategies)
    play(teacher, 60)
    state = teacher.state()
    kept = json.dumps(state)
    play(teacher, 60)
    assert json.dumps(state) == kept
    again = made(name_strategies)
    again.restore(state)
    play(again, 60)
    assert json.dumps(state) == kept


@pytest.mark.parametrize("name", ["linear", "ordered", "replay"])
def test_states_that_version_0_1_saved_are_read(name):
    teacher = made(name)
    play(teacher, 60)
    state = teacher.state()
    memory = state["memory"]
    before = {**state, "memory": {"asked" if part == "tasks" else part: saved for part, saved in memory.items()}}
    assert before != state
    again = made(name)
    again.restore(before)
    assert again.state() == state


def test_states_of_others_are_refused(name_strategies):
    teacher = made(name_strategies)
    other = made("linear" if name_strategies == "uniform" else "uniform")
    cases = [
        (other.state(), "this state is of another strategy"),
        (made(name_strategies, SPACES["one label"]).state(), "this state is of another space"),
        (made(name_strategies, labels=[0]).state(), "this state is of another settings"),
        ({**teacher.state(), "memory": {"nothing": 1}}, "not a whole one"),
        ({**teacher.state(), "rng": {"bit_generator": "MT19937"}}, "another random generator"),
        ({}, "this state is of another strategy"),
        (None, "a state is a mapping, not None"),
        ({**teacher.state(), "memory": 3}, "not a whole one"),
        ({**teacher.state(), "memory": list(teacher.state()["memory"])}, "not a whole one"),
        *(
            ({**teacher.state(), "memory": {**teacher.state()["memory"], part: damaged}}, "not a whole one")
            for part in teacher.memory
            for damaged in ("abc", None, {"a": 1}, [[[[1.0]]]])
        ),
    ]
    for state, message in cases:
        before = teacher.state()
        with pytest.raises(DataError, match=message):
            teacher.restore(state)
        assert teacher.state() == before  # nothing is restored by halves


def test_labels_that_do_not_matter_are_left_alone(name_strategies):
    space = PhiBox((-1.0, -2.0, -3.0), (0.0, 0.0, 0.5))
    tasks = play(made(name_strategies, space, labels=[1], **SHORT.get(name_strategies, {})), 200)
    assert {(task.low[0], task.high[0], task.low[2], task.high[2]) for task in tasks} == {(-1.0, 0.0, -3.0, 0.5)}
    if name_strategies != "uniform":
        assert len({task.low[1] for task in tasks}) > 3


def test_names_of_curves_do_not_change(name_strategies):
    teacher = made(name_strategies)
    before = set(teacher.log())
    play(teacher, 300)
    assert set(teacher.log()) == before
    assert all(isinstance(value, (int, float)) for value in teacher.log().values())


def test_all_pairs_of_sizes_of_settings_are_accepted(name_strategies):
    """The least values of all settings work together, too."""
    kind = STRATEGIES[name_strategies].settings_class
    least = {}
    for field, info in kind.model_fields.items():
        bounds = [getattr(one, "ge", None) for one in info.metadata]
        found = next((bound for bound in bounds if bound is not None), None)
        if found is not None and field not in ("low", "high"):
            least[field] = found
    for one, other in itertools.product(least, least):
        play(made(name_strategies, **{one: least[one], other: least[other]}), 30)
    play(made(name_strategies, **least), 120)


SPACES_PLACES = [
    PhiBox((-0.7,), (0.1,)),
    PhiBox((-1.3, -0.2), (-0.01, 0.4)),
    PhiBox((-1.0, 0.25, -3.0), (0.0, 0.25, 0.0)),
    PhiBox((-1.0, -1.0, -3.0), (0.0, 0.5, 0.0)),
]


def boxes(parts):
    return [box for box, _ in sorted(parts._named.items(), key=lambda pair: pair[1])]


@pytest.mark.parametrize("space", SPACES_PLACES)
@pytest.mark.parametrize("kind", [Levels, DifficultyGrid])
def test_parts_fill_the_space_and_do_not_overlap(space, kind):
    parts, rng = kind(DifficultyAxis(space), 4), np.random.default_rng(0)
    for _ in range(300):
        phi = draw(space, rng)
        mine = [parts._named[box] for box in boxes(parts) if box.holds(phi)]
        assert len(mine) == 1
        assert parts.index_of(Outcome(space, phi, True, 0.0, 1)) == mine[0]


@pytest.mark.parametrize("space", SPACES_PLACES)
def test_an_outcome_belongs_to_the_level_that_was_asked_for(space):
    levels, rng = Levels(DifficultyAxis(space), 3), np.random.default_rng(0)
    for level in range(3):
        for _ in range(10):
            task = levels.box(level, rng)
            assert levels.index_of(Outcome(task, draw(task, rng), True, 0.0, 1)) == level
            assert levels.index_of(Outcome(task, draw(space, rng), True, 0.0, 1)) == level  # a source that had none


@pytest.mark.parametrize("space", SPACES_PLACES)
def test_an_outcome_belongs_to_the_cell_that_its_scene_lay_in(space):
    cells, rng = DifficultyGrid(DifficultyAxis(space), 3), np.random.default_rng(0)
    for cell in range(cells.count):
        task = cells.box(cell)
        for phi in (draw(task, rng), task.low, task.high):  # faces, too, belong to the box that was asked for
            assert cells.index_of(Outcome(task, phi, True, 0.0, 1)) == cell
        other = cells.box((cell + 1) % cells.count)
        assert cells.index_of(Outcome(task, draw(other, rng), True, 0.0, 1)) == (cell + 1) % cells.count


def test_cells_without_scenes_are_closed_after_three_attempts_and_opened_by_a_scene():
    cells, rng = DifficultyGrid(DifficultyAxis(reach()), 4), np.random.default_rng(0)
    for cell, times in [(3, 3), (2, 2), (1, 5)]:
        for _ in range(times):
            cells.index_of(Outcome(cells.box(cell), (-0.1,), True, 0.0, 1))
    assert cells.open.tolist() == [1, 0, 1, 0]
    assert {cells.random_open(rng) for _ in range(50)} == {0, 2}
    assert cells.index_of(Outcome(reach(), (-0.9,), True, 0.0, 1)) == 3
    for _ in range(5):  # it has scenes, whatever the source says later
        cells.index_of(Outcome(cells.box(3), (-0.1,), True, 0.0, 1))
    assert cells.open.tolist() == [1, 0, 1, 1]


def test_the_last_cell_is_never_closed():
    cells, rng = DifficultyGrid(DifficultyAxis(reach()), 2), np.random.default_rng(0)
    for _ in range(5):
        for cell in range(2):
            assert cells.index_of(Outcome(cells.box(cell), (9.0,), True, 0.0, 1)) is None
    assert cells.open.sum() == 1
    assert cells.open[cells.random_open(rng)] == 1.0


def test_levels_are_difficulties():
    axis, rng = DifficultyAxis(SPACES_PLACES[1]), np.random.default_rng(0)
    assert axis.difficulty(axis.space.high) == 0.0
    assert axis.difficulty(axis.space.low) == 1.0
    assert axis.difficulty((-0.01, 0.1)) == pytest.approx(0.5)  # one label at its best, the other half way
    assert axis.difficulty((0.0, 0.1)) is None and axis.difficulty((float("nan"), 0.1)) is None
    for near, far in [(0.0, 0.3), (0.25, 0.5), (0.9, 1.0)]:
        found = [axis.difficulty(draw(pick(axis.shell(near, far), rng), rng)) for _ in range(100)]
        assert near - 1e-9 <= min(found) and max(found) <= far + 1e-9


def test_scenes_of_a_shell_are_spread_evenly():
    """Of two labels, in the difficulties from 0.5 to 1, a third each: first label alone, second alone, both far."""
    axis, rng = DifficultyAxis(reach(2)), np.random.default_rng(0)
    far = np.array([draw(pick(axis.shell(0.5, 1.0), rng), rng) for _ in range(3000)]) < -0.5
    shares = [np.mean(far[:, 0] & ~far[:, 1]), np.mean(far[:, 1] & ~far[:, 0]), np.mean(far.all(1))]
    assert shares == pytest.approx([1 / 3] * 3, abs=0.03)


def test_the_ends_of_the_reach_are_met_exactly():
    """However awkward the numbers: the hardest scene is in the last level, the easiest in the first."""
    rng = np.random.default_rng(0)
    for _ in range(200):
        low, high = sorted(rng.normal(size=2).tolist())
        levels = Levels(DifficultyAxis(PhiBox((low,), (high,))), 7)
        assert levels.box(6, rng).low == (low,) and levels.box(0, rng).high == (high,)


def test_draws_follow_their_weights():
    rng, weights = np.random.default_rng(0), np.array([0.0, 1.0, 3.0, 0.0])
    counts = np.bincount([draw_index(weights, rng) for _ in range(4000)], minlength=4)
    assert counts[0] == counts[3] == 0 and counts[2] / counts[1] == pytest.approx(3.0, rel=0.15)


@pytest.mark.long
@pytest.mark.parametrize("width", [1, 2, 4])
def test_mixtures_are_as_likely_as_those_of_scikit_learn(width):
    rng = np.random.default_rng(width)
    middles = np.array([[0.1] * width, [0.5] * width, [0.9] * width])
    points = np.concatenate([rng.normal(middle, 0.04, (80, width)) for middle in middles])
    found = fit(points, 5, rng, rounds=30)
    from sklearn.mixture import GaussianMixture  # a second of imports, which the other tests need not take

    theirs = GaussianMixture(len(found.weights), n_init=5, random_state=0).fit(points).score(points)
    apart = points[:, None] - found.means
    far = np.einsum("nkd,kde,nke->nk", apart, np.linalg.inv(found.covariances), apart)
    density = found.weights * np.exp(-far / 2) / np.sqrt(np.linalg.det(2 * np.pi * found.covariances))
    assert np.log(density.sum(1)).mean() > theirs - 0.15
    assert found.weights.sum() == pytest.approx(1.0)
    for middle in middles:
        assert np.abs(found.means - middle).max(1).min() < 0.05


@pytest.mark.parametrize("points", [np.zeros((1, 2)), np.zeros((50, 2)), np.ones((3, 3)), np.eye(4)])
def test_mixtures_of_few_or_equal_points_are_finite(points):
    found = fit(points, 4, np.random.default_rng(0))
    assert all(np.isfinite(part).all() for part in (found.weights, found.means, found.covariances))


BAD = [
    ("selfpaced", reach(), {}),
    ("curious", reach(), {}),
    ("self_paced", reach(), {"bands": 3}),
    ("self_paced", reach(), {"colour": "red"}),
    ("self_paced", reach(), {"band": 1}),
    ("self_paced", reach(), {"rate": float("nan")}),
    ("linear", reach(), {"episodes": "many"}),
    ("reverse", reach(), {"low": 0.9, "high": 0.1}),
    ("reverse", reach(), {"replay": 0.7, "share": 0.7}),
    ("uniform", reach(2), {"labels": [2]}),
    ("uniform", reach(2), {"labels": []}),
    ("uniform", PhiBox((0.0,), (-1.0,)), {}),
    ("uniform", PhiBox((float("-inf"),), (0.0,)), {}),
    ("uniform", PhiBox((-1.0, -1.0), (0.0,)), {}),
    ("uniform", PhiBox((), ()), {}),
    ("teacher", reach(13), {}),
]


def test_bad_requests(golden):
    lines = []
    for name, space, settings in BAD:
        with pytest.raises(RequestError) as caught:
            strategy(name, space, np.random.default_rng(0), **settings)
        lines += [f"== {name} {space.low} {space.high} {settings}", str(caught.value), ""]
    golden("play/strategies/bad_strategies.txt", "\n".join(lines))


@pytest.mark.parametrize(
    "name, space, rng, text",
    [
        (["linear"], PhiBox((-1.0,), (0.0,)), np.random.default_rng(0), "unknown strategy"),
        ("linear", None, np.random.default_rng(0), "None is no reach of phi"),
        ("linear", PhiBox(-1.0, 0.0), np.random.default_rng(0), "is no reach of phi"),
        ("linear", PhiBox(("a",), ("b",)), np.random.default_rng(0), "is no reach of phi"),
        ("linear", PhiBox((-1.0,), (0.0,)), 0, "`rng` is 0"),
    ],
)
def test_what_is_of_another_type(name, space, rng, text):
    with pytest.raises(RequestError, match=text):
        strategy(name, space, rng)


SURE = {"share": 0.0}


def made_promises(name, labels=1, seed=0, **settings):
    return strategy(name, reach(labels), np.random.default_rng(seed), **settings)


def tell(teacher, phi, success, total=None):
    total = (10.0 if success else 0.0) if total is None else total
    teacher.report(Outcome(PhiBox((-9.0,), (9.0,)), (phi,), success, total, 1))


def asked(teacher, count):
    """How often each tenth of the difficulties was asked for; wide boxes are left out."""
    middles = [-(task.low[0] + task.high[0]) / 2 for task in (teacher.next_task() for _ in range(count))
               if task.high[0] - task.low[0] < 0.2]  # fmt: skip
    return np.histogram(middles, bins=10, range=(0.0, 1.0))[0]


def schedule(teacher, count):
    """The tasks of a strategy that nobody reports to, as lines."""
    lines = []
    for episode in range(count):
        task = teacher.next_task()
        box = " x ".join(f"[{low:+.3f}, {high:+.3f}]" for low, high in zip(task.low, task.high, strict=True))
        lines.append(f"{episode:3} {box}")
    return lines


def test_schedules(golden):
    cases = {
        "ordered, 5 scenes a pass": made_promises("ordered", scenes=5),
        "linear, 3 levels in 6 episodes": made_promises("linear", levels=3, episodes=6),
        "linear, the same, growing": made_promises("linear", levels=3, episodes=6, grow=True),
        "linear, two labels: shells around the easy corner": made_promises("linear", labels=2, levels=3, episodes=6),
        "linear, two labels, growing": made_promises("linear", labels=2, levels=3, episodes=6, grow=True),
    }
    blocks = ["\n".join([f"== {title}", *schedule(teacher, 8)]) for title, teacher in cases.items()]
    golden("play/strategies/schedules.txt", "\n\n".join(blocks) + "\n")


def test_uniform_levels_are_even():
    counts = asked(made_promises("uniform", levels=10), 2000)
    assert counts.min() > 150 and counts.max() < 250


@pytest.mark.parametrize("labels", [1, 2])
def test_self_paced_asks_for_the_newest_levels_and_moves_on(labels):
    teacher, rng = made_promises("self_paced", labels, levels=5, window=10, rate=1.0, **SURE), np.random.default_rng(0)
    for level in range(5):
        seen = set()
        for _ in range(10):
            assert teacher.log()["level"] == level
            task = teacher.next_task()
            hardest = max(-low for low in task.low)
            seen.add(round(hardest * 5) - 1)
            teacher.report(Outcome(task, draw(task, rng), True, 10.0, 1))
        assert level in seen and seen <= {level - 1, level}
    assert teacher.next_task() == teacher.space


def test_self_paced_loses_patience_with_a_learner_that_never_succeeds():
    teacher, rng = made_promises("self_paced", levels=5, patience=30, **SURE), np.random.default_rng(0)
    for count in range(150):
        assert teacher.log()["level"] == count // 30
        task = teacher.next_task()
        teacher.report(Outcome(task, draw(task, rng), False, 0.0, 1))
    assert teacher.next_task() == teacher.space


def test_self_paced_hears_only_of_its_newest_levels():
    teacher = made_promises("self_paced", levels=5, window=10, rate=1.0)
    for _ in range(50):
        tell(teacher, -0.9, True)  # by luck, far out
    assert teacher.log()["level"] == 0
    for _ in range(9):
        tell(teacher, -0.1, True)
    tell(teacher, -0.1, False)
    assert teacher.log()["level"] == 0
    for _ in range(10):
        tell(teacher, -0.1, True)
    assert teacher.log()["level"] == 1


def test_reverse_stays_at_the_goal_until_that_is_learnt_and_goes_outwards_from_there():
    teacher = made_promises("reverse", levels=10, **SURE)
    for _ in range(50):
        tell(teacher, -0.05, False)
    assert asked(teacher, 200)[:5].sum() == 200
    for level in range(4):
        for _ in range(60):
            tell(teacher, -0.05 - level / 10, True)
    for success in [True, False] * 20:
        tell(teacher, -0.45, success)
    counts = asked(teacher, 400)
    assert teacher.log() == {"good": 1, "old": 4, "furthest": 4}
    assert counts[3:6].sum() > 200 and counts[9] == 0  # around the one good level
    assert 40 < counts[:3].sum() < 200  # replayed


@pytest.mark.parametrize("name", ["learnability", "replay", "alp_gmm", "teacher"])
def test_what_is_a_toss_up_is_asked_for(name):
    """Success at 0.5 alternates, nearer to the goal it is sure, further out it is out of the question."""
    teacher, rng = made_promises(name), np.random.default_rng(0)
    for _ in range(1500):
        phi = -float(rng.random())
        tell(teacher, phi, bool(rng.random() < 0.5) if -0.6 < phi < -0.4 else phi > -0.5)
    counts = asked(teacher, 500)
    assert counts[4:6].sum() > 0.55 * counts.sum()


def test_replay_sees_everything_first_and_forgets_nothing():
    teacher = made_promises("replay", cells=10, worth="total")
    assert asked(teacher, 60).min() > 0
    for turn in range(100):
        for cell in range(10):
            tell(teacher, -0.05 - cell / 10, True, 7.0 if cell else float(turn % 2))
    counts = asked(teacher, 1000)
    assert counts.argmax() == 0 and counts.min() > 5


def test_replay_does_not_care_about_the_scale_of_rewards():
    small, large = made_promises("replay", worth="total"), made_promises("replay", worth="total")
    rng = np.random.default_rng(1)
    for _ in range(500):
        phi, total = -float(rng.random()), float(rng.integers(3))
        tell(small, phi, False, total)
        tell(large, phi, False, total * 1024.0)
    assert [small.next_task() for _ in range(100)] == [large.next_task() for _ in range(100)]


@pytest.mark.parametrize("up", [True, False])
def test_teacher_asks_for_what_changes(up):
    """Cell 7 of 10 goes from never to always, or back; the others stand still."""
    teacher = made_promises("teacher", cells=10)
    for turn in range(30):
        for cell in range(10):
            tell(teacher, -0.05 - cell / 10, cell < 5 if cell != 7 else (turn >= 20) == up)
    counts = asked(teacher, 500)
    assert counts.argmax() == 7 and counts.min() > 0


def test_exp3s_is_drawn_to_what_changes():
    """Cell 7 of 10 is learnt and forgotten all the time, in runs of 20 of its own episodes; the others stand still."""
    teacher, counts = made_promises("exp3s", cells=10), np.zeros(10, dtype=int)
    for _ in range(3000):
        task = teacher.next_task()
        cell = int(-(task.low[0] + task.high[0]) / 2 * 10)
        teacher.report(Outcome(task, task.low, counts[7] // 20 % 2 == 0 if cell == 7 else cell < 5, 0.0, 1))
        counts[cell] += 1
    assert counts[7] > 0.4 * counts.sum() and counts.min() > 20


@pytest.mark.parametrize("name", ["learnability", "replay", "teacher", "exp3s"])
def test_cells_out_of_reach_are_left_alone(name):
    """No scene fails both labels badly: a source hands out what is nearest."""
    teacher, rng = made_promises(name, labels=2, cells=4), np.random.default_rng(0)
    vain = []
    for _ in range(600):
        task = teacher.next_task()
        phi = draw(task, rng)
        there = max(phi) > -0.5
        vain.append(not there)
        teacher.report(Outcome(task, phi if there else (phi[0], -0.45), bool(rng.random() < 0.3), 0.0, 1))
    assert 10 <= sum(vain) <= 12  # a quarter of the 16 cells, three times each
    assert not any(vain[300:])


def test_alp_gmm_knows_progress_from_standing_still():
    """Success comes and goes in the easy corner of two labels, a quarter of the square, and only there."""
    inside = []
    for seed in range(4):
        teacher, rng = made_promises("alp_gmm", 2, seed, width=0.02), np.random.default_rng(seed)
        for _ in range(500):
            phi = tuple((-rng.random(2)).tolist())
            success = min(phi) > -0.5 and rng.random() < 0.5
            teacher.report(Outcome(teacher.space, phi, bool(success), 0.0, 1))
        tasks = [task for task in (teacher.next_task() for _ in range(200)) if task != teacher.space]
        inside.append(np.mean([min(task.low) > -0.5 for task in tasks]))
    assert np.mean(inside) > 0.6
