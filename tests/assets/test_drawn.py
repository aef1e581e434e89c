"""The surfaces of .obj, .stl and URDF files, and what is refused of damaged and hostile ones."""

import struct

import numpy as np
import pytest

from scenegen.things import colored_mesh, meshfile
from scenegen.things.meshfile import mesh_surfaces
from scenegen.things.outline import MeshError
from scenegen.things.urdf import robot_surfaces

from .gltf_files import png

MTL = b"newmtl skin\nKd 0.5 1 1\nmap_Kd -o 0.25 -s 2 2 2 skin 1.png\nnewmtl red\nKd 1 0 0\nd 0.5\n"
OBJ = b"""mtllib a.mtl
v 0 0 0
v 1 0 0 # a corner
v 1 1 0
v 0 1 1
vt 0 0.25
vt 1 0
vt 1 1
usemtl red
f 1 2 3 \\
  4
usemtl skin
f -4/1/1 -2/2 -1/3
usemtl None
f 1//1 2//1 4//1
"""


def obj(data=OBJ, **files):
    files = {"a.mtl": MTL, "skin 1.png": png()} | {name.replace("_", "."): text for name, text in files.items()}

    def read(name):
        if name not in files:
            raise MeshError(f"{name}: no such file")
        return files[name]

    return mesh_surfaces("a.obj", data, read)


def test_an_obj_has_a_surface_for_each_material():
    red, skin, plain = obj()
    assert red.color == (1.0, 0.0, 0.0) and not red.texture and red.uv is None
    assert red.faces.tolist() == [[0, 1, 2], [0, 2, 3]]  # a polygon, from its first corner, on two lines
    assert skin.color == (0.5, 1.0, 1.0) and skin.texture == png()
    assert skin.vertices.tolist() == [[0, 0, 0], [1, 1, 0], [0, 1, 1]]
    # Twice as often, a quarter to the right, and from the upper edge down.
    assert np.allclose(skin.uv, [(0.25, 0.5), (2.25, 1.0), (2.25, -1.0)])
    assert plain.color is None and plain.vertices.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 1]]


def test_an_obj_without_materials_has_the_color_of_its_object():
    (only,) = obj(b"v 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl anything\nf 1 2 3\n")
    assert only.color is None and only.uv is None


def test_materials_may_come_from_several_files_and_files_have_spaces():
    text = OBJ.replace(b"mtllib a.mtl", b"mtllib b.mtl c.mtl")
    first, second = MTL.split(b"newmtl red")
    assert len(obj(text, b_mtl=first, c_mtl=b"newmtl red" + second)) == 3
    assert len(obj(OBJ.replace(b"a.mtl", b"a b.mtl"), **{"a b_mtl": MTL})) == 3


