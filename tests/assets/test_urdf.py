"""Outlines of URDF files: hand-worked ones, and an independent oracle."""

import math
import random

import numpy as np
import pytest
import shapely
from scipy.spatial.transform import Rotation

from scenegen.errors import SpecError
from scenegen.geometry import Box, Circle, Polygon
from scenegen.geometry.footprint import convex_hull, is_convex
from scenegen.lang.checker import check_file, check_text
from scenegen.things.meshfile import vertices
from scenegen.things.outline import CORNERS, simplified
from scenegen.things.urdf import outline

from .urdf_files import HERE, OBJ, box, close, cylinder, no_mesh, robot, stl, stl_text


def test_the_tray_worked_by_hand():
    """The board is 30 x 20 cm; lying grips of 10 cm reach 8 mm beyond a centre line that is 1 cm outside of it."""
    footprint, height = outline((HERE / "tray.urdf").read_bytes(), no_mesh)
    near = [(-0.168, -0.05), (-0.15, -0.1), (0.15, -0.1), (0.168, -0.05)]
    close(footprint, [*near, *((-x, -y) for x, y in near)])
    assert height == pytest.approx(0.040, abs=1e-6)


def test_the_bookend_worked_by_hand():
    """Turned by a quarter about its corner: (x, y) -> (-y, x)."""
    footprint, height = outline((HERE / "bookend.urdf").read_bytes(), {"package://props/bookend.obj": OBJ}.__getitem__)
    close(footprint, [(-0.08, 0.06), (-0.002, 0.0), (0.0, 0.0), (0.0, 0.12), (-0.002, 0.12)])
    assert height == pytest.approx(0.150)


@pytest.mark.parametrize(
    ("shapes", "footprint", "height"),
    [
        ([(cylinder(0.04, 0.1), "")], Circle(0.04), 0.1),
        ([(cylinder(0.04, 0.1), 'rpy="3.14159265 0 0.3" xyz="0 0 7"')], Circle(0.04), 0.1),
        ([(cylinder(0.04, 0.1), ""), (box(0.05, 0.05, 0.2), "")], Circle(0.04), 0.2),
        ([('<sphere radius="0.03"/>', 'xyz="0 0 0.5"')], Circle(0.03), 0.06),
        ([(box(0.3, 0.2, 0.04), "")], Box(0.3, 0.2), 0.04),
        ([(box(0.3, 0.2, 0.04), 'rpy="0 0 1.5708"')], Box(0.2, 0.3), 0.04),
        ([(box(0.3, 0.2, 0.04), 'rpy="0 1.570796327 0"')], Box(0.04, 0.2), 0.3),
        ([(box(0.1, 0.2, 0.1), 'xyz="-0.05 0 0"'), (box(0.1, 0.2, 0.1), 'xyz="0.05 0 0.1"')], Box(0.2, 0.2), 0.2),
        ([(box(0.2, 0.2, 0.1), ""), ('<sphere radius="0.1"/>', "")], Box(0.2, 0.2), 0.2),
    ],
)
def test_circles_and_boxes_are_found(shapes, footprint, height):
    found, tall = robot(*shapes)
    assert type(found) is type(footprint)
    assert found.extent == pytest.approx(footprint.extent, rel=3e-5)
    assert tall == pytest.approx(height, rel=3e-5)


@pytest.mark.parametrize(
    "shapes",
    [
        [(cylinder(0.04, 0.1), 'xyz="0.001 0 0"')],
        [(cylinder(0.04, 0.1), 'rpy="0.01 0 0"')],
        [(box(0.3, 0.2, 0.1), 'xyz="0 0.001 0"')],
        [(box(0.3, 0.2, 0.1), 'rpy="0 0 1.57"')],
        [(cylinder(0.04, 0.1), ""), (box(0.06, 0.06, 0.1), "")],
    ],
)
def test_what_is_nearly_a_circle_or_a_box_is_a_polygon(shapes):
    assert isinstance(robot(*shapes)[0], Polygon)


def sampled(kind, sizes, source):
    """Points on a solid, dense enough that their hull is the solid but for a per cent."""
    if kind == "box":
        return np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * np.array(sizes) / 2.0
    turn = np.linspace(0.0, math.tau, 720)
    if kind == "cylinder":
        rim = np.column_stack([sizes[0] * np.cos(turn), sizes[0] * np.sin(turn), np.full(720, sizes[1] / 2.0)])
        return np.concatenate([rim, rim * (1, 1, -1)])
    points = source.normal(size=(20_000, 3))
    return sizes[0] * points / np.linalg.norm(points, axis=1, keepdims=True)


