"""Looks of simulators' files: those of the pictures with the same seed."""

import json

import mujoco
import numpy as np
import pytest
from PIL import Image

from scenegen.errors import RequestError
from scenegen.worlds.export.world import TALL
from tests.export.worlds import tower
from tests.looks.pictures import four_colors

CONFIG = """
[table]
texture = {choice = ["wood", "textures/four.png", "checker"]}
texture_size = 0.2
[ground]
texture = "speckle"
[walls]
distance = {uniform = [0.3, 0.9]}
color = "pink"
texture = {choice = ["plain", "stripes"]}
[objects]
hue = {uniform = [-0.5, 0.5]}
[light]
azimuth = {uniform = [-180, 180]}
elevation = {uniform = [40, 85]}
color = "#ffeedd"
[camera]
azimuth = {uniform = [-40, 40]}
fov = {uniform = [30, 60]}
roll = 5
"""


@pytest.fixture
def looks(tmp_path):
    four_colors(tmp_path, "textures/four.png")
    (tmp_path / "looks.toml").write_text(CONFIG)
    return tmp_path / "looks.toml"


def records(folder):
    return [json.loads(line) for line in (folder / "looks.jsonl").read_text().splitlines()]


def frame_of(record):
    """(4, 4): from the camera's frame of a record, y down and z ahead, to the world."""
    return np.linalg.inv(np.array(record["world_to_camera"]))


def shines(look):
    turn, rise = np.radians(look["light_azimuth"]), np.radians(look["light_elevation"])
    return -np.array([np.sin(turn) * np.cos(rise), -np.cos(turn) * np.cos(rise), np.sin(rise)])


@pytest.mark.long
def test_the_looks_of_worlds_are_those_of_pictures(looks, tmp_path):
    scenes = tower()
    scenes.render(tmp_path / "pictures", size=None, looks=looks, seed=4)
    scenes.export(tmp_path / "worlds", "mjcf", looks=looks, seed=4)
    drawn, exported = records(tmp_path / "pictures"), records(tmp_path / "worlds")
    assert [one["file"] for one in exported] == ["scene_0001.xml", "scene_0002.xml"]
    for one, other in zip(drawn, exported, strict=True):
        del one["pictures"], other["file"]
        assert one == other


@pytest.mark.parametrize("seed", [4, 5, 6])
def test_mujoco_has_the_camera_the_light_the_colours_and_the_walls(looks, tmp_path, seed):
    scenes = tower()
    files = scenes.export(tmp_path / "worlds", "mjcf", looks=looks, seed=seed)
    plain = mujoco.MjModel.from_xml_path(str(scenes.export(tmp_path / "plain", "mjcf")[0]))
    for path, record in zip(files, records(tmp_path / "worlds"), strict=True):
        look = record["look"]
        model = mujoco.MjModel.from_xml_path(str(path))
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        frame = frame_of(record)
        np.testing.assert_allclose(data.camera("look").xpos, frame[:3, 3], atol=1e-6)
        turned = data.camera("look").xmat.reshape(3, 3) * [1.0, -1.0, -1.0]  # MuJoCo's has y up and z behind
        np.testing.assert_allclose(turned, frame[:3, :3], atol=1e-6)
        assert model.camera("look").fovy[0] == pytest.approx(look["camera_fov"])
        np.testing.assert_allclose(data.light_xdir[0], shines(look), atol=1e-6)
        np.testing.assert_allclose(model.light_diffuse[0], look["light_intensity"] * np.array(look["light_color"]))
        np.testing.assert_allclose(model.material("table").rgba[:3], look["table_color"], atol=1e-6)
        np.testing.assert_allclose(model.material("wall_1").rgba[:3], look["walls_color"], atol=1e-6)
        tints = {
            geom: tuple(rgba) for geom, rgba in enumerate(model.geom_rgba[model.geom_bodyid > 1].round(6).tolist())
        }
        assert set(tints.values()) != {tuple(rgba) for rgba in plain.geom_rgba[plain.geom_bodyid > 1].round(6).tolist()}
        # What collides, and how, is as without looks.
        solid = model.geom_contype > 0
        assert solid.sum() == (plain.geom_contype > 0).sum()
        np.testing.assert_array_equal(model.geom_size[solid], plain.geom_size[plain.geom_contype > 0])
        np.testing.assert_array_equal(model.body_mass, plain.body_mass)
        np.testing.assert_array_equal(model.key_qpos, plain.key_qpos if path == files[0] else model.key_qpos)


