"""Names pick assets, sizes hold, colours tell objects apart. Furniture: pieces that share no space, surfaces that are
free above, meshes as high as both. The surfaces of .obj, .stl and URDF files, and what is refused of damaged and
hostile ones. Meshes and colours of plain shapes: boxes, cylinders and prisms of any size.
"""

import itertools
import math
import struct

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from scenegen.geometry import Polygon
from scenegen.geometry.footprint import convex_hull
from scenegen.scenes.data import ShapeData, footprint_data, footprint_of
from scenegen.things import ASSETS, Box, Circle, Shape, asset_of, colored_mesh, has_picture, meshfile, shape_of, stem
from scenegen.things.bodies import collision_of, mass_of, parts_of, parts_of_asset
from scenegen.things.furniture import PITCH, Cabinet
from scenegen.things.library import cabinet_shape
from scenegen.things.meshfile import mesh_surfaces
from scenegen.things.outline import MeshError
from scenegen.things.palette import object_colors
from scenegen.things.surfaces import base_heights, fits, narrowest, overlapping, slabs_of, surfaces_of
from scenegen.things.urdf import robot_surfaces

from ..laws import examples
from .gltf_files import png


@pytest.mark.parametrize(
    ("name", "asset"),
    [
        ("mug", "mug"), ("block[3]", "block"), ("fork_2", "fork"), ("knife7", "knife"), ("Cracker_Box", "crackerbox"),
        ("gizmo", "block"), ("mugs", "block"), ("", "block"),
        ("box", "carton"), ("box[2]", "carton"), ("Cell_Phone_3", "phone"),
    ],
)  # fmt: skip
def test_a_name_picks_its_asset(name, asset):
    assert asset_of(name).name == asset


def test_the_stem_drops_numbers_only_at_the_end():
    assert [stem(name) for name in ("block[12]", "block_3", "a1b", "x")] == ["block", "block", "a1b", "x"]


@pytest.mark.parametrize("asset", ASSETS.values(), ids=lambda asset: asset.name)
def test_meshes_are_closed_and_stay_within_footprint_and_height(asset):
    parts = parts_of_asset(asset)
    assert len(parts) >= 2  # one colour alone is not recognisable
    vertices = np.concatenate([part.mesh.vertices for part in parts])
    assert np.isfinite(vertices).all()
    for part in parts:
        assert part.mesh.is_closed
        assert part.mesh.volume > 0.0  # triangles face outwards
        assert all(0.0 <= channel <= 1.0 for channel in part.color)
        assert len(part.mesh.faces) * 3 < 8192  # pybullet's limit for meshes in memory on some systems
    match asset.footprint:
        case Circle(radius):
            reach = np.hypot(vertices[:, 0], vertices[:, 1]) / radius
        case Box(length, width):
            reach = np.maximum(np.abs(vertices[:, 0]) * 2 / length, np.abs(vertices[:, 1]) * 2 / width)
    assert 0.97 < reach.max() < 1.0 + 1e-9
    assert abs(vertices[:, 2].min()) < 1e-12
    assert 0.97 * asset.height < vertices[:, 2].max() < asset.height + 1e-9


@pytest.mark.parametrize("asset", ASSETS.values(), ids=lambda asset: asset.name)
def test_every_asset_shows_its_heading(asset):
    """Turned by a half, an asset does not look the same."""

    def corners(vertices, sign):
        return {tuple(row) for row in (vertices * (sign, sign, 1)).round(5).tolist()}

    assert any(corners(part.mesh.vertices, 1) != corners(part.mesh.vertices, -1) for part in parts_of_asset(asset))


def test_shapes_are_what_scene_files_hold():
    for name in ("plate", "fork", "nobody knows"):
        shape = shape_of(name)
        data = ShapeData(asset=shape.asset, footprint=footprint_data(shape.footprint), height=shape.height)
        assert (data.asset, data.height) == (asset_of(name).name, asset_of(name).height)
        assert footprint_of(data.footprint) == asset_of(name).footprint


def test_the_main_color_can_be_chosen():
    for asset in ASSETS.values():
        own, other = parts_of_asset(asset), parts_of_asset(asset, (0.1, 0.8, 0.3))
        assert sum(a.color != b.color for a, b in zip(own, other, strict=True)) >= 1, asset.name
        assert [part.color for part in parts_of_asset(asset, asset.color)] == [part.color for part in own]


