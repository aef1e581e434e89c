"""The mesh builders: volumes against formulas, closedness, normals. A folder of assets with an index: entries are
scaled and turned upright, and every mistake says what it is. What stands in what: not what lies on it, or inside
it.
"""

import math

import numpy as np
import pytest

from scenegen.errors import DataError, SpecError
from scenegen.geometry import Box, Polygon
from scenegen.lang.checker import check_file
from scenegen.pictures.render.scenes import models_of, still_outlines
from scenegen.things import Shape, shape_of
from scenegen.things.indexed import UPRIGHTS, AssetEntry, IndexFileError, categories, fit_asset, read_index
from scenegen.things.mesh import Mesh, box, disc, prism, revolve, shade_mesh, tube
from scenegen.things.outline import MeshError
from scenegen.things.surfaces import overlapping

from .gltf_files import glb


def test_volumes_follow_the_formulas():
    assert box(2.0, 3.0, 4.0).volume == pytest.approx(24.0)
    assert disc(1.0, 0.0, 2.0, sides=720).volume == pytest.approx(2.0 * math.pi, rel=1e-4)
    ring = revolve([(1.0, 0.0), (2.0, 0.0), (2.0, 1.0), (1.0, 1.0)], 720)
    assert ring.volume == pytest.approx(3.0 * math.pi, rel=1e-4)
    half = revolve([(1.0, 0.0), (2.0, 0.0), (2.0, 1.0), (1.0, 1.0)], 360, start=-1.0, sweep=math.pi)
    assert half.volume == pytest.approx(1.5 * math.pi, rel=1e-4)
    assert prism([(0, 0), (1, 0), (0, 1)], 0.0, 1.0).volume == pytest.approx(0.5)
    assert tube([(0.0, 0.0), (0.5, 0.0), (1.0, 0.0)], 0.1, 0.1, 360).volume == pytest.approx(0.01 * math.pi, rel=1e-3)


def test_an_open_mesh_is_not_called_closed():
    whole = box(1.0, 1.0, 1.0)
    assert whole.is_closed
    assert not Mesh(whole.vertices, whole.faces[1:]).is_closed
    flipped = whole.faces.copy()
    flipped[0] = flipped[0][::-1]
    assert not Mesh(whole.vertices, flipped).is_closed


def test_moving_scaling_and_tipping_keep_the_form():
    mesh = box(2.0, 3.0, 4.0)
    assert mesh.shift(1.0, 2.0, 3.0).volume == pytest.approx(24.0)
    assert mesh.scale(1.0, 2.0, 0.5).volume == pytest.approx(24.0)
    tipped = mesh.tip()
    assert tipped.volume == pytest.approx(24.0)
    assert tipped.vertices[:, 1].min() == pytest.approx(-4.0)


def test_normals_are_flat_on_a_box_and_smooth_on_a_cylinder():
    vertices, normals, indices = shade_mesh(box(1.0, 1.0, 1.0))
    assert np.allclose(np.abs(normals).max(axis=1), 1.0)
    assert len(vertices) == len(normals) == len(indices)
    vertices, normals, _ = shade_mesh(disc(1.0, 0.0, 1.0, sides=36))
    wall = np.abs(normals[:, 2]) < 0.5
    assert np.allclose(normals[wall][:, :2], vertices[wall][:, :2], atol=0.02)
    assert np.allclose(normals[~wall][:, :2], 0.0, atol=1e-9)


MUG = '[[asset]]\nname = "mug"\nfile = "mug.obj"\n'


SIDES = "1 2 4 3,5 7 8 6,1 5 6 2,3 4 8 7,1 3 7 5,2 6 8 4"


def solid(x, y, z):
    """An OBJ file of a box with a corner at the origin."""
    points = "".join(f"v {a} {b} {c}\n" for a in (0, x) for b in (0, y) for c in (0, z))
    return (points + "".join(f"f {side}\n" for side in SIDES.split(","))).encode()


def nothing(name):
    raise AssertionError(f"{name} is not wanted")


def sizes(data=None, **fields):
    data = data or solid(100, 50, 20)
    fit = fit_asset(
        AssetEntry(**{"name": "a", "file": "a.obj", "scale": 0.001, "center": True} | fields), data, nothing
    )
    assert isinstance(fit.footprint, Box)
    return tuple(round(size, 6) for size in (fit.footprint.length, fit.footprint.width, fit.height))


def test_meshes_are_scaled_and_turned_upright():
    assert sizes() == (0.1, 0.05, 0.02)
    assert sizes(up="y") == sizes(up="-y") == sizes(roll=90) == (0.1, 0.02, 0.05)
    assert sizes(up="x") == sizes(pitch=-90) == (0.02, 0.05, 0.1)
    assert sizes(up="y", yaw=-270.0, scale=0.01) == (0.2, 1.0, 0.5)
    # In a glTF file y is up unless the index says otherwise.
    box = {"data": glb(), "file": "a.glb", "scale": 1.0}
    assert sizes(**box) == sizes(**box, up="y") == (0.2, 0.1, 0.3)
    assert sizes(**box, up="z") == (0.2, 0.3, 0.1)


