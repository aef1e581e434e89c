"""How near generated scenes are to the truth, in four figures that see different faults.

* `coverage` (coverage.py) falls where a part of the truth is left out.
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

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scenegen.errors import DataError, RequestError
from scenegen.errors.learning import WRONG_SHAPE
from scenegen.errors.requests import OUT_OF_RANGE
from scenegen.pose import THETA, TWO_PI, X, Y, along, is_angle, object_count
from scenegen.scenes.coverage import NEIGHBOURS, Array, checked_pair, covered_share, features

# --------------------------------------------------------------------------------------------------------------------
# Do two sets of scenes have the same distribution? The energy distance, with a permutation test.
#
# Szekely & Rizzo 2004 ("Testing for equal distributions in high dimension"): for sets of n and m points,
#
#     E = n m / (n + m) * (2 mean |a - b| - mean |a - a'| - mean |b - b'|),
#
# which tends to infinity under every alternative. The p-value counts permutations of the pooled set: it is exact for
# any n and m and any distribution (Davison & Hinkley 1997, section 4.3).
#
# Distances are taken after whitening: the pooled covariance of `features` becomes the identity. The test is then
# invariant to units and to linear changes of coordinates, and a *difference* of two objects' coordinates that a spec
# restricts to a centimetre has the same weight as a coordinate that varies over the table. Without this the energy
# distance hardly detects such narrow directions, in which samplers of narrow phi ranges fail: scenes of experiment 1
# projected onto the target level pass with 5,000 scenes without whitening and fail with 500 with it. The price is
# some power against differences in the wide directions, which Kolmogorov-Smirnov (below) detects well. Whitening
# does not depend on which set a scene belongs to, so the test stays exact. Directions narrower than a micrometre
# (fixed objects) are left out.


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


# --------------------------------------------------------------------------------------------------------------------
# Tail probabilities for the tests of distribution: Kolmogorov, Kuiper, chi-square.
#
# Scalars, plain Python, no dependence on scipy; relative error below 1e-9 if the tail exceeds 1e-300.


_EPS = 1e-16


def kolmogorov_tail(x: float) -> float:
    """P(K > x) of the limit law of sqrt(n) sup |F_n - F| (Kolmogorov 1933).

    2 sum (-1)^(j-1) exp(-2 j^2 x^2), and below x = 1 one minus its Jacobi transform,
    sqrt(2 pi) / x sum exp(-(2j - 1)^2 pi^2 / 8 x^2); either needs at most six terms.
    """
    if x <= 0.0:
        return 1.0
    if x < 1.0:
        body = sum(math.exp(-(((2 * j - 1) * math.pi / x) ** 2) / 8.0) for j in range(1, 7))
        return 1.0 - math.sqrt(2.0 * math.pi) / x * body
    return 2.0 * math.fsum((-1) ** (j - 1) * math.exp(-2.0 * (j * x) ** 2) for j in range(1, 7))


def kuiper_tail(x: float) -> float:
    """P(V > x) of the limit law of sqrt(n) (sup (F_n - F) + sup (F - F_n)) (Kuiper 1960).

    2 sum (4 j^2 x^2 - 1) exp(-2 j^2 x^2); below x = 0.4, where it differs from 1 by less than 1e-6 and the terms grow
    in number, 1.
    """
    if x < 0.4:
        return 1.0
    squares = [(j * x) ** 2 for j in range(1, 12)]
    return min(1.0, max(0.0, 2.0 * math.fsum((4.0 * square - 1.0) * math.exp(-2.0 * square) for square in squares)))


def chi_square_tail(x: float, degrees: int) -> float:
    """P(X > x) of the chi-square law: the regularised upper incomplete gamma function Q(degrees / 2, x / 2).

    The power series of 1 - Q (Abramowitz & Stegun 6.5.29) left of a + 1, Legendre's continued fraction (6.5.31,
    even part) by the modified Lentz method right of it; O(sqrt(degrees)) terms.
    """
    a, z = degrees / 2.0, x / 2.0
    if z <= 0.0:
        return 1.0
    front = math.exp(a * math.log(z) - z - math.lgamma(a))
    if z < a + 1.0:
        term = total = 1.0 / a
        n = a
        while term > total * _EPS:
            n += 1.0
            term *= z / n
            total += term
        return max(0.0, 1.0 - front * total)
    if front == 0.0:
        return 0.0
    b = z + 1.0 - a
    c, d = math.inf, 1.0 / b
    fraction, step, j = d, 0.0, 0
    while abs(step - 1.0) > 10.0 * _EPS:
        j += 1
        an = -j * (j - a)
        b += 2.0
        d = 1.0 / (an * d + b)
        c = b + an / c
        step = c * d
        fraction *= step
    return front * fraction


# --------------------------------------------------------------------------------------------------------------------
# Kolmogorov-Smirnov tests of every coordinate and every pair, with Bonferroni correction: which coordinate is wrong?
#
# Two-sample tests of each object's x, y and theta, and of each pair's dx, dy, dtheta and distance. Lengths are tested
# by Kolmogorov-Smirnov. Angles have no origin, and Kolmogorov-Smirnov would depend on where the circle is cut; they
# are tested by Kuiper's statistic (Kuiper 1960), which does not. Limit distributions with Stephens' correction for
# finite samples (Stephens 1970, "Use of the Kolmogorov-Smirnov, Cramer-von Mises and related statistics without
# extensive tables", the modified D and V), n replaced by n m / (n + m). The worst p-value times the number of columns
# bounds the chance that right scenes look this bad (Bonferroni), however the columns depend on each other.


@dataclass(frozen=True, slots=True)
class ScreenedColumn:
    """One column's test: its name, the KS or Kuiper statistic in [0, 1], its own p-value."""

    name: str
    statistic: float
    p: float


