"""The one place that turns metres into pixels, and a proof from pictures that it does not swap or mirror. What
programs read: depth, masks and cameras, held against geometry; transparency; things on things. The light of the sky
and the wood, as functions: no picture needed.
"""

import json

import numpy as np
import pytest
from PIL import Image

from scenegen.errors import ScenegenError
from scenegen.geometry import Box, Circle
from scenegen.looks.camera import VIEWS, frame
from scenegen.looks.stage import poses_of, stage_of
from scenegen.looks.textures import wood
from scenegen.pictures.render.light import SKY_MAP, Ambient, landscape_camera
from scenegen.pictures.render.scenes import render_scenes
from scenegen.things import ASSETS, Shape, shape_of
from scenegen.things.bodies import parts_of, parts_of_asset

from .scenefiles import scene_file

SIZE = (320, 240)
NAMES = ("gizmo", "wrench", "lamp", "vase")  # blocks: their colour is at their centre
POSES = [
    [(0.15, 0.40, 0.0), (0.80, 0.85, 1.0), (0.60, 0.20, 2.0), (0.40, 0.75, 3.0)],
    [(0.90, 0.10, 4.0), (0.30, 0.30, 5.0), (0.10, 0.90, 6.0), (0.70, 0.55, 0.5)],
]


def tone(colors):
    """Colour without its brightness, which light and shadow change."""
    colors = np.asarray(colors, dtype=float)
    return colors / np.maximum(np.linalg.norm(colors, axis=-1, keepdims=True), 1e-9)


def found(picture, pixel, color):
    """Whether some of the pixels within 4 of `pixel` have the colour."""
    column, row = (round(float(part)) for part in pixel)
    near = picture[max(row - 4, 0) : max(row + 5, 0), max(column - 4, 0) : max(column + 5, 0)].reshape(-1, 3)
    return bool((np.linalg.norm(tone(near) - tone(color), axis=1) < 0.10).sum() >= 4)


@pytest.fixture(scope="module")
def drawn(tmp_path_factory):
    file = scene_file(NAMES, POSES)
    folder = tmp_path_factory.mktemp("mirror")
    render_scenes(file, folder, views=VIEWS, size=SIZE, workers=1)
    pictures = {
        (scene, view): np.asarray(Image.open(folder / f"scene_{scene + 1:04d}_{view}.png"))
        for scene in range(len(POSES))
        for view in VIEWS
    }
    return file, pictures


def hits(drawn, view, change):
    """For every object of every scene: is its colour found where `change(point)` is projected to?"""
    file, pictures = drawn
    stage = stage_of(file)
    camera = frame(view, stage.corners(), SIZE)
    answers = []
    for scene, poses in enumerate(poses_of(file)):
        for thing, (x, y, _) in zip(stage.things, poses, strict=True):
            u, v = change(float(x), float(y))
            pixel = camera.project([(u, v, 0.03)])[0]
            answers.append(found(pictures[scene, view], pixel, thing.color))
    return answers


@pytest.mark.long
@pytest.mark.parametrize("view", VIEWS)
def test_objects_are_where_their_poses_say(drawn, view):
    assert all(hits(drawn, view, lambda x, y: (x, y)))


@pytest.mark.long
@pytest.mark.parametrize("view", VIEWS)
@pytest.mark.parametrize(
    "wrong",
    [lambda x, y: (y, x), lambda x, y: (1.0 - x, y), lambda x, y: (x, 1.0 - y), lambda x, y: (1.0 - x, 1.0 - y)],
    ids=["swapped", "x mirrored", "y mirrored", "turned"],
)
def test_the_test_above_would_notice_a_wrong_projection(drawn, view, wrong):
    answers = hits(drawn, view, wrong)
    assert sum(answers) <= len(answers) // 4


@pytest.mark.parametrize("view", VIEWS)
def test_x_is_to_the_right_and_y_upwards(view):
    stage = stage_of(scene_file(NAMES, POSES))
    camera = frame(view, stage.corners(), SIZE)
    centre, right, away, high = camera.project([(0.5, 0.5, 0), (0.6, 0.5, 0), (0.5, 0.6, 0), (0.5, 0.5, 0.1)])
    assert right[0] > centre[0] + 5
    assert away[1] < centre[1] - 5
    if view == "three-quarter":  # from the right of the viewer's side
        assert right[1] > centre[1] + 5
        assert away[0] > centre[0] + 5
    else:
        assert abs(right[1] - centre[1]) < 0.5
        assert abs(away[0] - centre[0]) < 0.5
    assert np.allclose(high, centre) if view == "top" else high[1] < centre[1] - 5


