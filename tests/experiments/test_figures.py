"""Figures say what the scenes say."""

import io

import numpy as np
import pytest
from PIL import Image

from experiments.charts import small_png
from experiments.figures import orderings as fig9
from experiments.figures.isomap import Query, isomap
from experiments.figures.overlay import overlay
from experiments.figures.steering import STEPS
from experiments.figures.strip import strips
from experiments.measure import phi_of
from experiments.problems import PROBLEMS
from experiments.semantics import PLATE, TEXT, way


def pixels(png):
    return np.asarray(Image.open(io.BytesIO(png)).convert("RGB"))


class Recorder:
    """Axes that note the lines drawn on them."""

    def __init__(self):
        self.lines = []

    def plot(self, x, y, **style):
        self.lines.append((np.asarray(x), np.asarray(y), style))


@pytest.mark.parametrize(
    "x, y, place, start, end",
    [
        ([0.1, 0.5, 0.55], [0.2, 0.3, 0.9], 0, (0.5, 0.3), (0.55, 0.3)),
        ([0.9, 0.6, 0.55], [0.2, 0.3, 0.9], 1, (0.6, 0.3), (0.55, 0.3)),
        ([0.1, 0.5, 0.2], [0.2, 0.25, 0.9], 2, (0.1, 0.2), (0.1, 0.25)),
        ([0.1, 0.5, 0.2], [0.9, 0.4, 0.35], 3, (0.5, 0.4), (0.5, 0.35)),
    ],
)
def test_the_red_bar_is_as_long_as_phi_and_at_the_closest_pair(x, y, place, start, end):
    axes = Recorder()
    fig9._bar(axes, np.array(x), np.array(y), place, 0.05)
    bar_x, bar_y, style = axes.lines[0]
    assert style["color"] == fig9.RED
    assert np.allclose([bar_x[0], bar_y[0]], start) and np.allclose([bar_x[1], bar_y[1]], end)


@pytest.mark.long
def test_an_ordering_that_is_missing_is_said():
    rng = np.random.default_rng(0)
    scene = np.sort(rng.random(3))[:, None] * [1, 0, 0] + [0, 0.5, 0]
    one = scene.reshape(-1, 1)
    with_all = {0.05: np.concatenate([one, one[[6, 7, 8, 3, 4, 5, 0, 1, 2]]], axis=1)}
    assert pixels(fig9.orderings({0.05: one}, "")).shape == pixels(fig9.orderings(with_all, "")).shape
    assert (pixels(fig9.orderings({0.05: one}, "")) != pixels(fig9.orderings(with_all, ""))).any()


def test_the_mug_goes_round_the_plate():
    from scenegen.api.spec import parse

    share, rows = way(11)
    phi = dict(zip(("close", "right", "left"), phi_of(parse(TEXT), rows), strict=True))
    assert np.allclose(phi["right"], rows[0] - PLATE[0]) and np.allclose(phi["left"], PLATE[0] - rows[0])
    assert np.allclose(phi["close"], 0.25 - np.hypot(rows[0] - PLATE[0], rows[1] - PLATE[1]))
    assert (np.diff(rows[0]) > 0).all() and phi["close"].argmax() == 5 and share[5] == 0.5
    assert phi["close"][0] < 0 < phi["close"][5]


def test_steering_asks_for_what_can_be_had():
    """A distance d between the centres allows every phi of the task from -d to d / sqrt(2)."""
    for label, steps in STEPS.items():
        held = {pair[1 if label == "task" else 0] for pair in steps}
        assert len(held) == 1 and min(held) >= 0.0
        assert all(-(safe + 0.25) <= task <= (safe + 0.25) / np.sqrt(2.0) for task, safe in steps)


@pytest.mark.long
def test_panels_of_points():
    spec = PROBLEMS["exp2"].load()
    rng = np.random.default_rng(0)
    scenes = rng.random((12, 40))
    full, empty = (pixels(overlay(spec, {"a": scenes[:, :n]}, 700)) for n in (40, 0))
    assert full.shape == empty.shape and (full != empty).sum() > 100
    assert (pixels(overlay(spec, {"a": scenes}, 20)) == pixels(overlay(spec, {"a": scenes[:, :20]}, 20))).all()
    phi = rng.normal(0.19, 0.01, 40)
    query = Query("here", 0.19, {"truth": (scenes[:6], phi), "none": (scenes[:6, :0], phi[:0])}, "truth")
    assert pixels(isomap([query], 30, 6)).std() > 0.0


def test_pictures_side_by_side():
    red, blue = (Image.new("RGB", (40, 30), color) for color in ("#ff0000", "#0000ff"))
    found = pixels(strips([("a row", [(red, ["left"]), (blue, ["right", "below"])]), ("", [(blue, ["x"])])]))
    assert (found == (255, 0, 0)).all(axis=2).sum() == 40 * 30 and (found == (0, 0, 255)).all(
        axis=2
    ).sum() == 2 * 40 * 30


def test_small_pictures_keep_their_colours():
    gradient = Image.linear_gradient("L").convert("RGB")
    assert abs(pixels(small_png(gradient)).astype(int) - np.asarray(gradient)).max() <= 2