@dataclass(frozen=True, slots=True)
class Screen:
    """All columns, worst first, and the Bonferroni-corrected p-value of the worst."""

    columns: tuple[ScreenedColumn, ...]
    corrected: float

    @property
    def worst(self) -> ScreenedColumn:
        return self.columns[0]


def ks_screen(a: npt.ArrayLike, b: npt.ArrayLike, names: Sequence[str] | None = None) -> Screen:
    """Screens scenes `a` (3N, n) against `b` (3N, m); `names` (N of them) are the objects', by default 1 to N.

    Columns in which all scenes of both sets are equal (fixed objects) are not tested nor counted; if there are no
    others, the result is p = 1. Time O((n + m) log(n + m)) for each of 3 N + 2 N (N - 1) columns, 2 ms each for 20,000
    scenes; memory O(n + m). Ties, as between duplicates, make a p-value too high, never too low. Raises DataError if
    the sets have different numbers of objects, one is empty, or the names do not fit.
    """
    first, second = checked_pair(a, b, (1, 1))
    objects = object_count(len(first))
    known = [str(index + 1) for index in range(objects)] if names is None else list(names)
    if len(known) != objects:
        found = f"{len(known)} for {objects} objects"
        raise DataError(WRONG_SHAPE(what="names", found=found, wanted="one name per object"))
    tested: list[ScreenedColumn] = []
    for (name, circular, left), (_, _, right) in zip(_columns(first, known), _columns(second, known), strict=True):
        if left.min() != left.max() or right.min() != right.max() or left[0] != right[0]:
            tested.append(ScreenedColumn(name, *(kuiper(left, right) if circular else kolmogorov_smirnov(left, right))))
    if not tested:
        return Screen((ScreenedColumn("all columns are constant", 0.0, 1.0),), 1.0)
    tested.sort(key=lambda column: column.p)
    return Screen(tuple(tested), min(1.0, tested[0].p * len(tested)))


def kolmogorov_smirnov(a: Array, b: Array) -> tuple[float, float]:
    """Statistic sup |F_a - F_b| and asymptotic p-value of samples (n,) and (m,) of a number."""
    above, below = _deviations(a, b)
    statistic = max(above, below)
    root = math.sqrt(len(a) * len(b) / (len(a) + len(b)))
    return statistic, kolmogorov_tail((root + 0.12 + 0.11 / root) * statistic)


def kuiper(a: Array, b: Array) -> tuple[float, float]:
    """Statistic sup (F_a - F_b) + sup (F_b - F_a) and asymptotic p-value of samples (n,) and (m,) of an angle.

    The angles may lie in any interval of one turn: the statistic does not depend on where it starts.
    """
    above, below = _deviations(a, b)
    root = math.sqrt(len(a) * len(b) / (len(a) + len(b)))
    return above + below, kuiper_tail((root + 0.155 + 0.24 / root) * (above + below))


def _deviations(a: Array, b: Array) -> tuple[float, float]:
    """The greatest excess of a's empirical distribution function over b's, and of b's over a's; both >= 0."""
    a, b = np.sort(a), np.sort(b)
    # F_a - F_b steps up at values of a only, down at values of b only; ties are resolved on the right.
    at_a = np.searchsorted(a, a, side="right") / len(a) - np.searchsorted(b, a, side="right") / len(b)
    at_b = np.searchsorted(b, b, side="right") / len(b) - np.searchsorted(a, b, side="right") / len(a)
    return max(0.0, float(at_a.max())), max(0.0, float(at_b.max()))


def _columns(rows: Array, names: Sequence[str]) -> Iterator[tuple[str, bool, Array]]:
    """Name, whether it is an angle (then in [0, 2 pi)), and values (B,) of every column, one at a time."""
    x, y, theta = rows[along(X)], rows[along(Y)], rows[along(THETA)]
    for i, name in enumerate(names):
        yield f"x({name})", False, x[i]
        yield f"y({name})", False, y[i]
        yield f"theta({name})", True, _on_circle(theta[i])
    for i, first in enumerate(names):
        for j in range(i + 1, len(names)):
            dx, dy = x[j] - x[i], y[j] - y[i]
            yield f"x({names[j]}) - x({first})", False, dx
            yield f"y({names[j]}) - y({first})", False, dy
            yield f"theta({names[j]}) - theta({first})", True, _on_circle(theta[j] - theta[i])
            yield f"dist({first}, {names[j]})", False, np.hypot(dx, dy)


def _on_circle(angle: Array) -> Array:
    """Into [0, 2 pi). A tiny negative angle rounds to 2 pi itself, which is 0."""
    wrapped = np.mod(angle, TWO_PI)
    return np.where(wrapped >= TWO_PI, 0.0, wrapped)


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
