"""Pairs with a grasp: one yaw, in the frame of what is moved, that fits at both ends, as `graspable` measures it."""

import math
from functools import cache

import numpy as np
import pytest

import scenegen
from experiments.metrics import energy_test
from scenegen.errors import RequestError
from scenegen.geometry import MATH
from scenegen.lang.formula.interpret import phi
from scenegen.pose import as_rows
from scenegen.sampling.grasps import movable_things, parse_grasp

TEXT = """workspace [-0.2, 0.2] x [-0.2, 0.2]
object cube = box(4 cm, 4 cm, 4 cm), bar = box(9 cm, 3 cm, 4 cm), post[2] = cylinder(4 cm, 9 cm)
robot arm = panda at (0, -0.5, NORTH)
require noOverlap()
task: leftOf(cube, bar)
"""
SPEC = scenegen.parse(TEXT)
YAWS = [k * math.pi / 12 for k in range(12)]


@cache
def core_of(thing):
    lines = [f"at{k}: handRoom({thing}, arm, {yaw!r}, 2 cm) >= 0\n" for k, yaw in enumerate(YAWS)]
    text = f"{TEXT}reach: reachable({thing}, arm)\nbest: graspable({thing}, arm)\n{''.join(lines)}"
    return scenegen.parse(text).checked.core


def margins(pose_of_scene, thing):
    """Of one scene (N, 3): the margin of a grasp at each of the 12 yaws, by the reference interpreter in plain floats,
    and phi of `graspable`."""
    found = phi(core_of(thing), as_rows(pose_of_scene).tolist(), MATH)
    return [min(found["reach"], found[f"at{k}"]) for k in range(12)], found["best"]


@pytest.mark.long
@pytest.mark.parametrize("moved", [1, 2])
@pytest.mark.parametrize("low, high", [(0.0, None), (0.008, None), (-0.01, -0.002)])
def test_the_grasp_of_a_pair_fits_at_both_ends(moved, low, high):
    made = scenegen.pairs(SPEC, n=10, moved=moved, grasp={"arm": (low, high)}, seed=1)
    told = made.phi["grasp.arm"]
    assert (told >= low).all() and (told <= (high or 1.0)).all()
    assert made.header.request.phi["grasp.arm"] == (low, high) and made.header.sampler["grasp"] == "arm"
    for number, (start, goal) in enumerate(made.poses):
        least = math.inf
        for which, thing in enumerate(made.objects[:-1]):
            yaw = made.facts[f"yaw.{thing}"][number]
            assert math.isnan(yaw) == (start[which] == goal[which]).all()
            if math.isnan(yaw):
                continue
            (here, at_start), (there, at_goal) = margins(start, thing), margins(goal, thing)
            shared = [min(pair) for pair in zip(here, there, strict=True)]
            assert shared[round(yaw / math.pi * 12)] == pytest.approx(max(shared), abs=1e-12)
            if low >= 0.0:
                assert min(at_start, at_goal) >= low
            least = min(least, max(shared))
        assert told[number] == pytest.approx(least, abs=1e-12)


@pytest.mark.long
def test_robots_stay_and_all_else_is_moved():
    spec = scenegen.parse("robot arm = panda\nobject apple, lemon, can at (0.5, 0.5)\ntask: leftOf(apple, lemon)\n")
    made = scenegen.pairs(spec, n=8, grasp="arm", seed=2)
    stays = (made.poses[:, 0] == made.poses[:, 1]).all(axis=(0, 2))
    assert dict(zip(made.objects, stays.tolist(), strict=True)) == {
        "arm": True,
        "apple": False,
        "lemon": False,
        "can": True,
    }
    assert len(np.unique(made.poses[:, 0, 0], axis=0)) == 8, "its base is drawn"
    assert sorted(made.facts) == ["distance", "moved", "yaw.apple", "yaw.lemon"]
    assert made.phi["grasp.arm"].min() >= 0.0 and (made.facts["moved"] == 2).all()


