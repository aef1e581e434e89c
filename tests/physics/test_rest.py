"""Where scenes come to rest: in both simulators, in files of every format, on any number of processes."""

import json
import math

import numpy as np
import pandas
import pytest
from scipy.spatial.transform import Rotation

import scenegen
from scenegen.errors import RequestError
from scenegen.geometry.workspace import standing, turn_between, upright
from scenegen.worlds.export import mjcf, sdf
from scenegen.worlds.export.world import world_of
from scenegen.worlds.physics.bodies import TABLE, Contact, board_of, gathered, piece_files, whole_of
from scenegen.worlds.physics.rest import settle_file
from scenegen.worlds.physics.simulation import FINE, SIMULATORS, MujocoSetup, PybulletSetup, RestJob
from tests.export.worlds import scenes_of, tower

BOXES = "object base = box(0.1, 0.1, 0.1) at (0.5, 0.5, 0), near = box(0.1, 0.1, 0.1), far = box(0.04, 0.06, 0.02)\n"
BASE = {"base": (0.5, 0.5, 0.0)}
AWAY = {"near": (0.7, 0.5, 0.0), "far": (0.9, 0.9, 1.0)}
DEEP = {"near": (0.595, 0.5, 0.0), "far": (0.9, 0.9, 1.0)}


def boxes():
    """Two scenes: boxes apart, and the same with one of them 5 mm deep in a box that is held in place."""
    return scenes_of(f"{BOXES}task: leftOf(base, near)\nturned: angle(far, EAST, 10 deg)", BASE | AWAY, BASE | DEEP)


@pytest.fixture(params=SIMULATORS)
def simulator(request):
    if request.param == "mujoco":
        pytest.importorskip("mujoco", reason="mujoco is not installed (pip install 'scenegen[mujoco]')")
    return request.param


def rested(scenes, simulator, seconds):
    """What becomes of scenes, in this process."""
    world = world_of(scenes.header, next(scenes.blocks()))
    places = world.poses[..., [0, 1, 3, 2]]
    if simulator == "mujoco":
        return RestJob(MujocoSetup(mjcf.bench(world).decode()), seconds)(places)
    bodies = [*map(whole_of, world.bodies), *(board_of(board, sdf.ROUGH) for board in world.boards)]
    with piece_files(bodies) as files:
        return RestJob(PybulletSetup(bodies, files, len(world.boards), step=FINE), seconds)(places)


def test_what_stands_in_and_on_things_rests(simulator):
    """A mug in the hollow of a plate, a block on a block on a tray that is held."""
    found = rested(tower(), simulator, 0.5)
    assert found.shift.max() < 5e-4 and found.turn.max() < 0.5
    assert max(touch.depth for one in found.contacts for touch in one) < 1e-6
    names = tower().objects
    pairs = {(names[touch.a] if touch.a != TABLE else "", names[touch.b]) for touch in found.contacts[0]}
    assert {("plate", "mug"), ("block[1]", "block[2]"), ("", "plate")} <= pairs and ("", "mug") not in pairs


BOARDS = """region low = rect(0.2, 0.2, 0.6, 0.5) at 30 cm
region high = circle((0.8, 0.3), 0.1) at 50 cm
object can[2] on any of [low, high, workspace]
task: closeTo(can[1], can[2], 2 m)
"""


def test_what_stands_on_boards_rests(simulator):
    """A can on a rectangular board and one on a round board: neither falls, and the boards count as the table."""
    spec = scenegen.parse(BOARDS)
    scenes = scenegen.sample(spec, None, 12, seed=2, fix={"can[1]": (0.4, 0.3), "can[2]": (0.8, 0.3)}, workers=1)
    assert {(1.0, 2.0), (1.0, 3.0), (3.0, 2.0)} <= {(a, b) for a, b in scenes.on.tolist()}
    found = rested(scenes, simulator, 0.3)
    assert found.planned[..., 2].max() == 0.5 and found.shift.max() < 5e-4 and found.turn.max() < 0.5
    pairs = {(touch.a, touch.b) for one in found.contacts for touch in one}
    assert pairs == {(TABLE, 0), (TABLE, 1)}


def test_depths_before_and_shifts_after_are_those_of_the_boxes(simulator):
    found = rested(boxes(), simulator, 0.5)
    apart, deep = found.contacts
    assert [(touch.a, touch.b) for touch in apart] == [(TABLE, 1), (TABLE, 2)]
    assert [touch.depth for touch in deep if touch.a == 0] == pytest.approx([0.005], abs=3e-5)
    assert found.shift[0].max() < 1e-4 and found.shift[1, 0] < 2e-5
    assert 0.002 < found.shift[1, 1] < 0.1 and found.shift[1, 2] < 1e-4


def test_scenes_do_not_affect_each_other(simulator):
    """So which process simulates a scene, and after which other, does not matter."""
    both, alone = rested(boxes(), simulator, 0.1), rested(boxes()[1:], simulator, 0.1)
    assert (both.poses[1] == alone.poses[0]).all() and both.contacts[1] == alone.contacts[0]


def test_gathered_keeps_the_deepest_point_of_each_pair_and_drops_what_is_far():
    points = [(2, 0, -0.001), (0, 2, -0.003), (TABLE, 1, 5e-5), (1, 2, 0.02)]
    assert gathered(points) == (Contact(TABLE, 1, 0.0), Contact(0, 2, 0.003))