def test_an_unknown_name_keeps_its_color():
    alone = object_colors([("gizmo", "block")])
    assert alone == object_colors([("gizmo", "block"), ("mug", "mug")])[:1]
    assert alone != object_colors([("lamp", "block")])


@pytest.mark.parametrize(
    "objects",
    [
        [(f"block[{k}]", "block") for k in range(1, 8)],
        [(f"thing{k}", "block") for k in range(12)],
        [("fork", "fork"), ("fork_2", "fork"), ("fork_3", "fork")],
        [("block", "block"), ("gizmo", "block"), ("wrench", "block"), ("block2", "block")],
    ],
)
def test_objects_of_one_asset_can_be_told_apart(objects):
    for a, b in itertools.combinations(object_colors(objects, distinct=True), 2):
        assert np.abs(np.subtract(a, b)).max() > 0.08


def test_thirty_objects_of_one_asset_can_all_differ():
    for objects in ([(f"thing{k}", "block") for k in range(30)], [(f"mug{k}", "mug") for k in range(30)]):
        assert len(set(object_colors(objects, distinct=True))) == 30


@pytest.mark.parametrize(
    ("objects", "color"),
    [
        ([(f"block[{k}]", "block") for k in range(1, 8)], ASSETS["block"].color),
        ([(f"apple[{k}]", "apple") for k in range(1, 4)], ASSETS["apple"].color),
        ([("plate1", "plate"), ("plate2", "plate"), ("starter", "plate")], ASSETS["plate"].color),
        ([(f"gizmo[{k}]", "block") for k in range(1, 8)], None),
        ([(f"pawn[{k}]", "cylinder") for k in range(1, 5)], None),
    ],
)
def test_what_is_the_same_thing_looks_the_same(objects, color):
    """No blue apples, no purple plates."""
    (only,) = set(object_colors(objects))
    assert color is None or only == color


def test_blocks_and_shapes_with_names_of_their_own_differ():
    for names, asset in ((["block1", "block2", "block3", "lamp"], "block"), (["pawn[1]", "king", "rook"], "cylinder")):
        assert len(set(object_colors([(name, asset) for name in names]))) == len(names)


def test_which_names_have_a_picture():
    assert all(map(has_picture, [*ASSETS, "block[3]", "fork_2", "Plate7"]))
    assert not any(map(has_picture, ["lamp", "plates", ""]))


OPEN = [(0.0,), (0.02,), (0.4,), (1.0, 0.7, 0.3), (0.0, 0.9, 0.0), (0.1, 0.05, 0.9, 0.0), (1.0,) * 6]
SHAPES = [*map(cabinet_shape, OPEN), *map(shape_of, ("cabinet", "drawer", "rack"))]


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: f"{shape.asset}{shape.open}")
def test_pieces_share_no_space_and_fill_what_the_footprint_says(shape):
    slabs = slabs_of(shape)
    low = np.array([(*one.box[:2], one.low) for one in slabs])
    high = np.array([(*one.box[2:], one.high) for one in slabs])
    assert (high - low > 1e-9).all()
    for a, b in itertools.combinations(range(len(slabs)), 2):
        assert (np.minimum(high[a], high[b]) - np.maximum(low[a], low[b])).min() < 1e-9, (slabs[a], slabs[b])
    size = np.array([*shape.footprint.extent, shape.height])
    assert high.max(axis=0) == pytest.approx(size * (0.5, 0.5, 1.0))
    assert low.min(axis=0) == pytest.approx(size * (-0.5, -0.5, 0.0))
    assert len(collision_of(shape)) == len(slabs)


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: f"{shape.asset}{shape.open}")
def test_nothing_is_above_a_surface_and_something_below(shape):
    for surface in surfaces_of(shape):
        if surface.pull is not None and surface.pull.reach <= 0.0:
            continue
        xs, ys = zip(*surface.outline.vertices, strict=True)
        over = [
            one
            for one in slabs_of(shape)
            if min(one.box[2], max(xs)) - max(one.box[0], min(xs)) > 1e-9
            and min(one.box[3], max(ys)) - max(one.box[1], min(ys)) > 1e-9
        ]
        assert not [one for one in over if one.high > surface.height + 1e-9], surface
        assert any(abs(one.high - surface.height) < 1e-9 for one in over), surface


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: f"{shape.asset}{shape.open}")
def test_what_is_drawn_is_as_high_as_the_surfaces_to_the_micrometre(shape):
    """Closed meshes within footprint and height, with a flat part at the height of every surface, none above it."""
    parts = parts_of(shape, ASSETS[shape.asset].color)
    points = np.concatenate([part.mesh.vertices for part in parts])
    assert all(part.mesh.is_closed and part.mesh.volume > 0.0 for part in parts)
    limits = np.array(shape.footprint.extent) / 2.0
    assert (np.abs(points[:, :2]).max(axis=0) <= limits + 1e-9).all()
    assert points[:, 2].min() == pytest.approx(0.0, abs=1e-12) and points[:, 2].max() <= shape.height + 1e-9
    for surface in surfaces_of(shape):
        if surface.pull is None or surface.pull.reach > 0.0:
            xs, ys = zip(*surface.outline.vertices, strict=True)
            middle = np.array([(min(xs) + max(xs)) / 2.0, (min(ys) + max(ys)) / 2.0])
            assert drawn_height(parts, middle, surface.height) == pytest.approx(surface.height, abs=1e-6)


