"""Init states, with stand-ins for the environment; test_in_robosuite.py has the real ones."""

from types import SimpleNamespace

import numpy as np
import pytest
import torch

import scenegen
from scenegen.errors import RequestError
from scenegen.robosuite import Placement, init_states
from scenegen.worlds.planning import import_problem
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


TASK = """
(define (problem own_task) (:domain robosuite)
  (:regions
    (plate_place (:target main_table) (:ranges ((-0.05 -0.25 0.0 -0.2))))
    (bowl_place (:target main_table) (:ranges ((0.1 0.0 0.15 0.05))))
    (stove_place (:target main_table) (:ranges ((-0.31 0.29 -0.29 0.31)))))
  (:fixtures main_table - table flat_stove_1 - flat_stove)
  (:objects white_bowl_1 - white_bowl plate_1 - plate)
  (:init (On white_bowl_1 main_table_bowl_place) (On plate_1 main_table_plate_place)
    (On flat_stove_1 main_table_stove_place))
  (:goal (And (On white_bowl_1 plate_1))))
"""


def test_a_task_of_libero_from_its_file_to_its_states(tmp_path):
    """Names and places are those of the file; the stove, which is held, is no body of the state."""
    (tmp_path / "task.bddl").write_text(TASK)
    spec = scenegen.parse(import_problem(tmp_path / "task.bddl").text)
    things = [Thing("plate_1"), Thing("white_bowl_1")]
    here = Placement(
        spec, {"goal": (-0.4, 0.0), "start": (0.0, None)}, reference_pos=(0.0, 0.0, 0.9), mujoco_objects=things
    )
    made = init_states(SimpleNamespace(sim=Simulation(things), reset=lambda: None), here, 8)
    plate, bowl = made.states[:, 2:16].reshape(8, 2, 7).transpose(1, 0, 2)
    assert ((plate[:, :2] >= (-0.05, -0.25)) & (plate[:, :2] <= (0.0, -0.2))).all()
    assert ((bowl[:, :2] >= (0.1, 0.0)) & (bowl[:, :2] <= (0.15, 0.05))).all()
    assert (bowl[:, 2] == pytest.approx(0.92)) and (made.read["goal"] < 0).all()
    assert made.read["goal"] == pytest.approx(made.phi["goal"])
