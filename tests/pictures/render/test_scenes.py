"""render_scenes: files, names, order, the same bytes from any number of workers, and nothing left after a failure.
Pictures of scenes that differ in how many things there are: what is not there is not in them. Pictures of plain
shapes and regions: where they are, what hides what, and that all of them are on the table. Objects with glTF meshes
are drawn as their files show them, or it is said why not.
"""

import json
import sys
import textwrap
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import scenegen
from scenegen.api.sample import sample
from scenegen.api.spec import load
from scenegen.errors import DataError, OutputError, RequestError, ScenegenError
from scenegen.errors.files import CANNOT_WRITE
from scenegen.geometry import Box, Circle, Polygon
from scenegen.looks.camera import USUAL_VIEWS, frame
from scenegen.looks.stage import overlaps_of, poses_of, stage_of, usual_size
from scenegen.pictures.figures.heatmap import heatmap
from scenegen.pictures.figures.sweep import sweep
from scenegen.pictures.render import scenes
from scenegen.pictures.render.files import FIRST_ID
from scenegen.pictures.render.scenes import models_of, render_scenes, still_outlines
from scenegen.processes import process
from scenegen.scenes import files
from scenegen.scenes.data import Pose, RegionData, footprint_data
from scenegen.scenes.formats.scenes_json import dump
from scenegen.scenes.formats.scenes_json import load as read
from scenegen.things import ASSETS, Shape

from ...things.gltf_files import BODY, document, inline, png
from .scenefiles import scene_file

SIZE = (96, 72)
NAMES = ("mug", "plate")
THREE = [[(0.2, 0.3, 0.1), (0.7, 0.6, 0.0)], [(0.4, 0.4, 0.1), (0.7, 0.2, 0.0)], [(0.9, 0.9, 1.0), (0.1, 0.1, 0.0)]]


@pytest.mark.long
def test_names_order_sizes_and_progress(tmp_path):
    seen = []
    file, out = scene_file(NAMES, THREE), tmp_path / "out"
    done = render_scenes(file, out, size=SIZE, progress=lambda *at: seen.append(at), workers=1)
    names = [f"scene_{number:04d}_{view}.png" for number in (1, 2, 3) for view in ("top", "perspective")]
    assert [path.name for path in done.pictures] == names
    assert done.sheet == tmp_path / "out" / "contact_sheet.png"
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == sorted(
        [*names, "cameras.json", "contact_sheet.png"]
    )
    for path in done.pictures:
        with Image.open(path) as picture:
            assert (picture.size, picture.mode, picture.format) == (SIZE, "RGB", "PNG")
    assert seen == [(1, 3), (2, 3), (3, 3)]


@pytest.mark.parametrize(
    ("x", "y", "size"),
    [
        (1.0, 1.0, (640, 480)),
        (1.2, 0.8, (768, 400)),
        (0.9, 0.35, (896, 352)),
        (3.0, 0.3, (960, 320)),
        (0.3, 1.0, (480, 640)),
    ],
)
def test_pictures_have_the_shape_of_their_table(x, y, size):
    file = scene_file(["bottle"], [[(0.2, 0.2, 0.0)]], x=(0.0, x), y=(0.0, y))
    assert usual_size(file) == size
    # The table reaches the frame's edges on at least one axis, and most of the way on the other.
    corners = frame("perspective", stage_of(file).corners(), size).project(stage_of(file).corners())
    filled = np.ptp(corners, axis=0) / size
    assert filled.max() > 0.9 and (filled.min() > 0.75 or max(x, y) > 2.0 * min(x, y))


@pytest.mark.long
def test_a_wide_table_is_drawn_wide_unless_a_size_is_given(tmp_path, monkeypatch):
    file = scene_file(["mug"], [[(0.2, 0.2, 0.0)]], x=(0.0, 1.4), y=(0.0, 0.7))
    assert usual_size(file) == (848, 352)
    monkeypatch.setattr(scenes, "usual_size", lambda file: (84, 36))  # drawn ten times as small
    (picture,) = render_scenes(file, tmp_path, views=("perspective",), workers=1).pictures
    assert Image.open(picture).size == (84, 36)


def test_the_elements_of_an_array_are_coloured_apart_on_request():
    file = scene_file([f"apple[{k}]" for k in (1, 2, 3)], [[(0.2 * k, 0.5, 0.0) for k in (1, 2, 3)]])
    assert len({thing.color for thing in stage_of(file).things}) == 1
    assert len({thing.color for thing in stage_of(file, distinct=True).things}) == 3


