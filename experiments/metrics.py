"""Metrics of the experiments, and of the tests of samplers: errors, tests of distribution, duplicates, precision and
recall, memorisation. numpy only; scenes are arrays (3N, B), one column per scene. What model cards say is measured by
scenegen.learn.evaluation.fidelity.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scenegen.arrays import Array
from scenegen.learn.evaluation.fidelity import deviations, summed_distances, whiten
from scenegen.pose import THETA, TWO_PI, X, Y, is_angle, object_count, rows_along
from scenegen.scenes.coverage import (
    center,
    check_rows,
    checked_pair,
    features,
    kth_squared,
    least_squared,
    nearest,
    rounding,
)

# --------------------------------------------------------------------------------------------------------------------
# phi of generated scenes minus the target phi (the paper's accuracy tables).


WITHIN = 0.025  # the half-width of the paper's "within" counts, in the unit of phi


@dataclass(frozen=True, slots=True)
class LabelErrors:
    """phi minus the target phi of one label: mean, population standard deviation, mean absolute error, share within."""

    label: str
    wanted: float
    mean: float
    std: float
    mean_abs: float
    within: float


@dataclass(frozen=True, slots=True)
class ErrorStatistics:
    """Errors per label, and the share of scenes that are within the tolerance on *all* labels at once."""

    labels: tuple[LabelErrors, ...]
    within: float
    tolerance: float
    scenes: int


def error_statistics(
    phi: npt.ArrayLike, wanted: npt.ArrayLike, labels: Sequence[str], *, tolerance: float = WITHIN
) -> ErrorStatistics:
    """Errors of `phi` (L, B) against `wanted` (L,), in the unit of phi (metres or radians).

    `within` counts errors of at most `tolerance`. Raises ValueError for shapes that do not fit, no scenes, or phi
    that is not finite.
    """
    values, target = np.asarray(phi, dtype=np.float64), np.asarray(wanted, dtype=np.float64)
    if values.ndim != 2 or values.shape[0] != len(labels) or target.shape != (len(labels),) or not values.size:
        found = f"{values.shape}, with wanted of shape {target.shape} and {len(labels)} labels"
        wanted = "phi as (L, B) with B >= 1 scenes, wanted as (L,)"
        raise ValueError(f"phi of shape {found}: give {wanted}")
    if not (np.isfinite(values).all() and np.isfinite(target).all()):
        raise ValueError("phi is not finite")
    error = values - target[:, None]
    inside = np.abs(error) <= tolerance
    rows = tuple(
        LabelErrors(
            label=label,
            wanted=float(target[index]),
            mean=float(error[index].mean()),
            std=float(error[index].std()),
            mean_abs=float(np.abs(error[index]).mean()),
            within=float(inside[index].mean()),
        )
        for index, label in enumerate(labels)
    )
    return ErrorStatistics(rows, float(inside.all(axis=0).mean()), tolerance, values.shape[1])


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
    numbers of objects or fewer than two scenes, ValueError for permutations < 1 or most < 2.
    """
    if permutations < 1 or most < 2:
        raise ValueError(f"{permutations} permutations of at most {most} scenes; 1 and 2 are the least")
    first, second = (_subsample(poses, most, generator) for poses in checked_pair(a, b, (2, 2)))
    n, m = first.shape[1], second.shape[1]
    points = whiten(np.concatenate([features(first), features(second)]))
    labels = np.zeros((n + m, permutations + 1), dtype=np.float32)
    labels[:n, 0] = 1.0
    for column in range(1, permutations + 1):
        labels[generator.permutation(n + m)[:n], column] = 1.0
    within, to_first, total = summed_distances(points, labels)
    across = to_first - within
    rest = total - 2.0 * to_first + within
    values = n * m / (n + m) * (2.0 * across / (n * m) - within / n**2 - rest / m**2)
    # In small sets a permutation can repeat the observed sets; rounding must not make that look less extreme.
    reached = int((values[1:] >= values[0] - _TIE * max(1.0, abs(values[0]))).sum())
    return EnergyTest(float(values[0]), (1 + reached) / (1 + permutations), (n, m))


