"""Objects from mesh files are drawn as their files show them: opened again, geometry, colours and pictures agree."""

import io
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import scenegen
from scenegen.things.mesh import box
from scenegen.worlds.own_body import own_bodies_of

MTL = "newmtl skin\nKd 0.5 1 1\nmap_Kd skin.jpg\nnewmtl lid\nKd 0.2 0.4 0.6\n"


@pytest.fixture
def scenes(tmp_path: Path) -> scenegen.SceneSet:
    """A box that has a picture, its upper side a colour."""
    mesh = box(0.1, 0.06, 0.04)
    lid = (mesh.vertices[mesh.faces][:, :, 2] > mesh.vertices[:, 2].max() - 1e-9).all(axis=1)
    lines = ["mtllib crate.mtl", *("v {:.6f} {:.6f} {:.6f}".format(*one) for one in mesh.vertices)]
    lines += [f"vt {one / 8} {one * one / 64}" for one in range(len(mesh.vertices))]
    lines += ["usemtl skin", *("f {0}/{0} {1}/{1} {2}/{2}".format(*one) for one in mesh.faces[~lid] + 1)]
    lines += ["usemtl lid", *("f {} {} {}".format(*one) for one in mesh.faces[lid] + 1)]
    (tmp_path / "crate.obj").write_text("\n".join(lines))
    (tmp_path / "crate.mtl").write_text(MTL)
    picture = Image.new("RGB", (8, 8), (200, 30, 30))
    picture.paste((30, 30, 200), (0, 0, 8, 4))
    picture.save(tmp_path / "skin.jpg", quality=95)
    (tmp_path / "s.spec").write_text('object c = mesh("crate.obj"), mug\ntask: leftOf(c, mug)')
    return scenegen.sample(scenegen.load(tmp_path / "s.spec"), {"task": (0.1, None)}, n=2, seed=3)


def corners(points: np.ndarray, places: np.ndarray) -> set[tuple[float, ...]]:
    return {tuple(row) for row in np.column_stack([points, places]).astype(float).round(4).tolist()}


def wanted(scenes: scenegen.SceneSet, folder: Path) -> set[tuple[float, ...]]:
    """Places of the textured surface and of its corners in the picture, v = 0 below."""
    skin = next(one for one in own_bodies_of(scenes.file(), folder, painted=True)["c"].skins if one.texture)
    flat = skin.faces.ravel()
    assert skin.uv is not None
    return corners(skin.vertices[flat], skin.uv[flat] * (1.0, -1.0) + (0.0, 1.0))


def is_the_picture(data: bytes, folder: Path) -> None:
    with Image.open(io.BytesIO(data)) as made, Image.open(folder / "skin.jpg") as given:
        assert made.format == "PNG" and np.array_equal(np.asarray(made), np.asarray(given.convert("RGB")))


@pytest.mark.long
@pytest.mark.parametrize("looks", [None, "random"])
def test_mujoco_has_geometry_colours_and_pictures(scenes, tmp_path, looks):
    mujoco = pytest.importorskip("mujoco")
    path, _ = scenes.export(tmp_path / "out", "mjcf", meshes=tmp_path, looks=looks)
    model = mujoco.MjModel.from_xml_path(str(path))
    seen = [k for k in range(model.ngeom) if model.geom_group[k] == 2 and model.body(model.geom_bodyid[k]).name == "c"]
    textured = [k for k in seen if model.geom_matid[k] >= 0]
    assert len(seen) == 2 and len(textured) == 1
    material = model.geom_matid[textured[0]]
    texture = max(model.mat_texid[material])
    assert texture >= 0 and (model.tex_width[texture], model.tex_height[texture]) == (8, 8)
    (plain,) = set(seen) - set(textured)
    if looks is None:
        assert model.geom_rgba[textured[0]][:3] == pytest.approx((0.5, 1.0, 1.0), abs=1e-3)
        assert model.geom_rgba[plain][:3] == pytest.approx((0.2, 0.4, 0.6), abs=1e-3)
    mesh = model.geom_dataid[textured[0]]
    at, count = model.mesh_faceadr[mesh], model.mesh_facenum[mesh]
    points = model.mesh_vert[model.mesh_vertadr[mesh] + model.mesh_face[at : at + count].ravel()]
    turn = np.zeros(9)
    mujoco.mju_quat2Mat(turn, model.mesh_quat[mesh])
    points = points @ turn.reshape(3, 3).T + model.mesh_pos[mesh]  # MuJoCo moves meshes to their centres of mass
    places = model.mesh_texcoord[model.mesh_texcoordadr[mesh] + model.mesh_facetexcoord[at : at + count].ravel()]
    assert corners(points, places * (1.0, -1.0) + (0.0, 1.0)) == wanted(scenes, tmp_path)  # its v = 0 is above
    solid = [k for k in range(model.ngeom) if model.geom_group[k] == 3 and model.geom_contype[k]]
    assert {model.body(model.geom_bodyid[k]).name for k in solid} == {"c", "mug"}
    is_the_picture(next((tmp_path / "out" / "meshes").glob("*.png")).read_bytes(), tmp_path)


@pytest.mark.long
def test_usd_has_geometry_colours_and_pictures(scenes, tmp_path):
    pytest.importorskip("pxr")
    from pxr import Usd, UsdGeom, UsdShade

    path, _ = scenes.export(tmp_path / "out", "usd", meshes=tmp_path)
    stage = Usd.Stage.Open(str(path))
    parts = [one for one in stage.GetPrimAtPath("/Scene/c/visuals").GetChildren() if one.IsA(UsdGeom.Mesh)]
    assert len(parts) == 2
    found = {}
    for part in parts:
        surface = UsdShade.MaterialBindingAPI(part).ComputeBoundMaterial()[0].ComputeSurfaceSource()[0]
        color = surface.GetInput("diffuseColor")
        found[bool(color.HasConnectedSource())] = part, color
    (textured, color), (_, plain) = found[True], found[False]
    assert tuple(plain.Get()) == pytest.approx((0.2, 0.4, 0.6), abs=1e-3)
    picture = UsdShade.Shader(color.GetConnectedSource()[0].GetPrim())
    assert picture.GetIdAttr().Get() == "UsdUVTexture"
    assert tuple(picture.GetInput("scale").Get())[:3] == pytest.approx((0.5, 1.0, 1.0), abs=1e-3)
    is_the_picture(Path(picture.GetInput("file").Get().resolvedPath).read_bytes(), tmp_path)
    mesh = UsdGeom.Mesh(textured)
    flat = np.array(mesh.GetFaceVertexIndicesAttr().Get())
    points = np.array(mesh.GetPointsAttr().Get())[flat]
    places = np.array(UsdGeom.PrimvarsAPI(textured).GetPrimvar("st").ComputeFlattened())
    assert corners(points, places) == wanted(scenes, tmp_path)
    assert stage.GetPrimAtPath("/Scene/c/collisions").GetChildren()


def test_sdf_and_settling_read_no_pictures(scenes, tmp_path):
    (tmp_path / "skin.jpg").unlink()
    assert not own_bodies_of(scenes.file(), tmp_path)["c"].skins
    assert scenes.export(tmp_path / "out", "sdf", meshes=tmp_path)
