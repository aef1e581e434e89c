"""Objects with glTF meshes are drawn as their files show them, or it is said why not."""

import json

import numpy as np
import pytest
from PIL import Image

import scenegen
from scenegen.errors import DataError
from scenegen.show.render.scenes import models_of, still_outlines

from ..assets.gltf_files import BODY, document, inline, png

TEXT = 'workspace [0, 1] x [0, 1]\nobject box = mesh("box.gltf") at (0.5, 0.5, EAST), plate\ntask: leftOf(plate, box)'


@pytest.fixture
def scenes(tmp_path):
    made = document(texture={"uri": "skin.png"}, buffers=[{"uri": inline(BODY), "byteLength": len(BODY)}])
    (tmp_path / "box.gltf").write_text(json.dumps(made))
    (tmp_path / "skin.png").write_bytes(png())
    (tmp_path / "s.spec").write_text(TEXT)
    return scenegen.sample(scenegen.load(tmp_path / "s.spec"), {"task": (0.2, None)}, n=1, seed=3)


def share(path, channel):
    """Of the pixels in which a colour is by far the strongest."""
    pixels = np.asarray(Image.open(path).convert("RGB")).astype(int)
    others = np.delete(pixels, channel, axis=2).max(axis=2)
    return float((pixels[..., channel] > others + 60).mean())


@pytest.mark.long
def test_textures_and_colours_are_those_of_the_file(scenes, tmp_path):
    given = {"views": ("front", "top"), "size": (160, 120), "workers": 1}
    plain = scenes.render(tmp_path / "plain", **given).pictures[0]
    drawn = scenes.render(tmp_path / "drawn", meshes=tmp_path, masks=True, **given)
    front, top = drawn.pictures
    # The front is the blue half of the texture; on top both halves meet.
    assert share(front, 2) > 0.01 and min(share(top, 1), share(top, 2)) > 0.002
    assert max(share(plain, 1), share(plain, 2)) < 0.0005
    (tmp_path / "box.gltf").write_text(json.dumps(document(buffers=[{"uri": inline(BODY), "byteLength": len(BODY)}])))
    red = scenes.render(tmp_path / "red", meshes=tmp_path, **given).pictures[0]
    assert share(red, 0) > 0.02 > share(drawn.pictures[0], 0)


def test_what_cannot_be_drawn_says_why(scenes, tmp_path):
    file = scenes.file()
    first, second = models_of(file, tmp_path)
    assert second is None and first[0].vertices[:, 2].min() == 0.0

    def refused(words, folder=tmp_path):
        with pytest.raises(DataError, match=words) as caught:
            models_of(file, folder)
        assert caught.value.diagnostics[0].code == "unusable-model"

    (tmp_path / "skin.png").rename(tmp_path / "other.png")
    refused("skin.png: no such file")
    (tmp_path / "sub").mkdir()
    refused("box.gltf: no such file", tmp_path / "sub")
    (tmp_path / "sub" / "box.gltf").symlink_to(tmp_path / "box.gltf")
    refused("outside the folder", tmp_path / "sub")
    nodes = [{"mesh": 0, "scale": [2, 2, 2]}]
    (tmp_path / "box.gltf").write_bytes(json.dumps(document(nodes=nodes)).encode())
    refused("has no data")
    made = document(nodes=nodes, buffers=[{"uri": inline(BODY), "byteLength": len(BODY)}])
    (tmp_path / "box.gltf").write_text(json.dumps(made))
    refused("its outline is not that of the scenes")


def test_scenes_without_a_gltf_mesh_have_nothing_to_draw(tmp_path):
    scenes = scenegen.sample(scenegen.parse("task: leftOf(mug, plate)"), {"task": (0.0, None)}, n=1, seed=1)
    with pytest.raises(DataError) as caught:
        scenes.render(tmp_path / "out", meshes=tmp_path)
    assert caught.value.diagnostics[0].code == "no-model"
    assert not (tmp_path / "out").exists()


def test_obj_stl_and_urdf_are_drawn_too(tmp_path):
    ring = "v 0 0 1\nv .2 0 1\nv .2 .2 1\nv 0 .2 1.1\n"
    (tmp_path / "a.obj").write_text(f"mtllib a.mtl\n{ring}usemtl red\nf 1 2 3 4\n")
    (tmp_path / "a.mtl").write_text("newmtl red\nKd 1 0 0\n")
    solid = '<geometry><box size=".1 .1 .1"/></geometry>'
    seen = '<geometry><mesh filename="package://props/a.obj"/></geometry>'
    text = f'<robot name="r"><link name="a"><visual>{seen}</visual><collision>{solid}</collision></link></robot>'
    (tmp_path / "r.urdf").write_text(text)
    (tmp_path / "s.spec").write_text(
        'object a = mesh("a.obj"), r = urdf("r.urdf"), b = mesh("c.dae", box(9 cm, 9 cm, 9 cm))\ntask: leftOf(a, r)'
    )
    scenes = scenegen.sample(scenegen.load(tmp_path / "s.spec"), {"task": (0.2, None)}, n=1, seed=3)
    mesh, robot, other = models_of(scenes.file(), tmp_path)
    assert other is None and still_outlines(scenes.file(), tmp_path) == ("b",)
    assert mesh[0].color == (1.0, 0.0, 0.0) and np.allclose(mesh[0].vertices[:, 2], (0, 0, 0, 0.1))
    assert np.allclose(robot[0].vertices[:, 2], (1.05, 1.05, 1.05, 1.15))  # the collision box stands on the table
    (tmp_path / "a.mtl").unlink()
    with pytest.raises(DataError, match=r"a.obj, the mesh of `a`, cannot be drawn: line 1: a.mtl: no such file"):
        models_of(scenes.file(), tmp_path)
    (tmp_path / "a.mtl").symlink_to("/etc/passwd")
    with pytest.raises(DataError, match=r"line 1: a.mtl is outside the folder"):
        models_of(scenes.file(), tmp_path)
    (tmp_path / "a.obj").write_text(f"mtllib \x1b[31mred\n{ring}f 1 2 3 4\n")
    with pytest.raises(DataError, match=r"line 1: \?\[31mred: no such file"):  # nothing that a terminal obeys
        models_of(scenes.file(), tmp_path)


def test_a_texture_that_ends_early_is_refused_before_anything_is_drawn(scenes, tmp_path):
    (tmp_path / "skin.png").write_bytes(png(64, 64)[:60])
    with pytest.raises(DataError, match="texture 0 in it is damaged or cut short"):
        models_of(scenes.file(), tmp_path)
