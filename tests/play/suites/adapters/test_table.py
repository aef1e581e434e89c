"""The table of a spec, what it refuses, and the scripted policy's plans: what needs no simulator."""

import importlib.util
import math
from types import SimpleNamespace

import numpy as np
import pytest

import scenegen
from scenegen.errors import RequestError
from scenegen.errors.requests import NOT_INSTALLED, WRONG_VALUE
from scenegen.play.frame import rotate
from scenegen.play.suites.adapters import libero
from scenegen.play.suites.adapters.arms import ArmWorld, lean
from scenegen.play.suites.adapters.table import make, solids_of, table_of

SPEC = scenegen.parse("""
    workspace [0.0, 0.4] x [0.1, 0.3]
    object cube = box(4 cm, 6 cm, 8 cm), can = cylinder(3 cm, 10 cm), cup1 = box(5 cm, 5 cm, 5 cm) at (0.1, 0.2)
    require noOverlap()
    goal: leftOf(cube, can) & closeTo(cube, can, 12 cm)
""")


@pytest.fixture
def example(root, monkeypatch):
    def load(name):
        monkeypatch.syspath_prepend(root / "examples" / "policies")
        path = root / "examples" / "policies" / f"{name}.py"
        spec = importlib.util.spec_from_file_location(name, path)
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        return module

    return load


def test_solids_are_half_sizes():
    assert solids_of(SPEC) == {"cube": [0.02, 0.03, 0.04], "can": [0.03, 0.05], "cup1": [0.025, 0.025, 0.025]}


@pytest.mark.parametrize("text", ["mug, plate", "a = prism([(0, 0), (0.1, 0), (0, 0.1)], 5 cm), plate"])
def test_other_shapes_are_refused(text):
    spec = scenegen.parse(f"object {text} task: closeTo({text[:3].strip(' ,=')}, plate)")
    with pytest.raises(RequestError) as caught:
        make(SimpleNamespace(spec=spec))
    assert caught.value.diagnostics[0].kind == WRONG_VALUE


def test_boards_are_refused():
    text = (
        "region shelf = rect(0, 0, 1, 1) at 30 cm object a = box(5 cm, 5 cm, 5 cm) on shelf, b = box(5 cm, 5 cm, 5 cm)"
    )
    with pytest.raises(RequestError, match="shelf"):
        solids_of(scenegen.parse(f"{text} task: leftOf(a, b)"))


@pytest.mark.parametrize("adapter", [make, libero.make])
def test_what_is_not_installed_is_named(adapter):
    if importlib.util.find_spec(adapter.__module__.rpartition(".")[2].replace("table", "robosuite")):
        pytest.skip("it is installed here")
    with pytest.raises(RequestError) as caught:
        adapter(SimpleNamespace(spec=SPEC, name="a task"))
    assert caught.value.diagnostics[0].kind == NOT_INSTALLED


def test_the_workspace_is_over_the_middle_of_the_table():
    frame, size = table_of(SPEC)
    at, _ = frame.place([0.2, 0.2, 0.0, 1.0, 0.0, 0.0, 0.0])
    assert np.allclose(at, [0.0, 0.0, 0.8]) and size == (0.8, 0.8, 0.05)
    away, _ = frame.place([0.2, 0.3, 0.0, 1.0, 0.0, 0.0, 0.0])
    assert np.allclose(away - at, [0.1, 0.0, 0.0])  # the spec's y axis points away from the robot
    assert table_of(scenegen.parse("leftOf(a, b)"))[1] == (1.2, 1.2, 0.05)


def test_an_episode_needs_a_start():
    world = ArmWorld(None, None, None, {}, None, None, 10)
    with pytest.raises(RequestError) as caught:
        world.reset(seed=0)
    assert caught.value.diagnostics[0].kind == WRONG_VALUE


def test_quaternions(example):
    matrix = example("scripted").matrix
    for quaternion in np.random.default_rng(0).normal(size=(100, 4)):
        unit = quaternion / np.linalg.norm(quaternion)
        assert np.allclose(rotate(unit, np.array([1.0, 2.0, 3.0])), matrix(unit) @ [1.0, 2.0, 3.0])
    half = 0.15
    assert np.allclose(lean(np.array([[0, 0, 0, math.cos(half), math.sin(half), 0, 0]])), 0.3)


