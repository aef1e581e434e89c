"""Error statistics: phi of generated scenes minus the target phi (the paper's accuracy tables)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scenegen.errors import DataError, RequestError
from scenegen.errors.learning import ARRAY_NOT_FINITE, BAD_COUNTS, TOO_FEW_EXPECTED, WRONG_SHAPE
from scenegen.errors.requests import OUT_OF_RANGE
from scenegen.learn.evaluation.fidelity import chi_square_tail
from scenegen.pose import THETA, TWO_PI, along, is_angle
from scenegen.scenes.coverage import (
    Array,
    centred,
    checked,
    checked_pair,
    features,
    kth_squared,
    least_squared,
    nearest,
    rounding,
)

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

    `within` counts errors of at most `tolerance`. Raises DataError for shapes that do not fit, no scenes, or phi that
    is not finite.
    """
    values, target = np.asarray(phi, dtype=np.float64), np.asarray(wanted, dtype=np.float64)
    if values.ndim != 2 or values.shape[0] != len(labels) or target.shape != (len(labels),) or not values.size:
        found = f"{values.shape}, with wanted of shape {target.shape} and {len(labels)} labels"
        wanted = "phi as (L, B) with B >= 1 scenes, wanted as (L,)"
        raise DataError(WRONG_SHAPE(what="phi", found=found, wanted=wanted))
    if not (np.isfinite(values).all() and np.isfinite(target).all()):
        raise DataError(ARRAY_NOT_FINITE(what="phi"))
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

    The distribution is asymptotic: good if at least 5 scenes are expected per class (Cochran 1954). Raises DataError
    for fewer than two classes, counts that are negative or not whole, shares that are not positive, shapes that differ,
    or a class in which less than one scene is expected.
    """
    seen = np.asarray(counts, dtype=np.float64)
    shares = np.ones(seen.shape) if expected is None else np.asarray(expected, dtype=np.float64)
    if seen.ndim != 1 or len(seen) < 2 or shares.shape != seen.shape:
        found = f"{seen.shape} against shares of shape {shares.shape}"
        wanted = "one count, and one expected share, for each of at least two classes"
        raise DataError(WRONG_SHAPE(what="counts", found=found, wanted=wanted))
    if not (np.isfinite(seen).all() and (seen >= 0.0).all() and (seen == np.round(seen)).all()):
        raise DataError(BAD_COUNTS(what="a count is negative or not a whole number", remedy="give counts, not shares"))
    if not (np.isfinite(shares).all() and (shares > 0.0).all()):
        remedy = "leave out classes that cannot occur, and assert that"
        raise DataError(BAD_COUNTS(what="an expected share is not positive", remedy=remedy))
    wanted = shares * (seen.sum() / shares.sum())
    if wanted.min() < LEAST_EXPECTED:
        raise DataError(TOO_FEW_EXPECTED(expected=wanted.min(), classes=len(seen)))
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
    malformed scenes (none at all have no duplicates), RequestError for a tolerance that is negative or not below 1.
    """
    poses = checked(rows).copy()
    if not 0.0 <= tolerance < 1.0:
        wanted = "from 0 to below 1, in metres and radians"
        raise RequestError(OUT_OF_RANGE(argument="tolerance", value=tolerance, wanted=wanted, hint="1e-6 is usual"))
    poses[along(THETA)] = np.mod(poses[along(THETA)], TWO_PI)
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
    no more than `neighbours` scenes, RequestError for neighbours < 1.
    """
    if neighbours < 1:
        raise RequestError(OUT_OF_RANGE(argument="neighbours", value=neighbours, wanted="at least 1"))
    poses = checked_pair(reference, generated, (neighbours + 1, neighbours + 1))
    truth, made = centred(features(poses[0]), features(poses[1]))
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
    DataError if the sets have different numbers of objects or one is empty, RequestError for a level outside [0, 1] or
    no level.
    """
    if not levels or not all(0.0 <= level <= 1.0 for level in levels):
        wanted = "at least one level, each from 0 to 1"
        raise RequestError(OUT_OF_RANGE(argument="levels", value=list(levels), wanted=wanted))
    known, made = checked_pair(training, generated, (1, 1))
    points, queries = centred(features(known), features(made))
    distance, _ = nearest(queries, points)
    found = np.quantile(distance, list(levels))
    return TrainingDistances(tuple(map(float, levels)), tuple(map(float, found)), float(distance.mean()))
