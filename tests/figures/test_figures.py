"""Strips, animations, heat maps, the sheet of the library: what they show, not merely that they are files."""

import io
import json

import numpy as np
import pytest
from PIL import Image

from scenegen.scenes.data import Pose, RegionData, footprint_data
from scenegen.show.figures import heatmap as heat
from scenegen.show.figures.strip import EDGE, FOOT, GAP, animation, strip
from scenegen.show.render.gallery import gallery, library_sheet, measures
from scenegen.show.render.scenes import render_scenes
from scenegen.things import ASSETS, Box, Circle
from tests.render.scenefiles import scene_file

RED, GREEN, BLUE = (200, 30, 30), (30, 160, 60), (40, 60, 200)


def opened(data):
    with Image.open(io.BytesIO(data)) as image:
        return np.asarray(image.convert("RGB")).astype(int)


def frames(*colors, size=(60, 40)):
    return [Image.new("RGB", size, color) for color in colors]


def test_a_strip_holds_every_frame_in_order_with_its_phi():
    image = opened(strip(frames(RED, GREEN, BLUE), [-0.4, -0.1, 0.1], "task", ""))
    assert image.shape == (2 * EDGE + 40 + FOOT, 2 * EDGE + 3 * 60 + 2 * GAP, 3)
    for number, color in enumerate((RED, GREEN, BLUE)):
        x = EDGE + number * (60 + GAP)
        assert (image[EDGE : EDGE + 40, x : x + 60] == color).all()
    bars = [
        (np.abs(image[EDGE + 40 + 11, EDGE + k * (60 + GAP) :][:60] - (228, 228, 226)).max(axis=1) > 20).sum()
        for k in range(3)
    ]
    assert bars[0] < bars[1] < bars[2] == 60


def test_a_bar_is_red_as_long_as_the_formula_is_violated():
    image = opened(strip(frames(BLUE, BLUE), [-0.001, 0.001], "task", "a title"))
    left = image[-EDGE - FOOT + 11, EDGE + 2]
    right = image[-EDGE - FOOT + 11, EDGE + 60 + GAP + 2]
    assert left[0] > left[1] + 50 and right[1] > right[0] + 50


def test_an_animation_shows_every_frame_and_rests_on_the_last():
    data = animation(frames(RED, GREEN, BLUE), [-0.4, -0.1, 0.1], "task")
    with Image.open(io.BytesIO(data)) as image:
        assert (image.format, image.n_frames, image.info["loop"]) == ("GIF", 3, 0)
        times = []
        for number, color in enumerate((RED, GREEN, BLUE)):
            image.seek(number)
            times.append(image.info["duration"])
            shown = np.asarray(image.convert("RGB"))[5:35, 5:55].astype(int)
            # One palette, of the first and the last frame, for all.
            assert np.abs(shown - color).max() < (16 if color != GREEN else 255)
    assert times[0] == times[1] < times[2]


def test_density_is_greatest_where_most_scenes_are():
    generator = np.random.default_rng(0)
    many, few = (generator.normal((x, y, 0.0), 0.01, (n, 3)) for x, y, n in ((0.2, 0.7, 90), (1.5, 0.3, 30)))
    found = heat.density(np.concatenate([many, few]), (0.0, 0.0, 2.0, 1.0), (50, 100), 0.03)
    assert found.max() == 1.0 and found.min() >= 0.0
    for start, x, y in ((0, 0.2, 0.7), (60, 1.5, 0.3)):
        part = found[:, start : start + 40]
        row, column = np.unravel_index(part.argmax(), part.shape)
        assert ((column + start + 0.5) * 0.02, 1.0 - (row + 0.5) * 0.02) == pytest.approx((x, y), abs=0.03)
    assert found[:, 60:].max() == pytest.approx(1 / 3, abs=0.05)
    assert (heat.density(np.empty((0, 3)), (0.0, 0.0, 1.0, 1.0), (9, 9), 0.1) == 0.0).all()