@pytest.mark.long
@pytest.mark.parametrize("seed", range(40))
def test_random_chains_against_scipy_and_shapely(seed):
    """Two to five links in a random tree, all kinds of solids in random poses."""
    source = np.random.default_rng(seed)
    count = int(source.integers(1, 6))
    pose = [(np.eye(3), np.zeros(3))]
    texts, clouds = [], []

    def place():
        rpy, xyz = source.uniform(-3.2, 3.2, 3), source.uniform(-0.3, 0.3, 3)
        words = f'<origin rpy="{" ".join(map(repr, rpy.tolist()))}" xyz="{" ".join(map(repr, xyz.tolist()))}"/>'
        return Rotation.from_euler("xyz", rpy).as_matrix(), xyz, words

    for link in range(count):
        if link:
            parent = int(source.integers(0, link))
            turn, at, words = place()
            pose.append((pose[parent][0] @ turn, pose[parent][0] @ at + pose[parent][1]))
            texts.append(f'<joint name="j{link}"><parent link="l{parent}"/><child link="l{link}"/>{words}</joint>')
        turn, at, words = place()
        kind = ("box", "cylinder", "sphere")[int(source.integers(0, 3))]
        sizes = source.uniform(0.02, 0.3, 3).tolist()
        solid = {
            "box": box(*sizes),
            "cylinder": cylinder(*sizes[:2]),
            "sphere": f'<sphere radius="{sizes[0]!r}"/>',
        }[kind]
        tag = ("visual", "collision")[int(source.integers(0, 2))]
        texts.append(f'<link name="l{link}"><{tag}>{words}<geometry>{solid}</geometry></{tag}></link>')
        local = sampled(kind, sizes, source) @ turn.T + at
        clouds.append(local @ pose[link][0].T + pose[link][1])
    cloud = np.concatenate(clouds)
    random.Random(seed).shuffle(texts)  # the order of elements has no meaning

    footprint, height = outline(f"<robot>{''.join(texts)}</robot>".encode(), no_mesh)
    truth = shapely.MultiPoint(cloud[:, :2]).convex_hull
    ours = shapely.Point(0, 0).buffer(footprint.radius, 256) if isinstance(footprint, Circle) else None
    ours = ours or shapely.Polygon(footprint.vertices)
    assert ours.buffer(1e-5).contains(truth)
    assert ours.area < 1.02 * truth.area
    assert height == pytest.approx(np.ptp(cloud[:, 2]), rel=0.005)
    if isinstance(footprint, Polygon):
        assert len(footprint.vertices) <= CORNERS and is_convex(footprint.vertices)


@pytest.mark.parametrize(
    "data", [stl(b""), stl(b"solid work of binary"), stl_text(), stl_text().replace(b"\n", b"\r\n")]
)
def test_stl_files_say_what_the_obj_file_says(data):
    scaled = 'scale="0.001 0.001 0.001"'
    a = robot((f'<mesh filename="m.STL" {scaled}/>', ""), m=data)
    b = robot((f'<mesh filename="m.obj" {scaled}/>', ""), m=OBJ)
    assert a[1] == b[1] == pytest.approx(0.150)
    assert np.allclose(sorted(a[0].vertices), sorted(b[0].vertices), atol=1e-8)


def test_a_mesh_can_be_stretched_and_mirrored():
    footprint, height = robot(('<mesh filename="m.obj" scale="0.001 -0.002 0.001"/>', ""), m=OBJ)
    assert footprint.extent == pytest.approx((0.12, 0.16))
    assert min(y for _, y in footprint.vertices) == pytest.approx(-0.16)
    assert height == pytest.approx(0.150)


def test_a_mesh_is_read_once():
    read = []

    def mesh(name):
        read.append(name)
        return OBJ

    shape = '<collision><geometry><mesh filename="m.obj" scale="1e-3 1e-3 1e-3"/></geometry></collision>'
    outline(f'<robot><link name="a">{shape * 5}</link></robot>'.encode(), mesh)
    assert read == ["m.obj"]


