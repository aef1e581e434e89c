"""Init states, with stand-ins for the environment; test_in_robosuite.py has the real ones."""

from types import SimpleNamespace

import numpy as np
import pytest
import torch

import scenegen
from scenegen.errors import RequestError
from scenegen.robosuite import Placement, init_states
from scenegen.worlds.robosuite import upright
from tests.worlds.robosuite.stubs import Corner, Simulation, Thing

SPEC = scenegen.parse("object red = box(4 cm, 4 cm, 4 cm), blue\nrequire noOverlap()\ntask: closeTo(red, blue)\n")


@pytest.fixture
def begun():
    """An environment and a placement of its objects; the spec does not have the last."""
    things = [Thing("red"), Thing("blue"), Thing("lamp")]
    here = Placement(SPEC, (-0.2, 0), reference_pos=(0, 0, 0.8), mujoco_objects=things, rest=Corner(things[2:]))
    resets = []
    return SimpleNamespace(sim=Simulation(things), reset=lambda: resets.append(1), resets=resets), here


def test_states_have_the_objects_where_the_placement_wants_them(begun, tmp_path):
    env, here = begun
    made = init_states(env, here, 5)
    assert env.resets == [1] and made.states.shape == (5, 1 + 22 + 19)
    assert np.ptp(made.states[:, [0, 1]], axis=0).tolist() == [0, 0]  # the time and the robot are as after the reset
    places = made.states[:, 2:23].reshape(5, 3, 7)
    near = 0.25 - np.linalg.norm(places[:, 0, :2] - places[:, 1, :2], axis=1)
    assert near == pytest.approx(made.phi["task"]) and made.read["task"] == pytest.approx(made.phi["task"])
    assert ((near >= -0.2) & (near <= 0)).all() and np.unique(near).size == 5
    assert (places[:, 2, :3] == (0.5, 0.5, 0.8)).all()
    lying = upright([0.5, 0.5, -0.5, 0.5])  # as the reset left them, turned about the vertical alone
    assert all(upright(one) == pytest.approx(lying) for one in places[:, :2, 3:].reshape(-1, 4))
    speeds = made.states[:, 23:]
    assert (speeds[:, 0] == 1.0).all() and not speeds[:, 1:].any()
    read = torch.load(made.save(tmp_path / "task.pruned_init"), weights_only=False)
    assert isinstance(read, np.ndarray) and read.dtype == np.float64 and np.array_equal(read, made.states)


def test_bad_requests_are_answered(begun, monkeypatch):
    env, here = begun
    with pytest.raises(RequestError) as error:
        init_states(env, here, 0)
    assert error.value.diagnostics[0].code == "out-of-range"
    monkeypatch.setattr(Thing, "joints", [])
    with pytest.raises(RequestError) as error:
        init_states(env, here, 1)
    assert error.value.diagnostics[0].code == "placement"
