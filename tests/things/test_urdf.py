"""Outlines of URDF files: hand-worked ones, and an independent oracle. URDF files that are of no use are refused with
the reason, and damaged ones are read or refused.
"""

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
from scenegen.things.outline import MAX_OUTLINE_CORNERS, MeshError, simplify
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
        assert len(footprint.vertices) <= MAX_OUTLINE_CORNERS and is_convex(footprint.vertices)


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
    assert len(footprint.vertices) == MAX_OUTLINE_CORNERS
    assert ours.buffer(1e-6).contains(truth)
    assert ours.area < 1.01 * truth.area


@pytest.mark.parametrize("seed", range(30))
def test_fewer_corners_hold_more(seed):
    source = np.random.default_rng(seed)
    turn = np.sort(source.uniform(0.0, math.tau, 200))
    before = convex_hull([(math.cos(t) * 0.3, math.sin(t) * (0.01 + 0.3 * source.random())) for t in turn]).vertices
    after = simplify(before, 8)
    assert len(after) <= 8 and is_convex(after)
    assert shapely.Polygon(after).buffer(1e-6).contains(shapely.Polygon(before))
    same = shapely.Polygon(simplify(before, 1000))  # without corners that do not stand out
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


LINK = '<link name="a"><collision><geometry><box size="1 1 1"/></geometry></collision></link>'


def solid(text):
    return f'<robot>\n<link name="a"><collision>{text}</collision></link></robot>'


def mesh(name="m.obj", scale="1 1 1"):
    return solid(f'<geometry><mesh filename="{name}" scale="{scale}"/></geometry>')


def joint(parent, child, name="j"):
    return f'<joint name="{name}" type="fixed"><parent link="{parent}"/><child link="{child}"/></joint>'


BAD = {
    "empty": ("", "not well-formed XML at line 1: no element found"),
    "cut short": ("<robot>\n<link", "not well-formed XML at line 2"),
    "no XML": ("solid thing", "not well-formed XML at line 1"),
    "encoding": ('<?xml version="1.0" encoding="klingon"?><robot/>', "not well-formed"),
    "entities": ('<!DOCTYPE r [<!ENTITY a "aaaa">]><robot>&a;</robot>', "document type"),
    "xacro": ('<robot><xacro:include filename="a"/></robot>', "xacro file"),
    "another format": ("<sdf/>", "outermost element is <sdf>"),
    "deep": ("<robot>" + "<a>" * 60 + "</a>" * 60 + "</robot>", "nested more than"),
    "long": ("<robot>" + "<a/>" * 20_001 + "</robot>", "more than 20,000 elements"),
    "no link": ("<robot/>", "has no link"),
    "no shape": ('<robot><link name="a"/></robot>', "no link of it has a shape"),
    "no geometry": (solid(""), "line 2, <collision>: there is no <geometry>"),
    "empty geometry": (solid("<geometry/>"), "here is nothing"),
    "capsule": (solid("<geometry><capsule/></geometry>"), "box, cylinder, sphere or mesh; here is <capsule>"),
    "two": (solid("<geometry><box/><box/></geometry>"), "here is <box> and <box>"),
    "no size": (solid("<geometry><box/></geometry>"), "<box>: it has no size"),
    "a word": (solid('<geometry><box size="1 1 wide"/></geometry>'), 'size="1 1 wide" is not 3 numbers'),
    "two numbers": (solid('<geometry><box size="1 1"/></geometry>'), "is not 3 numbers"),
    "underscore": (solid('<geometry><box size="1 1 1_0"/></geometry>'), "is not 3 numbers"),
    "nan": (solid('<geometry><sphere radius="nan"/></geometry>'), "beyond all measure"),
    "infinite": (solid('<origin xyz="0 inf 0"/><geometry><sphere radius="1"/></geometry>'), "beyond all measure"),
    "negative": (solid('<geometry><sphere radius="-1"/></geometry>'), "is negative"),
    "flat": (solid('<geometry><box size="1 1 0"/></geometry>'), "no height"),
    "a line": (solid('<geometry><box size="1 0 1"/></geometry>'), "no area"),
    "a needle": (solid('<geometry><cylinder radius="0" length="1"/></geometry>'), "no area"),
    "a point": (solid('<geometry><sphere radius="0"/></geometry>'), "no area"),
    "millimetres": (
        solid('<geometry><box size="2000 80 90"/></geometry>'),
        'would measure 2,000 m; if its numbers are millimetres, write scale="0.001 0.001 0.001"',
    ),
    "two links of a name": (f"<robot>{LINK}{LINK}</robot>", "a second link `a`"),
    "two roots": (f'<robot>{LINK}<link name="b"/></robot>', "no joint moves `a` and none `b`"),
    "no such link": (f"<robot>{LINK}{joint('a', 'b')}</robot>", "there is no link `b`"),
    "a circle": (f'<robot>{LINK}<link name="b"/>{joint("a", "b")}{joint("b", "a")}</robot>', "in a circle through"),
    "its own parent": (f"<robot>{LINK}{joint('a', 'a')}</robot>", "in a circle through link `a`"),
    "two parents": (f'<robot>{LINK}<link name="b"/>{joint("a", "b")}{joint("a", "b", "k")}</robot>', "two parents"),
    "a circle aside": (
        f'<robot>{LINK}<link name="b"/><link name="c"/>{joint("b", "c")}{joint("c", "b")}</robot>',
        "in a circle through link `b`",
    ),
    "a joint without a child": (f'<robot>{LINK}<joint><parent link="a"/></joint></robot>', "there is no <child>"),
    "collada": (mesh("m.dae"), "mesh m.dae: only .obj and .stl meshes are read in a URDF file"),
    "no ending": (mesh("m"), "mesh m: only .obj and .stl meshes"),
    "no such file": (mesh(""), "it has no filename"),
    "obj without vertices": (mesh("empty.obj"), "it has no vertices"),
    "obj with a word": (mesh("word.obj"), "not three numbers"),
    "obj with an underscore": (mesh("underscore.obj"), "not three numbers"),
    "obj with nan": (mesh("nan.obj"), "no number"),
    "stl cut": (mesh("cut.stl"), "cut short"),
    "stl tiny": (mesh("word.stl"), "no STL file"),
    "no scale": (mesh(scale="0 0 0"), "no area"),
}
MESHES = {
    "m": OBJ,
    "empty": b"# nothing\n",
    "word": b"v 1 2 x\n",
    "nan": b"v 1 2 nan\n",
    "underscore": b"v 1_0 0 0\nv 0 0 0\nv 0 1 1\n",
    "cut": b"\0" * 80 + b"\xff\0\0\0" + b"0" * 99,
}


