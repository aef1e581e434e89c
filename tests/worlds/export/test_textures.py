"""Objects from mesh files are drawn as their files show them: opened again, geometry, colours and pictures agree.
Pictures of glTF, GLB and .obj files, of URDF visuals and of assets: each object of a world has its own. Colours
that a spec gives to plain shapes: in scene files, in pictures, in simulators' files.
"""

import io
import json
import re
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import scenegen
from scenegen.errors import SpecError
from scenegen.looks.stage import stage_of
from scenegen.things.mesh import box
from scenegen.things.palette import parse_rgb
from scenegen.worlds.own_body import own_bodies_of
from tests.things.gltf_files import BODY, document, glb, png

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


BOX = "".join(f"v {a} {b} {c}\n" for a in (0, 0.1) for b in (0, 0.1) for c in (0, 0.05))
BOX += "vt 0 0\nvt 1 0\nvt 1 1\n"
SIDES = "1 2 4 3,5 7 8 6,1 5 6 2,3 4 8 7,1 3 7 5,2 6 8 4".split(",")
FACES = "".join(
    "f " + " ".join(f"{corner}/{k % 3 + 1}" for k, corner in enumerate(side.split())) + "\n" for side in SIDES
)
VISUAL = '<visual><geometry><mesh filename="package://p/{0}.obj"/></geometry>{1}</visual>'
SKIN = '<material name="m"><texture filename="package://p/robot skin.png"/></material>'
SOLID = '<collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision>'
ROBOT = f'<robot name="r"><link name="a">{{}}{SOLID}</link></robot>'
SPEC = """object a = mesh("a.glb"), b = mesh("b.gltf"), c = mesh("c.obj"), d = urdf("d.urdf"), e = asset("e"), mug
task: leftOf(a, mug)
"""


def picture(color: tuple[int, int, int]) -> bytes:
    made = io.BytesIO()
    image = Image.new("RGB", (8, 8), color)
    image.putpixel((1, 2), (255, 255, 255))
    image.save(made, "PNG")
    return made.getvalue()


PICTURES = {
    "a": png(),
    "b": picture((10, 20, 30)),
    "c": picture((40, 50, 60)),
    "d": picture((70, 80, 90)),
    "e": picture((100, 110, 120)),
}


@pytest.fixture
def scenes_files(tmp_path: Path) -> scenegen.SceneSet:
    inside = document(texture={"bufferView": 3, "mimeType": "image/png"})
    inside["bufferViews"].append({"buffer": 0, "byteOffset": len(BODY), "byteLength": len(PICTURES["a"])})
    body = BODY + PICTURES["a"]
    inside["buffers"] = [{"byteLength": len(body)}]
    (tmp_path / "a.glb").write_bytes(glb(inside, body + b"\0" * (-len(body) % 4)))
    apart = document(texture={"uri": "skin%20one.png"}, buffers=[{"uri": "b.bin", "byteLength": len(BODY)}])
    (tmp_path / "b.gltf").write_text(json.dumps(apart))
    (tmp_path / "b.bin").write_bytes(BODY)
    (tmp_path / "skin one.png").write_bytes(PICTURES["b"])
    for name, file in (("c", "c.png"), ("e", "e.png")):
        (tmp_path / f"{name}.obj").write_text(f"mtllib {name}.mtl\n{BOX}usemtl s\n{FACES}")
        (tmp_path / f"{name}.mtl").write_text(f"newmtl s\nKd 1 1 1\nmap_Kd {file}\n")
        (tmp_path / file).write_bytes(PICTURES[name])
    (tmp_path / "look.obj").write_text(BOX + FACES)
    (tmp_path / "d.urdf").write_text(ROBOT.format(VISUAL.format("look", SKIN)))
    (tmp_path / "robot skin.png").write_bytes(PICTURES["d"])
    (tmp_path / "e.urdf").write_text(ROBOT.format(VISUAL.format("e", "")))
    (tmp_path / "assets.toml").write_text('[[asset]]\nname = "e"\nfile = "e.urdf"\nscale = 0.5\n')
    (tmp_path / "s.spec").write_text(SPEC)
    return scenegen.sample(scenegen.load(tmp_path / "s.spec"), {"task": (0.1, None)}, n=2, seed=3)


def same(first: bytes, second: bytes) -> bool:
    with Image.open(io.BytesIO(first)) as one, Image.open(io.BytesIO(second)) as other:
        return np.array_equal(np.asarray(one.convert("RGB")), np.asarray(other.convert("RGB")))


@pytest.mark.long
def test_mujoco_loads_each_object_with_its_picture(scenes_files, tmp_path):
    mujoco = pytest.importorskip("mujoco")
    for path in scenes_files.export(tmp_path / "out", "mjcf", meshes=tmp_path):
        model = mujoco.MjModel.from_xml_path(str(path))
        root = ET.parse(path).getroot()
        named = [one for one in root.iter("texture") if "file" in one.attrib]
        files = {one.attrib["name"]: path.parent / one.attrib["file"] for one in named}
        found = {}
        for geom in range(model.ngeom):
            if model.geom_matid[geom] < 0 or (texture := max(model.mat_texid[model.geom_matid[geom]])) < 0:
                continue
            name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_TEXTURE, texture)
            if name in files:
                found[model.body(model.geom_bodyid[geom]).name] = files[name]
        assert sorted(found) == sorted(PICTURES)
        assert all(same(found[name].read_bytes(), data) for name, data in PICTURES.items())
    made = {one.name for one in (tmp_path / "out").rglob("*.png")}
    assert made == {one.name for one in files.values()} and len(made) == len(PICTURES), "no picture that nothing names"


