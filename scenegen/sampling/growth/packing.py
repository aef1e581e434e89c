"""Proofs that a table, or a surface on which things stand, is too full, from areas alone.

Objects that keep clear of each other hold discs that do so, too. Of points in a convex set with area A and perimeter P
that are at least d apart, there are no more than 2 A / (sqrt(3) d^2) + P / (2 d) + 1 (Oler 1961, "An inequality in the
geometry of numbers"). And footprints that do not overlap take no more area than there is. Both are held against the
boxes that contraction leaves to the objects' places, for all objects and for those of each box by themselves; and
against the surfaces that the spec lets objects stand on: what can stand on several has the room of all of them.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise

import numpy as np

from scenegen.arrays import Array
from scenegen.errors import quote_names
from scenegen.geometry.footprint import POINT, Box, Circle, Footprint, corners, measures, standing_area
from scenegen.lang.formula.core import Apply, Const, Coord
from scenegen.lang.spec import CheckedSpec, Support, options_of
from scenegen.pose import PLACE, X, row_of
from scenegen.sampling.growth.graph import Graph, offset_of, ways_of
from scenegen.search.contract import node_bounds

Rectangle = tuple[float, float, float, float]  # left, bottom, right, top
Distances = dict[tuple[int, int], float]

AREA_SLACK = 1e-9  # relative: bounds of contraction are loose by that much
MAX_DISTANCES = 64  # distances that are looked at
SEAM = 1e-8  # taken off either end of a choice's part of the switch: there both surfaces would do


@dataclass(frozen=True, slots=True)
class SupportArea:
    """Where some objects are: on the surfaces that are `named`, else on the table. `parts` are the outlines of the
    surfaces, or the box of the centres; all of a footprint is inside those that are walled, elsewhere the centre."""

    where: str
    parts: tuple[tuple[Footprint, bool], ...]
    named: str = ""

    def max_centers(self, least: float, inner: float) -> int:
        """How many centres of discs of radius `inner` are `least` apart at most."""
        found = 0
        for outline, walled in self.parts:
            radius = inner if walled else 0.0
            inside, around = standing_area(Circle(radius), outline), _border_length(outline, radius)
            bound = 2.0 * inside / (math.sqrt(3.0) * least**2) + around / (2.0 * least) + 1.0
            found += math.floor(bound * (1.0 + AREA_SLACK) + AREA_SLACK)
        return found

    def space(self, reach: float) -> float:
        """The area that footprints can cover which reach no further than `reach` from their centres."""
        each = (
            area(outline) + (0.0 if walled else _border_length(outline, 0.0) * reach + math.pi * reach**2)
            for outline, walled in self.parts
        )
        return sum(each)


def packing_proof(graph: Graph, spec: CheckedSpec) -> Mapping[str, str]:
    """Why there is no scene, as the facts of TABLE_TOO_FULL; none where that is not proved."""
    of_all: dict[int, Footprint] = {}
    apart, clear = _distances(graph, of_all)
    for things, options, room in _surfaces(spec, graph.objects):
        shapes, near, without = of_all, apart, clear
        if spec.choices.keys() & set(things):
            mine = {thing: spec.shapes[thing].footprint for thing in things}
            inner = {thing: measures(shape).inner for thing, shape in mine.items()}
            most = {(a, b): inner[a] + inner[b] for a, b in combinations(things, 2)}
            if not _packing_proof(spec, room, things, most | apart, most, mine):
                continue  # not even if none may overlap, which takes longer to find out
            shapes = {}
            near, without = _distances_on_surfaces(graph, spec, things, options, shapes)
        if proof := _packing_proof(spec, room, things, near, without, shapes):
            return {"proof": proof, "surfaces": room.named}
    places = {thing: _place_bounds(graph, thing) for thing in sorted({end for pair in apart for end in pair})}
    for rectangle in dict.fromkeys([*places.values(), _bounding_box(places.values())] if places else ()):
        inside = [thing for thing, place in places.items() if _contains(place, rectangle)]
        width, height = rectangle[2] - rectangle[0], rectangle[3] - rectangle[1]
        room = SupportArea(f"in {100 * width:.3g} x {100 * height:.3g} cm", ((Box(width, height), False),))
        if proof := _packing_proof(spec, room, inside, apart, clear, of_all):
            return {"proof": proof}
    return {}


def _packing_proof(
    spec: CheckedSpec,
    room: SupportArea,
    things: Sequence[int],
    apart: Distances,
    clear: Distances,
    shapes: Mapping[int, Footprint],
) -> str:
    """Why some objects do not fit into a room, as a sentence; "" where that is not proved."""
    here = set(things)
    near = {pair: least for pair, least in apart.items() if here.issuperset(pair)}
    for value in sorted({round(value, 12) for value in near.values() if value > 0.0}, reverse=True)[:MAX_DISTANCES]:
        least = value * (1.0 - AREA_SLACK)
        group = _clique(things, near, least)
        inner = min((measures(spec.shapes[thing].footprint).inner for thing in group), default=0.0)
        most = room.max_centers(least, max(0.0, inner))
        if len(group) > most:
            return (
                f"the centres of {len(group)} objects ({_names(group, spec.objects)}) must be {100 * least:.3g} cm"
                f" apart, {room.where}: no more than {most} can be"
            )
    group = _clique([thing for thing in things if thing in shapes], clear, 0.0)
    space = room.space(max((measures(shapes[thing]).outer for thing in group), default=0.0))
    taken = sum(area(shapes[thing]) for thing in group)
    if taken > space * (1.0 + AREA_SLACK):
        where = f" on {'' if all(walled for _, walled in room.parts) else 'and around '}{room.named}"
        return (
            f"the footprints of {len(group)} objects ({_names(group, spec.objects)}) take {1e4 * taken:.0f} cm2,"
            f" and there are {1e4 * space:.0f}{where if room.named else ''}"
        )
    return ""


def _surfaces(spec: CheckedSpec, free: Collection[int]) -> Iterator[tuple[list[int], list[Support], SupportArea]]:
    """Free objects that stand on one of the same surfaces, or of some of these, with the surfaces."""
    options = {one: options_of(one, spec.supports, spec.choices) for one in sorted(free)}
    for surfaces in dict.fromkeys(filter(None, options.values())):
        things = [thing for thing, own in options.items() if own and set(own) <= set(surfaces)]
        named = quote_names([one.name for one in surfaces])
        if len(things) > 1:
            parts = tuple((one.outline, one.walled) for one in surfaces)
            yield things, list(surfaces), SupportArea(f"on {named}", parts, named)


def _distances_on_surfaces(
    graph: Graph, spec: CheckedSpec, things: Sequence[int], surfaces: Sequence[Support], shapes: dict[int, Footprint]
) -> tuple[Distances, Distances]:
    """What `_distances` knows of objects of which two stand on the same of some surfaces, whichever it is."""
    low, high = (np.repeat(ends[:, None], len(surfaces), axis=1) for ends in (graph.low.min(1), graph.high.max(1)))
    stands = {thing: options_of(thing, spec.supports, spec.choices) for thing in things}
    for thing in spec.choices.keys() & stands.keys():
        row, ends = row_of(spec.choices[thing].switch, X), (0.0, *spec.choices[thing].ends)
        for column, one in enumerate(surfaces):
            if one in stands[thing]:
                begin, end = ends[stands[thing].index(one)], ends[stands[thing].index(one) + 1]
                seam = min(SEAM, (end - begin) / 2.0)
                low[row, column], high[row, column] = begin + seam, end - seam
    bounds = node_bounds(graph.core, low, high)
    highest = np.array([np.broadcast_to(one.hi, len(surfaces)) for one in bounds])
    each = [_distances(graph, shapes, column) for column in highest.T]
    apart: Distances = {}
    clear: Distances = {}
    for pair in combinations(things, 2):
        both = [known for one, known in zip(surfaces, each, strict=True) if all(one in stands[end] for end in pair)]
        for place, found in enumerate((apart, clear)):
            if all(pair in known[place] for known in both):
                found[pair] = min((known[place][pair] for known in both), default=math.inf)
    return apart, clear


def _distances(graph: Graph, shapes: dict[int, Footprint], highest: Array | None = None) -> tuple[Distances, Distances]:
    """How far the centres of two objects are apart at least, of all and of those whose footprints, or the same part of
    them, do not overlap: these become the `shapes`. `highest` bounds the nodes of the core; left out, constants are
    known."""
    apart: Distances = {}
    clear: Distances = {}

    def learn(first: int, second: int, of: Sequence[Footprint], least: float) -> None:
        key, inner = (min(first, second), max(first, second)), [measures(shape).inner for shape in of]
        if first == second or least < 0.0 or min(inner) < 0.0:
            return
        apart[key] = max(apart.get(key, 0.0), least + sum(inner))
        if POINT not in of and all(shapes.setdefault(*one) == one[1] for one in zip((first, second), of, strict=True)):
            clear[key] = apart[key]

    for pair in graph.pairs:
        if isinstance(pair.first, int) and isinstance(pair.second, int):
            learn(pair.first, pair.second, pair.shapes, float(pair.low.min()))
    nodes = graph.core.nodes
    for clause in (*graph.clauses, *(choice.whole for choice in graph.choices)):
        least, ways = float(clause.low.min()), []
        for way in ways_of(graph.core, clause.node) if least > -math.inf else ():
            node = nodes[way]
            most = node.value if isinstance(node, Const) else math.inf if highest is None else highest[way]
            ways += [] if most < least else [way]
        form = offset_of(nodes, ways[0]) if len(ways) == 1 else None
        if form is not None and form[1] > 0.0:  # max(gap(a, b), -5 cm) >= 0 is a pair, too
            node = nodes[form[0]]
            assert isinstance(node, Apply)
            ends = [nodes[node.args[at]] for at in (0, len(node.args) // 2)]
            things = [one.object for one in ends if isinstance(one, Coord) and one.axis == X]
            if graph.objects.issuperset(things) and len(things) == 2:
                learn(things[0], things[1], node.shapes or (POINT, POINT), least - form[2])
    return apart, clear


def _place_bounds(graph: Graph, thing: int) -> Rectangle:
    """Where contraction leaves an object's centre, in any cell."""
    rows = [row_of(thing, axis) for axis in PLACE]
    left, bottom = graph.low[rows].min(axis=1)
    right, top = graph.high[rows].max(axis=1)
    return float(left), float(bottom), float(right), float(top)


def _bounding_box(places: Collection[Rectangle]) -> Rectangle:
    left, bottom, right, top = np.array(list(places)).T
    return float(left.min()), float(bottom.min()), float(right.max()), float(top.max())


def _contains(place: Rectangle, other: Rectangle) -> bool:
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


def _names(group: Collection[int], names: Sequence[str]) -> str:
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


def _border_length(footprint: Footprint, inner: float) -> float:
    """The length of the border of what is left of a footprint by moving its sides inwards, at most, in metres."""
    if isinstance(footprint, Circle):
        return math.tau * max(0.0, footprint.radius - inner)
    ring = corners(footprint)
    return max(0.0, sum(math.dist(a, b) for a, b in pairwise((*ring, ring[0]))) - math.tau * inner)