@pytest.mark.long
def test_starts_are_uniform_given_that_they_have_a_grasp():
    """Against goals and starts by plain rejection."""
    text = """workspace [-0.15, 0.15] x [-0.15, 0.15]
object cube = box(4 cm, 4 cm, 4 cm), post = cylinder(4.5 cm, 9 cm)
robot arm = panda at (0, -0.5, NORTH)
require noOverlap()
task: leftOf(cube, post)
"""
    spec, count = scenegen.parse(text), 600
    made = scenegen.pairs(spec, (0.0, None), (None, 0.0), n=count, moved=1, grasp="arm", seed=3)
    lines = [f"at{k}: reachable(cube, arm) & handRoom(cube, arm, {15 * k} deg, 2 cm) >= 0\n" for k in range(12)]
    text = text.replace("require", "apart:")
    measured = scenegen.parse(text + "".join(lines))
    rng = np.random.default_rng(4)

    def table(n):
        poses = rng.uniform([-0.15, -0.15, 0.0], [0.15, 0.15, math.tau], (n, 2, 3))
        return np.concatenate([poses, np.broadcast_to([0.0, -0.5, math.pi / 2], (n, 1, 3))], axis=1)

    def measure(poses):
        found = measured.scenes(poses).phi
        return found["task"], found["apart"], np.array([found[f"at{k}"] for k in range(12)])

    goals = table(6 * count)
    task, apart, at_goal = measure(goals)
    kept = np.flatnonzero((task >= 0.0) & (apart >= 0.0))[:count]
    goals, at_goal, starts = goals[kept], at_goal[:, kept], goals[kept].copy()
    left = np.arange(len(goals))
    for _ in range(300):
        tried = goals[left].copy()
        tried[:, 0] = table(len(left))[:, 0]  # only the cube fits into a hand
        task, apart, here = measure(tried)
        good = (task < 0.0) & (apart >= 0.0) & (np.minimum(here, at_goal[:, left]).max(axis=0) >= 0.0)
        starts[left[good]] = tried[good]
        left = left[~good]
    truth = np.delete(np.concatenate([starts[:, :2], goals[:, :2]], axis=1), left, axis=0)
    ours = np.concatenate([made.poses[:, 0, :2], made.poses[:, 1, :2]], axis=1)
    some = min(len(truth), count)
    test = np.random.default_rng(0)
    assert energy_test(as_rows(truth), as_rows(ours), test, permutations=499, most=some).p > 0.01
    free = scenegen.pairs(spec, (0.0, None), (None, 0.0), n=count, moved=1, seed=3)
    others = np.concatenate([free.poses[:, 0, :2], free.poses[:, 1, :2]], axis=1)
    assert energy_test(as_rows(truth), as_rows(others), test, permutations=499, most=some).p < 0.01


@pytest.mark.parametrize("ending", ["json", "jsonl", "parquet"])
def test_files_read_back_bit_for_bit(ending, tmp_path):
    made = scenegen.pairs(SPEC, n=5, moved=1, grasp="arm")
    assert np.isnan(made.facts["yaw.cube"]).any()
    read = scenegen.read_motions(made.save(tmp_path / f"pairs.{ending}"))
    assert read.header == made.header and list(read.facts) == list(made.facts)
    for name, values in made.facts.items():
        assert np.array_equal(read.facts[name], values, equal_nan=True)
    assert read.save(tmp_path / f"again.{ending}").read_bytes() == (tmp_path / f"pairs.{ending}").read_bytes()
    header, first = (line.split(",") for line in made.save(tmp_path / "pairs.csv").read_text().splitlines()[:2])
    yaw = dict(zip(header, first, strict=True))["yaw.cube"]
    assert (yaw == "") == math.isnan(made.facts["yaw.cube"][0])


@pytest.mark.long
def test_numbers_of_things_and_assets_that_are_drawn():
    text = """robot arm = panda at (0.5, -0.25, NORTH)
object mug of category("mug", [asset("red", box(5 cm, 5 cm, 8 cm)), asset("blue", box(6 cm, 6 cm, 8 cm))]), can[1..2]
require noOverlap()
task: forall c in can: leftOf(mug, c)
"""
    made = scenegen.pairs(scenegen.parse(text), n=8, moved=1, grasp="arm")
    yaws = np.array([made.facts[f"yaw.{name}"] for name in made.objects if name != "arm"])
    moved = (made.poses[:, 0] != made.poses[:, 1]) & ~np.isnan(made.poses[:, 0])
    there = np.array([moved.any(axis=2)[:, k] for k, name in enumerate(made.objects) if name != "arm"])
    assert (np.isfinite(yaws) == there).all() and (there.sum(axis=0) == 1).all()
    assert made.phi["grasp.arm"].min() >= 0.0


@pytest.mark.parametrize(
    "text, grasp, code",
    [
        (TEXT, "amr", "no-robot"),
        (TEXT, "cube", "no-robot"),
        (TEXT, "", "no-robot"),
        ("object mug, plate\ntask: leftOf(mug, plate)\n", "arm", "no-robot"),
        ("object mug at (0.5, 0.5)\nrobot arm = panda\ntask: leftOf(mug, arm)\n", "arm", "nothing-to-grasp"),
        (TEXT, 3, "wrong-value"),
        (TEXT, {"arm": (0.1, 0.0)}, "range-reversed"),
        pytest.param(TEXT, {"arm": (0.05, None)}, "too-few-motions", marks=pytest.mark.long),
    ],
)
def test_bad_grasps_are_one_diagnostic(text, grasp, code):
    with pytest.raises(RequestError) as raised:
        scenegen.pairs(scenegen.parse(text), n=64, moved=1, grasp=grasp)
    assert [one.code for one in raised.value.diagnostics] == [code]


def test_a_name_that_is_none_and_a_margin_that_is_no_length():
    with pytest.raises(RequestError, match='`""` is no robot of the spec'):
        movable_things(scenegen.parse(TEXT).checked, "")
    with pytest.raises(RequestError, match="a margin is a length"):
        parse_grasp("arm=1deg:")
    assert parse_grasp("arm=1cm:")["arm"].low == 0.01
