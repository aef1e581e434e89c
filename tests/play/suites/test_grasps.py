"""Suites with grasps: each start has a goal, and one grasp of what is moved there."""

import hashlib
import importlib.util
import json
import math
from types import SimpleNamespace

import numpy as np
import pytest

import scenegen
from scenegen.errors import DataError, RequestError
from scenegen.errors.worlds import NOT_A_SUITE
from scenegen.learn.success.files import BLANK_DIGEST
from scenegen.play.suites.adapters.table import make, solids_of
from scenegen.play.suites.new import new_suite
from scenegen.play.suites.suite import SUITE_JSON, Suite, check_suite
from scenegen.sampling.request import Range

SPEC = """# Put the cube to the left of the post.
# reverse: Put the cube to the right of it.
workspace [-0.2, 0.2] x [-0.2, 0.2]
object cube = box(4 cm, 4 cm, 4 cm), post[2] = cylinder(4.5 cm, 9 cm)
region mount = rect(-0.3, -0.8, 0.3, -0.4) at 11.2 cm
robot arm = panda on mount at (0, -0.56, NORTH)
require noOverlap()
goal: leftOf(cube, post[1])
start: !goal & y(cube) <= 15 cm
"""


@pytest.fixture(scope="module")
def room(tmp_path_factory):
    folder = tmp_path_factory.mktemp("suites")
    (folder / "left.spec").write_text(SPEC)
    new_suite(
        [("left", folder / "left.spec")], folder / "room", bands=2, n=3, workers=1,
        grasp={"arm": (0.005, None)}, goal=Range(0.02, None),
    )  # fmt: skip
    return folder / "room"


@pytest.mark.long
def test_every_start_has_a_goal_and_a_grasp_that_leads_there(room):
    """Room for the hand at the yaw that the suite says, by a spec that says it in words."""
    for suite in check_suite(room):
        for start in suite:
            moved = np.isfinite(start.yaws)
            assert moved.tolist() == [True, False, False, False]  # the posts are wider than a hand opens
            assert np.array_equal(start.goal[1:], start.poses[1:]) and (start.goal[0] != start.poses[0]).any()
            yaw = math.degrees(start.yaws[0])
            rule = f"reachable(cube, arm) & handRoom(cube, arm, {yaw!r} deg, 2 cm) >= 0"
            spec = scenegen.parse(SPEC.replace("start:", f"held: {rule}\nstart:"))
            both = np.stack([start.poses, start.goal])
            heading = 2.0 * np.arctan2(both[..., 6], both[..., 3])
            phi = spec.scenes(np.concatenate([both[..., :2], heading[..., None]], axis=-1)).phi
            assert phi["held"].min() == pytest.approx(start.margin, abs=1e-9) and start.margin >= 0.005
            assert phi[start.task.success][0] < 0.0 < 0.02 <= phi[start.task.success][1] + 1e-9


@pytest.mark.long
def test_its_bytes_follow_from_spec_and_arguments(room, tmp_path):
    spec = room.parent / "left.spec"
    given = {"bands": 2, "n": 3, "grasp": {"arm": (0.005, None)}, "goal": Range(0.02, None)}
    new_suite([("left", spec)], tmp_path / "room", workers=2, **given)
    for path in room.iterdir():
        assert path.read_bytes() == (tmp_path / "room" / path.name).read_bytes()


def with_other(room, folder, change):
    """The suite with another suite.json, which has the digest of what it then is."""
    folder.mkdir()
    for path in room.iterdir():
        (folder / path.name).write_bytes(path.read_bytes())
    data = json.loads((room / SUITE_JSON).read_bytes())
    change(data["tasks"][0]["bands"][0]["grasps"][0], data)
    text = json.dumps({**data, "digest": BLANK_DIGEST})
    (folder / SUITE_JSON).write_text(text.replace(BLANK_DIGEST, hashlib.sha256(text.encode()).hexdigest(), 1))
    return folder


@pytest.mark.long
@pytest.mark.parametrize(
    "change",
    [
        lambda one, data: one.update(margin=one["margin"] + 1e-3),
        lambda one, data: one["yaw"].update(cube=one["yaw"]["cube"] + 0.5),
        lambda one, data: one["goal"]["cube"].__setitem__(0, 0.199),
        lambda one, data: one["goal"].update(cup=[0.0, 0.0, 0.0]),
        lambda one, data: data["tasks"][0]["bands"][0]["grasps"].pop(),
        lambda one, data: data.pop("robot"),
        lambda one, data: data.update(robot="cube"),
    ],
)
def test_what_was_forged_does_not_pass_the_check(room, tmp_path, change):
    with pytest.raises((DataError, RequestError)) as caught:
        check_suite(with_other(room, tmp_path / "forged", change))
    assert caught.value.diagnostics[0].code in (NOT_A_SUITE.code, "no-robot")


@pytest.mark.long
def test_too_few_starts_with_a_grasp(room, tmp_path):
    with pytest.raises(RequestError, match="starts of level1 of left have a goal"):
        new_suite(
            [("left", room.parent / "left.spec")],
            tmp_path / "none",
            bands=1,
            n=64,
            workers=1,
            grasp={"arm": (0.05, None)},
        )
    assert not (tmp_path / "none").exists()


def test_a_robot_and_its_mount_are_no_bodies_of_the_table():
    assert list(solids_of(scenegen.parse(SPEC))) == ["cube", "post[1]", "post[2]"]
    on_it = "object cup = box(5 cm, 5 cm, 5 cm) on mount\nrobot"
    nearer = SPEC.replace("-0.4) at", "0) at").replace("robot", on_it)
    with pytest.raises(RequestError, match="mount"):
        solids_of(scenegen.parse(nearer))


@pytest.mark.parametrize(
    "other",
    ["ur5e on mount at (0, -0.56, NORTH)", "panda at (0, -0.56, NORTH)", "panda on mount at (0.1, -0.56, NORTH)"],
)
def test_a_robot_elsewhere_than_that_of_the_world_is_refused(other):
    pytest.importorskip("robosuite")
    text = SPEC if "mount" in other else SPEC.replace("region mount = rect(-0.3, -0.8, 0.3, -0.4) at 11.2 cm\n", "")
    spec = scenegen.parse(text.replace("panda on mount at (0, -0.56, NORTH)", other))
    with pytest.raises(RequestError, match=r"panda: at \(0, -0.56, 90 deg\), 0.112 m high"):
        make(SimpleNamespace(spec=spec, name="left"))


@pytest.mark.long
def test_the_scripted_policy_takes_the_goal_and_the_grasp(room, root, monkeypatch):
    monkeypatch.syspath_prepend(root / "examples" / "policies")
    spec = importlib.util.spec_from_file_location("scripted", root / "examples" / "policies" / "scripted.py")
    scripted = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(scripted)
    start = Suite.load(room)[0]
    policy = scripted.Scripted(SimpleNamespace(task=start.task))
    policy.reset(0)
    policy.seen = {"objects": start.poses, "goal": start.goal, "yaws": start.yaws}
    policy.rest, policy.middle = 0.0, math.pi / 4.0
    ((which, goal),) = policy.moves(scripted.flat(start.poses))
    assert which == 0 and np.allclose(goal[:2], start.goal[0, :2])
    before, after = policy.grasp(which, goal, 0.02)
    own = [turn - theta for turn, theta in ((before, scripted.flat(start.poses)[0, 2]), (after, goal[2]))]
    assert [math.remainder(one - start.yaws[0], math.pi) for one in own] == pytest.approx([0.0, 0.0], abs=1e-9)