def _subsample(poses: Array, most: int, generator: np.random.Generator) -> Array:
    if poses.shape[1] <= most:
        return poses
    return poses[:, generator.choice(poses.shape[1], most, replace=False)]


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
    the sets have different numbers of objects or one is empty, ValueError if the names do not fit.
    """
    first, second = checked_pair(a, b, (1, 1))
    objects = object_count(len(first))
    known = [str(index + 1) for index in range(objects)] if names is None else list(names)
    if len(known) != objects:
        found = f"{len(known)} for {objects} objects"
        raise ValueError(f"names of shape {found}: give one name per object")
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
    statistic = max(deviations(a, b))
    root = math.sqrt(len(a) * len(b) / (len(a) + len(b)))
    return statistic, kolmogorov_tail((root + 0.12 + 0.11 / root) * statistic)


def kuiper(a: Array, b: Array) -> tuple[float, float]:
    """Statistic sup (F_a - F_b) + sup (F_b - F_a) and asymptotic p-value of samples (n,) and (m,) of an angle.

    The angles may lie in any interval of one turn: the statistic does not depend on where it starts.
    """
    statistic = sum(deviations(a, b))
    root = math.sqrt(len(a) * len(b) / (len(a) + len(b)))
    return statistic, kuiper_tail((root + 0.155 + 0.24 / root) * statistic)


def _columns(rows: Array, names: Sequence[str]) -> Iterator[tuple[str, bool, Array]]:
    """Name, whether it is an angle (then in [0, 2 pi)), and values (B,) of every column, one at a time."""
    x, y, theta = rows[rows_along(X)], rows[rows_along(Y)], rows[rows_along(THETA)]
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


# --------------------------------------------------------------------------------------------------------------------
# Pearson's chi-square test of counts against expected shares (Pearson 1900).
#
# Used for "orderings have equal shares" and "scenes are spread evenly over the cells". The p-value assumes
# independent scenes: scenes of a Markov chain, or survivors of few ancestors, have more variance and are rejected
# even if their distribution is right, so the test detects such dependence.


LEAST_EXPECTED = 1.0


@dataclass(frozen=True, slots=True)
class ChiSquare:
    """Sum of (count - expected)^2 / expected, its degrees of freedom (classes - 1), and the p-value."""

    statistic: float
    degrees: int
    p: float


def chi_square(counts: npt.ArrayLike, expected: npt.ArrayLike | None = None) -> ChiSquare:
    """Tests `counts` (K,) of scenes in K classes against `expected` (K,) shares in any unit; None means equal shares.

    The distribution is asymptotic: good if at least 5 scenes are expected per class (Cochran 1954). Raises ValueError
    for fewer than two classes, counts that are negative or not whole, shares that are not positive, shapes that differ,
    or a class in which less than one scene is expected.
    """
    seen = np.asarray(counts, dtype=np.float64)
    shares = np.ones(seen.shape) if expected is None else np.asarray(expected, dtype=np.float64)
    if seen.ndim != 1 or len(seen) < 2 or shares.shape != seen.shape:
        found = f"{seen.shape} against shares of shape {shares.shape}"
        wanted = "one count, and one expected share, for each of at least two classes"
        raise ValueError(f"counts of shape {found}: give {wanted}")
    if not (np.isfinite(seen).all() and (seen >= 0.0).all() and (seen == np.round(seen)).all()):
        raise ValueError("a count is negative or not a whole number: give counts, not shares")
    if not (np.isfinite(shares).all() and (shares > 0.0).all()):
        raise ValueError("an expected share is not positive: leave out classes that cannot occur, and assert that")
    wanted = shares * (seen.sum() / shares.sum())
    if wanted.min() < LEAST_EXPECTED:
        raise ValueError(f"only {wanted.min():.3g} scenes are expected in one of the {len(seen)} classes")
    statistic = float(((seen - wanted) ** 2 / wanted).sum())
    return ChiSquare(statistic, len(seen) - 1, chi_square_tail(statistic, len(seen) - 1))


# --------------------------------------------------------------------------------------------------------------------
# Share of duplicates: scenes that repeat an earlier scene of the same set, exactly or within a tolerance.
#
# A check of samplers that reuse particles and of generators that collapsed (Arora, Risteski & Zhang 2018, "Do GANs
# learn the distribution?", estimate a generator's support from its near-duplicates). Independent scenes have almost
# none.
#
# Found without the n^2 / 2 comparisons: scenes whose sorted coordinates are separated by a gap wider than the
# tolerance are in different groups; groups are split along one coordinate after another, single scenes are removed,
# and the rest is compared within its group. Sorting makes it O(n log n); only a cloud of distinct scenes a few
# tolerances wide is slower.


Indices = npt.NDArray[np.intp]

TOLERANCE = 1e-6  # metres, and radians
_SMALL = 16  # groups of at most this size are compared, not split further
_SLACK = 1e-14  # the cosines of two equal angles may be rounded differently


@dataclass(frozen=True, slots=True)
class Duplicates:
    """Shares in [0, 1] of scenes equal to an earlier one, and of scenes within the tolerance of an earlier one."""

    exact: float
    near: float
    tolerance: float


def duplicates(rows: npt.ArrayLike, *, tolerance: float = TOLERANCE) -> Duplicates:
    """Shares of duplicates among scenes (3N, B).

    Two scenes are near if *every* coordinate differs by at most `tolerance`: metres, or radians on the circle, so that
    theta and theta + 2 pi are the same. With c distinct scenes among B the exact share is 1 - c / B. A million scenes
    of four objects take 1 to 3 s on one core; memory is two to three times that of the scenes. Raises DataError for
    malformed scenes (none at all have no duplicates), ValueError for a tolerance that is negative or not below 1.
    """
    poses = check_rows(rows).copy()
    if not 0.0 <= tolerance < 1.0:
        raise ValueError(f"tolerance is {tolerance}; it is from 0 to below 1, in metres and radians")
    poses[rows_along(THETA)] = np.mod(poses[rows_along(THETA)], TWO_PI)
    scenes = poses.shape[1]
    if not scenes:
        return Duplicates(0.0, 0.0, tolerance)
    return Duplicates(_repeats(poses, 0.0) / scenes, _repeats(poses, tolerance) / scenes, tolerance)


def _repeats(poses: Array, tolerance: float) -> int:
    """How many scenes have an earlier one within the tolerance."""
    scenes, group = _grouped(poses, tolerance)
    if not len(scenes):
        return 0
    # The first scene of a group has no earlier one; in a collapsed set all others are near it, which ends the search.
    order = np.lexsort((scenes, group))
    scenes, group = scenes[order], group[order]
    opens = np.flatnonzero(np.diff(group, prepend=-1))
    leader = scenes[opens[np.cumsum(np.diff(group, prepend=-1) > 0) - 1]]
    repeats = _near(poses, scenes, leader, tolerance) & (scenes != leader)
    undecided = ~repeats & (scenes != leader)
    return int(repeats.sum()) + _repeats_among(poses, scenes, group, undecided, tolerance)


def _grouped(poses: Array, tolerance: float) -> tuple[Indices, Indices]:
    """Scenes that may have a near one, and their groups (numbers in no special order): near scenes share a group.

    Angles are cut by cosine and sine, which are never farther apart than the angles and have no seam.
    """
    scenes = np.arange(poses.shape[1])
    group = np.zeros_like(scenes)
    before = (-1, -1)
    while len(scenes) and before != (before := (len(scenes), int(group.max()))):
        for row in range(len(poses)):
            for function in (np.cos, np.sin) if is_angle(row) else (np.positive,):
                if np.bincount(group, minlength=1).max() <= _SMALL:
                    return scenes, group
                values = function(poses[row, scenes])
                order = np.lexsort((values, group))
                scenes, group, values = scenes[order], group[order], values[order]
                opens = np.ones(len(scenes), dtype=np.intp)
                opens[1:] = (np.diff(group) > 0) | (np.diff(values) > tolerance + _SLACK)
                group = np.cumsum(opens) - 1
                company = np.bincount(group, minlength=1)[group] > 1
                scenes, group = scenes[company], group[company]
    return scenes, group


def _repeats_among(poses: Array, scenes: Indices, group: Indices, undecided: npt.NDArray[np.bool_], tol: float) -> int:
    """How many of the remaining scenes have an earlier near one in their group: neighbours in sorted order, nearest
    first."""
    if not undecided.any():
        return 0
    spreads = [-1.0 if is_angle(index) else np.ptp(row) for index, row in enumerate(poses[:, scenes])]
    values = poses[np.argmax(spreads)]
    order = np.lexsort((values[scenes], group))
    scenes, group, undecided = scenes[order], group[order], undecided[order]
    values = values[scenes]
    found = np.zeros(len(scenes), dtype=bool)
    for direction in (-1, 1):
        active, lag = np.flatnonzero(undecided & ~found), 0
        while len(active):
            lag += direction
            active = active[(active + lag >= 0) & (active + lag < len(scenes))]
            other = active + lag
            inside = (group[other] == group[active]) & (np.abs(values[other] - values[active]) <= tol + _SLACK)
            active, other = active[inside], other[inside]
            near = (scenes[other] < scenes[active]) & _near(poses, scenes[other], scenes[active], tol)
            found[active[near]] = True
            active = active[~near]
    return int(found.sum())


def _near(poses: Array, a: Indices, b: Indices, tolerance: float) -> npt.NDArray[np.bool_]:
    """Whether scenes a and b (both (K,)) agree within the tolerance in every coordinate."""
    near = np.ones(len(a), dtype=bool)
    for index, row in enumerate(poses):
        apart = np.abs(row[a] - row[b])
        near &= (np.minimum(apart, TWO_PI - apart) if is_angle(index) else apart) <= tolerance
    return near


# --------------------------------------------------------------------------------------------------------------------
# Precision and recall of generated scenes (Kynkaanniemi et al. 2019, "Improved Precision and Recall Metric for
# Assessing Generative Models", eq. 1 and 2).
#
# The support of a distribution is estimated by balls: around every scene of a set, one that reaches its k-th nearest
# other scene of that set. Precision is the share of generated scenes inside the reference's support (fidelity),
# recall the share of reference scenes inside the generated support (diversity). Coverage (Naeem et al. 2020) is
# recall with the balls of the reference, so that generated outliers cannot widen the support; it is more informative
# than recall, and precision complements it. Their density improves precision in the same way. Neither value is 1 for
# a perfect sampler: compare with the values of a new set of true scenes.


NEIGHBOURS = 3  # the paper's k


@dataclass(frozen=True, slots=True)
class PrecisionRecall:
    """Shares in [0, 1]: generated scenes in the reference's support, reference scenes in the generated support."""

    precision: float
    recall: float