@pytest.mark.parametrize("up", UPRIGHTS)
def test_the_axis_that_is_up_becomes_z_without_a_mirror(up):
    axis = np.eye(3)["xyz".index(up[-1])] * (-1.0 if up[0] == "-" else 1.0)
    turn = AssetEntry(name="a", file="a.obj", up=up).matrix
    assert np.array_equal(turn @ axis, (0.0, 0.0, 1.0)) and np.linalg.det(turn) == pytest.approx(1.0)


def test_turns_are_about_fixed_axes_in_order():
    turn = AssetEntry(name="a", file="a.stl", roll=90, pitch=90, yaw=30).matrix
    # y goes to z by the roll, to x by the pitch, and then 30 degrees round.
    assert turn @ (0.0, 1.0, 0.0) == pytest.approx((np.cos(np.pi / 6), 0.5, 0.0))


@pytest.fixture
def folder(tmp_path):
    """Checks a spec with assets; its folder has a box of 10 by 5 by 2 cm in millimetres, and a red one in metres."""
    (tmp_path / "set" / "mug").mkdir(parents=True)
    (tmp_path / "set" / "mug" / "a.obj").write_bytes(solid(100, 50, 20))
    (tmp_path / "set" / "box.glb").write_bytes(glb())
    (tmp_path / "set" / "assets.toml").write_text(
        '[[asset]]\nname = "025_mug"\nfile = "mug/a.obj"\nscale = 0.001\ncategory = ["mug", "cup"]\nup = "y"\n'
        '[[asset]]\nname = "box"\nfile = "box.glb"\ncategory = "mug"\nroll = 90\ncenter = true\n'
    )
    return tmp_path


def checked(folder, asset):
    spec = folder / "a.spec"
    spec.write_text(f"object first = asset({asset}), plate\ntask: leftOf(first, plate)\n")
    return check_file(spec, spec.read_bytes())


def test_a_spec_names_an_entry_and_its_canonical_text_stands_alone(folder):
    spec = checked(folder, '"set/025_mug"')
    first = spec.shapes[0]
    assert (first.asset, first.path, first.height) == ("asset", "set/025_mug", 0.05)
    assert 'asset("set/025_mug", prism([' in spec.source
    (folder / "alone").mkdir()
    (folder / "alone" / "a.spec").write_text(spec.source)
    again = check_file(folder / "alone" / "a.spec", spec.source.encode())
    assert again.shapes == spec.shapes and again.source == spec.source
    entries = read_index((folder / "set" / "assets.toml").read_bytes())
    assert categories(entries) == {"mug": ["025_mug", "box"], "cup": ["025_mug"]}


def refused(folder, asset, code, words):
    with pytest.raises(SpecError) as caught:
        checked(folder, asset)
    (one,) = caught.value.diagnostics
    said = f"{one.title} {one.help}"
    assert one.code == code and words in said and one.span is not None, said


def test_names_folders_and_files_that_are_not_there(folder):
    refused(folder, '"025_mug"', "asset-index", "there is no assets.toml")
    refused(folder, '"sets/025_mug"', "asset-index", "sets/assets.toml")
    refused(folder, '"set/025_mag"', "unknown-asset", "did you mean `025_mug`?")
    refused(folder, '"set/"', "unknown-asset", "it has 025_mug, box")
    refused(folder, "mug", "file-without-quotes", 'asset("025_mug")')
    refused(folder, '"../set/025_mug"', "outside-folder", "")
    (folder / "set" / "mug" / "a.obj").unlink()
    refused(folder, '"set/025_mug"', "cannot-read-import", "set/mug/a.obj")


def test_an_index_that_cannot_be_used_says_where(folder):
    for text, words in (
        ("[[asset]]\nname = mug", "line 2"),
        ("", "it has no assets"),
        ("asset = 3", "asset"),
        (MUG + "[[asset]]\nfile = 'b.obj'", "asset 2 (line 4): `name`: is missing"),
        (MUG + MUG, "asset 2 (line 4): a second `mug`; the first is asset 1 (line 1)"),
        (MUG + "scale = 0", "`scale`: input should be greater than 0"),
        (MUG + "scale = true", "expected a number"),
        (MUG + "scale = nan", "`scale`"),
        (MUG + "category = ''", "`category`"),
        (MUG + "category = []", "`category`"),
        (MUG + "up = 'w'", "`up`"),
        (MUG + "catgory = 'mug'", "did you mean `category`?"),
        (MUG + "[other]\na = 1", "there are asset"),
        (MUG.replace("mug.obj", "../mug.obj"), "must lie in the folder of the index"),
        (MUG.replace("mug.obj", "/etc/passwd"), "must lie in the folder of the index"),
        (MUG.replace("mug.obj", "c:/mug.obj"), "must lie in the folder of the index"),
        (MUG.replace('"mug"', '"a/b"'), "names have no"),
        ("a = " + "[" * 100_000, "it is not TOML"),
    ):
        (folder / "assets.toml").write_text(text)
        refused(folder, '"mug"', "asset-index", words)
    (folder / "assets.toml").write_bytes(b"\xff\xfe")
    refused(folder, '"mug"', "asset-index", "UTF-8")
    with pytest.raises(IndexFileError):
        read_index(b" " * 16_000_001)


