"""LIBERO's own tasks: starts that miss and states that solve, by its own judgement, in an environment made anew."""

import os

import numpy as np
import pytest

import scenegen
from scenegen.cli.app import run
from scenegen.errors import RequestError
from scenegen.libero import init_states, spec_of
from scenegen.worlds.libero.files import SUITES, make_environment, tasks_of, write_home

pytestmark = pytest.mark.libero
# a drawer, a stove that is on, a basket of two, and then all others
FIRST = [
    "open_the_top_drawer_and_put_the_bowl_inside",
    "KITCHEN_SCENE3_turn_on_the_stove_and_put_the_moka_pot_on_it",
    "LIVING_ROOM_SCENE2_put_both_the_cream_cheese_box_and_the_butter_in_the_basket",
]


@pytest.fixture(scope="module", autouse=True)
def installed():
    pytest.importorskip("libero", reason="needs LIBERO: make test-libero installs it")


def chosen():
    count = int(os.environ.get("LIBERO_TASKS", "3"))
    names = list(FIRST)
    if count > len(FIRST):
        names += [task.name for suite in SUITES for task in tasks_of(suite) if task.name not in FIRST]
    return names[:count]


def after_20_steps(env, state):
    """What LIBERO's evaluation does: set the state, wait."""
    env.set_init_state(state)
    first = env.check_success()
    for _ in range(20):
        env.env.timestep, env.env.done = 0, False
        env.step([0.0] * 6 + [-1.0])
    return first, env.check_success()


@pytest.mark.parametrize("name", chosen())
def test_states_are_judged_as_phi_says(name):
    task = tasks_of(name)[0]
    env = make_environment(task, seed=3)
    own = spec_of(env)
    assert scenegen.parse(own.text).labels == own.spec.labels
    missing, solved = (
        init_states(env, n=4, spec=own, seed=1),
        init_states(env, {"goal": (0, None)}, 4, spec=own, seed=1),
    )
    env.close()
    anew = make_environment(task, seed=3)
    for made, wanted in ((missing, False), (solved, True)):
        assert len(made.states) == 4 and made.agreed >= 0.9 * made.judged
        assert ((made.read["goal"] >= 0) == wanted).all() and (made.moved < 0.01).all()
        assert np.isfinite(made.states).all() and len(np.unique(made.states, axis=0)) == 4
        for state in made.states:
            assert after_20_steps(anew, state) == (wanted, wanted)
    anew.close()


def test_the_same_seed_gives_the_same_states_and_phi_is_a_range():
    env = make_environment(tasks_of(FIRST[0])[0], seed=0)
    wanted = {"goal": (-0.3, -0.1), "start": (None, None)}
    first, again = (init_states(env, wanted, 3, seed=7) for _ in range(2))
    assert np.array_equal(first.states, again.states)
    assert ((first.phi["goal"] >= -0.3) & (first.phi["goal"] <= -0.1)).all()
    assert first.read["goal"] == pytest.approx(first.phi["goal"], abs=0.02)
    with pytest.raises(RequestError):
        init_states(env, {"goal": (5, None)}, 1)
    env.close()


def test_the_command_makes_a_home_that_libero_reads(tmp_path, monkeypatch, capsys):
    task = tasks_of(FIRST[0])[0]
    words = ["libero", task.name, "-n", "2", "--phi", "goal=:-0.01", "--out", str(tmp_path), "--workers", "1"]
    assert run(words) == 0 and "2 states" in capsys.readouterr().err
    monkeypatch.setenv("LIBERO_CONFIG_PATH", str(tmp_path))
    from libero.libero import get_libero_path
    from libero.libero.benchmark import get_benchmark

    assert get_libero_path("init_states") == str(tmp_path / "init_files")
    suite = get_benchmark(task.suite)()
    states = suite.get_task_init_states(suite.get_task_names().index(task.name))
    assert np.shape(states)[0] == 2
    torch = pytest.importorskip("torch")  # the form of LIBERO's first release, and of LeRobot
    file = tmp_path / "init_files" / task.suite / f"{task.name}.pruned_init"
    assert np.array_equal(torch.load(file, weights_only=False), states)
    assert run(words) == 0  # all of it is there
    assert write_home(tmp_path).read_text().count("\n") == 5