@pytest.mark.long
def test_one_worker_and_two_give_the_same_bytes(tmp_path):
    file = scene_file(NAMES, THREE)
    one = render_scenes(file, tmp_path / "one", size=SIZE, workers=1)
    two = render_scenes(file, tmp_path / "two", size=SIZE, workers=2)
    for a, b in zip((*one.pictures, one.sheet), (*two.pictures, two.sheet), strict=True):
        assert a.read_bytes() == b.read_bytes()
    assert len({path.read_bytes() for path in one.pictures}) == 6  # and they are six pictures, not one


@pytest.mark.slow
def test_every_asset_shows_up_in_its_colors(tmp_path):
    """On large tables, in both views: some pixels of each, of more than one colour."""
    for start in range(0, len(ASSETS), 25):
        names = list(ASSETS)[start : start + 25]
        row = [(0.3 + 0.5 * (k % 5), 0.3 + 0.5 * (k // 5), 0.5) for k in range(len(names))]
        file = scene_file(names, [row], x=(0.0, 2.6), y=(0.0, 2.6))
        done = render_scenes(file, tmp_path / str(start), size=(640, 480), workers=1, masks=True)
        _shows_its_colors(done.pictures, names)


def _shows_its_colors(pictures, names):
    for path in pictures:
        picture = np.asarray(Image.open(path)).astype(int)
        mask = np.load(path.with_suffix(".npz"))["mask"]
        for number, name in enumerate(names, start=2):
            seen = picture[mask == number]
            assert len(seen) > 15, (name, path.name)
            assert np.ptp(seen, axis=0).max() > 40, (name, path.name)


@pytest.mark.long
@pytest.mark.parametrize(
    ("count", "x", "y"), [(1, (-0.5, 0.5), (-0.3, 0.9)), (20, (-0.5, 0.5), (-0.3, 0.9)), (2, (0.0, 20.0), (0.0, 10.0))]
)
def test_any_number_of_objects_on_any_workspace(tmp_path, count, x, y):
    spots = np.linspace(0.0, 1.2, count)  # the last ones stand off the workspace
    row = [(x[0] + s * (x[1] - x[0]), y[0] + s * (y[1] - y[0]), 6.0 * s) for s in spots]
    done = render_scenes(scene_file([f"obj{k}" for k in range(count)], [row], x=x, y=y), tmp_path, size=SIZE, workers=1)
    for path in done.pictures:
        assert np.asarray(Image.open(path)).std() > 5


@pytest.mark.long
def test_poses_beyond_all_measure_are_drawn_without_harm(tmp_path):
    done = render_scenes(scene_file(NAMES, [[(1e300, -1e300, 1e9), (0.5, 0.5, 0.0)]]), tmp_path, size=SIZE, workers=1)
    assert len(done.pictures) == 2


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"views": ("Top",)}, "did you mean `top`?"),
        ({"views": ("perspectve",)}, "did you mean `perspective`?"),
        ({"views": ("zzz",)}, "`perspective`, `front` and `three-quarter`"),
        ({"views": ()}, "`views` is empty"),
        ({"size": (15, 480)}, "16 to 4096"),
        ({"size": (640, 4097)}, "16 to 4096"),
        ({"workers": 0}, "`workers` is 0"),
    ],
)
def test_bad_requests_are_refused_before_anything_is_written(tmp_path, options, words):
    with pytest.raises(RequestError, match=words):
        render_scenes(scene_file(NAMES, THREE), tmp_path / "out", **options)
    assert not (tmp_path / "out").exists()


def test_bad_data_is_refused_before_anything_is_written(tmp_path):
    with pytest.raises(DataError, match="no scenes"):
        render_scenes(scene_file(NAMES, []), tmp_path / "out")
    with pytest.raises(DataError, match="workspace is empty"):
        render_scenes(scene_file(NAMES, THREE, x=(1.0, 1.0)), tmp_path / "out")
    data = scene_file(NAMES, THREE).model_dump()
    del data["scenes"][1]["poses"]["plate"]
    with pytest.raises(DataError, match="scene 2 has no pose for `plate`"):
        render_scenes(type(scene_file(NAMES, THREE)).model_validate(data), tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_folder_that_cannot_be_made(tmp_path):
    with pytest.raises(OutputError, match="does not exist"):
        render_scenes(scene_file(NAMES, THREE), tmp_path / "no" / "such")
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError):
        render_scenes(scene_file(NAMES, THREE), tmp_path / "file")


