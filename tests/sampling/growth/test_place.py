"""Weights are unbiased: the mean over many islands is the probability that a formula gives."""

import math

import numpy as np
import pytest

from scenegen.sampling.growth.moves import MoveSettings
from scenegen.sampling.growth.population import Grown, Step, grow
from scenegen.sampling.growth.sampler import log_base
from scenegen.sampling.request import Range

from ..plain import square_line
from .made import POSITIVE, machine_of


def estimates(text, ranges=POSITIVE, *, islands=200, each=16, tries=2, sweeps=0, seed=0, **words):
    """Each island's estimate of the probability, (islands,)."""
    machine = machine_of(text, ranges, **words)
    count = islands * each
    cell, island = np.zeros(count, dtype=np.intp), np.arange(count) % islands
    steps = [Step(tries, sweeps)] * len(machine.order)
    with np.errstate(divide="ignore"):
        grown = grow(machine, cell, island, steps, MoveSettings({}), np.random.default_rng(seed))
    assert isinstance(grown, Grown)
    return np.exp(grown.log_share + log_base(machine)).sum(axis=1), grown


def lens(d, r, s):
    """The area of two discs, of radii r and s at a distance d, together."""
    one = r * r * math.acos((d * d + r * r - s * s) / (2 * d * r))
    two = s * s * math.acos((d * d + s * s - r * r) / (2 * d * s))
    both = one + two - 0.5 * math.sqrt((-d + r + s) * (d + r - s) * (d - r + s) * (d + r + s))
    return math.pi * (r * r + s * s) - both


TWO = "object a = cylinder(0.15, 0.1), b = cylinder(0.1, 0.1)\nrequire noOverlap()\n"
# name -> spec, range, probability
KNOWN = {
    "two discs": (TWO + "task: farFrom(a, b, 0.0)", POSITIVE, 1 - square_line(0.25)),
    "two discs, within a box": (
        "object a = cylinder(0.1, 0.1), b = cylinder(0.1, 0.1)\nrequire noOverlap()\nrequire insideWorkspace()\n"
        "task: closeTo(a, b, 0.5)", {"task": Range(0.1, 0.4)}, 0.8**4 * (square_line(0.5) - square_line(0.25))),
    "three in order": ("leftOf(a, b) & leftOf(b, c)", POSITIVE, 1 / 6),
    "in order, with gaps": ("leftOf(a, b) & leftOf(b, c)", {"task": Range(0.2)}, 0.6**3 / 6),
    "overlapping branches": (
        "closeTo(a, (0.4, 0.5), 0.2) | closeTo(a, (0.6, 0.5), 0.3)", POSITIVE, lens(0.2, 0.2, 0.3)),
    "a heading either way": ("angle(a, EAST, 0.4) | angle(a, NORTH, 0.6)", POSITIVE, 2.0 / (2 * math.pi)),
    "overlapping ways": ("(leftOf(a, b) & leftOf(b, c)) | (leftOf(a, c) & leftOf(b, c))", POSITIVE, 1 / 3),
    "three ways, one in another": (
        "(leftOf(a, b) & leftOf(b, c)) | leftOf(a, c) & leftOf(b, c) | leftOf(b, a) & leftOf(c, a)", POSITIVE, 2 / 3),
    "a way for a third": ("leftOf(a, b) | leftOf(b, c) | leftOf(c, a)", {"task": Range(0.0)}, 1.0),
}  # fmt: skip


@pytest.mark.parametrize("sweeps", [0, 1])
@pytest.mark.parametrize("name", KNOWN)
def test_the_mean_over_islands_is_the_probability(name, sweeps):
    text, ranges, truth = KNOWN[name]
    found, _ = estimates(text, ranges, sweeps=sweeps)
    error = found.std(ddof=1) / math.sqrt(len(found))
    assert abs(found.mean() - truth) < 4 * error + 1e-6
    assert error < 0.05 * truth  # precise enough to see what a missing weight would do


def test_overlapping_branches_that_count_twice_would_be_seen(monkeypatch):
    """The same test rejects weights that do not look at how many branches hold a pose."""
    text, ranges, truth = KNOWN["overlapping branches"]
    monkeypatch.setattr("scenegen.sampling.growth.room.Boxes.holding", lambda self, poses: np.ones(poses.shape[1:]))
    found, _ = estimates(text, ranges)
    assert abs(found.mean() - truth) > 10 * found.std(ddof=1) / math.sqrt(len(found))


def test_the_pose_that_is_taken_is_uniform_over_the_free_ones():
    """One disc held in place: the other is uniform over what it leaves, whatever the number of tries."""
    fixed = {"a": (0.5, 0.5, 0.0)}
    _, grown = estimates(TWO + "task: farFrom(a, b, 0.0)", fixed=fixed, each=100, tries=3)
    x, y = grown.particles.scenes[3:5]
    assert np.hypot(x - 0.5, y - 0.5).min() >= 0.25
    free = 1 - math.pi * 0.25**2
    corner = (x < 0.25) & (y < 0.25)
    ring = np.hypot(x - 0.5, y - 0.5) < 0.35
    for share, truth in ((corner.mean(), 0.0625 / free), (ring.mean(), math.pi * (0.35**2 - 0.25**2) / free)):
        assert abs(share - truth) < 4 * math.sqrt(truth / len(x))


def test_the_shares_of_overlapping_ways_are_right():
    """Of the scenes in which c is last, half have a before b: the way that asks for it is no reason for more."""
    text, ranges, _ = KNOWN["overlapping ways"]
    _, grown = estimates(text, ranges, each=100, tries=4)
    a, b, c = grown.particles.scenes[0::3]
    assert (c > np.maximum(a, b)).all()
    assert abs((a < b).mean() - 0.5) < 4 * 0.5 / math.sqrt(len(a) / 2)
    assert abs(c.mean() - 0.75) < 4 * 0.2 / math.sqrt(len(a) / 2)