def drawn_height(parts, place, start):
    """The highest that a mesh gets right above or below a place, from 1 cm below a height on."""
    best = -1.0
    for part in parts:
        a, b, c = (part.mesh.vertices[part.mesh.faces[:, corner]] for corner in range(3))
        u, v, w = b[:, :2] - a[:, :2], c[:, :2] - a[:, :2], place - a[:, :2]
        area = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
        flat = np.abs(area) > 1e-12
        s = (w[:, 0] * v[:, 1] - w[:, 1] * v[:, 0])[flat] / area[flat]
        t = (u[:, 0] * w[:, 1] - u[:, 1] * w[:, 0])[flat] / area[flat]
        z = a[flat, 2] + s * (b[flat, 2] - a[flat, 2]) + t * (c[flat, 2] - a[flat, 2])
        best = max(best, z[(s >= -1e-9) & (t >= -1e-9) & (s + t <= 1.0 + 1e-9)].max(initial=-1.0))
    return best if best > start - 0.01 else -1.0


def test_a_cabinet_has_the_drawers_it_was_made_with():
    shape = cabinet_shape((0.0, 0.9, 0.0, 0.5))
    assert [one.name for one in surfaces_of(shape)] == ["top", *(f"drawer[{k}]" for k in (1, 2, 3, 4))]
    heights = [one.height for one in surfaces_of(shape)[1:]]
    assert np.diff(heights) == pytest.approx([PITCH] * 3)
    assert mass_of(shape) == pytest.approx(ASSETS["cabinet"].mass * shape.height / ASSETS["cabinet"].height)
    assert (Cabinet().length, Cabinet().height) == pytest.approx((*ASSETS["cabinet"].footprint.extent[:1], 0.35))
    assert cabinet_shape((0.0,) * 3).footprint.extent == pytest.approx(ASSETS["cabinet"].footprint.extent)


def test_a_drawer_above_hides_what_is_below_it():
    free, hidden = (Cabinet((0.0, 0.8, share)).surfaces()[2].pull for share in (0.0, 0.5))
    assert free.reach - hidden.reach == pytest.approx(0.5 * 0.3)
    assert hidden.least(hidden.reach) == pytest.approx(0.8)


@pytest.mark.parametrize("footprint", [Box(0.18, 0.038), Circle(0.05), Polygon(((0.0, 0.0), (0.2, 0.0), (0.0, 0.1)))])
def test_the_narrowest_strip_that_holds_a_footprint(footprint):
    """What fits into a strip of that length fits, and into one that is shorter it does not."""
    need = narrowest(footprint, 0.38)
    strips = [Polygon(((0.0, -0.19), (long, -0.19), (long, 0.19), (0.0, 0.19))) for long in (need + 1e-4, need - 1e-3)]
    if not isinstance(footprint, Polygon):  # a polygon's middle is not the middle of what it covers
        assert [fits(footprint, strip) for strip in strips] == [True, False]
    assert narrowest(footprint, 0.03) is None