@pytest.mark.long
@pytest.mark.parametrize("after", [3, 6])
def test_a_full_disk_leaves_nothing_behind(tmp_path, monkeypatch, after):
    """`after` = 6 is the contact sheet."""
    real, written = files._write, []

    def full(path, data):
        if len(written) == after:
            raise OutputError(CANNOT_WRITE(path=path, reason="no space left on device"))
        real(path, data)
        written.append(path)

    monkeypatch.setattr(files, "_write", full)
    with pytest.raises(OutputError, match="no space"):
        render_scenes(scene_file(NAMES, THREE), tmp_path / "new", size=SIZE, workers=1)
    assert len(written) == after
    assert not (tmp_path / "new").exists()


@pytest.mark.long
def test_a_failure_leaves_other_files_alone(tmp_path, monkeypatch):
    (tmp_path / "notes.txt").write_text("mine")

    def stop(done, total):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        render_scenes(scene_file(NAMES, THREE), tmp_path, size=SIZE, progress=stop, workers=1)
    assert [path.name for path in tmp_path.iterdir()] == ["notes.txt"]


def test_a_worker_that_dies_is_a_diagnostic(tmp_path, monkeypatch):
    program = [sys.executable, "-c", "import sys; sys.exit('out of paint')"]
    monkeypatch.setattr(process, "command", lambda module, load=(): program)
    with pytest.raises(ScenegenError, match="out of paint"):
        render_scenes(scene_file(NAMES, THREE), tmp_path / "out", size=SIZE, workers=1)
    assert not (tmp_path / "out").exists()


@pytest.mark.long
def test_standard_output_stays_clean_in_a_plain_script_that_uses_torch(tmp_path, warm):
    """No banner of pybullet, no pybullet in the caller, and no need for `if __name__ == "__main__"`."""
    (tmp_path / "file.json").write_text(scene_file(NAMES, THREE).model_dump_json())
    (tmp_path / "script.py").write_text(
        textwrap.dedent(
            """
            import sys
            from scenegen.pictures.render.scenes import render_scenes
            assert "pybullet" not in sys.modules
            import torch
            from pathlib import Path
            from scenegen.scenes.data import SceneFile
            torch.ones(200, 200) @ torch.ones(200, 200)
            file = SceneFile.model_validate_json(Path("file.json").read_text())
            done = render_scenes(file, Path("out"), size=(32, 24), workers=2)
            assert "pybullet" not in sys.modules
            print(len(done.pictures))
            """
        )
    )
    ran = warm.run(["script.py"], tmp_path)
    assert (ran.returncode, ran.stdout, ran.stderr) == (0, "6\n", "")


SPEC = "object block[1..2] = box(0.3, 0.3, 0.1), mug\nrequire noOverlap(objects)\ntask: leftOf(block[1], mug)\n"


@pytest.fixture(scope="module")
def scenes_numbers():
    return scenegen.sample(scenegen.parse(SPEC), (0.0, None), n=4, seed=1)


@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_a_stage_is_as_large_as_what_is_there(scenes_numbers):
    file = scenes_numbers.file()
    assert (np.isnan(poses_of(file)[..., 0]) == ~scenes_numbers.present).all()
    stage = stage_of(file)
    assert all(map(np.isfinite, (*stage.table, stage.height)))
    assert overlaps_of(file) == [[]] * 4
    assert heatmap(file).startswith(b"\x89PNG")


@pytest.mark.long
def test_masks_show_what_is_there(scenes_numbers, tmp_path):
    scenes_numbers.render(tmp_path / "p", views=("top",), size=(120, 90), masks=True, workers=1)
    for number, here in enumerate(scenes_numbers.present):
        with Image.open(tmp_path / "p" / f"scene_000{number + 1}_top_mask.png") as picture:
            seen = set(np.unique(np.asarray(picture)).tolist())
        shown = {k for k in range(3) if k + FIRST_ID in seen}
        assert shown == set(np.flatnonzero(here).tolist())


def test_a_sweep_keeps_the_number_of_things_of_the_hardest_scene(scenes_numbers):
    found, label = sweep(scenes_numbers, frames=3)
    hardest = int(scenes_numbers.phi["task"].argmin())
    assert label == "task" and not found.header.counts
    assert len(found.objects) == scenes_numbers.present[hardest].sum()
    assert (np.diff(found.phi["task"]) > 0.0).all()


