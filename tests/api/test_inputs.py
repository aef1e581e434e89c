"""Values as people have them: of numpy, torch and pandas; poses of held objects; ranges reached only at a bound."""

import inspect
import typing

import gymnasium
import numpy as np
import pytest
import torch

import scenegen
from scenegen.api.monitor import read_trajectories
from scenegen.errors import DataError, RequestError
from scenegen.robosuite import Placement

HELD = scenegen.parse("object mug, plate at (0.5, 0.5, 30 deg)\ntask: closeTo(mug, plate, 15 cm)")
OVER_TIME = scenegen.parse("object mug, plate at (0.5, 0.5)\ntime 1 steps\ntask: always closeTo(mug, plate, 15 cm)")
AT_BOUND = scenegen.parse("object red, blue\ntask: closeTo(red, blue, 20 cm) & angle(red, NORTH, 0 deg)")
PAIR = scenegen.parse("object mug, plate\ntask: closeTo(mug, plate, 15 cm)")
TABLE = "scenegen.curriculum:scenegen/TableTop-v0"


def poses_of(*shape, theta=0.0):
    poses = torch.full((*shape, 2, 3), 0.5, dtype=torch.float64)
    poses[..., 2] = theta
    return poses


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
@pytest.mark.parametrize("turns", [-1, 0, 3])
def test_held_objects_in_their_place_are_taken(dtype, turns):
    poses = poses_of(4, theta=np.pi / 6 + turns * 2 * np.pi).to(dtype)
    assert torch.allclose(HELD.robustness()(poses), torch.full((4, 1), 0.15, dtype=dtype))


@pytest.mark.parametrize(("axis", "by"), [(0, 0.4), (1, 1e-6), (2, 0.1)])
def test_a_held_object_elsewhere_is_refused_by_robustness(axis, by):
    poses = poses_of(4, theta=np.pi / 6)
    poses[2, 1, axis] += by
    with pytest.raises(ValueError, match=r"`plate` is held at \(0.5, 0.5, 0.523599\).* in scene 2; take the `at`"):
        HELD.robustness()(poses)


def test_a_held_object_elsewhere_is_refused_over_time():
    poses = poses_of(3, 2)
    assert OVER_TIME.trace_robustness()(poses).flatten().tolist() == [0.15] * 3
    poses[1, 1, 1, 0] = 0.9
    with pytest.raises(ValueError, match="elsewhere at moment 1 of motion 1"):
        OVER_TIME.trace_robustness()(poses)


def test_a_held_object_elsewhere_is_refused_by_monitors():
    monitor = scenegen.Monitor(OVER_TIME)
    assert monitor.add({"mug": (0.5, 0.5, 0.0)}).high["task"] == 0.15
    for moved in ({"mug": (0.5, 0.5, 0), "plate": (0.9, 0.5, 0)}, [[0.5, 0.5, 0], [0.9, 0.5, 0]]):
        with pytest.raises(RequestError, match=r"held-elsewhere.*at moment 1"):
            monitor.add(moved)


def test_a_held_object_elsewhere_is_refused_in_recordings(tmp_path):
    rows = "0,.5,.5,0,.5,.5,0\n1,.5,.5,0,{x},.5,0\n"
    text = "t,mug.x,mug.y,mug.theta,plate.x,plate.y,plate.theta\n" + rows
    path = tmp_path / "recorded.csv"
    path.write_text(text.format(x=0.5))
    assert read_trajectories(OVER_TIME, path)[0][None].shape == (2, 2, 3)
    path.write_text(text.format(x=0.9))
    with pytest.raises(DataError, match=r"held-elsewhere.*at moment 1"):
        read_trajectories(OVER_TIME, path)


@pytest.mark.parametrize(
    "ask",
    [
        lambda: scenegen.pairs(AT_BOUND, n=2),
        lambda: Placement(AT_BOUND, (0, None))._starts.take(),
        lambda: scenegen.pairs(PAIR, start=(0.15, None), n=2),
    ],
)
def test_a_promised_range_that_phi_reaches_only_at_its_bound_is_refused(ask):
    with pytest.raises(RequestError, match=r"only-at-bound.*\n.*ask for a band beside it"):
        ask()


@pytest.mark.parametrize("ends", [(0, None), (0.0, 0.1)])
def test_environments_refuse_it_with_the_range_to_ask_for(ends):
    env = gymnasium.make(TABLE, spec=AT_BOUND)
    with pytest.raises(gymnasium.error.InvalidBound, match=r"ask for a band beside it, -0.025:0"):
        env.reset(seed=0, options={"phi": ends})


def test_sample_warns_and_draws_the_band():
    scenes = scenegen.sample(AT_BOUND, (0, None), n=4)
    assert [(one.code, one.severity) for one in scenes.warnings] == [("only-at-bound", "warning")]
    assert (scenes.phi["task"] >= -0.025).all()