REFUSED = {
    "a vertex past the last": (OBJ.replace(b"f 1 2 3 ", b"f 1 2 9 "), "line 10: a face names vertex 9 of 4"),
    "a place past the last": (OBJ.replace(b"-2/2", b"-2/7"), "line 13: a face names place in a texture 7 of 3"),
    "vertex 0": (OBJ.replace(b"f 1 2", b"f 0 2"), "line 10: `0` is not the number of a vertex"),
    "back past the first": (OBJ.replace(b"-4/1", b"-5/1"), "line 13: -5 counts back past the first of 4"),
    "an absurd number": (OBJ.replace(b"f 1 2", b"f " + b"9" * 5000), "line 10: `9{20}` is not the number"),
    "a number of Python's": (OBJ.replace(b"f 1 2", b"f 1_0 2"), "line 10: `1_0` is not"),
    "a word": (OBJ.replace(b"f 1 2", b"f one 2"), "line 10: `one` is not"),
    "two corners": (OBJ.replace(b"f 1 2 3 \\\n  4", b"f 1 2"), "line 10: a face has at least 3 corners"),
    "no face": (b"v 0 0 0\nv 1 0 0\n", "it has no faces"),
    "not a number": (OBJ.replace(b"v 1 1 0", b"v 1 nan 0"), "a coordinate in it is no number"),
    "a place that is none": (OBJ.replace(b"vt 1 0", b"vt inf 0"), "line 7: a number is none"),
    "a place in words": (OBJ.replace(b"vt 1 0", b"vt x"), "line 7: here must be numbers"),
    "no materials": (OBJ.replace(b"a.mtl", b"b.mtl"), "line 1: b.mtl: no such file"),
    "another material": (OBJ.replace(b"usemtl red", b"usemtl blue"), "line 9: material `blue` is not in a.mtl"),
    "no places": (OBJ.replace(b"-2/2", b"-2"), "line 13: a face has a texture, but no places in it"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_hostile_objs_are_refused(case):
    text, words = REFUSED[case]
    with pytest.raises(MeshError, match=words):
        obj(text)


@pytest.mark.parametrize(
    ("line", "words"),
    [
        (b"map_Kd missing.png", "a.mtl, line 3: missing.png: no such file"),
        (b"map_Kd -s 1 1", "a.mtl, line 3: 1: no such file"),
        (b"map_Kd", "a.mtl, line 3: a texture without a file"),
        (b"map_Kd -mm 0 1 skin 1.png", "a.mtl, line 3: the option -mm"),
        (b"map_Kd a.mtl", "a.mtl, line 3: a.mtl is neither PNG nor JPEG"),
        (b"Kd nan 0 0", "a.mtl, line 3: a number is none"),
        (b"Kd red", "a.mtl, line 3: here must be numbers"),
    ],
)
def test_hostile_materials_are_refused(line, words):
    with pytest.raises(MeshError, match=words):
        obj(a_mtl=MTL.replace(b"map_Kd -o 0.25 -s 2 2 2 skin 1.png", line))


def test_files_that_are_too_much_are_refused(monkeypatch):
    monkeypatch.setattr(colored_mesh, "MOST_PIXELS", 31)
    with pytest.raises(MeshError, match="more than 31 pixels"):
        obj()
    monkeypatch.setattr(colored_mesh, "MOST_TRIANGLES", 3)
    with pytest.raises(MeshError, match="more than 3 triangles"):
        obj()
    monkeypatch.setattr(meshfile, "MOST_MATERIALS", 1)
    with pytest.raises(MeshError, match="line 1: its files have more than 1 materials"):
        obj()
    monkeypatch.setattr(colored_mesh, "MOST_BYTES", 10)
    with pytest.raises(MeshError, match="its files are larger than 10 bytes"):
        obj()


def test_an_stl_is_one_surface():
    corners = np.arange(18, dtype="<f4").reshape(2, 3, 3)
    data = bytes(80) + struct.pack("<I", 2) + b"".join(bytes(12) + one.tobytes() + bytes(2) for one in corners)
    (only,) = mesh_surfaces("a.STL", data, None)
    assert np.array_equal(only.vertices[only.faces], corners) and only.color is None
    with pytest.raises(MeshError, match="fewer than three corners"):
        mesh_surfaces("a.stl", b"solid abc\nvertex 0 0 0\nvertex 0 1 0\n", None)


MESH = '<mesh filename="package://props/sub/a.obj" scale="1 -2 1"/>'


def robot(visual, rest="", link=""):
    text = f'<robot name="r"><link name="base">{visual}{link}</link>{rest}</robot>'
    files = {"sub/a.obj": OBJ, "sub/a.mtl": MTL, "sub/skin 1.png": png(), "skin.png": png()}

    def read(name):
        name = name.removeprefix("package://props/")  # which whoever reads files looks up
        if name not in files:
            raise MeshError(f"{name}: no such file")
        return files[name]

    return robot_surfaces(text.encode(), read)


def visual(geometry, material="", origin=""):
    return f"<visual>{origin}<geometry>{geometry}</geometry>{material}</visual>"


def test_visuals_have_their_places_scales_and_colors():
    turned = '<origin xyz="1 0 0" rpy="0 0 1.5707963267948966"/>'
    red = '<material name="red"><color rgba="1 0 0 1"/></material>'
    first = visual('<box size="0.2 0.4 0.6"/>', '<material name="red"/>', turned)
    second = visual(MESH, red)
    made = robot(first + second, rest=red, link='<collision><geometry><sphere radius="9"/></geometry></collision>')
    box, *mesh = made
    assert box.color == (1.0, 0.0, 0.0) and len(mesh) == 3
    assert np.allclose([box.vertices.min(0), box.vertices.max(0)], [(0.8, -0.1, -0.3), (1.2, 0.1, 0.3)])
    # The mesh's own colours count; what has none gets that of the shape. A mirrored mesh still faces outwards.
    assert [one.color for one in mesh] == [(1.0, 0.0, 0.0), (0.5, 1.0, 1.0), (1.0, 0.0, 0.0)]
    assert mesh[1].texture == png() and mesh[0].vertices[2].tolist() == [1.0, -2.0, 0.0]
    assert mesh[0].faces.tolist() == [[2, 1, 0], [3, 2, 0]]


BALL = '<sphere radius="0.5"/>'


def test_round_visuals_and_links_along_joints():
    ends = '<joint name="j" type="fixed"><parent link="base"/><child link="top"/><origin xyz="0 0 1"/></joint>'
    top = f'<link name="top">{visual(BALL)}</link>'
    rod, ball = robot(visual('<cylinder radius="0.1" length="2"/>'), rest=top + ends)
    assert rod.color is None
    assert np.allclose([rod.vertices.min(0), rod.vertices.max(0)], [(-0.1, -0.1, -1), (0.1, 0.1, 1)])
    assert np.allclose([ball.vertices.min(0), ball.vertices.max(0)], [(-0.5, -0.5, 0.5), (0.5, 0.5, 1.5)])


def test_without_a_visual_shape_the_collision_shapes_are_drawn():
    (only,) = robot("", link='<collision><geometry><box size="1 1 1"/></geometry></collision>')
    assert only.color is None


SKIN = '<material name="s"><texture filename="package://props/skin.png"/></material>'


def test_many_shapes_are_counted_together(monkeypatch):
    monkeypatch.setattr(colored_mesh, "MOST_TRIANGLES", 5000)
    with pytest.raises(MeshError, match="line 1, <sphere>: its meshes have more than 5,000 triangles"):
        robot(visual(BALL) * 6)
    with pytest.raises(MeshError, match="more than 5,000 triangles"):
        robot(visual(MESH) * 1300)


@pytest.mark.parametrize(
    ("shape", "words"),
    [
        (visual('<mesh filename="b.obj"/>'), "line 1, <mesh>: b.obj: no such file"),
        (visual('<mesh filename="b.glb"/>'), "line 1, <mesh>: mesh b.glb: only .obj and .stl"),
        (visual('<box size="1 1 nan"/>'), "beyond all measure"),
        (visual('<box size="1 1 1"/>', '<material name="gold"/>'), "line 1, <material>: there is no material `gold`"),
        (visual('<box size="1 1 1"/>', '<material><color rgba="1 0 0"/></material>'), "is not 4 numbers"),
        (visual('<box size="1 1 1"/>', SKIN), "line 1, <box>: it has a texture and no places in it"),
        (visual('<box size="1 1 1"/>', SKIN.replace("skin", "x")), "line 1, <texture>: x.png: no such file"),
        ("", "no link of it has a shape"),
    ],
)
def test_hostile_visuals_are_refused(shape, words):
    with pytest.raises(MeshError, match=words):
        robot(shape)


def test_thousands_of_parts_in_one_place_are_refused():
    once = b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 1\nf 1 2 3 4\n"
    assert obj(once + 100 * b"f 1 2 3 4\n")
    with pytest.raises(MeshError, match="more than 200 times the area of the box round them: leave out what is hidden"):
        obj(once + 2000 * b"f 1 2 3 4\n")
    boxes = "<visual><geometry><box size='1 1 1'/></geometry></visual>"
    robot = "<robot name='r'><link name='a'>{}</link></robot>"
    assert robot_surfaces(robot.format(10 * boxes).encode(), read=None)
    with pytest.raises(MeshError, match="leave out what is hidden"):
        robot_surfaces(robot.format(300 * boxes).encode(), read=None)
