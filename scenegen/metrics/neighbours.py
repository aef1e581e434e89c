"""Nearest neighbours by brute force: every distance is computed, few are held.

|a - b|^2 = |a|^2 - 2 a.b + |b|^2 is written as one matrix product of the extended points (a, |a|^2, 1) and
(-2 b, 1, |b|^2), so a tile of squared distances costs one product and no further pass. Tiles are as small as a core's
cache: 20,000 against 20,000 points of 8 (28) dimensions take 0.4 (0.7) s on one core. Trees do not pay here; with 8 and
more dimensions the neighbourhoods reach across most of the unit square.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from scenegen.metrics.features import Array

Indices = npt.NDArray[np.intp]

_ROWS, _COLUMNS = 64, 4096  # squared distances held at a time: 2 MB
_CLASSES = 64  # columns that share a class in `kth_squared`
_SLACK = 64 * np.finfo(np.float64).eps  # rounding of a squared distance, as a share of the largest square
_FAR = 1e300  # stands for a column that is none; finite, because infinity times zero is NaN


def centred(first: Array, second: Array) -> tuple[Array, Array]:
    """Both sets about the mean of the first: distances do not depend on the origin, but their rounding does."""
    origin = first.mean(axis=0)
    return first - origin, second - origin


def rounding(*points: Array) -> float:
    """What squared distances between these points (., D) may be wrong by."""
    return float(_SLACK * max((p * p).sum(axis=1).max() for p in points))


def least_squared(queries: Array, points: Array, weights: Array | None = None) -> Array:
    """For each query (Q, D) the least |query - point|^2 + weight over the points (P, D) with weights (P,), or 0: (Q,).

    With minus a squared radius for a weight this is the power distance: the query lies in one of the balls where it is
    at most 0. Time O(Q P D), memory a few MB. Rounded by up to `rounding`.
    """
    out = np.full(len(queries), np.inf)
    for rows, _, tile in _tiles(queries, points, weights):
        np.minimum(out[rows], tile.min(axis=1), out=out[rows])
    return out


def nearest(queries: Array, points: Array) -> tuple[Array, Indices]:
    """Distance (Q,) from each query (Q, D) to its nearest of the points (P, D), and that point's index (Q,).

    The search is rounded (`rounding`), the distance is not: it is computed from the pair found. Time O(Q P D).
    """
    out = np.full(len(queries), np.inf)
    index = np.zeros(len(queries), dtype=np.intp)
    for rows, columns, tile in _tiles(queries, points):
        low = tile.min(axis=1)
        better = np.flatnonzero(low < out[rows])
        out[rows.start + better] = low[better]
        index[rows.start + better] = columns.start + tile[better].argmin(axis=1)
    return np.linalg.norm(queries - points[index], axis=1), index


def kth_squared(points: Array, k: int) -> Array:
    """Squared distance (P,) from each point to its k-th nearest *other* point; P > k >= 1.

    The columns of a tile are dealt into classes; the k nearest columns lie in the k classes whose nearest is nearest,
    so only those are searched. Time O(P^2 D), memory O(P k).
    """
    out = np.full((len(points), k), _FAR)
    for rows, columns, tile in _tiles(points, points):
        # a point is not its own neighbour
        own = np.arange(max(rows.start, columns.start), min(rows.stop, columns.stop))
        tile[own - rows.start, own - columns.start] = _FAR
        found = _smallest(tile, k)
        out[rows] = np.partition(np.concatenate([out[rows], found], axis=1), k - 1, axis=1)[:, :k]
    kth: Array = np.maximum(out.max(axis=1), 0.0)
    return kth


def _smallest(tile: Array, k: int) -> Array:
    """Values (B, C) -> (B, >= min(k, C)) of them, the k least included."""
    width = tile.shape[1] // _CLASSES
    if width <= k:
        return tile
    whole = width * _CLASSES
    dealt = tile[:, :whole].reshape(len(tile), _CLASSES, width)
    classes = np.argpartition(dealt.min(axis=1), k - 1, axis=1)[:, :k]
    found = np.take_along_axis(dealt, classes[:, None, :], axis=2).reshape(len(tile), -1)
    return np.concatenate([found, tile[:, whole:]], axis=1)


def _tiles(queries: Array, points: Array, weights: Array | None = None) -> Iterator[tuple[slice, slice, Array]]:
    """Rows, columns and values of tiles of the (Q, P) squared distances plus weights; the values' memory is reused."""
    buffer = np.empty(_ROWS * _COLUMNS)
    for column in range(0, len(points), _COLUMNS):
        part = points[column : column + _COLUMNS]
        squares = (part * part).sum(axis=1)
        if weights is not None:
            squares += weights[column : column + _COLUMNS]
        right = np.vstack([-2.0 * part.T, np.ones(len(part)), squares])
        for row in range(0, len(queries), _ROWS):
            these = queries[row : row + _ROWS]
            left = np.column_stack([these, (these * these).sum(axis=1), np.ones(len(these))])
            tile = buffer[: len(these) * len(part)].reshape(len(these), len(part))
            yield (
                slice(row, row + len(these)),
                slice(column, column + len(part)),
                np.matmul(left, right, out=tile),
            )