def test_without_declared_heights_things_stand_where_they_are():
    """On the top, in the drawer, on its rim where they do not fit, on the table beside the cabinet."""
    shapes = [cabinet_shape((0.0, 0.0, 0.9)), shape_of("apple"), shape_of("tray")]
    top, *_, drawer = surfaces_of(shapes[0])
    apple = [(-0.1, 0.0), (0.15, 0.1), (0.297, 0.0), (0.9, 0.0)]
    poses = np.array([[(0.0, 0.0, 0.0), (*place, 0.0), (5.0, 5.0, 0.0)] for place in apple])
    found = base_heights(shapes, poses)[:, 1]
    assert found == pytest.approx([top.height, drawer.height, 0.03 + 3 * PITCH - 0.003, 0.0])


def test_what_is_under_an_open_drawer_does_not_overlap_it():
    shapes = [cabinet_shape((0.0, 0.0, 0.9)), shape_of("crackerbox")]
    reach = shapes[0].footprint.extent[0] / 2.0
    poses = np.array([[(0.0, 0.0, 0.0), (reach + 0.02, 0.0, 0.0)], [(0.0, 0.0, 0.0), (-reach - 0.02, 0.0, 0.0)]])
    assert overlapping(shapes, poses, declared=(0.0, 0.0)) == [[], [(0, 1)]]


def test_bins_with_names_of_their_own_differ_in_colour():
    assert len(set(object_colors([("food", "bin"), ("metal", "bin"), ("toy", "bin")]))) == 3
    assert len(set(object_colors([(f"bin[{k}]", "bin") for k in (1, 2, 3)]))) == 1


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
    monkeypatch.setattr(colored_mesh, "MAX_PIXELS", 31)
    with pytest.raises(MeshError, match="more than 31 pixels"):
        obj()
    monkeypatch.setattr(colored_mesh, "MAX_TRIANGLES", 3)
    with pytest.raises(MeshError, match="more than 3 triangles"):
        obj()
    monkeypatch.setattr(meshfile, "MAX_MATERIALS", 1)
    with pytest.raises(MeshError, match="line 1: its files have more than 1 materials"):
        obj()
    monkeypatch.setattr(colored_mesh, "MAX_MESH_BYTES", 10)
    with pytest.raises(MeshError, match="its files are larger than 10 bytes"):
        obj()


def test_an_stl_is_one_surface():
    corners = np.arange(18, dtype="<f4").reshape(2, 3, 3)
    data = bytes(80) + struct.pack("<I", 2) + b"".join(bytes(12) + one.tobytes() + bytes(2) for one in corners)
    (only,) = mesh_surfaces("a.STL", data, None)
    assert np.array_equal(only.vertices[only.faces], corners) and only.color is None


FACET = b"facet normal 0 0 1\n outer loop\n  vertex 0 0 0\n  vertex 1 0 0\n  vertex 1 2 0\n endloop\nendfacet\n"
WORDS = b"solid one\n" + FACET + FACET.replace(b"2 0", b"2 3") + b"endsolid one\n"


def extent(name, data):
    """The size of all that a file shows, and how many triangles that are."""
    surfaces = mesh_surfaces(name, data, None)
    points = np.concatenate([one.vertices for one in surfaces])
    return np.ptp(points, axis=0).tolist(), sum(len(one.faces) for one in surfaces)


@pytest.mark.parametrize(
    "data",
    [
        WORDS,
        WORDS.rstrip(),
        WORDS.upper(),
        WORDS.replace(b"\n", b"\r"),
        b"\xef\xbb\xbf" + WORDS.replace(b"\n", b"\r\n"),
        b"solid none\nendsolid none\n" + WORDS,
        WORDS.replace(b"endsolid one", b"endsolid\n\nsolid facet vertex\nend solid"),
        WORDS.replace(b"endloop", b"end loop").replace(b"endfacet", b"end facet"),
        WORDS.replace(b"normal 0 0 1", b"normal nan nan -nan"),
    ],
)
def test_an_stl_in_words(data):
    assert extent("a.stl", data) == ([1.0, 2.0, 3.0], 2)