def test_a_heat_map_has_a_panel_per_object_with_its_places_its_regions_and_its_heading():
    generator = np.random.default_rng(1)
    rows = [
        [(x, y, t), (1.0 - x, 1.0 - y, u)]
        for x, y, t, u in zip(
            generator.normal(0.25, 0.02, 60),
            generator.normal(0.25, 0.02, 60),
            generator.normal(1.6, 0.1, 60),
            generator.uniform(0.0, 6.28, 60),
            strict=True,
        )
    ]
    mat = RegionData(name="mat", footprint=footprint_data(Box(0.2, 0.2)), pose=Pose(x=0.8, y=0.2, theta=0.0))
    disc = RegionData(name="disc", footprint=footprint_data(Circle(0.1)), pose=Pose(x=0.2, y=0.8, theta=0.0))
    image = opened(heat.heatmap(scene_file(["mug", "apple"], rows, regions=[mat, disc])))
    blank = opened(heat.heatmap(scene_file(["mug", "apple"], [[(9.0, 9.0, 0.0), (9.0, 9.0, 0.0)]])))
    assert image.shape == blank.shape
    panels = [image[-328:-28, 28 + k * 318 :][:, :300] for k in (0, 1)]

    def ink(panel, x, y):
        return np.abs(panel[round((1 - y) * 299), round(x * 299)] - heat.BARE).sum()

    for panel, (x, y) in zip(panels, ((0.25, 0.25), (0.75, 0.75)), strict=True):
        assert ink(panel, x + 0.03, y) > 150 > 20 > ink(panel, 0.5, 0.5)
        assert ink(panel, 0.8, 0.2) > 20 and ink(panel, 0.2, 0.8) > 20  # both regions
    white = [(panel == 255).all(axis=2).sum() for panel in panels]
    assert white[0] > 50 and white[1] == 0  # headings of the mug agree, of the apple they do not


def test_a_heat_map_of_a_thread_has_room_for_its_title():
    """A spread of 20 km over a workspace of a metre is not worked out metre by metre; titles go on a second line."""
    file = scene_file(["mug"], [[(5e4, 0.5, 0.0)]], x=(0.0, 1e5), y=(0.0, 1.0))
    title = "A mug somewhere along a road that is far longer than it is wide."
    low = opened(heat.heatmap(file))
    high = opened(heat.heatmap(file.model_copy(update={"spec": file.spec.model_copy(update={"title": title})})))
    assert high.shape[0] > low.shape[0] and high.shape[1] == low.shape[1]


@pytest.mark.long
def test_the_gallery_shows_every_asset_whole_and_large():
    names = ["pen", "laptop"]
    found = gallery(names, (96, 72), workers=1)
    assert list(found) == names
    for name in names:
        picture = opened(found[name])
        assert picture.shape == (72, 96, 3)
        saturated = np.ptp(picture.astype(int), axis=2) > 12  # the ground behind is grey
        assert not saturated[0].any() and saturated.any(axis=0).mean() > 0.7
    assert found["pen"] != found["laptop"]
    sheet = opened(library_sheet(found))
    assert sheet.std() > 10
    assert measures(ASSETS["mug"]) == "12.4 x 12.4 x 9.5 cm, 350 g"


@pytest.mark.long
def test_unknown_objects_are_blocks_with_their_names_beside_them(tmp_path):
    """Known ones have none; and no name is written where programs are to learn from the pictures."""
    rows = [[(0.3, 0.4, 0.0), (0.7, 0.6, 0.0)]]
    renders = {}
    options = {"size": (200, 150), "workers": 1, "views": ("top",)}
    for kind, names in (("named", ["mug", "gizmo"]), ("plain", ["mug", "gizmo"]), ("known", ["mug", "block"])):
        done = render_scenes(scene_file(names, rows), tmp_path / kind, masks=kind == "plain", **options)
        renders[kind] = opened(done.pictures[0].read_bytes())
        assert json.loads(done.cameras.read_text())["ids"]["3"] == names[1]
    white = {key: (picture > 245).all(axis=2).sum() for key, picture in renders.items()}
    assert white["named"] > white["plain"] + 60
    assert abs(white["known"] - white["plain"]) < 20
