"""What stands is drawn uniformly where it stands: volumes, what the slices of headings hold, and where things come to
be."""

import math

import numpy as np
import pytest

import scenegen
from scenegen.geometry import NUMPY, PRIMITIVES
from scenegen.geometry.footprint import Box
from scenegen.lang.check.supports import area_of
from scenegen.lang.formula.interpret import evaluate
from scenegen.pose import TWO_PI, row_of
from scenegen.search.surfaces import SLICES, stands_of, step_for

CANS = "object tray, can[2] on any of [tray, workspace], mug\ntask: leftOf(can[1], can[2])"
FORKS = "object tray, fork on any of [tray, workspace], mug\ntask: leftOf(fork, mug)"
NESTED = """object tray, plate on any of [tray, workspace], apple on any of [plate, tray, workspace]
require noCollision()
task: restsOn(apple, plate)"""


def steps(text):
    spec = scenegen.parse(text).checked
    lowest, highest = spec.box()

    def ends(row):
        return float(lowest[row]), float(highest[row])

    stands = stands_of(spec, lowest, highest)
    return spec, stands, [step_for(stand, ends) for stand in stands]


def test_the_volume_is_that_of_the_surfaces():
    _, stands, found = steps(CANS)
    assert [stand.thing for stand in stands] == [1, 2]
    for stand, step in zip(stands, found, strict=True):
        lengths = np.diff([0.0, *stand.ends])
        areas = [area_of(stand.upper, one) for one in stand.options]
        assert math.exp(step.log_volume) == pytest.approx(float(np.dot(lengths, areas)))


@pytest.mark.parametrize("text", [CANS, FORKS, NESTED])
def test_what_is_drawn_stands(text):
    spec, stands, found = steps(text)
    lowest, highest = spec.box()
    rng = np.random.default_rng(4)
    rows = lowest[:, None] + rng.random((len(lowest), 4000)) * (highest - lowest)[:, None]
    for step in found:
        step.draw(rows, rng)
    on = [index for index, node in enumerate(spec.core.nodes) if " on any of " in getattr(node, "text", "")]
    values = evaluate(spec.core, list(rows), NUMPY, None, on)
    assert len(on) == len(stands)
    # slices are a little wider than what fits, and so are the boxes of round rims
    assert min(float((values[node] >= 0.0).mean()) for node in on) > 0.85
    if text is CANS:
        assert min(float((values[node] >= -1e-12).mean()) for node in on) == 1.0


def test_carriers_come_before_what_they_carry():
    _, stands, _ = steps(NESTED)
    assert [stand.thing for stand in stands] == [1, 2]


def test_the_slices_hold_every_place_where_a_fork_fits():
    _, (stand,), (step,) = steps(FORKS)
    tray = stand.options[0]
    assert tray.walled and isinstance(tray.outline, Box)
    rng = np.random.default_rng(1)
    u, v = ((rng.random(40_000) - 0.5) * size for size in tray.outline.extent)
    theta = rng.random(40_000) * TWO_PI
    zero = np.zeros(40_000)
    room = PRIMITIVES["room"].evaluate(NUMPY, stand.upper, tray.outline, u, v, theta, zero, zero, zero)
    fits = np.flatnonzero(room >= 0.0)
    assert len(fits) > 1000
    mine = step.number == step.frames.index(row_of(0, 0))
    number = np.round(step.heading[mine] / (TWO_PI / SLICES)).astype(int)
    where = {int(one): place for place, one in enumerate(number)}
    middle, half = step.middle[:, mine], step.half[:, mine]
    for place in fits:
        at = where[int(theta[place] / (TWO_PI / SLICES))]  # a slice that is left out would be a KeyError
        assert abs(u[place] - middle[0, at]) <= half[0, at] + 1e-12
        assert abs(v[place] - middle[1, at]) <= half[1, at] + 1e-12
    inside = step.half[0][mine] * step.half[1][mine]
    assert inside.max() > 1.5 * inside.min()  # aslant there is less room


@pytest.mark.long
def test_growth_and_rejection_find_the_same_probability():
    found = {}
    for method in ("rejection", "growth"):
        scenes = scenegen.sample(scenegen.parse(NESTED), {"task": (0.0, None)}, 600, seed=2, method=method, workers=1)
        found[method] = scenes.header.sampler
    one, other = (found[method]["log10_probability"] for method in ("rejection", "growth"))
    error = math.hypot(*(found[method]["log10_error"] for method in ("rejection", "growth")))
    assert abs(one - other) < max(2.0 * error, 0.02) and error < 0.15