@pytest.mark.long
def test_the_handle_of_a_mug_shows_its_heading(tmp_path):
    headings = (0.0, np.pi / 2, 2.5)
    file = scene_file(["mug"], [[(0.5, 0.5, heading)] for heading in headings], x=(0.4, 0.6), y=(0.4, 0.6))
    render_scenes(file, tmp_path, views=("top",), size=SIZE, workers=1)
    stage = stage_of(file)
    camera = frame("top", stage.corners(), SIZE)
    for number, heading in enumerate(headings, start=1):
        picture = np.asarray(Image.open(tmp_path / f"scene_{number:04d}_top.png"))
        there = np.array([np.cos(heading), np.sin(heading)]) * 0.056
        ahead, behind = camera.project([(0.5 + there[0], 0.5 + there[1], 0.05), (0.5 - there[0], 0.5 - there[1], 0.05)])
        assert found(picture, ahead, stage.things[0].color)
        assert not found(picture, behind, stage.things[0].color)


@pytest.mark.parametrize("view", VIEWS)
@pytest.mark.parametrize("size", [(640, 480), (300, 900), (1000, 100)])
@pytest.mark.parametrize(
    ("x", "y"), [((0, 1), (0, 1)), ((-0.5, 0.5), (-0.3, 0.9)), ((0, 20), (0, 10)), ((5, 9), (0, 0.2))]
)
def test_the_table_is_framed_whole_and_large(view, size, x, y):
    stage = stage_of(scene_file(["mug"], [[(x[0], y[0], 0.0)]], x=x, y=y))
    pixels = frame(view, stage.corners(), size).project(stage.corners())
    share = (pixels.max(axis=0) - pixels.min(axis=0)) / size
    assert (pixels >= 0).all()
    assert (pixels <= size).all()
    assert share.max() > 0.9


def test_the_table_grows_for_objects_off_the_workspace_but_not_without_end():
    near = stage_of(scene_file(["mug"], [[(-0.3, 0.5, 0.0)]]))
    assert near.table[0] < -0.3
    assert near.table[1:] == stage_of(scene_file(["mug"], [[(0.5, 0.5, 0.0)]])).table[1:]
    far = stage_of(scene_file(["mug"], [[(1e30, 0.5, 0.0)]]))
    assert far.table[2] < 2.0


@pytest.mark.parametrize("view", VIEWS)
def test_rays_undo_the_projection(view):
    stage = stage_of(scene_file(["mug"], [[(0.5, 0.5, 0.0)]], x=(-2, 3), y=(1, 2)))
    camera = frame(view, stage.corners(), SIZE)
    points = np.array([(0.3, 1.2, 0.0), (-1.0, 1.9, 0.0), (2.0, 1.5, 0.0)])
    pixels = camera.project(points)
    origin, direction = camera.rays(pixels[:, 0], pixels[:, 1])
    depth = -origin[:, 2] / direction[:, 2]
    assert np.allclose(origin + depth[:, None] * direction, points)


def test_a_shape_of_another_size_scales_the_asset():
    file = scene_file(["block"], [[(0.5, 0.5, 0.0)]])
    shape = {"asset": "block", "footprint": {"kind": "box", "length": 0.1, "width": 0.05}, "height": 0.2}
    data = file.model_dump()
    data["objects"][0]["shape"] = shape
    (thing,) = stage_of(type(file).model_validate(data)).things
    own, drawn = parts_of_asset(ASSETS["block"], thing.color), parts_of(thing.shape, thing.color)
    for before, after in zip(own, drawn, strict=True):
        assert np.allclose(after.mesh.vertices, before.mesh.vertices * (2.0, 1.0, 4.0))
        assert after.color == before.color
    data["objects"][0]["shape"] = {**shape, "asset": "no such asset"}
    assert stage_of(type(file).model_validate(data)).things == (thing,)


SIZE_MASKS = (160, 120)
CRATE = Shape("box", Box(0.3, 0.2), 0.1)
POST = Shape("cylinder", Circle(0.06), 0.25)