def test_a_fine_mesh_gets_few_corners_round_it():
    turn = np.linspace(0.0, math.tau, 5000)
    lines = "".join(f"v {0.2 * math.cos(t) + 0.01!r} {0.1 * math.sin(t)!r} {z}\n" for t in turn for z in (0, 0.1))
    footprint, _ = robot(('<mesh filename="m.obj"/>', ""), m=lines.encode())
    truth = shapely.Polygon(np.column_stack([0.2 * np.cos(turn) + 0.01, 0.1 * np.sin(turn)]))
    ours = shapely.Polygon(footprint.vertices)
    assert len(footprint.vertices) == CORNERS
    assert ours.buffer(1e-6).contains(truth)
    assert ours.area < 1.01 * truth.area


@pytest.mark.parametrize("seed", range(30))
def test_fewer_corners_hold_more(seed):
    source = np.random.default_rng(seed)
    turn = np.sort(source.uniform(0.0, math.tau, 200))
    before = convex_hull([(math.cos(t) * 0.3, math.sin(t) * (0.01 + 0.3 * source.random())) for t in turn]).vertices
    after = simplified(before, 8)
    assert len(after) <= 8 and is_convex(after)
    assert shapely.Polygon(after).buffer(1e-6).contains(shapely.Polygon(before))
    same = shapely.Polygon(simplified(before, 1000))  # without corners that do not stand out
    assert same.symmetric_difference(shapely.Polygon(before)).area < 2e-6


def test_a_spec_names_a_urdf_and_its_canonical_text_needs_no_file():
    spec = HERE.parent / "everything.spec"
    first = check_file(spec, spec.read_bytes())
    again = check_text(first.source, "elsewhere.spec")
    assert again.shapes == first.shapes
    looks = dict(zip(first.objects, first.shapes, strict=True))
    assert looks["server"].path == "urdf/tray.urdf"
    assert looks["server"].footprint == outline((HERE / "tray.urdf").read_bytes(), no_mesh)[0]


def test_habits_of_programs_that_write_obj_files():
    """A byte order mark hides no vertex; long lines may go on; colours and weights may stand behind coordinates."""
    plain = b"v 0.1 0 0\nv 0 0.1 0\nv 0 0 0.1\nv 0 0 0\n"
    for data in (b"\xef\xbb\xbf" + plain, plain.replace(b"0.1 0 0", b"0.1 \\\r\n 0 0 1 0.5 0.5 0.5")):
        assert vertices("a.obj", data).tolist() == vertices("a.obj", plain).tolist()
        assert len(vertices("a.obj", data)) == 4


def test_a_spec_names_a_mesh_and_its_canonical_text_needs_no_file(tmp_path):
    """The triangular foot of the bookend is its outline; the upright stands over one of its sides."""
    metres = "\n".join(
        " ".join(["v", *(str(float(word) / 1000) for word in line.split()[1:])]) if line.startswith("v ") else line
        for line in OBJ.decode().splitlines()
    )
    (tmp_path / "bookend.OBJ").write_text(metres)
    (tmp_path / "plate.stl").write_bytes(stl_text(0.001))
    text = 'object bookend = mesh("bookend.OBJ"), part[2] = mesh("plate.stl")\ntask: x(bookend) >= x(part[2])'
    spec = check_file(tmp_path / "s.spec", text.encode())
    bookend, part = spec.shapes[0], spec.shapes[2]
    close(bookend.footprint, [(0.0, 0.0), (0.12, 0.0), (0.12, 0.002), (0.06, 0.08), (0.0, 0.002)])
    assert (bookend.asset, bookend.height, bookend.path) == ("mesh", pytest.approx(0.15), "bookend.OBJ")
    assert (part.asset, part.height) == ("mesh", pytest.approx(0.15, abs=1e-6))
    again = check_text(spec.source, "elsewhere.spec")
    assert again.shapes == spec.shapes and 'mesh("bookend.OBJ", prism(' in spec.source
    for name, data, words in (
        ("x.ply", b"ply", ".ply files cannot be read here"),
        ("flat.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\n", "it has no height"),
        ("thin.obj", b"v 0 0 0\nv 1 0 0\nv 2 0 1\n", "it covers no area"),
        ("millimetres.stl", stl_text(), r"would measure 150 m; if its numbers are millimetres, .* scale = 0\.001"),
        (
            "huge.obj",
            b"v 0 0 0\nv 2000 0 0\nv 0 1 1\n",
            r"would measure 2,?000 m; if its numbers are millimetres, .* scale = 0\.001",
        ),
    ):
        (tmp_path / name).write_bytes(data)
        with pytest.raises(SpecError, match=words) as caught:
            check_file(tmp_path / "s.spec", f'object thing = mesh("{name}")\ntask: x(thing) >= 0.5'.encode())
        assert caught.value.diagnostics[0].span.text == f'"{name}"'
