"""Heights that a spec declares reach files, arrays, pictures and simulators."""

import json
import math
import re

import numpy as np
import pytest

import scenegen
from scenegen.errors import DataError, RequestError
from scenegen.scenes.stage import places_of, poses_of, stage_of

TEXT = """object tray at (0.5, 0.5, 30 deg), can on tray, low = box(0.2, 0.2, 0.05) at (0.2, 0.2)
object block[2] on [low, block[1]]
require noCollision()
task: leftOf(block[1], can)
"""
HEIGHTS = [0.0, 0.01, 0.0, 0.05, 0.10]
FURNISHED = """object c = cabinet(open = [0, 0.95, 0]) at (0.3, 0.6, SOUTH), spoon on c.drawer[2]
object pot on c.top, lid on pot.rim
object rack at (0.8, 0.2, 30 deg), bottle on rack.slot[2], drawer at (0.8, 0.7, EAST), bin on drawer, apple on bin
object stand at (0.3, 0.1), orange on stand
require noCollision()
task: leftOf(spoon, apple) & inside(pot, c.top) & closeTo(orange, stand, 5 cm)
"""
FURNITURE = {
    "c": 0.0,
    "spoon": 0.148,
    "pot": 0.35,
    "lid": 0.46,
    "rack": 0.0,
    "bottle": 0.01,
    "drawer": 0.0,
    "bin": 0.008,
}
FURNITURE |= {"apple": 0.016, "stand": 0.0, "orange": 0.14}


@pytest.fixture(scope="module")
def scenes():
    return scenegen.sample(scenegen.parse(TEXT), {"task": (0.0, None)}, n=5)


@pytest.mark.long
def test_a_file_says_how_high_objects_stand_and_on_what(scenes, tmp_path):
    for name in ("scenes.json", "scenes.jsonl"):
        again = scenegen.read_scenes(scenes.save(tmp_path / name))
        assert again.header.version == 2
        assert [one.support.z for one in again.header.objects] == pytest.approx(HEIGHTS)
        assert [one.support.on for one in again.header.objects] == ["", "tray.inside", "", "low.top", "block[1].top"]
        assert (again.poses == scenes.poses).all()


def test_a_file_of_a_spec_without_supports_is_version_1(tmp_path):
    plain = scenegen.sample(scenegen.parse("leftOf(mug, plate)"), {"task": (0.0, None)}, n=2)
    data = json.loads(plain.save(tmp_path / "plain.json").read_text())
    assert data["version"] == 1 and all(set(one) == {"name", "shape"} for one in data["objects"])


@pytest.mark.parametrize(("version", "keep"), [(1, True), (2, False), (3, True)])
def test_a_file_whose_version_and_supports_disagree_is_refused(scenes, tmp_path, version, keep):
    data = json.loads(scenes.save(tmp_path / "scenes.json").read_text())
    data["version"] = version
    if not keep:
        del data["objects"][0]["support"]
    (tmp_path / "other.json").write_text(json.dumps(data))
    with pytest.raises(DataError):
        scenegen.read_scenes(tmp_path / "other.json")


def test_poses7(scenes):
    found = scenes.poses7()
    assert found.shape == (5, 5, 7) and found.dtype == np.float64
    assert found[:, :, 2] == pytest.approx(np.tile(HEIGHTS, (5, 1)))
    assert (found[..., :2] == scenes.poses[..., :2]).all()
    assert np.hypot(found[..., 3], found[..., 6]) == pytest.approx(np.ones((5, 5)))
    turned = 2.0 * np.arctan2(found[..., 6], found[..., 3]) % math.tau
    assert turned == pytest.approx(scenes.poses[..., 2])
    assert scenes.poses7(tensor=True, dtype="float32").dtype.is_floating_point
    with pytest.raises(RequestError, match="float32"):
        scenes.poses7(dtype="int8")


def test_heights_that_follow_from_poses_are_in_poses7_too():
    plain = scenegen.sample(scenegen.parse("on(mug, plate)"), {"task": (0.05, None)}, n=1)
    assert plain.poses7()[0, :, 2].tolist() == pytest.approx([0.0074, 0.0], abs=0.02)
    assert plain.poses7()[0, 0, 2] > 0.0


def test_pictures_have_the_same_heights(scenes):
    file = scenes.file()
    assert places_of(stage_of(file), poses_of(file))[..., 3] == pytest.approx(np.tile(HEIGHTS, (5, 1)))


@pytest.fixture(scope="module")
def furnished():
    return scenegen.sample(scenegen.parse(FURNISHED), {"task": (0.0, None)}, n=3)


@pytest.mark.long
def test_furniture_has_one_height_in_files_arrays_pictures_and_gazebo(furnished, tmp_path):
    heights = [FURNITURE[name] for name in furnished.objects]
    assert furnished.poses7()[..., 2] == pytest.approx(np.tile(heights, (3, 1)), abs=1e-6)
    file = scenegen.read_scenes(furnished.save(tmp_path / "scenes.json")).file()
    assert places_of(stage_of(file), poses_of(file))[..., 3] == pytest.approx(np.tile(heights, (3, 1)), abs=1e-6)
    (path,) = furnished[:1].export(tmp_path / "all.sdf")
    for name, (x, y, _), z in zip(furnished.objects, furnished.poses[0], heights, strict=True):
        found = re.search(rf'<model name="{name}">.*?<pose[^>]*>([^<]+)</pose>', path.read_text(), re.DOTALL)
        assert found and [float(one) for one in found[1].split()[:3]] == pytest.approx([x, y, z], abs=1e-6), name


@pytest.mark.long
@pytest.mark.parametrize("which", ["scenes", "furnished"])
def test_mujoco_has_the_same_heights_and_finds_no_collision(which, request, tmp_path):
    """The convex pieces of simulators, at the heights of the file, reach into each other by no more than 0.1 mm."""
    mujoco = pytest.importorskip("mujoco")
    from scenegen.worlds.export.world import world_of

    scenes = request.getfixturevalue(which)
    world = world_of(scenes.header, next(scenes.blocks()))
    heights = HEIGHTS if which == "scenes" else [FURNITURE[name] for name in scenes.objects]
    assert world.poses[..., 2] == pytest.approx(np.tile(heights, (len(scenes), 1)), abs=1e-6)
    scenes.export(tmp_path, "mjcf")
    for number, path in enumerate(sorted(tmp_path.rglob("*.xml"))):
        model = mujoco.MjModel.from_xml_path(str(path))
        data = mujoco.MjData(model)
        if model.nkey:
            mujoco.mj_resetDataKeyframe(model, data, 0)
        mujoco.mj_forward(model, data)
        names = {model.body(k).name: k for k in range(model.nbody)}
        for name, pose in zip(scenes.objects, scenes.poses7()[number], strict=True):
            assert data.xpos[names[name]] == pytest.approx(pose[:3], abs=1e-6)
        depths = [contact.dist for contact in data.contact]
        assert min(depths, default=0.0) > -1e-4
