"""What every entry of STRATEGIES keeps to. A new strategy is tested by being in the table."""

import inspect
import itertools
import json
import math
import re
import subprocess
import sys

import numpy as np
import pytest

from scenegen.errors import DataError
from scenegen.learn.curriculum.strategies import STRATEGIES, strategy
from scenegen.learn.curriculum.strategies.base import Base
from scenegen.learn.curriculum.tasks import Outcome, PhiBox

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
def name(request):
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


def test_the_table_tells_what_is_there(name):
    kind = STRATEGIES[name]
    assert issubclass(kind, Base) and kind.name == name
    # every setting is explained to its reader, and every strategy says what becomes of several labels
    own = set(kind.settings_class.model_fields) - {"labels"}
    assert all(f"`{field}`" in kind.settings_class.__doc__ for field in own)
    assert "everal labels" in inspect.getdoc(kind)


def test_the_page_has_a_row_for_it(name, root):
    rows = [
        line for line in (root / "docs" / "curriculum.md").read_text().splitlines() if line.startswith(f"| `{name}`")
    ]
    source = inspect.getdoc(STRATEGIES[name])
    for word in re.findall(r"[A-Z]\w+ et al|\d{4}", rows[0]):
        assert word.removesuffix(" et al") in source


def test_the_room_does_without_torch_and_gymnasium():
    """The room above makes its environment known to gymnasium where that is installed; here it is not."""
    code = (
        "import sys; sys.modules['gymnasium'] = None; from scenegen.learn.curriculum.strategies import STRATEGIES\n"
        "sys.exit(', '.join({'torch', 'sklearn', 'scipy'} & set(sys.modules)) or None)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("space", SPACES.values(), ids=SPACES)
def test_tasks_lie_inside_the_space(name, space):
    tasks = play(made(name, space, **SHORT.get(name, {})), 300)
    assert all(inside(task, space) for task in tasks)
    assert all(type(value) is float for task in tasks for value in task.low + task.high)


def test_the_generator_alone_decides(name):
    space = SPACES["two labels"]
    assert play(made(name, space), 150) == play(made(name, space), 150)
    np.random.seed(0)
    before = np.random.get_state()[1].copy()
    made_once = made(name, space)
    play(made_once, 150)
    assert (np.random.get_state()[1] == before).all()
    if name not in BY_THE_CLOCK:
        assert play(made(name, space), 150) != play(made(name, space, seed=1), 150)


def test_outcomes_may_come_late_in_any_order_or_never(name):
    """64 episodes at once, as in a vector environment, reported in another order; every tenth never."""
    teacher, rng = made(name), np.random.default_rng(5)
    for _ in range(6):
        tasks = [teacher.next_task() for _ in range(64)]
        assert all(inside(task, teacher.space) for task in tasks)
        for index in rng.permutation(64):
            if index % 10:
                teacher.report(outcome(tasks[index], rng))


def test_outcomes_of_the_tasks_of_others_do_no_harm(name):
    """Boxes that nobody asked for, scenes out of the space, phi and rewards that are no numbers."""
    teacher, rng = made(name), np.random.default_rng(6)
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
def test_nobody_gets_stuck(name, labels, success):
    """Whether the learner never or always succeeds, every tenth of the difficulties is met. Wide boxes
    count as scenes drawn evenly from them."""
    teacher, rng = made(name, reach(labels), **SHORT.get(name, {})), np.random.default_rng(3)
    met = set()
    for _ in range(800):
        task = teacher.next_task()
        heard = outcome(task, rng, success)
        met.add(min(int(-min(heard.phi) * 10), 9))
        teacher.report(heard)
    assert met >= set(range(10 if labels == 1 else 1, 10)) and len(met) >= 9
    if labels == 1:
        assert met == set(range(10))


def test_a_source_that_cannot_serve_all_of_the_space(name):
    """Nothing is harder than half of the reach, and what is asked for beyond is answered with the nearest there is: the
    strategy goes on, and does not ask for the rest alone."""
    teacher, rng = made(name, **SHORT.get(name, {})), np.random.default_rng(4)
    pupil, served = Chain(rng), 0
    for _ in range(800):
        task = teacher.next_task()
        there = PhiBox((max(task.low[0], -0.5),), (max(task.high[0], -0.5),))
        heard = pupil.play(there)
        served += task.high[0] > -0.5
        teacher.report(Outcome(task, heard.phi, heard.success, heard.total, heard.steps))
    assert served > 100


@pytest.mark.parametrize("generator", [np.random.PCG64, np.random.MT19937], ids=lambda kind: kind.__name__)
def test_a_saved_strategy_goes_on_as_if_nothing_had_happened(name, generator):
    space = SPACES["two labels"]
    first = strategy(name, space, np.random.Generator(generator(7)))
    play(first, 130)
    text = json.dumps(first.state(), allow_nan=False)
    second = strategy(name, space, np.random.Generator(generator(8)))
    second.restore(json.loads(text))
    assert second.state() == first.state()
    assert play(second, 130) == play(first, 130)
    assert second.log() == first.log()


def test_a_state_outlives_the_strategy_that_it_is_of(name):
    teacher = made(name)
    play(teacher, 60)
    state = teacher.state()
    kept = json.dumps(state)
    play(teacher, 60)
    assert json.dumps(state) == kept
    again = made(name)
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


def test_states_of_others_are_refused(name):
    teacher = made(name)
    other = made("linear" if name == "uniform" else "uniform")
    cases = [
        (other.state(), "this state is of another strategy"),
        (made(name, SPACES["one label"]).state(), "this state is of another space"),
        (made(name, labels=[0]).state(), "this state is of another settings"),
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


def test_labels_that_do_not_matter_are_left_alone(name):
    space = PhiBox((-1.0, -2.0, -3.0), (0.0, 0.0, 0.5))
    tasks = play(made(name, space, labels=[1], **SHORT.get(name, {})), 200)
    assert {(task.low[0], task.high[0], task.low[2], task.high[2]) for task in tasks} == {(-1.0, 0.0, -3.0, 0.5)}
    if name != "uniform":
        assert len({task.low[1] for task in tasks}) > 3


def test_names_of_curves_do_not_change(name):
    teacher = made(name)
    before = set(teacher.log())
    play(teacher, 300)
    assert set(teacher.log()) == before
    assert all(isinstance(value, (int, float)) for value in teacher.log().values())


def test_all_pairs_of_sizes_of_settings_are_accepted(name):
    """The least values of all settings work together, too."""
    kind = STRATEGIES[name].settings_class
    least = {}
    for field, info in kind.model_fields.items():
        bounds = [getattr(one, "ge", None) for one in info.metadata]
        found = next((bound for bound in bounds if bound is not None), None)
        if found is not None and field not in ("low", "high"):
            least[field] = found
    for one, other in itertools.product(least, least):
        play(made(name, **{one: least[one], other: least[other]}), 30)
    play(made(name, **least), 120)