@pytest.mark.parametrize("name", BAD)
def test_what_is_of_no_use_is_refused_with_the_reason(name):
    text, words = BAD[name]
    with pytest.raises(MeshError) as caught:
        outline(text.encode(), lambda name: MESHES[name.partition(".")[0]])
    assert words in str(caught.value)


def test_damaged_files_are_read_or_refused():
    """Bytes changed at random, in the URDF and in its meshes: nothing but MeshError comes."""
    source = random.Random(7)
    tray, bookend = ((HERE / name).read_bytes() for name in ("tray.urdf", "bookend.urdf"))
    bookend_stl = bookend.replace(b".obj", b".stl")
    words = [
        b"-1",
        b"1e999",
        b"nan",
        b"<",
        b">",
        b'"',
        b"0",
        b"\xff",
        b"<link/>",
        b"<collision/>",
        b"1e-300",
        b"900000",
    ]

    def damaged(data):
        data = bytearray(data)
        for _ in range(source.randint(1, 4)):
            at = source.randrange(len(data))
            match source.randrange(3):
                case 0:
                    data[at] = source.randrange(256)
                case 1:
                    del data[at : at + source.randint(1, 60)]
                case 2:
                    data[at : at + source.randint(0, 4)] = source.choice(words)
        return bytes(data)

    meshes = [OBJ, stl_text(), stl(b"")]
    read = refused = 0
    for k in range(1500):
        urdf = (tray, bookend, bookend_stl)[k % 3]
        try:
            footprint, height = outline(damaged(urdf) if k % 2 else urdf, lambda name: damaged(source.choice(meshes)))
        except MeshError as error:
            assert str(error) and "\n" not in str(error)
            refused += 1
        else:
            assert 0.0 < height <= 1000.0 and min(footprint.extent) > 0.0
            if isinstance(footprint, Polygon):
                assert is_convex(footprint.vertices)
            read += 1
    assert read > 200 and refused > 200


def test_a_spec_whose_urdf_is_of_no_use_says_where(tmp_path):
    (tmp_path / "a.urdf").write_text(mesh("gone.obj"))
    (tmp_path / "b.urdf").write_text("<robot>")
    for name, words in (
        ("a", "cannot read gone.obj"),
        ("b", "b.urdf cannot be used: it is not well-formed XML at line 1"),
    ):
        text = f'object thing = urdf("{name}.urdf")\ntask: x(thing) >= 0.5'
        with pytest.raises(SpecError, match=words) as caught:
            check_file(tmp_path / "s.spec", text.encode())
        assert caught.value.diagnostics[0].span.text == f'"{name}.urdf"'
