"""render_scenes: files, names, order, the same bytes from any number of workers, and nothing left after a failure."""

import sys
import textwrap

import numpy as np
import pytest
from PIL import Image

from scenegen.errors import DataError, OutputError, RequestError, ScenegenError
from scenegen.errors.files import CANNOT_WRITE
from scenegen.processes import process
from scenegen.scenes import files
from scenegen.scenes.stage import stage_of
from scenegen.show.looks.camera import frame
from scenegen.show.render import scenes
from scenegen.show.render.files import usual_size
from scenegen.show.render.scenes import render_scenes
from scenegen.things import ASSETS

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
            from scenegen.show.render.scenes import render_scenes
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