def test_an_stl_in_words_that_is_cut_short_is_refused():
    lines = WORDS.splitlines(keepends=True)
    for kept in range(1, len(lines)):
        with pytest.raises(MeshError, match="cut short"):
            extent("a.stl", b"".join(lines[:kept]))
    four = FACET.replace(b" endloop", b"  vertex 1 1 1\n endloop")
    for text in (FACET.replace(b"  vertex 1 0 0\n", b"") + four, FACET + b"vertex 0 0 0\n", b"endsolid\n" + FACET):
        with pytest.raises(MeshError, match=r"^line \d+: .*facet|^line \d+: .*solid"):
            extent("a.stl", b"solid one\n" + text + b"endsolid one\n")


@pytest.mark.parametrize("behind", [b"", b"\n", b"solid"])
@pytest.mark.parametrize("opening", [b"made by", b"solid", b"SOLID\n", b"solid part\r\n"])
def test_an_stl_in_bytes_may_open_with_solid_and_have_bytes_behind(opening, behind):
    corners = np.array([[[0, 0, 0], [1, 0, 0], [1, 2, 3]]], dtype="<f4")
    data = opening.ljust(80, b" ") + struct.pack("<I", 1) + bytes(12) + corners.tobytes() + bytes(2)
    assert extent("a.stl", data + behind) == ([1.0, 2.0, 3.0], 1)
    with pytest.raises(MeshError, match="it is cut short"):
        extent("a.stl", data[:-1])


NOTE = b"# C:\\models\\\n"


@pytest.mark.parametrize("end", [b"\n", b"\r\n", b"\r"])
def test_a_comment_ends_with_its_line(end):
    lines = OBJ.splitlines(keepends=True)
    plain = obj(OBJ)
    for place in range(len(lines)):
        if lines[place - 1].endswith(b"\\\n"):
            continue
        text = b"".join([*lines[:place], NOTE, *lines[place:]])
        found = obj(text.replace(b"\n", end), a_mtl=(NOTE + MTL.replace(b"Kd 1", NOTE + b"Kd 1")).replace(b"\n", end))
        for one, other in zip(found, plain, strict=True):
            assert np.array_equal(one.vertices[one.faces], other.vertices[other.faces]) and one.color == other.color
    with pytest.raises(MeshError, match="line 12: a face names vertex 9 of 4"):
        obj((NOTE + OBJ.replace(b"f 1 2 3", NOTE + b"f 1 2 9")).replace(b"\n", end))


def test_a_material_that_is_alone_needs_no_usemtl():
    text = b"mtllib b.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2/1 3/1\n"
    (only,) = obj(text, b_mtl=b"newmtl scan\nmap_Kd skin 1.png\n")
    assert only.texture == png() and only.color == (1.0, 1.0, 1.0) and only.uv.shape == (3, 2)
    (only,) = obj(text, b_mtl=MTL)  # which of two is not said
    assert only.color is None and not only.texture


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
    monkeypatch.setattr(colored_mesh, "MAX_TRIANGLES", 5000)
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


GREY = (0.5, 0.5, 0.5)
SIZES = st.floats(0.001, 5.0)


@st.composite
def prisms(draw):
    """Polygons of three to twelve corners that need not surround the origin."""
    x, y, count = draw(st.floats(-3.0, 3.0)), draw(st.floats(-3.0, 3.0)), draw(st.integers(3, 12))
    long, wide, start = draw(SIZES), draw(SIZES), draw(st.floats(0.0, 1.0))
    turns = [math.tau * (k + start) / count for k in range(count)]
    return convex_hull([(x + long * math.cos(turn), y + wide * math.sin(turn)) for turn in turns])


def area_of(footprint):
    match footprint:
        case Circle(radius):
            return math.pi * radius**2
        case Box(length, width):
            return length * width
    return shapely.Polygon(footprint.vertices).area


def reach(footprint, points):
    """How far points (P, 2) get out of the footprint, in metres."""
    match footprint:
        case Circle(radius):
            return float((np.hypot(*points.T) - radius).max())
        case Box(length, width):
            return float((np.abs(points) - (length / 2, width / 2)).max())
    outline = shapely.Polygon(footprint.vertices)
    return max(outline.distance(point) for point in shapely.points(points))


FOOTPRINTS = st.one_of(SIZES.map(Circle), st.builds(Box, SIZES, SIZES), prisms())


