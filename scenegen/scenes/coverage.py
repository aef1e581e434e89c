"""Coverage: how much of the true distribution a set of generated scenes reaches.

The share of reference scenes whose nearest generated scene lies within that reference scene's own k-th-nearest-
neighbour radius in the reference (Naeem et al. 2020, "Reliable Fidelity and Diversity Metrics for Generative Models",
section 3). A fresh set from the truth scores 1 - 2^-k on average for sets of equal size, i.e. 0.969 for k = 5.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import numpy.typing as npt

from scenegen.arrays import Array
from scenegen.errors import DataError
from scenegen.errors.learning import ARRAY_NOT_FINITE, DIFFERENT_OBJECTS, TOO_FEW_SCENES, WRONG_SHAPE
from scenegen.pose import SIZE, THETA, TWO_PI, X, Y, axis_of, object_count, rows_along


def check_rows(rows: npt.ArrayLike) -> Array:
    """Poses (3N, B) in metres and radians, as float64. Raises DataError for another shape or values not finite."""
    poses = np.asarray(rows, dtype=np.float64)
    if poses.ndim != 2 or poses.shape[0] % SIZE or not poses.shape[0]:
        raise DataError(WRONG_SHAPE(what="poses", found=str(poses.shape), wanted="(3N, B)"))
    if not np.isfinite(poses).all():
        raise DataError(ARRAY_NOT_FINITE(what="a pose"))
    return poses


def checked_pair(reference: npt.ArrayLike, generated: npt.ArrayLike, least: tuple[int, int]) -> tuple[Array, Array]:
    """Two sets of poses (3N, R) and (3N, G) of the same objects, R and G no smaller than `least`.

    Raises DataError if a set is malformed or too small, or if the numbers of objects differ.
    """
    truth, made = check_rows(reference), check_rows(generated)
    if len(truth) != len(made):
        objects, others = object_count(len(truth)), object_count(len(made))
        raise DataError(DIFFERENT_OBJECTS(reference=objects, generated=others))
    for poses, needed, which in ((truth, least[0], "reference"), (made, least[1], "generated")):
        if poses.shape[1] < needed:
            scenes = "one scene" if needed == 1 else f"{needed} scenes"
            raise DataError(TOO_FEW_SCENES(count=poses.shape[1], which=which, needed=scenes))
    return truth, made


def features(rows: npt.ArrayLike, depends: Sequence[int] | None = None) -> Array:
    """Poses (3N, B) in metres and radians -> (B, 4N): x, y, cos(theta) / 2 pi, sin(theta) / 2 pi per object; of the
    storage rows in `depends` alone, where given.

    The angle enters as a circle with a circumference of 1, so that a full turn has the same weight as the unit square's
    edge. Raises DataError for another shape or coordinates that are not finite.
    """
    poses = check_rows(rows)
    if depends is None:
        x, y, theta = poses[rows_along(X)], poses[rows_along(Y)], poses[rows_along(THETA)]
    else:
        x, y, theta = (poses[[row for row in depends if axis_of(row) == axis]] for axis in (X, Y, THETA))
    return np.concatenate([x, y, np.cos(theta) / TWO_PI, np.sin(theta) / TWO_PI]).T


# Nearest neighbours by brute force: every distance is computed, few are in memory at a time.
#
# |a - b|^2 = |a|^2 - 2 a.b + |b|^2 is written as one matrix product of the extended points (a, |a|^2, 1) and (-2 b, 1,
# |b|^2), so a tile of squared distances costs one product and no further pass. Tiles fit into a core's cache: 20,000
# against 20,000 points of 8 (28) dimensions take 0.4 (0.7) s on one core. Trees are not faster here; with 8 and more
# dimensions the neighbourhoods extend over most of the unit square.
#
# A tile (S, Q, W) has Q queries against S * W points, as S products so small that BLAS computes them on one thread:
# threads that synchronise after each of many small products cost far more than they save when a core is busy
# (measured on two busy cores: 33 s instead of 2).


Indices = npt.NDArray[np.intp]

_STACK, _WIDTH = 32, 128  # products in a tile and points in each; with 64 queries a tile is 2 MB
_QUERIES = 64
_ONE_THREAD = 262_144  # multiplications of a product that OpenBLAS does not split among threads
_SLACK = 64 * np.finfo(np.float64).eps  # rounding of a squared distance, as a share of the largest square
_FAR = 1e300  # the squared distance of a padding point; finite, because infinity times zero is NaN


def center(first: Array, second: Array) -> tuple[Array, Array]:
    """Both sets relative to the mean of the first: distances do not depend on the origin, but their rounding does."""
    origin = first.mean(axis=0)
    return first - origin, second - origin


def rounding(*points: Array) -> float:
    """The maximum error of squared distances between these points (., D)."""
    return float(_SLACK * max((p * p).sum(axis=1).max() for p in points))


def least_squared(queries: Array, points: Array, weights: Array | None = None) -> Array:
    """For each query (Q, D) the least |query - point|^2 + weight over the points (P, D) with weights (P,), or 0: (Q,).

    With minus a squared radius as the weight this is the power distance: the query lies in one of the balls if it is at
    most 0. Time O(Q P D), memory a few MB. Rounded by up to `rounding`.
    """
    out = np.full(len(queries), np.inf)
    for rows, _, tile in _tiles(queries, points, weights):
        np.minimum(out[rows], tile.min(axis=0).min(axis=1), out=out[rows])
    return out


def nearest(queries: Array, points: Array) -> tuple[Array, Indices]:
    """Distance (Q,) from each query (Q, D) to its nearest of the points (P, D), and that point's index (Q,).

    The search is rounded (`rounding`), the distance is not: it is computed from the pair found. Time O(Q P D).
    """
    out = np.full(len(queries), np.inf)
    index = np.zeros(len(queries), dtype=np.intp)
    for rows, start, tile in _tiles(queries, points):
        stack, _, width = tile.shape
        low = tile.min(axis=0).min(axis=1)
        better = np.flatnonzero(low < out[rows])
        out[rows.start + better] = low[better]
        flat = tile[:, better].transpose(1, 0, 2).reshape(len(better), stack * width)
        index[rows.start + better] = start + flat.argmin(axis=1)
    return np.linalg.norm(queries - points[index], axis=1), index


def kth_squared(points: Array, k: int) -> Array:
    """Squared distance (P,) from each point to its k-th nearest *other* point; P > k >= 1.

    The points of a tile fall into W classes of S; the k nearest lie in the k classes whose nearest is nearest, so only
    those are searched. Time O(P^2 D), memory O(P k).
    """
    out = np.full((len(points), k), _FAR)
    for rows, start, tile in _tiles(points, points):
        stack, queries, width = tile.shape
        # A point is not its own neighbour.
        own = np.arange(max(rows.start, start), min(rows.stop, start + stack * width))
        tile[(own - start) // width, own - rows.start, (own - start) % width] = _FAR
        if k < width:
            classes = np.argpartition(tile.min(axis=0), k - 1, axis=1)[:, :k]
            tile = np.take_along_axis(tile, classes[None], axis=2)
        found = tile.transpose(1, 0, 2).reshape(queries, -1)
        out[rows] = np.partition(np.concatenate([out[rows], found], axis=1), k - 1, axis=1)[:, :k]
    kth: Array = np.maximum(out.max(axis=1), 0.0)
    return kth


def _tiles(queries: Array, points: Array, weights: Array | None = None) -> Iterator[tuple[slice, int, Array]]:
    """Squared distances plus weights in tiles (S, Q, W) whose memory is used again: the queries' rows, the first
    point's index, the tile. Its entry (s, q, w) belongs to point start + s W + w; points beyond the last are far."""
    terms, whole = points.shape[1] + 2, _STACK * _WIDTH
    step = max(1, min(_QUERIES, _ONE_THREAD // (_WIDTH * terms)))
    buffer = np.empty(whole * step)
    for start in range(0, len(points), whole):
        part = points[start : start + whole]
        stack = -(-len(part) // _WIDTH)
        right = np.zeros((stack * _WIDTH, terms))
        right[: len(part), :-2] = -2.0 * part
        right[:, -2] = 1.0
        right[:, -1] = _FAR
        right[: len(part), -1] = (part * part).sum(axis=1)
        if weights is not None:
            right[: len(part), -1] += weights[start : start + whole]
        products = np.ascontiguousarray(right.reshape(stack, _WIDTH, terms).transpose(0, 2, 1))
        for row in range(0, len(queries), step):
            these = queries[row : row + step]
            left = np.column_stack([these, (these * these).sum(axis=1), np.ones(len(these))])
            tile = buffer[: stack * len(these) * _WIDTH].reshape(stack, len(these), _WIDTH)
            yield slice(row, row + len(these)), start, np.matmul(left, products, out=tile)


NEIGHBOURS = 5


def coverage(reference: npt.ArrayLike, generated: npt.ArrayLike, *, neighbours: int = NEIGHBOURS) -> float:
    """Share in [0, 1] of the `reference` scenes (3N, R) that the `generated` scenes (3N, G) cover.

    Time grows with R * (R + G), 1 to 1.6 s for 20,000 each on one core; memory stays at a few MB beyond the scenes for
    any R and G. Raises DataError if the two sets have different numbers of objects, nothing was generated, or
    R <= neighbours.
    """
    poses = checked_pair(reference, generated, (neighbours + 1, 1))
    return covered_share(features(poses[0]), features(poses[1]), neighbours)


def covered_share(reference: Array, generated: Array, neighbours: int = NEIGHBOURS) -> float:
    """The same of points (R, D) and (G, D)."""
    truth, made = center(reference, generated)
    radius = kth_squared(truth, neighbours)
    return float((least_squared(truth, made) <= radius + rounding(truth, made)).mean())
