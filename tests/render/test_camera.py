"""The one place that turns metres into pixels, and a proof from pictures that it does not swap or mirror."""

import numpy as np
import pytest
from PIL import Image

from scenegen.scenes.stage import poses_of, stage_of
from scenegen.show.looks.camera import VIEWS, frame
from scenegen.show.render.scenes import render_scenes
from scenegen.things import ASSETS
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