@settings(max_examples=examples(150), deadline=None)
@given(footprint=FOOTPRINTS, height=SIZES)
def test_meshes_are_closed_and_fill_footprint_and_height(footprint, height):
    body, mark = parts_of(Shape("urdf", footprint, height), GREY)
    size = max(*footprint.extent, height)
    for part in (body, mark):
        assert part.mesh.is_closed and part.mesh.volume > 0.0
        assert len(part.mesh.faces) * 3 < 8192  # pybullet's limit for meshes in memory on some systems
        assert reach(footprint, part.mesh.vertices[:, :2]) < 1e-9 * size
        assert part.mesh.vertices[:, 2].min() > -1e-12 * size
    assert mark.color != body.color
    top = mark.mesh.vertices[:, 2].max()
    assert top == pytest.approx(height)
    assert 0.9 * height < body.mesh.vertices[:, 2].max() < top  # the mark is to be seen
    # A regular polygon stands for the circle, bevels and the mark's rise take a little.
    assert 0.85 * area_of(footprint) * height < body.mesh.volume <= area_of(footprint) * height * (1 + 1e-9)


@pytest.mark.parametrize(
    "footprint", [Circle(0.1), Box(0.3, 0.1), Box(0.1, 0.3), convex_hull([(1, 1), (2, 1), (1, 3)])]
)
def test_the_mark_points_along_the_heading(footprint):
    """Its front is narrower than its back, and it is as wide to the left as to the right."""
    _, mark = parts_of(Shape("prism", footprint, 0.1), GREY)
    x, y = mark.mesh.vertices[:, :2].T
    front, back = y[x > x.max() - 1e-9], y[x < x.min() + 1e-9]
    assert np.ptp(front) < 0.3 * np.ptp(back)
    assert front.mean() == pytest.approx(back.mean(), abs=1e-9)


@pytest.mark.long
def test_a_prism_with_very_many_corners_can_be_drawn():
    turns = np.linspace(0.0, math.tau, 3000, endpoint=False)
    body, _ = parts_of(Shape("prism", Polygon(tuple(zip(np.cos(turns), np.sin(turns), strict=True))), 1.0), GREY)
    assert len(body.mesh.faces) * 3 < 8192
    assert body.mesh.is_closed


def test_an_asset_with_a_polygon_is_a_prism_and_with_another_size_is_stretched():
    corners = Polygon(((0.0, 0.0), (0.2, 0.0), (0.0, 0.1)))
    for a, b in zip(
        parts_of(Shape("mug", corners, 0.1), GREY), parts_of(Shape("prism", corners, 0.1), GREY), strict=True
    ):
        assert np.array_equal(a.mesh.vertices, b.mesh.vertices)
    stretched = parts_of(Shape("mug", Circle(0.124), 0.095), ASSETS["mug"].color)
    for part, own in zip(stretched, parts_of_asset(ASSETS["mug"]), strict=True):
        assert np.allclose(part.mesh.vertices, own.mesh.vertices * (2.0, 2.0, 1.0))


def test_elements_of_an_array_can_have_shades_and_the_first_has_the_colour_of_the_name():
    names = [f"post[{k}]" for k in range(1, 8)]
    colors = object_colors([(name, "cylinder") for name in names], distinct=True)
    for a, b in itertools.combinations(colors, 2):
        assert np.abs(np.subtract(a, b)).max() > 0.08
    assert colors[:1] == object_colors([("post", "cylinder")])
    # The same whatever stands beside it, as long as that is of the library.
    assert object_colors([("mug", "mug"), *((name, "cylinder") for name in names)], distinct=True)[1:] == colors


def test_a_plain_shape_with_the_name_of_an_asset_has_its_colour():
    assert object_colors([("block[1]", "box"), ("mug", "prism")]) == (ASSETS["block"].color, ASSETS["mug"].color)


def test_plain_shapes_of_all_kinds_can_be_told_apart():
    names = [("tray", "box"), ("post", "cylinder"), ("wedge", "prism"), ("server", "urdf"), ("block", "box")]
    names += [("block2", "box"), ("shelf[1]", "box"), ("shelf[2]", "box")]
    for a, b in itertools.combinations(object_colors(names, distinct=True), 2):
        assert np.abs(np.subtract(a, b)).max() > 0.08
