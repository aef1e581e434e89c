"""Names pick assets, sizes hold, colours tell objects apart."""

import itertools

import numpy as np
import pytest

from scenegen.scenes.data import ShapeData, footprint_data, footprint_of
from scenegen.things import ASSETS, Box, Circle, asset_of, has_picture, shape_of, stem
from scenegen.things.bodies import parts_of_asset
from scenegen.things.palette import colors_of


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
        assert part.mesh.closed
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
    alone = colors_of([("gizmo", "block")])
    assert alone == colors_of([("gizmo", "block"), ("mug", "mug")])[:1]
    assert alone != colors_of([("lamp", "block")])


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
    for a, b in itertools.combinations(colors_of(objects, distinct=True), 2):
        assert np.abs(np.subtract(a, b)).max() > 0.08


def test_thirty_objects_of_one_asset_can_all_differ():
    for objects in ([(f"thing{k}", "block") for k in range(30)], [(f"mug{k}", "mug") for k in range(30)]):
        assert len(set(colors_of(objects, distinct=True))) == 30


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
    (only,) = set(colors_of(objects))
    assert color is None or only == color


def test_blocks_and_shapes_with_names_of_their_own_differ():
    for names, asset in ((["block1", "block2", "block3", "lamp"], "block"), (["pawn[1]", "king", "rook"], "cylinder")):
        assert len(set(colors_of([(name, asset) for name in names]))) == len(names)


def test_which_names_have_a_picture():
    assert all(map(has_picture, [*ASSETS, "block[3]", "fork_2", "Plate7"]))
    assert not any(map(has_picture, ["lamp", "plates", ""]))
