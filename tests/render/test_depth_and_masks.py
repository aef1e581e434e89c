"""What programs read: depth, masks and cameras, held against geometry; transparency; things on things."""

import json

import numpy as np
import pytest
from PIL import Image

from scenegen.errors import ScenegenError
from scenegen.geometry import Box, Circle
from scenegen.show.looks.camera import VIEWS
from scenegen.show.render.scenes import render_scenes
from scenegen.things import Shape, shape_of

from .scenefiles import scene_file

SIZE = (160, 120)
CRATE = Shape("box", Box(0.3, 0.2), 0.1)
POST = Shape("cylinder", Circle(0.06), 0.25)


@pytest.fixture(scope="module")
def drawn(tmp_path_factory):
    """Two boxes and a mug that stands on one of them."""
    folder = tmp_path_factory.mktemp("arrays")
    file = scene_file(
        ["crate", "post", "mug"], [[(0.4, 0.5, 0.7), (0.8, 0.7, 0.0), (0.4, 0.5, 1.0)]], shapes=[CRATE, POST]
    )
    done = render_scenes(file, folder, views=VIEWS, size=SIZE, workers=1, depth=True, masks=True)
    cameras = json.loads(done.cameras.read_text())
    arrays = {view: dict(np.load(folder / f"scene_0001_{view}.npz")) for view in VIEWS}
    return done, cameras, arrays


def world(cameras, view, depth):
    """(h, w, 3): the points that pixels show, from the file's own formula."""
    camera = cameras["views"][view]
    k = camera["intrinsics"]
    u, v = np.meshgrid(np.arange(SIZE[0]) + 0.5, np.arange(SIZE[1]) + 0.5)
    x, y = (u - k["cx"]) / k["fx"], (v - k["cy"]) / k["fy"]
    if camera["kind"] == "perspective":
        x, y = x * depth, y * depth
    points = np.stack([x, y, depth, np.ones_like(depth)], axis=-1)
    return (points @ np.linalg.inv(np.array(camera["world_to_camera"])).T)[..., :3]


@pytest.mark.long
@pytest.mark.parametrize("view", VIEWS)
def test_depth_and_mask_agree_with_the_geometry_of_the_scene(drawn, view):
    """Every pixel's point, worked out with nothing but cameras.json, lies on what its mask says."""
    _, cameras, arrays = drawn
    depth, mask = arrays[view]["depth"], arrays[view]["mask"]
    assert (depth.dtype, mask.dtype, depth.shape, mask.shape) == (np.float32, np.uint16, SIZE[::-1], SIZE[::-1])
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
def test_the_mask_from_above_is_sampled_in_the_middle_of_pixels(drawn):
    """The crate's outline, to the pixel: not a row or a column too far to one side."""
    _, cameras, arrays = drawn
    mask = arrays["top"]["mask"]
    x, y, _ = np.moveaxis(world(cameras, "top", np.zeros(mask.shape)), -1, 0)
    u, v = (x - 0.4) * np.cos(0.7) + (y - 0.5) * np.sin(0.7), (y - 0.5) * np.cos(0.7) - (x - 0.4) * np.sin(0.7)
    inside = (np.abs(u) < 0.15) & (np.abs(v) < 0.10)
    covered = (mask == 2) | (mask == 4)
    assert (inside != covered).sum() <= 0.02 * inside.sum()
    for ours, theirs in zip(np.nonzero(inside), np.nonzero(covered), strict=True):
        assert abs(ours.mean() - theirs.mean()) < 0.06


@pytest.mark.long
def test_the_pictures_hold_the_same_as_the_arrays(drawn):
    done, cameras, arrays = drawn
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
    render_scenes(file, tmp_path / "clear", size=SIZE, workers=1, transparent=True, masks=True)
    render_scenes(file, tmp_path / "solid", size=SIZE, workers=1)
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
    render_scenes(file, tmp_path, views=("top",), size=SIZE, workers=1, depth=True, masks=True)
    on, beside = (np.load(tmp_path / f"scene_000{k}_top.npz") for k in (1, 2))
    tops = [float(np.median(found["depth"][found["mask"] == 3])) for found in (on, beside)]
    assert tops[1] - tops[0] == pytest.approx(shape_of("book").height, abs=0.002)


@pytest.mark.slow
def test_the_graphics_card_draws_the_same_scene(tmp_path):
    """Or what stands for one; where there is none of either, the process says so."""
    file = scene_file(["mug", "crate"], [[(0.3, 0.4, 0.0), (0.7, 0.5, 0.4)]], shapes=[shape_of("mug"), CRATE])
    options = {"size": SIZE, "workers": 1, "depth": True, "masks": True}
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