def precision_recall(
    reference: npt.ArrayLike, generated: npt.ArrayLike, *, neighbours: int = NEIGHBOURS
) -> PrecisionRecall:
    """Precision and recall of the `generated` scenes (3N, G) against the `reference` scenes (3N, R).

    Distances are those of `features`. Time grows with (R + G)^2, 2 to 3 s for 20,000 each on one core; memory stays
    at a few MB beyond the scenes. Raises DataError if the two sets have different numbers of objects or a set has
    no more than `neighbours` scenes, ValueError for neighbours < 1.
    """
    if neighbours < 1:
        raise ValueError(f"neighbours is {neighbours}; it is at least 1")
    poses = checked_pair(reference, generated, (neighbours + 1, neighbours + 1))
    truth, made = center(features(poses[0]), features(poses[1]))
    return PrecisionRecall(
        precision=_inside(made, truth, neighbours),
        recall=_inside(truth, made, neighbours),
    )


def _inside(queries: Array, points: Array, neighbours: int) -> float:
    """Share of the queries that lie in the ball of at least one point."""
    power = least_squared(queries, points, -kth_squared(points, neighbours))
    return float((power <= rounding(queries, points)).mean())


# --------------------------------------------------------------------------------------------------------------------
# Memorisation: how near generated scenes are to the scenes that a model was trained on.
#
# The usual nearest-neighbour check of generative models (Theis et al. 2016, "A note on the evaluation of generative
# models"), as numbers instead of pictures. Compare the distances with those of new exact scenes: a model whose
# quantiles are clearly below theirs repeats its training set.


