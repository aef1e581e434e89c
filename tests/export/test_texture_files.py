"""Pictures of glTF, GLB and .obj files, of URDF visuals and of assets: each object of a world has its own."""

import io
import json
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import scenegen
from tests.assets.gltf_files import BODY, document, glb, png

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
def scenes(tmp_path: Path) -> scenegen.SceneSet:
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
def test_mujoco_loads_each_object_with_its_picture(scenes, tmp_path):
    mujoco = pytest.importorskip("mujoco")
    for path in scenes.export(tmp_path / "out", "mjcf", meshes=tmp_path):
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
def test_usd_finds_each_picture(scenes, tmp_path):
    pytest.importorskip("pxr")
    from pxr import Usd, UsdShade

    for path in scenes.export(tmp_path / "out", "usd", meshes=tmp_path):
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
def test_a_damaged_picture_is_named_and_nothing_else_is_blamed(file, said, scenes, tmp_path):
    whole = (tmp_path / file).read_bytes()
    for damaged in (whole[: len(whole) - 20], whole[:-30] + bytes([whole[-30] ^ 1]) + whole[-29:]):
        (tmp_path / file).write_bytes(damaged)
        with pytest.raises(scenegen.errors.DataError, match=f"({said}).*is damaged or cut short"):
            scenes.export(tmp_path / "out", "mjcf", meshes=tmp_path)
    assert not (tmp_path / "out").exists()
