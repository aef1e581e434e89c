"""Proofs that a table is too full, from areas alone.

Objects that keep clear of each other hold discs that do so, too. Of points in a convex set with area A and perimeter P
that are at least d apart, there are no more than 2 A / (sqrt(3) d^2) + P / (2 d) + 1 (Oler 1961, "An inequality in the
geometry of numbers"). And footprints that do not overlap take no more area than there is. Both are held against the
boxes that contraction leaves to the objects' places, for all objects and for those of each box by themselves.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping

import numpy as np

from scenegen.pose import PLACE, row_of
from scenegen.primitives.footprint import POINT, Box, Circle, Footprint
from scenegen.primitives.outline import corners, measures
from scenegen.sampling.growth.graph import Graph

Rectangle = tuple[float, float, float, float]  # left, bottom, right, top
Distances = dict[tuple[int, int], float]

SAFE = 1e-9  # relative: bounds of contraction are loose by that much
MOST = 64  # distances that are looked at


def too_full(graph: Graph, names: Collection[str]) -> str:
    """Why there is no scene, as a sentence; "" where that is not proved."""
    apart, clear, shapes = _distances(graph)
    places = {thing: _place(graph, thing) for thing in sorted({end for pair in apart for end in pair})}
    called = list(names)
    for rectangle in dict.fromkeys([*places.values(), _around(places.values())] if places else ()):
        inside = [thing for thing, place in places.items() if _within(place, rectangle)]
        width, height = rectangle[2] - rectangle[0], rectangle[3] - rectangle[1]
        near = {pair: least for pair, least in apart.items() if pair[0] in inside and pair[1] in inside}
        for value in sorted({round(value, 12) for value in near.values() if value > 0.0}, reverse=True)[:MOST]:
            least = value * (1.0 - SAFE)
            group = _clique(inside, near, least)
            most = 2.0 * width * height / (math.sqrt(3.0) * least**2) + (width + height) / least + 1.0
            if len(group) > math.floor(most * (1.0 + SAFE) + SAFE):
                return (
                    f"the centres of {len(group)} objects ({_listed(group, called)}) must be {100 * least:.3g} cm"
                    f" apart, in {100 * width:.3g} x {100 * height:.3g} cm: no more than {math.floor(most)} can be"
                )
        group = _clique([thing for thing in inside if thing in shapes], clear, 0.0)
        reach = max((measures(shapes[thing]).outer for thing in group), default=0.0)
        room = width * height + 2.0 * (width + height) * reach + math.pi * reach**2
        taken = sum(area(shapes[thing]) for thing in group)
        if taken > room * (1.0 + SAFE):
            return (
                f"the footprints of {len(group)} objects ({_listed(group, called)}) take {1e4 * taken:.0f} cm2,"
                f" and there are {1e4 * room:.0f}"
            )
    return ""


def _distances(graph: Graph) -> tuple[Distances, Distances, dict[int, Footprint]]:
    """How far the centres of two objects are apart at least, of all and of those whose footprints do not overlap; and
    these footprints."""
    apart: Distances = {}
    clear: Distances = {}
    shapes: dict[int, Footprint] = {}
    for pair in graph.pairs:
        if not (isinstance(pair.first, int) and isinstance(pair.second, int)):
            continue
        least, inner = float(pair.low.min()), [measures(shape).inner for shape in pair.shapes]
        if least < 0.0 or min(inner) < 0.0:
            continue
        key = min(pair.first, pair.second), max(pair.first, pair.second)
        apart[key] = max(apart.get(key, 0.0), least + sum(inner))
        if pair.shapes != (POINT, POINT):
            clear[key] = apart[key]
            shapes |= {pair.first: pair.shapes[0], pair.second: pair.shapes[1]}
    return apart, clear, shapes


def _place(graph: Graph, thing: int) -> Rectangle:
    """Where contraction leaves an object's centre, in any cell."""
    rows = [row_of(thing, axis) for axis in PLACE]
    left, bottom = graph.low[rows].min(axis=1)
    right, top = graph.high[rows].max(axis=1)
    return float(left), float(bottom), float(right), float(top)


def _around(places: Collection[Rectangle]) -> Rectangle:
    left, bottom, right, top = np.array(list(places)).T
    return float(left.min()), float(bottom.min()), float(right.max()), float(top.max())


def _within(place: Rectangle, other: Rectangle) -> bool:
    return place[0] >= other[0] and place[1] >= other[1] and place[2] <= other[2] and place[3] <= other[3]


def _clique(things: Collection[int], apart: Mapping[tuple[int, int], float], least: float) -> list[int]:
    """Objects that are all at least so far apart: many, not always as many as there are."""
    near: dict[int, set[int]] = {thing: set() for thing in things}
    for (first, second), value in apart.items():
        if value >= least and first in near and second in near:
            near[first].add(second)
            near[second].add(first)
    group: list[int] = []
    for thing in sorted(near, key=lambda one: (-len(near[one]), one)):
        if near[thing].issuperset(group):
            group.append(thing)
    return group


def _listed(group: Collection[int], names: list[str]) -> str:
    shown = [f"`{names[thing]}`" for thing in sorted(group)]
    return ", ".join(shown) if len(shown) <= 3 else f"{shown[0]} to {shown[-1]}"


def area(footprint: Footprint) -> float:
    """The area of a footprint, in square metres."""
    if isinstance(footprint, Circle):
        return float(np.pi * footprint.radius**2)
    if isinstance(footprint, Box):
        return footprint.length * footprint.width
    x, y = np.array(corners(footprint)).T
    return float(0.5 * np.abs(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1))))
