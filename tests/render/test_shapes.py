"""Pictures of plain shapes and regions: where they are, what hides what, and that all of them are on the table."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from scenegen.api.sample import sample
from scenegen.api.spec import load
from scenegen.errors import DataError
from scenegen.geometry import Box, Circle, Polygon
from scenegen.scenes.data import Pose, RegionData, footprint_data
from scenegen.scenes.formats.scenes_json import dump
from scenegen.scenes.formats.scenes_json import load as read
from scenegen.scenes.stage import stage_of
from scenegen.show.figures.heatmap import heatmap
from scenegen.show.looks.camera import USUAL, frame
from scenegen.show.render.scenes import render_scenes
from scenegen.things import Shape

from .scenefiles import scene_file

SIZE = (320, 240)
EVERYTHING = Path(__file__).parents[1] / "assets" / "everything.spec"
TRIANGLE = Polygon(((0.0, 0.0), (0.2, 0.0), (0.0, 0.1)))
FAR = Polygon(((0.20, 0.10), (0.36, 0.10), (0.36, 0.22), (0.20, 0.22)))  # beside its own origin


def region(name, footprint, x, y, theta=0.0):
    return RegionData(name=name, footprint=footprint_data(footprint), pose=Pose(x=x, y=y, theta=theta))


def drawn(file, folder, size=SIZE):
    """View -> picture of the first scene, and what projects points to pixels."""
    render_scenes(file, folder, size=size, workers=1)
    stage = stage_of(file)
    pictures = {}
    for view in USUAL:
        with Image.open(folder / f"scene_0001_{view}.png") as picture:
            pictures[view] = np.asarray(picture).astype(float), frame(view, stage.corners(), size)
    return pictures


def at(picture, camera, point):
    column, row = np.floor(camera.project([point])[0]).astype(int)
    return picture[row, column]


def alike(color, other):
    """Whether two colours have the same tone: light and shadow change their brightness alone."""
    a, b = (np.asarray(one) / np.linalg.norm(one) for one in (color, other))
    return np.linalg.norm(a - b) < 0.10


@pytest.mark.long
def test_a_prism_stands_where_the_frame_of_its_corners_says(tmp_path):
    """Headings turn it about the origin of the corners, which lies beside it."""
    shape = Shape("prism", FAR, 0.03)
    x, y, theta = 0.5, 0.5, 2.0
    file = scene_file(["slab"], [[(x, y, theta)]], shapes=[shape])
    (thing,) = stage_of(file).things
    turn = np.array([[np.cos(theta), -np.sin(theta)], [np.sin(theta), np.cos(theta)]])
    for picture, camera in drawn(file, tmp_path).values():
        for inside in ((0.21, 0.11), (0.35, 0.12), (0.35, 0.21), (0.21, 0.21)):
            u, v = turn @ inside + (x, y)
            assert alike(at(picture, camera, (u, v, 0.03)), thing.color)
        for outside in ((0.0, 0.0), (0.17, 0.16), (0.28, 0.05), (0.40, 0.16)):
            u, v = turn @ outside + (x, y)
            assert not alike(at(picture, camera, (u, v, 0.0)), thing.color)


@pytest.mark.long
def test_footprints_and_heights_are_drawn_to_size(tmp_path):
    """Points just inside and just outside of each outline, at the height of its top and on the table."""
    box, post, wedge = (
        Shape("box", Box(0.3, 0.1), 0.05),
        Shape("cylinder", Circle(0.1), 0.02),
        Shape("urdf", TRIANGLE, 0.05),
    )
    tower = Shape("box", Box(0.1, 0.1), 0.35)
    cases = [
        (box, (0.25, 0.2), [(0.14, 0.04), (-0.14, -0.04)], [(0.0, 0.07), (0.17, 0.0)]),
        (post, (0.75, 0.2), [(0.09, 0.0), (0.0, -0.09)], [(0.12, 0.0), (0.085, 0.085)]),
        (wedge, (0.2, 0.6), [(0.02, 0.01), (0.16, 0.01), (0.01, 0.085)], [(0.11, 0.06), (-0.02, 0.0)]),
        (tower, (0.75, 0.75), [(0.04, 0.04), (-0.04, -0.04)], []),
    ]
    names = ["box", "post", "wedge", "tower"]
    row = [(*place, 0.0) for _, place, _, _ in cases]
    file = scene_file(names, [row], shapes=[shape for shape, *_ in cases])
    pictures = drawn(file, tmp_path)
    for thing, (shape, (x, y), inside, outside) in zip(stage_of(file).things, cases, strict=True):
        for picture, camera in pictures.values():
            for dx, dy in inside:
                assert alike(at(picture, camera, (x + dx, y + dy, shape.height)), thing.color)
        picture, camera = pictures["top"]
        for dx, dy in outside:
            assert not alike(at(picture, camera, (x + dx, y + dy, 0.0)), thing.color)


@pytest.mark.long
def test_regions_lie_on_the_table_under_the_things(tmp_path):
    """Seen in both views where they are and nowhere else, in a colour of their own, and hidden by what stands there."""
    regions = [
        region("mat", Box(0.4, 0.2), 0.5, 0.2),
        region("disc", Circle(0.1), 0.2, 0.6),
        region("corner", TRIANGLE, 0.6, 0.6, np.pi / 2),
    ]
    row = [[(0.5, 0.2, 0.0)]]
    shapes = [Shape("box", Box(0.1, 0.1), 0.001)]
    bare = drawn(scene_file(["sheet"], row, shapes=shapes), tmp_path / "bare")
    with_regions = drawn(scene_file(["sheet"], row, shapes=shapes, regions=regions), tmp_path / "regions")
    points = {
        "mat": [(0.35, 0.15), (0.65, 0.25), (0.31, 0.11)],
        "disc": [(0.2, 0.6), (0.27, 0.6), (0.2, 0.53)],
        "corner": [(0.58, 0.62), (0.58, 0.75), (0.53, 0.61)],
        "": [(0.28, 0.2), (0.5, 0.33), (0.28, 0.68), (0.7, 0.62), (0.54, 0.76), (0.9, 0.9)],
    }
    for view in USUAL:
        (before, camera), (after, again) = bare[view], with_regions[view]
        assert np.array_equal(camera.view, again.view)
        tones = {}
        for name, places in points.items():
            for x, y in places:
                changed = np.abs(at(after, camera, (x, y, 0.0)) - at(before, camera, (x, y, 0.0))).max()
                assert changed > 8 if name else changed == 0, (view, name, x, y)
            tones[name] = at(after, camera, (*places[0], 0.0))
        for a, b in (("mat", "disc"), ("disc", "corner"), ("mat", "corner")):
            assert np.abs(tones[a] - tones[b]).max() > 8
        for x, y in ((0.47, 0.17), (0.53, 0.23)):  # on the sheet, a millimetre above the mat
            assert np.array_equal(at(after, camera, (x, y, 0.001)), at(before, camera, (x, y, 0.001)))


def test_the_table_and_the_picture_hold_all_of_every_thing(tmp_path):
    """A wide tray turned on the edge of the workspace, a prism beside its origin, and a region that reaches over."""
    shapes = [Shape("box", Box(0.5, 0.3), 0.04), Shape("prism", FAR, 0.05)]
    poses = [(0.98, 0.02, np.pi / 4), (0.9, 0.9, 0.5)]
    file = scene_file(["tray", "slab"], [poses], shapes=shapes, regions=[region("strip", Box(0.2, 1.4), 0.1, 0.5)])
    stage = stage_of(file)
    x0, y0, x1, y1 = stage.table
    corners = []
    for (x, y, theta), local in zip(
        poses, [[(a, b) for a in (-0.25, 0.25) for b in (-0.15, 0.15)], FAR.vertices], strict=True
    ):
        corners += [
            (x + a * np.cos(theta) - b * np.sin(theta), y + a * np.sin(theta) + b * np.cos(theta)) for a, b in local
        ]
    corners += [(0.0, -0.2), (0.2, 1.2)]
    for u, v in corners:
        assert x0 < u < x1 and y0 < v < y1
    for view in USUAL:
        pixels = frame(view, stage.corners(), SIZE).project([(u, v, 0.0) for u, v in corners])
        assert (pixels > 0).all() and (pixels < SIZE).all()


def test_small_things_leave_the_margin_as_it_is():
    stage = stage_of(scene_file(["block"], [[(0.5, 0.5, 0.0)]]))
    assert stage.table == pytest.approx((-0.07, -0.07, 1.07, 1.07))


@pytest.mark.parametrize("height", [0.35, 0.6])
def test_the_top_of_a_tall_thing_is_in_the_picture(height):
    stage = stage_of(scene_file(["tower"], [[(0.5, 1.0, 0.0)]], shapes=[Shape("box", Box(0.1, 0.1), height)]))
    pixels = frame("perspective", stage.corners(), SIZE).project([(0.45, 1.0, height), (0.55, 1.0, height)])
    assert (pixels > 0).all() and (pixels < SIZE).all()


@pytest.mark.long
def test_the_smallest_and_largest_sizes_are_drawn_without_harm(tmp_path):
    shapes = [
        Shape("box", Box(1e-6, 1e-6), 1e-6),
        Shape("box", Box(1e3, 1e3), 1e3),
        Shape("cylinder", Circle(1e-6), 1e3),
        Shape("prism", Polygon(((0.0, 0.0), (1e3, 0.0), (1e3, 1e-3))), 1e-6),
        Shape("prism", Polygon(((-1e6, -1e6), (1e6, -1e6), (0.0, 1e6))), 1e3),
        Shape("mug", Circle(1e3), 1e3),
    ]
    row = [(0.1 * k, 0.1 * k, 1.0) for k in range(len(shapes))]
    regions = [region(f"r{k}", shape.footprint, *row[k]) for k, shape in enumerate(shapes)]
    file = scene_file([f"thing{k}" for k in range(len(shapes))], [row], shapes=shapes, regions=regions)
    assert len(render_scenes(file, tmp_path, size=(96, 72), workers=1).pictures) == 2


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"shapes": [Shape("mug", Circle(1e300), 0.1)]}, "`mug` is 2e\\+300 m"),
        ({"shapes": [Shape("mug", Circle(0.1), 1e-300)]}, "`mug` is 1e-300 m"),
        ({"x": (0.0, 1e300)}, "the workspace or a region is 1e\\+300 m away"),
        ({"x": (0.0, 1e-300)}, "the workspace is 1e-300 m wide"),
        ({"regions": [region("r", Circle(0.1), 0.0, -1e300)]}, "the workspace or a region is 1e\\+300 m away"),
        ({"regions": [region("r", Circle(1e300), 0.0, 0.0)]}, "the region `r` is 2e\\+300 m large"),
    ],
)
def test_sizes_that_no_spec_can_say_are_refused(changed, said, tmp_path):
    file = scene_file(["mug"], [[(0.5, 0.5, 0.0)]], **changed)
    for draws in (lambda: render_scenes(file, tmp_path / "out"), lambda: heatmap(file)):
        with pytest.raises(DataError, match=said) as caught:
            draws()
        assert caught.value.diagnostics[0].help and not list(tmp_path.iterdir())


@pytest.mark.long
def test_a_workspace_far_out_is_drawn_as_one_at_the_origin(tmp_path):
    """Coordinates of 65 km have no millimetres in single precision. Cameras are told in the world's own frame."""
    pictures, cameras = [], []
    for name, away in (("near", 0.0), ("far", 65536.0)):
        file = scene_file(
            ["mug", "plate"],
            [[(away + 0.25, 0.5 - away, 1.0), (away + 0.75, 0.5 - away, 0.0)]],
            x=(away, away + 1.0),
            y=(-away, 1.0 - away),
            regions=[region("mat", Box(0.5, 0.25), away + 0.5, 0.25 - away)],
        )
        made = render_scenes(file, tmp_path / name, views=("perspective",), size=(96, 72), masks=True, workers=1)
        pictures.append([made.pictures[0].read_bytes(), made.beside[0].read_bytes()])
        cameras.append(frame("perspective", stage_of(file).corners(), (96, 72)))
    assert pictures[0] == pictures[1]
    there = cameras[1].project([(65536.25, 0.5 - 65536.0, 0.0)])
    assert there == pytest.approx(cameras[0].project([(0.25, 0.5, 0.0)]), abs=1e-3)