def test_attitudes_agree_with_scipy():
    draw = np.random.default_rng(3)
    yaw, tilt, axis = draw.uniform((0, 0, 0), (math.tau, 3.0, math.tau), (50, 3)).T
    lying = Rotation.from_rotvec(tilt[:, None] * np.stack([np.cos(axis), np.sin(axis), 0 * axis], axis=1))
    turned = lying * Rotation.from_rotvec(yaw[:, None] * [[0.0, 0.0, 1.0]])
    poses = np.concatenate([np.zeros((50, 3)), np.roll(turned.as_quat(), 1, axis=1)], axis=1)
    assert np.abs(np.remainder(upright(poses)[:, 2] - yaw + 1.0, math.tau) - 1.0).max() < 1e-12
    plan = standing(np.stack([0 * yaw, 0 * yaw, yaw, 0 * yaw], axis=1))
    np.testing.assert_allclose(turn_between(plan[:, 3:], poses[:, 3:]), np.degrees(tilt), atol=1e-10)
    assert turn_between(plan[:, 3:], -plan[:, 3:]).max() < 1e-12  # a quaternion and its negative are one attitude


@pytest.fixture(scope="module")
def settled():
    return scenegen.settle(boxes(), "pybullet", seconds=0.25, workers=1)


def test_scenes_that_moved_are_marked_and_phi_is_scored_again(settled):
    scenes = boxes()
    assert settled.settled.tolist() == [True, False] and settled.moved[1].tolist() == [False, True, False]
    assert settled.deepest.tolist() == pytest.approx([0.0, 0.005], abs=3e-5)
    x = settled.poses[:, :, 0]
    assert settled.phi["task"] == pytest.approx(x[:, 1] - x[:, 0], abs=1e-12)
    assert settled.poses[:, 0, :2].tolist() == scenes.poses[:, 0, :2].tolist()  # what is held, to the last bit
    assert "1 of 2 scenes settled (pybullet, 0.25 s); in 1 an object moved too far: `near` in 1" in repr(settled)


def test_files_of_every_format_hold_the_same(settled, tmp_path):
    boxes().save(tmp_path / "scenes.json")
    summary = settle_file(tmp_path / "scenes.json", tmp_path / "s.jsonl", "pybullet", seconds=0.25, workers=1)
    assert (summary.scenes, summary.far) == (2, 1)
    header, *lines = map(json.loads, (tmp_path / "s.jsonl").read_text().splitlines())
    whole = json.loads(settled.save(tmp_path / "s.json").read_text())
    assert whole == header | {"scenes": lines}
    assert (header["format"], header["version"], header["max_shift_mm"]) == ("scenegen/settled", 1, 2.0)
    assert [(one["scene"], one["settled"], one["moved"]) for one in lines] == [(1, True, []), (2, False, ["near"])]
    assert list(lines[1]["objects"]["near"].values())[:7] == settled.poses[1, 1].tolist()
    assert lines[1]["contacts"][0]["a"] is None and lines[1]["objects"]["near"]["shift_mm"] > 2.0
    table = pandas.read_parquet(settled.save(tmp_path / "s.parquet"))
    assert table["near.qw"].tolist() == settled.poses[:, 1, 3].tolist()
    assert table["settled"].tolist() == [True, False] and table["moved"][1].tolist() == ["near"]
    assert table["phi.task"].tolist() == settled.phi["task"].tolist()
    assert [dict(one) for one in table["contacts"][1]] == lines[1]["contacts"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"simulator": "bullet"}, "unknown simulator `bullet`"),
        ({"seconds": 0}, "`seconds`"),
        ({"max_shift": -1.0}, "`max_shift`"),
        ({"max_turn": "2deg"}, "`max_turn`"),
        ({"workers": 0}, "`workers`"),
    ],
)
def test_wrong_arguments_are_refused(arguments, words):
    with pytest.raises(RequestError, match=words):
        scenegen.settle(boxes(), **{"simulator": "pybullet"} | arguments)


def test_no_scenes_are_refused_and_a_missing_simulator_is_named(monkeypatch):
    with pytest.raises(RequestError, match="no scenes"):
        scenegen.settle(boxes()[:0], "pybullet")
    monkeypatch.setattr("scenegen.needs.found", lambda package: package != "mujoco")
    with pytest.raises(RequestError, match="mujoco") as error:
        scenegen.settle(boxes(), "mujoco")
    assert 'pip install "scenegen[mujoco]"' in str(error.value)


def test_what_diverges_is_null_and_has_not_settled(tmp_path):
    """A simulation that leaves NaN: the file says so."""
    from scenegen.lang.checker import check_text
    from scenegen.worlds.physics.rest import _header, _judged
    from scenegen.worlds.physics.simulation import RestResult

    scenes = boxes()
    header = _header(scenes.header, "pybullet", 2.0, 0.002, 2.0)
    world = world_of(scenes.header, next(scenes.blocks()))
    planned = standing(world.poses[..., [0, 1, 3, 2]])
    poses = planned.copy()
    poses[0, 1] = np.nan
    spec = check_text(scenes.header.spec.source)
    block = _judged(
        spec, scenes.header, header, world, RestResult(planned, poses, ((), ())), scenes.poses, np.empty((2, 0))
    )
    assert block.moved.tolist() == [[False, True, False], [False] * 3]
    assert np.isnan(block.phi[:, 0]).all() and np.isfinite(block.phi[:, 1]).all()
    from scenegen.scenes.formats.settled import write_settled

    write_settled(tmp_path / "s.json", header, [block])
    first = json.loads((tmp_path / "s.json").read_text())["scenes"][0]
    assert first["phi"]["task"] is None and first["objects"]["near"]["x"] is None and not first["settled"]