@pytest.fixture(scope="module")
def drawn_masks(tmp_path_factory):
    """Two boxes and a mug that stands on one of them."""
    folder = tmp_path_factory.mktemp("arrays")
    file = scene_file(
        ["crate", "post", "mug"], [[(0.4, 0.5, 0.7), (0.8, 0.7, 0.0), (0.4, 0.5, 1.0)]], shapes=[CRATE, POST]
    )
    done = render_scenes(file, folder, views=VIEWS, size=SIZE_MASKS, workers=1, depth=True, masks=True)
    cameras = json.loads(done.cameras.read_text())
    arrays = {view: dict(np.load(folder / f"scene_0001_{view}.npz")) for view in VIEWS}
    return done, cameras, arrays


def world(cameras, view, depth):
    """(h, w, 3): the points that pixels show, from the file's own formula."""
    camera = cameras["views"][view]
    k = camera["intrinsics"]
    u, v = np.meshgrid(np.arange(SIZE_MASKS[0]) + 0.5, np.arange(SIZE_MASKS[1]) + 0.5)
    x, y = (u - k["cx"]) / k["fx"], (v - k["cy"]) / k["fy"]
    if camera["kind"] == "perspective":
        x, y = x * depth, y * depth
    points = np.stack([x, y, depth, np.ones_like(depth)], axis=-1)
    return (points @ np.linalg.inv(np.array(camera["world_to_camera"])).T)[..., :3]


@pytest.mark.long
@pytest.mark.parametrize("view", VIEWS)
def test_depth_and_mask_agree_with_the_geometry_of_the_scene(drawn_masks, view):
    """Every pixel's point, worked out with nothing but cameras.json, lies on what its mask says."""
    _, cameras, arrays = drawn_masks
    depth, mask = arrays[view]["depth"], arrays[view]["mask"]
    assert (depth.dtype, mask.dtype, depth.shape, mask.shape) == (
        np.float32,
        np.uint16,
        SIZE_MASKS[::-1],
        SIZE_MASKS[::-1],
    )
    ids = {name: int(number) for number, name in cameras["ids"].items()}
    assert ids == {"ground": 0, "table": 1, "crate": 2, "post": 3, "mug": 4}
    points = world(cameras, view, depth.astype(float))
    assert set(np.unique(mask)) == set(ids.values())
    at = points[mask == ids["table"]]
    assert at[:, 2].max() < 0.001 and np.median(np.abs(at[:, 2])) < 0.001
    assert at[:, :2].min() > -0.08 and at[:, :2].max() < 1.08
    x, y, z = points[mask == ids["post"]].T
    assert np.hypot(x - 0.8, y - 0.7).max() < 0.0615 and z.min() > -0.002 and z.max() < 0.2515
    x, y, z = points[mask == ids["crate"]].T
    u, v = (x - 0.4) * np.cos(0.7) + (y - 0.5) * np.sin(0.7), (y - 0.5) * np.cos(0.7) - (x - 0.4) * np.sin(0.7)
    assert np.abs(u).max() < 0.1515 and np.abs(v).max() < 0.1015 and z.min() > -0.002 and z.max() < 0.1015
    x, y, z = points[mask == ids["mug"]].T
    assert np.hypot(x - 0.4, y - 0.5).max() < 0.0635 and z.min() > 0.098 and 0.19 < z.max() < 0.197


@pytest.mark.long
def test_the_mask_from_above_is_sampled_in_the_middle_of_pixels(drawn_masks):
    """The crate's outline, to the pixel: not a row or a column too far to one side."""
    _, cameras, arrays = drawn_masks
    mask = arrays["top"]["mask"]
    x, y, _ = np.moveaxis(world(cameras, "top", np.zeros(mask.shape)), -1, 0)
    u, v = (x - 0.4) * np.cos(0.7) + (y - 0.5) * np.sin(0.7), (y - 0.5) * np.cos(0.7) - (x - 0.4) * np.sin(0.7)
    inside = (np.abs(u) < 0.15) & (np.abs(v) < 0.10)
    covered = (mask == 2) | (mask == 4)
    assert (inside != covered).sum() <= 0.02 * inside.sum()
    for ours, theirs in zip(np.nonzero(inside), np.nonzero(covered), strict=True):
        assert abs(ours.mean() - theirs.mean()) < 0.06


