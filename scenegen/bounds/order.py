"""Coordinates in a row, each at least so far from the one before: x1 + l1 <= x2, x2 + l2 <= x3, ...

Where all have the same room, what is left after taking the distances l off is a simplex, and uniform points of it are
sorted uniform numbers: no bins, nothing rejected. One of the gaps may be bounded from above as well: its excess g has
the survival function ((L - g) / L)^n, and the others share what it leaves (spacings of uniform samples: Pyke 1965).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scenegen.bounds.chain import Edge

Array = npt.NDArray[np.float64]

NEAR = 1e-5  # of the room: how much the rooms may differ, for contraction loosens every gap a little
NETWORK = 12  # numbers that are sorted by comparing and swapping rows


@dataclass(frozen=True, slots=True)
class Order:
    """Row `rows[k]` is `offset[k]` plus the k-th smallest of n numbers in [0, room].

    `narrow` is the gap (after point `narrow`, counted from 0) whose excess is at most `most`; -1 for none.
    """

    rows: tuple[int, ...]
    offset: Array
    room: float
    narrow: int = -1
    most: float = math.inf

    @property
    def log_volume(self) -> float:
        count = len(self.rows)
        whole = count * math.log(self.room) - math.lgamma(count + 1)
        return whole if self.narrow < 0 else whole + math.log(self._share)

    @property
    def _share(self) -> float:
        return -math.expm1(len(self.rows) * math.log1p(-self.most / self.room))

    def draw(self, count: int, rng: np.random.Generator) -> list[Array]:
        """`count` points: one array per row."""
        points = len(self.rows)
        if self.narrow < 0:
            values = _sorted(points, count, rng)
            for value, offset in zip(values, self.offset, strict=True):
                value *= self.room
                value += offset
            return values
        gap = rng.random(count)
        gap *= -self._share
        np.log1p(gap, out=gap)
        gap /= points
        np.exp(gap, out=gap)  # what the gap leaves, as a share of the room
        gap *= self.room
        values = _sorted(points - 1, count, rng)
        for value in values:
            value *= gap
        np.subtract(self.room, gap, out=gap)
        later = [value + gap for value in values[self.narrow : self.narrow + 1]]
        for value in values[self.narrow + 1 :]:
            value += gap
        values[self.narrow + 1 : self.narrow + 1] = later
        for value, offset in zip(values, self.offset, strict=True):
            value += offset
        return values


def _sorted(points: int, count: int, rng: np.random.Generator) -> list[Array]:
    """Uniform numbers in [0, 1), sorted along the list."""
    if points > NETWORK:
        return list(np.sort(rng.random((points, count)), axis=0))
    values = [rng.random(count) for _ in range(points)]
    spare = np.empty(count)
    for last in range(1, points):
        for k in range(last, 0, -1):
            np.minimum(values[k - 1], values[k], out=spare)
            np.maximum(values[k - 1], values[k], out=values[k])
            values[k - 1], spare = spare, values[k - 1]
    return values


def make_order(edges: Sequence[Edge], intervals: Mapping[int, tuple[float, float]]) -> Order | None:
    """The order that a tree of edges makes, None where it is none: not a path, rooms of different size, or more than
    one gap with an upper end that matters."""
    near: dict[int, list[tuple[int, float, float]]] = {}
    for edge in edges:
        near.setdefault(edge.parent, []).append((edge.child, edge.low, edge.high))
        near.setdefault(edge.child, []).append((edge.parent, -edge.high, -edge.low))
    ends = sorted(row for row, others in near.items() if len(others) == 1)
    if len(ends) != 2 or any(len(others) > 2 for others in near.values()):
        return None
    for begin in ends:
        rows, gaps = _walk(begin, near)
        order = _fit(rows, gaps, intervals)
        if order is not None:
            return order
    return None


def _walk(
    begin: int, near: Mapping[int, Sequence[tuple[int, float, float]]]
) -> tuple[list[int], list[tuple[float, float]]]:
    rows, gaps = [begin], list[tuple[float, float]]()
    before = -1
    while True:
        following = [step for step in near[rows[-1]] if step[0] != before]
        if not following:
            return rows, gaps
        before = rows[-1]
        row, low, high = following[0]
        rows.append(row)
        gaps.append((low, high))


def _fit(
    rows: list[int], gaps: list[tuple[float, float]], intervals: Mapping[int, tuple[float, float]]
) -> Order | None:
    if not all(math.isfinite(low) for low, _ in gaps):
        return None
    offset = np.concatenate([np.zeros(1), np.cumsum([low for low, _ in gaps])])
    # Contraction may have stopped before the ends had told each other along a long row.
    low = np.maximum.accumulate(np.array([intervals[row][0] for row in rows]) - offset)
    high = np.minimum.accumulate((np.array([intervals[row][1] for row in rows]) - offset)[::-1])[::-1]
    begin, room = float(low.min()), float(high.max() - low.min())
    if room <= 0.0 or low.max() - low.min() > NEAR * room or high.max() - high.min() > NEAR * room:
        return None
    bounded = [(k, most - least) for k, (least, most) in enumerate(gaps) if most - least < room * (1.0 - NEAR)]
    if len(bounded) > 1 or any(most <= 0.0 for _, most in bounded):
        return None
    narrow, most = bounded[0] if bounded else (-1, math.inf)
    return Order(tuple(rows), offset + begin, room, narrow, most)
