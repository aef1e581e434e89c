"""MP4 files: what they show, for how long, and what is said without PyAV."""

import io

import numpy as np
import pytest
from PIL import Image

import scenegen
from scenegen import needs
from scenegen.show.figures.strip import HELD, STEP, video

COLORS = (200, 30, 30), (30, 160, 60), (40, 60, 200)


def pages(size=(61, 43)):
    return [Image.new("RGB", size, color) for color in COLORS]


def test_every_page_is_shown_and_the_last_one_is_held():
    av = pytest.importorskip("av")
    data = video(pages(), STEP, HELD)
    assert data == video(pages(), STEP, HELD)
    assert data.index(b"moov") < data.index(b"mdat")  # it plays before the whole file is there
    with av.open(io.BytesIO(data)) as file:
        stream = file.streams.video[0]
        assert (stream.codec_context.name, stream.width, stream.height) == ("h264", 62, 44)
        assert float(stream.duration * stream.time_base) * 1000 == pytest.approx(2 * STEP + HELD, abs=STEP)
        shown = [np.asarray(frame.to_image()).astype(int) for frame in file.decode(stream)]
    assert len(shown) == 2 + -(-HELD // STEP)
    for frame, color in zip(shown, [*COLORS, COLORS[-1]], strict=False):
        assert np.abs(frame[5:35, 5:55] - color).max() < 16
    assert (shown[0][-1, 5:55] > 180).any()  # the row that makes the height even is paper


@pytest.fixture(scope="module")
def motions():
    spec = scenegen.parse("object mug\ntime 1 steps\nrequire speed(mug) <= 30 cm/s\ntask: eventually moved(mug, 5 cm)")
    return scenegen.sample_motions(spec, n=2)


def test_without_pyav_one_sentence_says_what_to_install(motions, tmp_path, monkeypatch):
    monkeypatch.setattr(needs, "found", lambda package: package != "av")
    for draw in (lambda: motions.animate(tmp_path / "x.mp4", 1), lambda: motions.figures(tmp_path / "all", "mp4")):
        with pytest.raises(scenegen.RequestError, match=r"av is needed for MP4 files, and is not installed") as error:
            draw()
        assert 'pip install "scenegen[video]"' in str(error.value)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("name", "motion", "code"),
    [
        ("x.gif", None, "which-motion"),
        ("x.gif", 0, "no-such-motion"),
        ("x.gif", 3, "no-such-motion"),
        ("x.mov", 1, "unknown-choice"),
        ("x", 1, "unknown-choice"),
        ("none/x.gif", 1, "cannot-write"),
    ],
)
def test_what_cannot_be_drawn(motions, tmp_path, name, motion, code):
    with pytest.raises(scenegen.ScenegenError) as error:
        motions.animate(tmp_path / name, motion)
    assert error.value.diagnostics[0].code == code
    assert not list(tmp_path.iterdir())
