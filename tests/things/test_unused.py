"""What no triangle uses counts for nothing, and files are found where descriptions name them."""

import struct

import numpy as np
import pytest

import scenegen
from scenegen.errors import SpecError
from scenegen.geometry import Box
from scenegen.things.meshfile import mesh_surfaces
from scenegen.things.urdf import mesh_outline
from scenegen.worlds.own_body import mesh_body

CORNERS = [(x, y, z) for x in (-0.05, 0.05) for y in (-0.05, 0.05) for z in (0.0, 0.05)]
SIDES = [(1, 2, 4, 3), (5, 7, 8, 6), (1, 5, 6, 2), (3, 4, 8, 7), (1, 3, 7, 5), (2, 6, 8, 4)]


def obj(more="", sides=SIDES, corner="{}"):
    """A box of 10 by 10 by 5 cm, and what else the file says."""
    vertices = "".join(f"v {x} {y} {z}\n" for x, y, z in CORNERS)
    return (vertices + more + "".join(f"f {' '.join(corner.format(k) for k in side)}\n" for side in sides)).encode()


@pytest.mark.parametrize(
    "data",
    [
        obj("v 0 0 -0.2\n"),
        obj("v 5 5 5\n"),
        obj("v 5 5 5\n", corner="{}//{}".replace("{}//{}", "{0}//{0}")),
        obj("v 5 5 5\nv 6 6 6\n", [[k - 11 for k in side] for side in SIDES]),
        obj("v 5 5 5\nf 9 9 9\n"),  # a triangle without an area
        obj("v 5 5 5\nl 1 9\np 9\n"),
        obj("v 5 5 5\nf 1 2 \\\n 4 3\n"),
    ],
    ids=["below", "beyond", "slashes", "counted back", "no area", "lines and points", "a line that goes on"],
)
def test_vertices_without_a_face(data):
    footprint, height = mesh_outline("a.obj", data, None)
    assert footprint == Box(0.1, 0.1) and height == pytest.approx(0.05)
    points = np.concatenate([one.vertices for one in mesh_surfaces("a.obj", data, None)])
    np.testing.assert_allclose([points.min(axis=0), points.max(axis=0)], [CORNERS[0], CORNERS[-1]])
    (piece,) = mesh_body("a.obj", data, None).pieces
    assert piece.vertices[:, 2].min() == 0.0 and piece.volume == pytest.approx(0.0005)


def test_a_file_without_faces_is_its_points():
    assert mesh_outline("a.obj", obj(sides=[]), None)[0] == Box(0.1, 0.1)


@pytest.mark.parametrize("face", ["f 1 2", "f 1 2 99", "f 0 1 2", "f a b c", "f 1 2 -99"])
def test_faces_that_are_none_are_refused(face):
    with pytest.raises(Exception, match="line 9: "):
        mesh_outline("a.obj", obj(f"{face}\n"), None)


def test_triangles_of_an_stl_without_an_area():
    corners = np.array(CORNERS)
    faces = [[side[k] - 1 for k in three] for side in SIDES for three in ((0, 1, 2), (0, 2, 3))]
    rows = b"".join(struct.pack("<12fH", 0, 0, 0, *corners[face].ravel(), 0) for face in faces)
    rows += struct.pack("<12fH", 0, 0, 0, *[9.0] * 9, 0)
    data = bytes(80) + struct.pack("<I", len(faces) + 1) + rows
    footprint, height = mesh_outline("A.STL", data, None)
    assert footprint.extent == pytest.approx((0.1, 0.1)) and height == pytest.approx(0.05)


URDF = '<robot name="r"><link name="a"><collision><geometry><mesh filename="{}"/></geometry></collision></link></robot>'
USUAL = "package://pkg/meshes/tray.obj"


