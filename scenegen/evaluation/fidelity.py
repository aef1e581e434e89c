"""How near generated scenes are to the truth, in four figures that see different faults.

* `coverage` (coverage.py) falls where a part of the truth is left out.
* `ks` is the largest Kolmogorov-Smirnov (of headings: Kuiper) distance of a single coordinate: scenes that crowd.
* `sliced` is the largest Kolmogorov-Smirnov distance of a number that is made of several coordinates: random
  directions, sums, differences and products of pairs. It sees coordinates that are right one by one and wrong
  together, as those of a model that has lost a degree of freedom. Products and directions are of standardised features.
* `energy` is the energy distance 2 E|a - b| - E|a - a'| - E|b - b'| of whitened features (energy.py), which is 0 for
  equal distributions and sees every difference, but no small one.

All of them look at the coordinates that phi depends on and at nothing else: the others are uniform by construction, and
in many of them every fault is diluted. None is ideal in a finite set of true scenes: compare with `truth`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scenegen.evaluation.coverage import NEIGHBOURS, covered_share
from scenegen.evaluation.energy import energy_distance
from scenegen.evaluation.features import Array, checked_pair, features
from scenegen.evaluation.screen import kolmogorov_smirnov, kuiper
from scenegen.pose import TWO_PI, is_angle

SLICES = 64  # random directions, and pairs of coordinates, at most
SEED = 20_261_122  # of the directions and pairs: the same for every set of the same coordinates


@dataclass(frozen=True, slots=True)
class Fidelity:
    """All in [0, 1] but `energy`, which is in standard deviations. Only `coverage` is better the larger it is."""

    coverage: float
    ks: float
    sliced: float
    energy: float


def fidelity(reference: npt.ArrayLike, generated: npt.ArrayLike, depends: Sequence[int] | None = None) -> Fidelity:
    """Of the `generated` scenes (3N, G) against true ones (3N, R), over the storage rows in `depends` (None: all).

    Take as many of both: coverage depends on G / R. Time O(R (R + G)), 0.4 s for 2,000 each on one core. Raises
    DataError where the sets hold different numbers of objects, or fewer than six scenes.
    """
    truth, made = checked_pair(reference, generated, (NEIGHBOURS + 1, 2))
    rows = list(range(len(truth))) if depends is None else list(depends)
    points = features(truth, rows), features(made, rows)
    if not points[0].shape[1]:
        return Fidelity(1.0, 0.0, 0.0, 0.0)
    return Fidelity(
        covered_share(*points), _largest(truth, made, rows), sliced_distance(*points), energy_distance(*points)
    )


def sliced_distance(truth: Array, made: Array) -> float:
    """The largest Kolmogorov-Smirnov distance between points (R, D) and (G, D) along directions and in products."""
    random = np.random.default_rng(SEED)
    centre, spread = truth.mean(axis=0), truth.std(axis=0)
    moving = spread > 1e-9
    first, second = ((points[:, moving] - centre[moving]) / spread[moving] for points in (truth, made))
    width = first.shape[1]
    if width < 2:
        return 0.0
    pairs = np.argwhere(np.triu(np.ones((width, width)), 1))
    pairs = pairs[random.permutation(len(pairs))[:SLICES]]
    directions = random.normal(size=(width, SLICES))
    worst, scale = 0.0, spread[moving]
    for pair in pairs:
        one, other = (np.stack(list(_joined(points[:, pair], scale[pair]))) for points in (first, second))
        worst = max(worst, *(kolmogorov_smirnov(*both)[0] for both in zip(one, other, strict=True)))
    left, right = first @ directions, second @ directions
    return max(worst, *(kolmogorov_smirnov(left[:, k], right[:, k])[0] for k in range(SLICES)))


def _joined(two: Array, scale: Array) -> Iterator[Array]:
    """Product, difference and sum of two standardised coordinates (B, 2), the latter two in metres."""
    yield two[:, 0] * two[:, 1]
    yield two[:, 0] * scale[0] - two[:, 1] * scale[1]
    yield two[:, 0] * scale[0] + two[:, 1] * scale[1]


def _largest(truth: Array, made: Array, rows: Sequence[int]) -> float:
    """The largest distance of a single coordinate."""
    found = [0.0]
    for row in rows:
        a, b = truth[row], made[row]
        if is_angle(row):
            a, b = np.mod(a, TWO_PI), np.mod(b, TWO_PI)
        if a.min() != a.max() or b.min() != b.max():
            found.append((kuiper if is_angle(row) else kolmogorov_smirnov)(a, b)[0])
    return max(found)