QUANTILES = (0.0, 0.01, 0.05, 0.25, 0.5, 0.75, 1.0)


@dataclass(frozen=True, slots=True)
class TrainingDistances:
    """Quantiles of the distance to the nearest training scene (metres, in the space of `features`), and their mean."""

    levels: tuple[float, ...]
    quantiles: tuple[float, ...]
    mean: float


def training_distances(
    generated: npt.ArrayLike, training: npt.ArrayLike, *, levels: Sequence[float] = QUANTILES
) -> TrainingDistances:
    """Distances of the `generated` scenes (3N, G) to their nearest of the `training` scenes (3N, T).

    The distance of a copied scene is below 1e-7 of the scenes' spread, as a rule exactly 0. Time O(G T N): 20,000
    against 200,000 scenes of four objects take 4 to 6 s on one core; memory is a few times that of the scenes. Raises
    DataError if the sets have different numbers of objects or one is empty, ValueError for a level outside [0, 1] or
    no level.
    """
    if not levels or not all(0.0 <= level <= 1.0 for level in levels):
        raise ValueError(f"levels are {list(levels)}; there is at least one, each from 0 to 1")
    known, made = checked_pair(training, generated, (1, 1))
    points, queries = center(features(known), features(made))
    distance, _ = nearest(queries, points)
    found = np.quantile(distance, list(levels))
    return TrainingDistances(tuple(map(float, levels)), tuple(map(float, found)), float(distance.mean()))