@pytest.mark.parametrize(
    "ends", [np.array([0, 0.1]), torch.tensor([0, 0.1]), (torch.tensor(0.0), np.float32(0.1)), [np.int64(0), 0.1]]
)
def test_ranges_of_numpy_and_torch(ends):
    for phi in (ends, {"task": ends}):
        found = scenegen.sample(PAIR, phi, n=4).phi["task"]
        assert ((found >= 0) & (found <= 0.1001)).all()
    env = gymnasium.make(TABLE, spec=PAIR, phi=ends)
    assert 0 <= env.reset(seed=0)[1]["phi"]["task"] <= 0.1001


@pytest.mark.parametrize("ends", [np.zeros(3), "ab", 0.5, np.array([["a", "b"]]), (None, "x"), torch.zeros(2, 2)])
def test_what_is_no_range_is_refused(ends):
    with pytest.raises(RequestError, match="range-not-a-pair"):
        scenegen.sample(PAIR, ends, n=1)


def test_poses_of_numpy_and_torch_are_held():
    scenes = scenegen.sample(PAIR, n=4)
    for pose in (scenes.poses[3, 1], torch.tensor([0.25, 0.75]), (np.float32(0.25), torch.tensor(0.75))):
        held = scenegen.sample(PAIR, n=2, fix={"plate": pose}).poses[:, 1, : len(pose)]
        assert (held == np.array([float(one) for one in pose])).all()
    with pytest.raises(RequestError, match="not-a-pose"):
        scenegen.sample(PAIR, n=2, fix={"plate": np.zeros(4)})


def test_scenes_are_picked_by_masks_of_pandas_and_torch():
    scenes = scenegen.sample(PAIR, n=8)
    frame = scenes.to_pandas()
    mask = scenes.phi["task"] > np.median(scenes.phi["task"])
    for picked in (frame["phi.task"] > frame["phi.task"].median(), torch.from_numpy(mask), mask.tolist()):
        assert (scenes[picked].poses == scenes.poses[mask]).all()
    assert (scenes[torch.tensor(2)].poses["mug"].x, scenes[np.int64(-1)].poses["mug"].x) == tuple(
        scenes.poses[[2, -1], 0, 0]
    )
    assert len(scenes[torch.tensor([1, 2])]) == 2 and len(scenes[np.array([])]) == 0
    for bad in (
        torch.zeros(8),
        torch.ones(7, dtype=torch.bool),
        frame["phi.task"],
        torch.zeros(2, 2, dtype=torch.long),
    ):
        with pytest.raises(RequestError, match="not-an-index"):
            scenes[bad]


SURFACES = scenegen.parse("""
workspace [0, 0.9] x [0, 0.6]
object coaster = cylinder(5.5 cm, 0.5 cm), mug on any of [coaster, workspace]
require noCollision()
task: on(mug, coaster)
other: leftOf(mug, coaster)
""")


@pytest.mark.parametrize("goal", ["task", None])
def test_a_goal_on_a_surface_that_no_move_reaches_is_refused_when_the_environment_is_made(goal):
    with pytest.raises(gymnasium.error.Error, match=r"always on `coaster.top`; let `mug` .*choices-not-here"):
        gymnasium.make(TABLE, spec=SURFACES, move="mug", goal=goal)
    gymnasium.make(TABLE, spec=SURFACES, move="mug", goal="other")


def test_observations_and_moves_leave_out_headings_that_make_no_difference():
    spec = "object cup = cylinder(4 cm, 9 cm), tin = cylinder(4 cm, 9 cm), book = box(9 cm, 5 cm, 2 cm)\n"
    spec += "require noOverlap()\ntask: gap(book, cup) <= 5 cm & closeTo(cup, tin)"
    env = gymnasium.make(TABLE, spec=spec).unwrapped
    assert [name for name in env.views.names if name.endswith((".cos", ".sin"))] == ["book.cos", "book.sin"]
    assert [name for name in env.moves.names if "theta" in name] == ["book theta +", "book theta -"]
    env = gymnasium.make(TABLE, spec=spec + " & angle(cup, NORTH)").unwrapped
    assert "cup.cos" in env.views.names and "cup theta +" in env.moves.names


def test_the_repr_of_a_rarity_fits_a_terminal():
    assert len(repr(scenegen.rarity(PAIR))) < 500


WITH_TORCH = {"train"}  # names types of training


@pytest.mark.parametrize("name", [name for name in scenegen.__all__ if inspect.isfunction(getattr(scenegen, name))])
def test_type_hints_resolve(name):
    if name not in WITH_TORCH:
        assert "return" in typing.get_type_hints(getattr(scenegen, name))


def test_a_mask_with_holes_says_where():
    import pandas
    import polars

    scenes = scenegen.sample(scenegen.parse("task: leftOf(mug, plate)"), n=3)
    mask = [True, None, False]
    for given in (
        mask,
        pandas.array(mask, dtype="boolean"),
        pandas.Series(mask, dtype="boolean"),
        polars.Series(mask),
        np.array(mask, dtype=object),
    ):
        with pytest.raises(RequestError, match=r"a mask without a value at 1 does not pick scenes\n.*fillna\(False\)"):
            scenes[given]
    assert len(scenes[pandas.array([True, False, True], dtype="boolean")]) == 2
