"""How near generated scenes are to the truth, in four figures that see different faults.

* `coverage` (scenegen.scenes.coverage) falls where a part of the truth is left out.
* `ks` is the largest Kolmogorov-Smirnov (of headings: Kuiper) distance of a single coordinate: scenes that crowd.
* `sliced` is the largest Kolmogorov-Smirnov distance of a number that is made of several coordinates: random
  directions, sums, differences and products of pairs. It sees coordinates that are right one by one and wrong
  together, as those of a model that has lost a degree of freedom. Products and directions are of standardised features.
* `energy` is the energy distance 2 E|a - b| - E|a - a'| - E|b - b'| of whitened features, which is 0 for
  equal distributions and sees every difference, but no small one.

All of them look at the coordinates that phi depends on and at nothing else: the others are uniform by construction, and
in many of them every fault is diluted. None is ideal in a finite set of true scenes: compare with `truth`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scenegen.arrays import Array
from scenegen.pose import TWO_PI, is_angle
from scenegen.scenes.coverage import NEIGHBOURS, checked_pair, covered_share, features

# The energy distance (Szekely & Rizzo 2004, "Testing for equal distributions in high dimension").
#
# Distances are taken after whitening: the pooled covariance of `features` becomes the identity. The distance is then
# invariant to units and to linear changes of coordinates, and a *difference* of two objects' coordinates that a spec
# restricts to a centimetre has the same weight as a coordinate that varies over the table. Directions narrower than a
# micrometre (fixed objects) are left out.


Single = npt.NDArray[np.float32]

MIN_WHITENED_SPREAD = 1e-6  # metres, standard deviation
_BLOCK = 1024  # side of the square of distances held at a time: 4 MB
_RANK = 1e-13  # variances below this share of the greatest are rounding


def energy_distance(a: Array, b: Array) -> float:
    """2 mean |p - q| - mean |p - p'| - mean |q - q'| of points (n, D) and (m, D), whitened together: the statistic
    without the factor that makes it grow with n and m. A point is not compared with itself, so that the mean is that
    of the distributions, and it can be slightly negative."""
    n, m = len(a), len(b)
    labels = np.zeros((n + m, 1), dtype=np.float32)
    labels[:n] = 1.0
    points = whiten(np.concatenate([a, b]))
    if not points.shape[1]:
        return 0.0
    c = float(np.sqrt(2.0 * (points * points).sum(axis=1).mean(dtype=np.float64)))
    (within,), (to_first,), total = summed_distances(points, labels)
    across, rest = to_first - within, total - 2.0 * to_first + within
    # `summed_distances` takes c from each distance, that of a point to itself included
    near = [(part + c * k) / (k * (k - 1)) for part, k in ((within, n), (rest, m))]
    return float(2.0 * across / (n * m) - sum(near))


def whiten(points: Array) -> Single:
    """Points (B, D) in the axes of their covariance, each of unit variance; (B, D') without the narrow ones."""
    points = points - points.mean(axis=0)
    variances, axes = np.linalg.eigh(points.T @ points / len(points))
    kept = variances > max(MIN_WHITENED_SPREAD**2, _RANK * variances.max())
    white: Single = (points @ (axes[:, kept] / np.sqrt(variances[kept]))).astype(np.float32)
    return white


def summed_distances(points: Single, labels: Single) -> tuple[Array, Array, float]:
    """Sums of distances for each column u of the labels (B, P): u'Du and u'D1, both (P,), and 1'D1.

    D is symmetric, so square blocks on and right of the diagonal suffice, the diagonal ones at half weight. A constant
    c is subtracted from every distance (E does not change), which keeps the float32 sums small.
    """
    scenes, squares = len(points), (points * points).sum(axis=1)
    c = np.float32(np.sqrt(2.0 * squares.mean()))
    sums = np.zeros(scenes)
    within = np.zeros(labels.shape[1])
    parts = [slice(start, min(start + _BLOCK, scenes)) for start in range(0, scenes, _BLOCK)]
    for index, rows in enumerate(parts):
        for columns in parts[index:]:
            block = points[rows] @ (-2.0 * points[columns].T)
            block += squares[rows, None]
            block += squares[columns]
            np.sqrt(np.maximum(block, 0.0, out=block), out=block)
            if rows == columns:
                np.fill_diagonal(block, 0.0)
            block -= c
            if rows == columns:
                block *= 0.5
            within += 2.0 * np.einsum("bp,bp->p", labels[rows], block @ labels[columns], dtype=np.float64)
            sums[rows] += block.sum(axis=1, dtype=np.float64)
            sums[columns] += block.sum(axis=0, dtype=np.float64)
    return within, np.array([sums @ column for column in labels.T]), float(sums.sum())


# Kolmogorov-Smirnov and Kuiper distances of single numbers. Angles have no origin, and Kolmogorov-Smirnov would depend
# on where the circle is cut; Kuiper's statistic (Kuiper 1960) does not.


def ks_distance(a: Array, b: Array) -> float:
    """sup |F_a - F_b| of samples (n,) and (m,) of a number."""
    return max(deviations(a, b))


def kuiper_distance(a: Array, b: Array) -> float:
    """sup (F_a - F_b) + sup (F_b - F_a) of samples (n,) and (m,) of an angle, in any interval of one turn."""
    return sum(deviations(a, b))


def deviations(a: Array, b: Array) -> tuple[float, float]:
    """The greatest excess of a's empirical distribution function over b's, and of b's over a's; both >= 0."""
    a, b = np.sort(a), np.sort(b)
    # F_a - F_b steps up at values of a only, down at values of b only; ties are resolved on the right.
    at_a = np.searchsorted(a, a, side="right") / len(a) - np.searchsorted(b, a, side="right") / len(b)
    at_b = np.searchsorted(b, b, side="right") / len(b) - np.searchsorted(a, b, side="right") / len(a)
    return max(0.0, float(at_a.max())), max(0.0, float(at_b.max()))


MAX_SLICES = 64  # random directions, and pairs of coordinates, at most
SLICE_SEED = 20_261_122  # of the directions and pairs: the same for every set of the same coordinates


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
    random = np.random.default_rng(SLICE_SEED)
    centre, spread = truth.mean(axis=0), truth.std(axis=0)
    moving = spread > 1e-9
    first, second = ((points[:, moving] - centre[moving]) / spread[moving] for points in (truth, made))
    width = first.shape[1]
    if width < 2:
        return 0.0
    pairs = np.argwhere(np.triu(np.ones((width, width)), 1))
    pairs = pairs[random.permutation(len(pairs))[:MAX_SLICES]]
    directions = random.normal(size=(width, MAX_SLICES))
    worst, scale = 0.0, spread[moving]
    for pair in pairs:
        one, other = (np.stack(list(_combine_pair(points[:, pair], scale[pair]))) for points in (first, second))
        worst = max(worst, *(ks_distance(*both) for both in zip(one, other, strict=True)))
    left, right = first @ directions, second @ directions
    return max(worst, *(ks_distance(left[:, k], right[:, k]) for k in range(MAX_SLICES)))


def _combine_pair(two: Array, scale: Array) -> Iterator[Array]:
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
            found.append((kuiper_distance if is_angle(row) else ks_distance)(a, b))
    return max(found)