@pytest.mark.parametrize(
    ("robot", "mesh", "name"),
    [
        ("pkg/urdf/tray.urdf", "pkg/meshes/tray.obj", USUAL),  # the usual layout of ROS
        ("pkg/urdf/deep/tray.urdf", "pkg/meshes/tray.obj", "package://pkg//meshes//tray.obj"),
        ("pkg/urdf/tray.urdf", "pkg/meshes/tray.obj", "model://pkg/meshes/tray.obj"),
        ("pkg/urdf/tray.urdf", "pkg/meshes/tray.obj", "package://pkg\\meshes\\tray.obj"),
        ("pkg/urdf/tray.urdf", "pkg/meshes/tray.obj", "..\\meshes\\tray.obj"),
        ("pkg/tray.urdf", "pkg/meshes/tray.obj", "meshes//tray.obj"),
        ("src/robot/tray.urdf", "src/pkg/meshes/tray.obj", USUAL),  # another package beside it
        ("any/urdf/tray.urdf", "any/meshes/tray.obj", USUAL),  # a folder with another name
        ("tray.urdf", "meshes/tray.obj", USUAL),
        ("pkg/urdf/TRAY.URDF", "pkg/meshes/TRAY.OBJ", "package://pkg/meshes/TRAY.OBJ"),
    ],
)
def test_files_of_packages_are_found(tmp_path, robot, mesh, name):
    for path, data in ((robot, URDF.format(name).encode()), (mesh, obj("mtllib a.mtl\nv 5 5 5\n")), ("a.spec", b"")):
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / path).write_bytes(data)
    (tmp_path / mesh).with_name("a.mtl").write_text("newmtl red\nKd 1 0 0\n")
    (tmp_path / "a.spec").write_text(f'object tray = urdf("{robot}"), mug\ntask: leftOf(tray, mug)\n')
    spec = scenegen.load(tmp_path / "a.spec")
    assert spec.checked.shapes[0].footprint == Box(0.1, 0.1) and not spec.warnings
    scenes = scenegen.sample(spec, {"task": (0.0, None)}, n=1)
    scenes.export(tmp_path / "out", to="mjcf", meshes=tmp_path)


def test_the_package_of_that_name_comes_first(tmp_path):
    for folder, size in (("pkg/meshes", 1), ("pkg/urdf/meshes", 2), ("meshes", 3)):
        (tmp_path / folder).mkdir(parents=True)
        text = obj().decode().replace("0.05", f"0.0{size}")
        (tmp_path / folder / "tray.obj").write_text(text)
    (tmp_path / "pkg/urdf/tray.urdf").write_text(URDF.format(USUAL))
    (tmp_path / "a.spec").write_text('object tray = urdf("pkg/urdf/tray.urdf"), mug\ntask: leftOf(tray, mug)\n')
    assert scenegen.load(tmp_path / "a.spec").checked.shapes[0].footprint == Box(0.02, 0.02)


def test_packages_outside_of_the_folder_are_not_read(tmp_path):
    (tmp_path / "pkg/meshes").mkdir(parents=True)
    (tmp_path / "pkg/meshes/tray.obj").write_bytes(obj())
    (tmp_path / "pkg/urdf").mkdir()
    for name in (USUAL, "package://pkg/../meshes/tray.obj"):
        (tmp_path / "pkg/urdf/tray.urdf").write_text(URDF.format(name))
        (tmp_path / "pkg/urdf/a.spec").write_text('object tray = urdf("tray.urdf"), mug\ntask: leftOf(tray, mug)\n')
        with pytest.raises(SpecError):
            scenegen.load(tmp_path / "pkg/urdf/a.spec")


@pytest.mark.parametrize(
    ("move", "scale", "words"),
    [
        ((0, 0, 0), 1, None),
        ((0.04, 0, 0), 1, None),
        ((0, 0, 0), 100, "measures 10 m"),
        ((1, 2, 0.75), 1, "lies 1.95 m from its origin"),
        ((0, 0, 0.75), 1, None),
    ],
)
@pytest.mark.parametrize("kind", ["mesh", "urdf", "asset"])
def test_what_a_file_hardly_is_is_noted(tmp_path, move, scale, words, kind):
    points = "".join(f"v {' '.join(str(scale * c + m) for c, m in zip(p, move, strict=True))}\n" for p in CORNERS)
    (tmp_path / "tray.obj").write_text(points + obj().decode().partition("\nf ")[2].join(["f ", ""]))
    (tmp_path / "tray.urdf").write_text(URDF.format("tray.obj"))
    (tmp_path / "assets.toml").write_text('[[asset]]\nname = "tray"\nfile = "tray.obj"\n')
    name = {"mesh": "tray.obj", "urdf": "tray.urdf", "asset": "tray"}[kind]
    spec = scenegen.load(_spec(tmp_path, f'object tray[2] = {kind}("{name}"), mug'))
    assert [(one.code, one.severity) for one in spec.warnings] == ([("unlikely-shape", "note")] if words else [])
    assert all(words in one.title for one in spec.warnings)


def _spec(folder, objects):
    (folder / "a.spec").write_text(f"workspace [-20 m, 20 m] x [-20 m, 20 m]\n{objects}\ntask: x(mug) <= 0.5\n")
    return folder / "a.spec"


def test_texts_of_meshes_may_begin_with_a_byte_order_mark():
    facets = (
        "facet\n" + "".join("vertex {} {} {}\n".format(*CORNERS[side[k] - 1]) for k in (0, 1, 2)) + "endfacet\n"
        for side in SIDES
    )
    text = "solid a\n" + "".join(facets) + "endsolid a\n"
    for name, data in (("a.stl", text.encode()), ("a.obj", obj())):
        assert mesh_outline(name, b"\xef\xbb\xbf" + data, None)[0] == Box(0.1, 0.1)