def test_a_region_is_cut_off_where_the_table_ends_and_a_thing_is_not():
    reach = region("reach", Circle(0.6), 0.5, 0.0)
    assert stage_of(scene_file(["mug"], [[(0.5, 0.5, 0.0)]], regions=[reach])).table[1] == pytest.approx(-0.32)
    assert stage_of(scene_file(["mug"], [[(0.5, -0.4, 0.0)]], regions=[reach])).table[1] < -0.46


@pytest.fixture(scope="module")
def everything():
    return sample(load(EVERYTHING), {"task": (0.05, None)}, n=2, seed=1).file()


@pytest.mark.long
def test_a_scene_file_with_everything_reads_back_and_is_drawn_the_same(everything, tmp_path):
    data = dump(everything)
    again = read(data, "x.json")
    assert again == everything and dump(again) == data
    kinds = {item.name: (item.shape.asset, item.shape.footprint.kind) for item in again.objects}
    assert kinds["wedge"] == ("prism", "polygon")
    assert kinds["server"] == ("urdf", "polygon")
    assert [part.footprint.kind for part in again.regions] == ["box", "circle", "polygon"]
    one = render_scenes(everything, tmp_path / "one", size=(96, 72), workers=1)
    two = render_scenes(again, tmp_path / "two", size=(96, 72), workers=2)
    for a, b in zip((*one.pictures, one.sheet), (*two.pictures, two.sheet), strict=True):
        assert a.read_bytes() == b.read_bytes()


@pytest.mark.long
def test_every_thing_of_that_file_can_be_seen_from_above(everything, tmp_path):
    picture, camera = drawn(everything, tmp_path)["top"]
    stage = stage_of(everything)
    near = [(dx, dy) for dx in np.linspace(-0.12, 0.12, 25) for dy in np.linspace(-0.12, 0.12, 25)]
    for item, thing in zip(everything.objects, stage.things, strict=True):
        pose = everything.scenes[0].poses[item.name]
        points = [(pose.x + dx, pose.y + dy, item.shape.height) for dx, dy in near]
        columns, rows = np.clip(np.floor(camera.project(points)).astype(int), 0, np.array(SIZE) - 1).T
        found = sum(alike(color, thing.color) for color in picture[rows, columns])
        assert found > 6, item.name
