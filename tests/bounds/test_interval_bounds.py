"""No scene that hypothesis finds lies outside the interval bounds, and where no coordinate repeats they are exact."""

import math
import runpy
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scenegen.geometry import NUMPY
from scenegen.geometry.workspace import Workspace
from scenegen.lang.checker import check_text
from scenegen.lang.formula.interpret import evaluate
from scenegen.search import label_bounds, node_bounds, spec_bounds

from ..laws import examples

made = runpy.run_path(str(Path(__file__).parents[1] / "robustness" / "formulas.py"))
specs, seeds = made["specs"], made["seeds"]
EVERYWHERE = Workspace((-0.2, 1.2), (-0.2, 1.2))


def sub_boxes(rng, count, boxes, width):
    lowest, highest = EVERYWHERE.box(count)
    ends = rng.uniform(size=(2, 3 * count, boxes))
    low, high = ends.min(0), ends.max(0)
    high = np.minimum(low + width * (high - low), 1.0)
    span = (highest - lowest)[:, None]
    return lowest[:, None] + low * span, lowest[:, None] + high * span


def inside(rng, lowest, highest, scenes):
    """(3N, K, scenes): corners first, then uniform scenes, then the middle."""
    where = rng.uniform(size=(*lowest.shape, scenes))
    corners = scenes // 2
    where[..., :corners] = where[..., :corners].round()
    where[..., -1] = 0.5
    rows = lowest[..., None] + where * (highest - lowest)[..., None]
    return np.clip(rows, lowest[..., None], highest[..., None])


@pytest.mark.long
@settings(max_examples=examples(120), deadline=None, derandomize=True)
@given(specs(labels=("task", "safe")), seeds, st.sampled_from([1.0, 0.3, 1e-3, 1e-9, 0.0]))
def test_no_scene_of_a_box_lies_outside_its_bounds(spec, seed, width):
    rng = np.random.default_rng(seed)
    lowest, highest = sub_boxes(rng, len(spec.objects), 4, width)
    rows = inside(rng, lowest, highest, 32)
    values = evaluate(spec.core, list(rows), NUMPY)
    for node, value, bound in zip(spec.core.nodes, values, node_bounds(spec.core, lowest, highest), strict=True):
        low, high = np.broadcast_to(bound.lo, 4)[:, None], np.broadcast_to(bound.hi, 4)[:, None]
        assert ((low <= value) & (value <= high)).all(), node


@pytest.mark.long
@settings(max_examples=examples(50), deadline=None, derandomize=True)
@given(specs(labels=("task", "safe")), seeds)
def test_many_boxes_are_as_one_by_one(spec, seed):
    lowest, highest = sub_boxes(np.random.default_rng(seed), len(spec.objects), 3, 1.0)
    low, high = label_bounds(spec.core, lowest, highest)
    assert low.shape == high.shape == (2, 3)
    for box in range(3):
        one = label_bounds(spec.core, lowest[:, box], highest[:, box])
        assert np.array_equal(one[0], low[:, box]) and np.array_equal(one[1], high[:, box])


# in the unit square; the diagonal is 1.41421356...
EXACT = {
    "leftOf(mug, plate)": (-1.0, 1.0),
    "leftOf(mug, plate) & !closeTo(mug, plate, 0.25)": (-1.0, 1.0),
    "closeTo(mug, plate, 0.25)": (0.25 - math.sqrt(2.0), 0.25),
    "farFrom(mug, (0.5, 0.5), 0)": (0.0, math.sqrt(0.5)),
    "closeTo(mug, (2, 0.5), 0)": (-math.sqrt(4.25), -1.0),
    "abs(x(mug) - 0.25) <= 0.5": (-0.25, 0.5),
    "x(mug) * y(mug) <= 2": (1.0, 2.0),
    "-x(mug) / 4 <= 0": (0.0, 0.25),
    "min(x(mug), y(plate)) <= 0.5": (-0.5, 0.5),
    "max(x(mug), 0.5) <= y(plate)": (-1.0, 0.5),
    "leftOf(mug, plate) | belowOf(mug, plate)": (-1.0, 1.0),
    "x(mug) + y(plate) <= x(mug)": (-2.0, 1.0),  # wide, since x occurs twice: phi is -y(plate)
}


@pytest.mark.parametrize("text", EXACT)
def test_bounds_worked_by_hand(text):
    low, high = spec_bounds(check_text(text))["task"]
    assert (low, high) == EXACT[text]


@pytest.mark.parametrize(
    ("text", "low", "high"),
    [
        ("angle(mug, NORTH)", 0.2 - math.pi, 0.2),
        ("sin(theta(mug)) <= 0", -1.0, 1.0),
        ("cos(theta(mug)) <= 0.5", -0.5, 1.5),
    ],
)
def test_the_whole_circle_is_covered_to_a_hair(text, low, high):
    bounds = spec_bounds(check_text(text))["task"]
    assert bounds == pytest.approx((low, high), abs=1e-12)
    assert bounds[0] <= low and bounds[1] >= high