def test_sizes_that_nothing_on_a_table_has_name_the_unit(folder):
    (folder / "assets.toml").write_text(MUG)
    for size, words in (
        (30, "is its file in centimetres? scale = 0.01"),
        (900, "millimetres? scale = 0.001"),
        (1e7, ""),
    ):
        (folder / "mug.obj").write_bytes(solid(size, size, size))
        refused(folder, '"mug"', "unusable-shape-file", words)
    (folder / "mug.obj").write_bytes(solid(0.00009, 0.00009, 0.0001))
    refused(folder, '"mug"', "unusable-shape-file", "scale = 1000")
    (folder / "mug.obj").write_bytes(solid(1, 1, 0))
    refused(folder, '"mug"', "unusable-shape-file", "no height")
    with pytest.raises(MeshError, match=r"\.ply files cannot be read here: convert it to \.glb"):
        fit_asset(AssetEntry(name="a", file="a.ply"), b"", nothing)
    index = folder / "set" / "assets.toml"
    (folder / "set" / "old.dae").write_text("<COLLADA/>")
    index.write_text(index.read_text() + '[[asset]]\nname = "old"\nfile = "old.dae"\n')
    refused(folder, '"set/old"', "unusable-shape-file", "convert it to .glb, .gltf, .obj or .stl, with Blender")


def test_pictures_draw_the_mesh_scaled_and_turned(folder):
    import scenegen

    (folder / "a.spec").write_text(
        'object box = asset("set/box"), mug = asset("set/025_mug"), plate = asset("set/old", box(8 cm, 8 cm, 8 cm))\n'
        "task: leftOf(box, plate)"
    )
    index = folder / "set" / "assets.toml"
    index.write_text(index.read_text() + '[[asset]]\nname = "old"\nfile = "old.dae"\n')
    file = scenegen.sample(scenegen.load(folder / "a.spec"), {}, n=1, seed=2).file()
    box, mug, old = models_of(file, folder)
    points = np.concatenate([one.vertices for one in box])
    assert points.min(axis=0) == pytest.approx((-0.1, -0.15, 0.0), abs=1e-6)
    assert points.max(axis=0) == pytest.approx((0.1, 0.15, 0.1), abs=1e-6)
    points = np.concatenate([one.vertices for one in mug])
    assert points.max(axis=0) - points.min(axis=0) == pytest.approx((0.1, 0.02, 0.05))
    assert old is None and still_outlines(file, folder) == ("plate",)
    for text, words in (
        (index.read_text().replace("roll = 90", "roll = 45"), "its outline is not that"),
        (index.read_text().replace('"box"', '"bax"'), "has no asset `box`"),
        ("[", "is not TOML"),
    ):
        index.write_text(text)
        with pytest.raises(DataError, match=words) as caught:
            models_of(file, folder)
        assert caught.value.diagnostics[0].code == "unusable-model"


ROBOT = """<robot name="r"><link name="base"><inertial><mass value="0.4"/></inertial>
<contact><lateral_friction value="0.7"/></contact>
<visual><geometry><mesh filename="package://r/look.obj" scale="0.5 0.5 0.5"/></geometry></visual>
<collision><origin xyz="0 0 50"/><geometry><cylinder radius="30" length="100"/></geometry></collision></link></robot>"""