@pytest.mark.long
def test_plans_hold_and_take_the_fewest_moves(example):
    scripted = example("scripted")
    scenes = scenegen.sample(SPEC, {"goal": (None, -0.05)}, 4, spread="base", workers=1)
    for poses in scenes.poses:
        ((which, goal),) = scripted.plan(SPEC, "goal", poses)
        after = poses.copy()
        after[which] = goal[:3]
        assert SPEC.scenes(after[None]).phi["goal"][0] >= 0.0 and which in (0, 1) and goal[3] == 0.0


def test_what_a_suite_adds_to_a_spec_is_left_out(example):
    scripted = example("scripted")
    task = scenegen.parse(SPEC.checked.source + "require !goal & leftOf(can, cube)\n")
    assert scripted.without_start(task, "goal").checked.source == SPEC.checked.source
    assert scripted.without_start(SPEC, "goal") is SPEC


def test_the_hand_turns_least(example):
    scripted = example("scripted")
    long, cube = (
        SimpleNamespace(asset="box", footprint=SimpleNamespace(extent=e)) for e in ((0.09, 0.04), (0.04, 0.04))
    )
    ((before, after),) = scripted.across(long, 0.0, 0.0, 0.0)
    assert (before, after) == pytest.approx((math.pi / 2, math.pi / 2))
    ((before, after),) = scripted.across(long, 0.0, math.pi, 0.0)
    assert (before, after) == pytest.approx((-math.pi / 2, math.pi / 2))
    assert sorted(way for way, _ in scripted.across(cube, 0.3, 0.3, 0.0)) == pytest.approx([0.3 - math.pi / 2, 0.3])
    down = scripted.pointing_down(0.4)
    half = 0.2  # a half turn about the axis between the hand's x axis, turned by 0.4, and that of the table
    assert scripted.yaw([0.0] * 3 + [0.0, math.cos(half), math.sin(half), 0.0]) == pytest.approx(0.4)
    assert np.allclose(down @ [0.0, 0.0, 1.0], [0.0, 0.0, -1.0]) and np.linalg.det(down) == pytest.approx(1.0)
    turned = scripted.pointing_down(0.7) @ scripted.pointing_down(0.4).T
    assert np.allclose(scripted.rotation_vector(turned), [0.0, 0.0, 0.3])


@pytest.mark.parametrize(("post", "closes"), [((0.06, 0.0), 1.0), ((0.0, 0.06), 0.0), ((0.3, 0.0), 0.0)])
def test_the_hand_grasps_where_there_is_room(example, post, closes):
    """Beside a post the fingers close past it; with no post near, the hand turns least."""
    spec = scenegen.parse("object cube = box(4 cm, 4 cm, 4 cm), post = cylinder(2 cm, 10 cm)\ngoal: leftOf(cube, post)")
    policy = example("scripted").Scripted(SimpleNamespace(task=SimpleNamespace(spec=spec, success="goal")))
    policy.rest, policy.seen = 0.0, {"objects": np.array([[0.0] * 3 + [1, 0, 0, 0], [*post, 0.0, 1, 0, 0, 0]])}
    before, after = policy.grasp(0, np.array([-0.3, -0.3, 0.0, 0.0]), 0.015)
    assert abs(math.sin(before)) == pytest.approx(closes) and before == pytest.approx(after)


@pytest.mark.long
def test_a_cloned_policy_learns_what_goes_where(example, tmp_path):
    """Demonstrations that put the first thing 5 cm to the left of the second one."""
    cloned = example("cloned")
    cloned.EPOCHS = 150
    poses = np.random.default_rng(0).uniform([-0.2, -0.2, 0.0], [0.2, 0.2, 6.28], size=(300, 2, 3))
    seen = np.array([cloned.features(one) for one in poses])
    goals = np.column_stack([poses[:, 1, :2] - [0.05, 0.0], np.zeros(300)])
    done = [np.concatenate([[1.0, 0.0], cloned.features(goal[None])]) for goal in goals]
    path = tmp_path / "task.npz"
    np.savez(path, **cloned.learn(seen[:250], np.array(done[:250])))
    policy = cloned.Cloned(SimpleNamespace(task=SimpleNamespace(spec=SPEC, success="goal")), path=path)
    for one, goal in zip(poses[250:], goals[250:], strict=True):
        ((which, found),) = policy.moves(one)
        assert which == 0 and np.abs(found[:2] - goal[:2]).max() < 0.03
