"""Share of duplicates: scenes that repeat an earlier scene of the same set, exactly or within a tolerance.

A check of samplers that reuse particles and of generators that collapsed (Arora, Risteski & Zhang 2018, "Do GANs learn
the distribution?", estimate a generator's support from its near-duplicates). Independent scenes have almost none.

Found without the n^2 / 2 comparisons: scenes whose sorted coordinates are separated by a gap wider than the tolerance
are in different groups; groups are split along one coordinate after another, single scenes are removed, and the rest is
compared within its group. Sorting makes it O(n log n); only a cloud of distinct scenes a few tolerances wide is slower.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scenegen.errors import RequestError
from scenegen.errors.requests import OUT_OF_RANGE
from scenegen.evaluation.features import Array, checked
from scenegen.pose import THETA, TWO_PI, along, is_angle

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