@pytest.mark.long
def test_figures_take_them(scenes_numbers, tmp_path):
    (path, *_) = scenes_numbers[:2].figures(tmp_path, "topview")
    assert path.name == "scene_0001_topview.svg"
    assert ("block[2]" in path.read_text()) == scenes_numbers.present[0, 1]


SIZE_SHAPES = (320, 240)
EVERYTHING = Path(__file__).parents[2] / "things" / "everything.spec"
TRIANGLE = Polygon(((0.0, 0.0), (0.2, 0.0), (0.0, 0.1)))
FAR = Polygon(((0.20, 0.10), (0.36, 0.10), (0.36, 0.22), (0.20, 0.22)))  # beside its own origin


def region(name, footprint, x, y, theta=0.0):
    return RegionData(name=name, footprint=footprint_data(footprint), pose=Pose(x=x, y=y, theta=theta))


def drawn(file, folder, size=SIZE_SHAPES):
    """View -> picture of the first scene, and what projects points to pixels."""
    render_scenes(file, folder, size=size, workers=1)
    stage = stage_of(file)
    pictures = {}
    for view in USUAL_VIEWS:
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
    for view in USUAL_VIEWS:
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
    for view in USUAL_VIEWS:
        pixels = frame(view, stage.corners(), SIZE_SHAPES).project([(u, v, 0.0) for u, v in corners])
        assert (pixels > 0).all() and (pixels < SIZE_SHAPES).all()


def test_small_things_leave_the_margin_as_it_is():
    stage = stage_of(scene_file(["block"], [[(0.5, 0.5, 0.0)]]))
    assert stage.table == pytest.approx((-0.07, -0.07, 1.07, 1.07))


@pytest.mark.parametrize("height", [0.35, 0.6])
def test_the_top_of_a_tall_thing_is_in_the_picture(height):
    stage = stage_of(scene_file(["tower"], [[(0.5, 1.0, 0.0)]], shapes=[Shape("box", Box(0.1, 0.1), height)]))
    pixels = frame("perspective", stage.corners(), SIZE_SHAPES).project([(0.45, 1.0, height), (0.55, 1.0, height)])
    assert (pixels > 0).all() and (pixels < SIZE_SHAPES).all()


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
        columns, rows = np.clip(np.floor(camera.project(points)).astype(int), 0, np.array(SIZE_SHAPES) - 1).T
        found = sum(alike(color, thing.color) for color in picture[rows, columns])
        assert found > 6, item.name


TEXT = 'workspace [0, 1] x [0, 1]\nobject box = mesh("box.gltf") at (0.5, 0.5, EAST), plate\ntask: leftOf(plate, box)'


@pytest.fixture
def scenes_models(tmp_path):
    made = document(texture={"uri": "skin.png"}, buffers=[{"uri": inline(BODY), "byteLength": len(BODY)}])
    (tmp_path / "box.gltf").write_text(json.dumps(made))
    (tmp_path / "skin.png").write_bytes(png())
    (tmp_path / "s.spec").write_text(TEXT)
    return scenegen.sample(scenegen.load(tmp_path / "s.spec"), {"task": (0.2, None)}, n=1, seed=3)


def share(path, channel):
    """Of the pixels in which a colour is by far the strongest."""
    pixels = np.asarray(Image.open(path).convert("RGB")).astype(int)
    others = np.delete(pixels, channel, axis=2).max(axis=2)
    return float((pixels[..., channel] > others + 60).mean())


@pytest.mark.long
def test_textures_and_colours_are_those_of_the_file(scenes_models, tmp_path):
    given = {"views": ("front", "top"), "size": (160, 120), "workers": 1}
    plain = scenes_models.render(tmp_path / "plain", **given).pictures[0]
    drawn = scenes_models.render(tmp_path / "drawn", meshes=tmp_path, masks=True, **given)
    front, top = drawn.pictures
    # The front is the blue half of the texture; on top both halves meet.
    assert share(front, 2) > 0.01 and min(share(top, 1), share(top, 2)) > 0.002
    assert max(share(plain, 1), share(plain, 2)) < 0.0005
    (tmp_path / "box.gltf").write_text(json.dumps(document(buffers=[{"uri": inline(BODY), "byteLength": len(BODY)}])))
    red = scenes_models.render(tmp_path / "red", meshes=tmp_path, **given).pictures[0]
    assert share(red, 0) > 0.02 > share(drawn.pictures[0], 0)