def test_walls_face_inwards_and_let_the_light_onto_the_table(looks, tmp_path):
    """A ray from each corner of the table to the sun passes above every wall."""
    scenes = tower()
    for seed in range(5):
        files = scenes.export(tmp_path / str(seed), "mjcf", looks=looks, seed=seed)
        for path, record in zip(files, records(tmp_path / str(seed)), strict=True):
            model = mujoco.MjModel.from_xml_path(str(path))
            data = mujoco.MjData(model)
            mujoco.mj_forward(model, data)
            top = next(k for k in range(model.ngeom) if model.geom_type[k] == mujoco.mjtGeom.mjGEOM_BOX)
            center, half = data.geom_xpos[top], model.geom_size[top]
            corners = center + np.array([[x, y, 1.0] for x in (-1, 1) for y in (-1, 1)]) * half
            walls = [k for k in range(model.ngeom) if model.geom_type[k] == mujoco.mjtGeom.mjGEOM_PLANE][1:]
            assert len(walls) == 4
            towards = -shines(record["look"])
            for wall in walls:
                normal = data.geom_xmat[wall].reshape(3, 3)[:, 2]
                assert normal @ (center - data.geom_xpos[wall]) > 0.29
                height = data.geom_xpos[wall][2] + model.geom_size[wall][1]
                assert data.geom_xpos[wall][2] - model.geom_size[wall][1] == pytest.approx(-TALL)
                for corner in corners:
                    slope = normal @ towards
                    if slope < 0.0:
                        meets = corner + towards * (normal @ (data.geom_xpos[wall] - corner) / slope)
                        assert meets[2] > height - 1e-6


def test_textures_are_as_large_as_they_should_be(looks, tmp_path):
    scenes = tower()
    for seed in range(8):
        (path, _) = scenes.export(tmp_path / str(seed), "mjcf", looks=looks, seed=seed)
        if records(tmp_path / str(seed))[0]["look"]["table_texture"] == "textures/four.png":
            break
    else:
        pytest.fail("no seed has the texture")
    model = mujoco.MjModel.from_xml_path(str(path))
    top = next(k for k in range(model.ngeom) if model.geom_type[k] == mujoco.mjtGeom.mjGEOM_BOX)
    across, along, _ = 2.0 * model.geom_size[top]
    assert not model.material("table").texuniform[0]
    np.testing.assert_allclose(model.material("table").texrepeat, [across / 0.2, along / 0.1], rtol=1e-6)
    with Image.open(path.parent / "textures" / "four.png") as image:
        assert image.size == (64, 32)


def test_usd_has_the_camera_the_light_and_textures_that_are_there(looks, tmp_path):
    pytest.importorskip("pxr")
    from pxr import Gf, UsdGeom, UsdLux, UsdShade

    from tests.export.stages import faults, frame, opened, things

    scenes = tower()
    files = scenes.export(tmp_path / "stages", "usd", looks=looks, seed=4)
    before = opened(scenes.export(tmp_path / "plain", "usd")[0])
    for path, record in zip(files, records(tmp_path / "stages"), strict=True):
        stage, look = opened(path), record["look"]
        assert faults(stage) == []
        camera = UsdGeom.Camera(stage.GetPrimAtPath("/Environment/look"))
        np.testing.assert_allclose(
            frame(camera.GetPrim())[:3, :3] * [1.0, -1.0, -1.0], frame_of(record)[:3, :3], atol=1e-9
        )
        np.testing.assert_allclose(frame(camera.GetPrim())[:3, 3], frame_of(record)[:3, 3], atol=1e-9)
        seen = camera.GetCamera().GetFieldOfView(Gf.Camera.FOVVertical)
        assert seen == pytest.approx(look["camera_fov"], abs=1e-4)
        sun = UsdLux.DistantLight(stage.GetPrimAtPath("/Environment/sun"))
        np.testing.assert_allclose(frame(sun.GetPrim())[:3, :3] @ [0.0, 0.0, -1.0], shines(look), atol=1e-6)
        np.testing.assert_allclose(sun.GetColorAttr().Get(), look["light_color"], atol=1e-6)
        textures = [
            UsdShade.Shader(prim).GetInput("file").Get()
            for prim in stage.TraverseAll()
            if prim.GetTypeName() == "Shader" and UsdShade.Shader(prim).GetIdAttr().Get() == "UsdUVTexture"
        ]
        assert textures and all(one.resolvedPath for one in textures)
        assert (
            len([prim for prim in stage.TraverseAll() if prim.GetName().startswith("wall_") and prim.IsA(UsdGeom.Mesh)])
            == 4
        )
        assert things(stage).keys() == things(before).keys()


def test_looks_are_refused_where_they_cannot_be(looks, tmp_path):
    scenes = tower()
    with pytest.raises(RequestError, match="goes with mjcf and usd"):
        scenes.export(tmp_path / "a", "sdf", looks=looks)
    with pytest.raises(RequestError, match="a file of its own"):
        scenes.export(tmp_path / "all.xml", looks=looks)
    with pytest.raises(RequestError, match="seed"):
        scenes.export(tmp_path / "a", "mjcf", looks=looks, seed=-1)
    assert not list(tmp_path.glob("a*"))
