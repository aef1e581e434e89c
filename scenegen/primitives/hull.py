"""Convex hulls of points in the plane."""

from __future__ import annotations

from collections.abc import Sequence

from scenegen.primitives.footprint import Polygon

Point = tuple[float, float]


def _turn(a: Point, b: Point, c: Point) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def convex_hull(points: Sequence[Point]) -> Polygon:
    """Corners of the hull, counter-clockwise, without those that lie on an edge (Andrew 1979, monotone chain)."""
    ordered = sorted(set(points))
    chains: list[list[Point]] = []
    for run in (ordered, ordered[::-1]):
        chain: list[Point] = []
        for point in run:
            while len(chain) >= 2 and _turn(chain[-2], chain[-1], point) <= 0.0:
                chain.pop()
            chain.append(point)
        chains.append(chain[:-1])
    return Polygon((*chains[0], *chains[1]))


def is_convex(points: Sequence[Point]) -> bool:
    """Whether points in order are the corners of a convex polygon, either way round."""
    turns = [_turn(points[k - 2], points[k - 1], points[k]) for k in range(len(points))]
    return (all(turn >= 0.0 for turn in turns) or all(turn <= 0.0 for turn in turns)) and any(turns)
