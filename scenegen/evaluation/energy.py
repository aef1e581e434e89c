"""Do two sets of scenes have the same distribution? The energy distance, with a permutation test.

Szekely & Rizzo 2004 ("Testing for equal distributions in high dimension"): for sets of n and m points,

    E = n m / (n + m) * (2 mean |a - b| - mean |a - a'| - mean |b - b'|),

which tends to infinity under every alternative. The p-value counts permutations of the pooled set: it is exact for any
n and m and any distribution (Davison & Hinkley 1997, section 4.3).

Distances are taken after whitening: the pooled covariance of `features` becomes the identity. The test is then
invariant to units and to linear changes of coordinates, and a *difference* of two objects' coordinates that a spec
restricts to a centimetre has the same weight as a coordinate that varies over the table. Without this the energy
distance hardly detects such narrow directions, in which samplers of narrow phi ranges fail: scenes of experiment 1
projected onto the target level pass with 5,000 scenes without whitening and fail with 500 with it. The price is some
power against differences in the wide directions, which Kolmogorov-Smirnov (screen.py) detects well. Whitening does not
depend on which set a scene belongs to, so the test stays exact. Directions narrower than a micrometre (fixed objects)
are left out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scenegen.errors import RequestError
from scenegen.errors.requests import OUT_OF_RANGE
from scenegen.evaluation.features import Array, checked_pair, features

Single = npt.NDArray[np.float32]

PERMUTATIONS = 199
MOST = 2_000
NARROWEST = 1e-6  # metres, standard deviation
_BLOCK = 1024  # side of the square of distances held at a time: 4 MB
_TIE = 1e-4
_RANK = 1e-13  # variances below this share of the greatest are rounding


@dataclass(frozen=True, slots=True)
class EnergyTest:
    """The statistic E (no unit), the share of permutations (including the identity) that reach it, scenes used of
    each."""

    statistic: float
    p: float
    scenes: tuple[int, int]


def energy_test(
    a: npt.ArrayLike,
    b: npt.ArrayLike,
    generator: np.random.Generator,
    *,
    permutations: int = PERMUTATIONS,
    most: int = MOST,
) -> EnergyTest:
    """Tests whether scenes `a` (3N, n) and `b` (3N, m) follow one distribution; p is at least 1 / (permutations + 1).

    Of a larger set, `most` scenes are drawn without replacement by `generator`, which also permutes. Each distance is
    computed once; the permutations share one matrix product per block, in float32 (the observed labels are one of its
    columns, so rounding cannot bias p). Time O((n + m)^2 (N + permutations)): on one core 0.1 s for 2,000 each, about 6
    s for 20,000 each; memory O((n + m) permutations), 50 MB for the latter. Raises DataError if the sets have different
    numbers of objects or fewer than two scenes, RequestError for permutations < 1 or most < 2.
    """
    if permutations < 1 or most < 2:
        name, value, least = ("most", most, 2) if most < 2 else ("permutations", permutations, 1)
        hint = "199 permutations resolve p to 0.005"
        raise RequestError(OUT_OF_RANGE(argument=name, value=value, wanted=f"at least {least}", hint=hint))
    first, second = (_subsample(poses, most, generator) for poses in checked_pair(a, b, (2, 2)))
    n, m = first.shape[1], second.shape[1]
    points = _whitened(np.concatenate([features(first), features(second)]))
    labels = np.zeros((n + m, permutations + 1), dtype=np.float32)
    labels[:n, 0] = 1.0
    for column in range(1, permutations + 1):
        labels[generator.permutation(n + m)[:n], column] = 1.0
    within, to_first, total = _sums(points, labels)
    across = to_first - within
    rest = total - 2.0 * to_first + within
    values = n * m / (n + m) * (2.0 * across / (n * m) - within / n**2 - rest / m**2)
    # In small sets a permutation can repeat the observed sets; rounding must not make that look less extreme.
    reached = int((values[1:] >= values[0] - _TIE * max(1.0, abs(values[0]))).sum())
    return EnergyTest(float(values[0]), (1 + reached) / (1 + permutations), (n, m))


def energy_distance(a: Array, b: Array) -> float:
    """2 mean |p - q| - mean |p - p'| - mean |q - q'| of points (n, D) and (m, D), whitened together: the statistic
    without the factor that makes it grow with n and m. A point is not compared with itself, so that the mean is that
    of the distributions, and it can be slightly negative."""
    n, m = len(a), len(b)
    labels = np.zeros((n + m, 1), dtype=np.float32)
    labels[:n] = 1.0
    points = _whitened(np.concatenate([a, b]))
    if not points.shape[1]:
        return 0.0
    c = float(np.sqrt(2.0 * (points * points).sum(axis=1).mean(dtype=np.float64)))
    (within,), (to_first,), total = _sums(points, labels)
    across, rest = to_first - within, total - 2.0 * to_first + within
    # `_sums` takes c from each distance, that of a point to itself included
    near = [(part + c * k) / (k * (k - 1)) for part, k in ((within, n), (rest, m))]
    return float(2.0 * across / (n * m) - sum(near))


def _subsample(poses: Array, most: int, generator: np.random.Generator) -> Array:
    if poses.shape[1] <= most:
        return poses
    return poses[:, generator.choice(poses.shape[1], most, replace=False)]


def _whitened(points: Array) -> Single:
    """Points (B, D) in the axes of their covariance, each of unit variance; (B, D') without the narrow ones."""
    points = points - points.mean(axis=0)
    variances, axes = np.linalg.eigh(points.T @ points / len(points))
    kept = variances > max(NARROWEST**2, _RANK * variances.max())
    white: Single = (points @ (axes[:, kept] / np.sqrt(variances[kept]))).astype(np.float32)
    return white


def _sums(points: Single, labels: Single) -> tuple[Array, Array, float]:
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