@pytest.mark.long
def test_usd_finds_each_picture(scenes_files, tmp_path):
    pytest.importorskip("pxr")
    from pxr import Usd, UsdShade

    for path in scenes_files.export(tmp_path / "out", "usd", meshes=tmp_path):
        stage = Usd.Stage.Open(str(path))
        for name, data in PICTURES.items():
            pictures = set()
            for part in stage.GetPrimAtPath(f"/Scene/{name}/visuals").GetChildren():
                material = UsdShade.MaterialBindingAPI(part).ComputeBoundMaterial()[0]
                color = material.ComputeSurfaceSource()[0].GetInput("diffuseColor")
                if color.HasConnectedSource():
                    shader = UsdShade.Shader(color.GetConnectedSource()[0].GetPrim())
                    file = Path(shader.GetInput("file").Get().resolvedPath)
                    assert file.is_relative_to(tmp_path / "out")
                    pictures.add(file)
            assert len(pictures) == 1, name
            assert same(pictures.pop().read_bytes(), data), name


@pytest.mark.parametrize(
    ("file", "said"),
    [("skin one.png", "texture 0 in it"), ("c.png", r"c.mtl:3: c\.png|c\.png"), ("robot skin.png", "skin")],
)
def test_a_damaged_picture_is_named_and_nothing_else_is_blamed(file, said, scenes_files, tmp_path):
    whole = (tmp_path / file).read_bytes()
    for damaged in (whole[: len(whole) - 20], whole[:-30] + bytes([whole[-30] ^ 1]) + whole[-29:]):
        (tmp_path / file).write_bytes(damaged)
        with pytest.raises(scenegen.errors.DataError, match=f"({said}).*is damaged or cut short"):
            scenes_files.export(tmp_path / "out", "mjcf", meshes=tmp_path)
    assert not (tmp_path / "out").exists()


TEXT = (
    'object sponge = box(10 cm, 6 cm, 4 cm, color = "#ffdd33"), cup[2] = cylinder(3 cm, 8 cm, color = "red"),\n'
    '    wedge = prism([(0, 0), (20 cm, 0), (0, 12 cm)], 3 cm, color = "Navy"), other = box(10 cm, 6 cm, 4 cm)\n'
    "task: leftOf(sponge, other)\n"
)
COLORS = {"sponge": "#ffdd33", "cup[1]": "#ff0000", "cup[2]": "#ff0000", "wedge": "#000080"}


@pytest.fixture(scope="module")
def scenes_colors():
    return scenegen.sample(scenegen.parse(TEXT), n=2, seed=0)


def test_in_scene_files_and_pictures(scenes_colors, tmp_path):
    """They survive a file, and no other object has such a field."""
    for name in ("s.json", "s.jsonl"):
        scenes_colors.save(tmp_path / name)
        read = scenegen.read_scenes(tmp_path / name)
        assert {one.name: one.shape.color for one in read.header.objects if one.shape.color} == COLORS
        things = dict(zip(read.objects, stage_of(read.file()).things, strict=True))
        assert {name: things[name].color for name in COLORS} == {name: parse_rgb(one) for name, one in COLORS.items()}
    written = json.loads((tmp_path / "s.json").read_text())["objects"]
    assert [one["name"] for one in written if "color" not in one["shape"]] == ["other"]


@pytest.mark.parametrize(("to", "ending"), [("mjcf", "xml"), ("sdf", "sdf")])
def test_in_simulators(scenes_colors, tmp_path, to, ending):
    scenes_colors.export(tmp_path, to)
    text = (tmp_path / f"scene_0001.{ending}").read_text()
    found = {
        tuple(round(float(one), 3) for one in numbers.split()[:3])
        for numbers in re.findall(r"[\d.]+ [\d.]+ [\d.]+ 1\b", text)
    }
    for color in COLORS.values():
        assert tuple(round(one, 3) for one in parse_rgb(color)) in found


def test_the_text_keeps_them(scenes_colors):
    spec = scenegen.parse(TEXT)
    assert scenegen.parse(spec.source).definition.shapes == spec.definition.shapes
    assert spec.definition.shapes[0].color == "#ffdd33" and spec.definition.shapes[-1].color == ""


@pytest.mark.parametrize(
    ("shape", "code"),
    [
        ('box(1 cm, 1 cm, 1 cm, color = "redd")', "unknown-choice"),
        ('cylinder(1 cm, 1 cm, color = "#12")', "unknown-choice"),
        ('cylinder(1 cm, 1 cm, color = "hsl(0, 100%, 50%)")', "unknown-choice"),
        ("box(1 cm, 1 cm, 1 cm, color = red)", "file-without-quotes"),
        ("box(1 cm, 1 cm, 1 cm, 3)", "file-without-quotes"),
        ('box(1 cm, 1 cm, 1 cm, colour = "red")', "unknown-parameter"),
        ('mesh("x.obj", box(1 cm, 1 cm, 1 cm, color = "red"))', "not-a-shape"),
    ],
)
def test_what_is_no_colour(shape, code):
    with pytest.raises(SpecError) as caught:
        scenegen.parse(f"object a = {shape}, b\ntask: leftOf(a, b)")
    assert caught.value.diagnostics[0].code == code