def test_what_cannot_be_drawn_says_why(scenes_models, tmp_path):
    file = scenes_models.file()
    first, second = models_of(file, tmp_path)
    assert second is None and first[0].vertices[:, 2].min() == 0.0

    def refused(words, folder=tmp_path):
        with pytest.raises(DataError, match=words) as caught:
            models_of(file, folder)
        assert caught.value.diagnostics[0].code == "unusable-model"

    (tmp_path / "skin.png").rename(tmp_path / "other.png")
    refused("skin.png: no such file")
    (tmp_path / "sub").mkdir()
    refused("box.gltf: no such file", tmp_path / "sub")
    (tmp_path / "sub" / "box.gltf").symlink_to(tmp_path / "box.gltf")
    refused("outside the folder", tmp_path / "sub")
    nodes = [{"mesh": 0, "scale": [2, 2, 2]}]
    (tmp_path / "box.gltf").write_bytes(json.dumps(document(nodes=nodes)).encode())
    refused("has no data")
    made = document(nodes=nodes, buffers=[{"uri": inline(BODY), "byteLength": len(BODY)}])
    (tmp_path / "box.gltf").write_text(json.dumps(made))
    refused("its outline is not that of the scenes")


def test_scenes_without_a_gltf_mesh_have_nothing_to_draw(tmp_path):
    scenes = scenegen.sample(scenegen.parse("task: leftOf(mug, plate)"), {"task": (0.0, None)}, n=1, seed=1)
    with pytest.raises(DataError) as caught:
        scenes.render(tmp_path / "out", meshes=tmp_path)
    assert caught.value.diagnostics[0].code == "no-model"
    assert not (tmp_path / "out").exists()


def test_obj_stl_and_urdf_are_drawn_too(tmp_path):
    ring = "v 0 0 1\nv .2 0 1\nv .2 .2 1\nv 0 .2 1.1\n"
    (tmp_path / "a.obj").write_text(f"mtllib a.mtl\n{ring}usemtl red\nf 1 2 3 4\n")
    (tmp_path / "a.mtl").write_text("newmtl red\nKd 1 0 0\n")
    solid = '<geometry><box size=".1 .1 .1"/></geometry>'
    seen = '<geometry><mesh filename="package://props/a.obj"/></geometry>'
    text = f'<robot name="r"><link name="a"><visual>{seen}</visual><collision>{solid}</collision></link></robot>'
    (tmp_path / "r.urdf").write_text(text)
    (tmp_path / "s.spec").write_text(
        'object a = mesh("a.obj"), r = urdf("r.urdf"), b = mesh("c.dae", box(9 cm, 9 cm, 9 cm))\ntask: leftOf(a, r)'
    )
    scenes = scenegen.sample(scenegen.load(tmp_path / "s.spec"), {"task": (0.2, None)}, n=1, seed=3)
    mesh, robot, other = models_of(scenes.file(), tmp_path)
    assert other is None and still_outlines(scenes.file(), tmp_path) == ("b",)
    assert mesh[0].color == (1.0, 0.0, 0.0) and np.allclose(mesh[0].vertices[:, 2], (0, 0, 0, 0.1))
    assert np.allclose(robot[0].vertices[:, 2], (1.05, 1.05, 1.05, 1.15))  # the collision box stands on the table
    (tmp_path / "a.mtl").unlink()
    with pytest.raises(DataError, match=r"a.obj, the mesh of `a`, cannot be drawn: line 1: a.mtl: no such file"):
        models_of(scenes.file(), tmp_path)
    (tmp_path / "a.mtl").symlink_to("/etc/passwd")
    with pytest.raises(DataError, match=r"line 1: a.mtl is outside the folder"):
        models_of(scenes.file(), tmp_path)
    (tmp_path / "a.obj").write_text(f"mtllib \x1b[31mred\n{ring}f 1 2 3 4\n")
    with pytest.raises(DataError, match=r"line 1: \?\[31mred: no such file"):  # nothing that a terminal obeys
        models_of(scenes.file(), tmp_path)


def test_a_texture_that_ends_early_is_refused_before_anything_is_drawn(scenes_models, tmp_path):
    (tmp_path / "skin.png").write_bytes(png(64, 64)[:60])
    with pytest.raises(DataError, match="texture 0 in it is damaged or cut short"):
        models_of(scenes_models.file(), tmp_path)