@pytest.mark.long
def test_the_pictures_hold_the_same_as_the_arrays(drawn_masks):
    done, cameras, arrays = drawn_masks
    folder = done.sheet.parent
    for view in VIEWS:
        with Image.open(folder / f"scene_0001_{view}_depth.png") as picture:
            ticks = np.asarray(picture).astype(float)
        unit = cameras["depth"]["png_unit_in_metres"]
        near = arrays[view]["depth"] < 65535 * unit
        assert np.abs(ticks * unit - arrays[view]["depth"])[near].max() <= 0.51 * unit
        with Image.open(folder / f"scene_0001_{view}_mask.png") as picture:
            assert picture.mode == "P" and np.array_equal(np.asarray(picture), arrays[view]["mask"])
    names = {path.name for path in (*done.pictures, *done.beside, done.sheet, done.cameras)}
    assert names == {path.name for path in folder.iterdir()} and len(done.beside) == 3 * len(VIEWS)


def test_huge_pictures_are_sampled_in_the_middle_too(tmp_path):
    """Beyond 2048 pixels nothing is averaged: another path to the same place."""
    file = scene_file(["crate"], [[(0.5, 0.5, 0.0)]], shapes=[Shape("box", Box(0.4, 0.3), 0.01)])
    done = render_scenes(file, tmp_path, views=("top",), size=(2064, 40), workers=1, masks=True)
    mask = np.load(tmp_path / "scene_0001_top.npz")["mask"]
    k = json.loads(done.cameras.read_text())["views"]["top"]["intrinsics"]
    columns = np.nonzero((mask == 2).any(axis=0))[0]
    assert columns.mean() + 0.5 == pytest.approx(k["cx"], abs=0.51)
    rows = np.nonzero((mask == 2).any(axis=1))[0]
    assert rows.mean() + 0.5 == pytest.approx(k["cy"], abs=0.51)


@pytest.mark.long
def test_transparent_pictures_show_table_and_things_and_nothing_else(tmp_path):
    file = scene_file(["mug", "plate"], [[(0.3, 0.4, 0.0), (0.7, 0.5, 0.0)]])
    render_scenes(file, tmp_path / "clear", size=SIZE_MASKS, workers=1, transparent=True, masks=True)
    render_scenes(file, tmp_path / "solid", size=SIZE_MASKS, workers=1)
    for view in ("top", "perspective"):
        clear = np.asarray(Image.open(tmp_path / "clear" / f"scene_0001_{view}.png")).astype(int)
        solid = np.asarray(Image.open(tmp_path / "solid" / f"scene_0001_{view}.png")).astype(int)
        mask = np.load(tmp_path / "clear" / f"scene_0001_{view}.npz")["mask"]
        whole, empty = clear[..., 3] == 255, clear[..., 3] == 0
        assert (mask[empty] == 0).all() and (mask[whole] > 0).all() and empty.mean() > 0.05 and whole.mean() > 0.3
        assert np.abs(clear[whole][:, :3] - solid[whole]).max() <= 1
        edge = ~whole & ~empty
        assert 0 < edge.sum() < 0.03 * edge.size
        assert clear[edge][:, :3].mean() > 60  # the colour of the edge, not black mixed into it
    assert Image.open(tmp_path / "clear" / "contact_sheet.png").mode == "RGB"


@pytest.mark.long
def test_what_stands_on_something_is_drawn_on_it(tmp_path):
    """A block on a book is as high as both together, and one beside it is not."""
    file = scene_file(["book", "block"], [[(0.5, 0.5, 0.0), (0.52, 0.5, 0.3)], [(0.5, 0.5, 0.0), (0.8, 0.5, 0.3)]])
    render_scenes(file, tmp_path, views=("top",), size=SIZE_MASKS, workers=1, depth=True, masks=True)
    on, beside = (np.load(tmp_path / f"scene_000{k}_top.npz") for k in (1, 2))
    tops = [float(np.median(found["depth"][found["mask"] == 3])) for found in (on, beside)]
    assert tops[1] - tops[0] == pytest.approx(shape_of("book").height, abs=0.002)