def test_a_urdf_file_is_an_entry_with_its_own_mass_and_friction(tmp_path):
    import scenegen
    from scenegen.geometry import Circle
    from scenegen.worlds.own_body import own_bodies_of

    (tmp_path / "look.obj").write_bytes(solid(100, 50, 20))
    (tmp_path / "can.urdf").write_text(ROBOT)
    entries = ('name = "can"', 'name = "lying"\nroll = 90\ncenter = true\nmass = 0.2\nfriction = 0.1')
    entry = '[[asset]]\nfile = "can.urdf"\nscale = 0.001\n{}\n'
    (tmp_path / "assets.toml").write_text("".join(entry.format(one) for one in entries))
    text = 'object a = asset("can"), b = asset("lying"), plate\ntask: leftOf(a, plate) & leftOf(plate, b)'
    (tmp_path / "a.spec").write_text(text)
    can, lying, _ = scenegen.load(tmp_path / "a.spec").checked.shapes
    assert can.footprint == Circle(0.03) and can.height == pytest.approx(0.1)
    assert isinstance(lying.footprint, Box), "its middle is the origin"
    assert (*lying.footprint.extent, lying.height) == pytest.approx((0.06, 0.1, 0.06))

    file = scenegen.sample(scenegen.load(tmp_path / "a.spec"), {}, n=1, seed=1).file()
    bodies = own_bodies_of(file, tmp_path, painted=True)
    assert (bodies["a"].mass, bodies["a"].friction) == (0.4, 0.7), "the file's"
    assert (bodies["b"].mass, bodies["b"].friction) == (0.2, 0.1), "the index's"
    for name, height in (("a", 0.1), ("b", 0.06)):
        (piece,) = bodies[name].pieces
        assert (piece.vertices[:, 2].min(), piece.vertices[:, 2].max()) == pytest.approx((0.0, height), abs=2e-4)
    # What is drawn is scaled by both files, and turned as the body is.
    for skins in (bodies["a"].skins, models_of(file, tmp_path)[0]):
        points = np.concatenate([one.vertices for one in skins])
        assert points.max(axis=0) - points.min(axis=0) == pytest.approx((0.05, 0.025, 0.01))
    points = np.concatenate([one.vertices for one in bodies["b"].skins])
    assert points.max(axis=0) - points.min(axis=0) == pytest.approx((0.05, 0.01, 0.025))
    assert points[:, 2].min() == pytest.approx(0.03), "its middle is the can's axis"


def test_a_urdf_file_with_a_dae_mesh_says_what_to_convert_it_to(tmp_path):
    mesh = '<collision><geometry><mesh filename="m.dae"/></geometry></collision>'
    (tmp_path / "r.urdf").write_text(f'<robot name="r"><link name="a">{mesh}</link></robot>')
    (tmp_path / "m.dae").write_text("<COLLADA/>")
    (tmp_path / "assets.toml").write_text('[[asset]]\nname = "r"\nfile = "r.urdf"\n')
    words = "m.dae: only .obj and .stl meshes are read in a URDF file: convert it"
    refused(tmp_path, '"r"', "unusable-shape-file", words)


WEDGE = Shape("prism", Polygon(((0.0, 0.0), (0.2, 0.0), (0.0, 0.2))), 0.05)
PAIRS = [
    ("spoon", "bowl", (0.12, 0.0, 0.0), True),  # through the wall: its middle is beside the bowl
    ("spoon", "bowl", (0.02, 0.0, 0.0), False),  # across the rim
    ("apple", "bowl", (0.01, 0.0, 0.0), False),  # inside
    ("mug", "plate", (0.05, 0.0, 0.0), False),  # on it
    ("mug", "plate", (0.15, 0.0, 0.0), True),  # half on it
    ("mug", "plate", (0.19, 0.0, 0.0), False),  # beside it
    ("mug", "plate", (0.1865, 0.0, 0.0), False),  # by half a millimetre, which nobody sees
    ("napkin", "spoon", (0.16, 0.0, 0.0), True),
]


@pytest.mark.parametrize(("one", "other", "pose", "through"), PAIRS)
def test_pairs(one, other, pose, through):
    shapes, away = [shape_of(one), shape_of(other)], (2.0, 2.0, 0.0)
    at = (0.0, 0.0, 0.0)
    wanted = [[(0, 1)], []] if through else [[], []]
    assert overlapping(shapes, _scenes([pose, at], [away, at])) == wanted
    assert overlapping(shapes[::-1], _scenes([at, pose], [at, away])) == wanted


def test_heights_count():
    """A book on a carton reaches over the can beside it, and through the bottle, which is taller."""
    shapes = [shape_of("carton"), shape_of("book"), shape_of("can"), shape_of("bottle")]
    scene = [(0.0, 0.0, 0.0), (0.1, 0.0, 0.0), (0.22, 0.0, 0.0), (0.19, 0.08, 0.0)]
    assert overlapping(shapes, _scenes(scene)) == [[(1, 3)]]


def test_polygons_and_nothing_at_all():
    at = (0.0, 0.0, 0.0)
    assert overlapping([WEDGE, shape_of("can")], _scenes([at, (0.21, 0.02, 0.0)], [at, (0.14, 0.14, 0.0)])) == [
        [(0, 1)],
        [],
    ]
    assert overlapping([WEDGE], _scenes([at])) == [[]]
    assert overlapping([WEDGE, WEDGE], _scenes([at, at])[:0]) == []


def _scenes(*rows):
    return np.array(rows)