@pytest.mark.slow
def test_the_graphics_card_draws_the_same_scene(tmp_path):
    """Or what stands for one; where there is none of either, the process says so."""
    file = scene_file(["mug", "crate"], [[(0.3, 0.4, 0.0), (0.7, 0.5, 0.4)]], shapes=[shape_of("mug"), CRATE])
    options = {"size": SIZE_MASKS, "workers": 1, "depth": True, "masks": True}
    try:
        render_scenes(file, tmp_path / "card", renderer="egl", **options)
    except ScenegenError as error:
        assert "a process that draws was killed" in str(error)
        pytest.skip("no EGL here")
    render_scenes(file, tmp_path / "soft", **options)
    for view in ("top", "perspective"):
        card, soft = (np.load(tmp_path / name / f"scene_0001_{view}.npz") for name in ("card", "soft"))
        assert (card["mask"] != soft["mask"]).mean() < 0.003
        assert np.median(np.abs(card["depth"] - soft["depth"])) < 0.001
        one, two = (
            np.asarray(Image.open(tmp_path / name / f"scene_0001_{view}.png")).astype(int) for name in ("card", "soft")
        )
        assert np.abs(one - two).mean() < 12


STAGE = stage_of(scene_file(["mug"], [[(0.5, 0.5, 0.0)]]))


def looking_down(points):
    """Rays from a metre above each of (P, 2) points, and the depth at which they meet a height."""
    origin = np.column_stack([points, np.ones(len(points))])
    return origin, np.broadcast_to([0.0, 0.0, -1.0], origin.shape)


def landscape(heights):
    """What the software renderer's depth buffer would hold for a (MAP, MAP) landscape of heights."""
    camera = landscape_camera(STAGE)
    near, far = camera._planes()
    depth = -camera.view[2, 3] - heights
    return ((near - 1.0 / depth) / (near - far)).astype(np.float32)


def hidden(heights, points, z=0.0):
    ambient = Ambient(STAGE, *looking_down(np.asarray(points)))
    depth = np.full(len(points), 1.0 - z, dtype=np.float32)
    return ambient.hidden_sky(ambient.landscape(landscape(heights)), depth, slice(None))


def tower(height):
    """A square tower of 10 cm in the middle of the table, as (MAP, MAP) heights."""
    camera = landscape_camera(STAGE)
    columns, rows = np.meshgrid(np.arange(SKY_MAP) + 0.5, np.arange(SKY_MAP) + 0.5)
    origin, _ = camera.with_size((SKY_MAP, SKY_MAP)).rays(columns, rows)
    inside = (np.abs(origin[..., 0] - 0.5) < 0.05) & (np.abs(origin[..., 1] - 0.5) < 0.05)
    return np.where(inside, height, 0.0)


def test_an_empty_table_sees_all_of_the_sky():
    assert (hidden(np.zeros((SKY_MAP, SKY_MAP)), [(0.5, 0.5), (0.0, 1.0)]) == 0.0).all()


def test_less_of_the_sky_is_seen_the_nearer_a_wall_and_the_higher_it_is():
    away = np.array([0.002, 0.01, 0.02, 0.04, 0.08, 0.3])
    points = [(0.55 + one, 0.5) for one in away]
    low, high = hidden(tower(0.01), points), hidden(tower(0.2), points)
    assert (np.diff(high) <= 0.0).all() and high[0] > 0.25 and high[-1] == 0.0
    assert (low <= high).all() and low[0] < high[0]
    left = hidden(tower(0.2), [(0.45 - one, 0.5) for one in away])
    assert left == pytest.approx(high, abs=0.06)  # the same on every side, to a pixel of the landscape


def test_nothing_hides_the_sky_from_the_top_of_what_is_highest():
    assert hidden(tower(0.2), [(0.5, 0.5), (0.53, 0.47)], z=0.2).max() == 0.0


def test_wood_is_wood_everywhere_and_fades_where_pixels_are_coarse():
    generator = np.random.default_rng(0)
    x, y = generator.uniform(-50.0, 50.0, (2, 4000))
    fine, coarse = (wood(STAGE, x, y, (np.full(4000, size), np.full(4000, size))) for size in (0.0005, 0.5))
    assert fine.shape == (4000, 3) and np.isfinite(fine).all() and fine.min() > 0.4 and fine.max() < 1.15
    assert fine.std() > 1.5 * coarse.std()
    assert (fine[:, 2] < fine[:, 0]).mean() > 0.5  # dark streaks are warm
    assert np.array_equal(fine, wood(STAGE, x, y, (np.full(4000, 0.0005), np.full(4000, 0.0005))))
