"""Why growth has no plan: how far it got, what refused the rest, and proofs that a table is too full."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations, pairwise
from typing import Any

import numpy as np

from scenegen.arrays import Array
from scenegen.errors import Diagnostic, RequestError, Span, quoted
from scenegen.errors.requests import NO_ROOM, NO_TIME_TO_GROW, TABLE_TOO_FULL
from scenegen.geometry import NUMPY, PRIMITIVES
from scenegen.geometry.footprint import POINT, Box, Circle, Footprint, corners, measures, standing_area
from scenegen.lang.formula.core import Apply, Atom, Const, Coord, Core, Junction
from scenegen.lang.spec import CheckedSpec, Support, options_of
from scenegen.pose import FLAT, PLACE, X, row_of
from scenegen.sampling.growth.constraints import is_within, make_values
from scenegen.sampling.growth.graph import Graph, offset_of, ways_of
from scenegen.sampling.growth.model import GrowthModel, MoveTally, make_growth_model
from scenegen.sampling.growth.population import Grown, PlacementFailed, explore
from scenegen.sampling.plan import NoPlan
from scenegen.sampling.problem import Problem
from scenegen.sampling.report import too_early
from scenegen.search.contract import node_bounds
from scenegen.search.effort import Effort, StoppedError, TooMuchError


@dataclass(frozen=True, slots=True, eq=False)
class GrowthFailed(NoPlan):
    """No plan: time was up (`stuck` is None), there was no room for an object, a `proof` (facts of
    TABLE_TOO_FULL) says that there is none for all of them, or it is `dear`: it takes longer than was allowed."""

    model: GrowthModel | None
    stuck: PlacementFailed | None
    evaluations: float
    proof: Mapping[str, str] = field(default_factory=dict)
    dear: bool = False

    @property
    def time_is_up(self) -> bool:
        return self.stuck is None and not self.proof and not self.dear

    @property
    def final(self) -> bool:
        return self.time_is_up or bool(self.proof)

    @property
    def crowded(self) -> bool:
        """Whether poses met all clauses but those that keep objects apart: the table is too full."""
        return self.stuck is not None and self.stuck.placed.attracted > 0

    @property
    def too_dear(self) -> bool:
        return self.dear

    def error(self, problem: Problem) -> RequestError:
        tried = f"{int(self.evaluations):,} evaluations of growth"
        if self.proof:
            return RequestError(TABLE_TOO_FULL(**self.proof))
        if self.model is None:
            return RequestError(too_early(problem, tried, problem.cells.count))
        if self.stuck is None:
            return RequestError(late_message(self.model, tried))
        with np.errstate(all="ignore"):
            placed = refused_objects(problem, self.model, self.stuck)
            return RequestError(stuck_message(self.model, self.stuck, placed, tried))


# --------------------------------------------------------------------------------------------------------------------
# What is said where no scene has room for all objects: how far it got, and what refused the rest.


PROBED_POSES = 64  # poses in each of so many scenes, by which it is judged which clauses refuse an object
MAX_CLAUSES_SHOWN = 3  # clauses that an error names
TIGHT_SHARE = 0.5  # of an area: more than objects that are put down at random take
MAX_OTHERS_REFUSED = 3  # further objects of which it is seen whether they are refused, too
RETRY_SCENES, RETRY_EVALUATIONS = 256, 1e5  # scenes for that, and evaluations that each may take at least


def refused_objects(problem: Problem, model: GrowthModel, end: PlacementFailed) -> tuple[int, tuple[int, ...]]:
    """How many objects can be placed at once, and which are refused then: those that have been are left to the last, as
    far as a little work goes."""
    refused = [model.order[end.stage]]
    most = end.stage
    for attempt in range(MAX_OTHERS_REFUSED):
        number = np.arange(RETRY_SCENES)
        cell = end.particles.cell[number % end.particles.count]
        try:
            again = make_growth_model(problem, refused, deadline=model.deadline)
        except StoppedError:
            break
        again.most = max(RETRY_EVALUATIONS, model.work)
        try:
            found, _ = explore(again, cell, number % 2, np.random.default_rng(attempt), MoveTally())
        except (StoppedError, TooMuchError):
            most = max(most, again.furthest)
            break
        if isinstance(found, Grown):  # in another order there was room for all: few scenes were lucky
            break
        most = max(most, found.stage)
        thing = again.order[found.stage]
        if thing in refused:
            break
        refused.append(thing)
    return most, tuple(refused)


def stuck_message(
    model: GrowthModel, end: PlacementFailed, placed: tuple[int, tuple[int, ...]], tried: str
) -> Diagnostic:
    """The objects that could be `placed`, see `refused_objects`; the clauses that refuse the first one that could not
    be; and how full the table is."""
    problem, order = model.problem, model.order
    names = problem.core.objects
    most, refused_things = placed
    thing = order[end.stage]
    facts: dict[str, Any] = {
        "names": tuple(names[one] for one in refused_things),
        "placed": str(most),
        "count": len(order),
        **_fullness(model, thing),
    }
    refused = _refusing_clauses(model, end)
    if end.placed.attracted > 0:
        by_footprints, by_distances = _blocking_shares(model, end)
        if not by_distances or by_distances[0][2] < by_footprints:
            crowd = {"crowded": end.placed.attracted, "tries": end.placed.tries, "first": names[thing]}
            return NO_ROOM(tried=tried, **crowd, **facts)
        refused = by_distances
    span: Span | None = None
    if refused:
        text, span, share = refused[0]
        also = "; ".join(f"`{text}` {share:.0%}" for text, _, share in refused[1:MAX_CLAUSES_SHOWN])
        facts |= {"clause": text, "share": share, "others": also}
    return NO_ROOM(span, tried=tried, **facts)


def late_message(model: GrowthModel, tried: str) -> Diagnostic:
    """What to say where time is up while scenes grow."""
    count = len(model.order)
    placed = None if model.furthest == count else str(model.furthest)
    fullest = max((_fullness(model, thing) for thing in model.order), key=lambda facts: facts["filled"])
    return NO_TIME_TO_GROW(
        tried=tried, placed=placed, count=count, tight=fullest["filled"] >= TIGHT_SHARE or None, **fullest
    )


def _fullness(model: GrowthModel, thing: int) -> dict[str, Any]:
    """How full the surfaces are on which an object can stand: the share of their area that the footprints take of those
    that stand nowhere else; of the workspace where it stands on nothing."""
    spec = model.problem.spec
    options = {one: options_of(one, spec.supports, spec.choices) for one in model.order if one < len(spec.shapes)}
    mine = options.get(thing, ())
    things = [one for one, own in options.items() if set(own) <= set(mine) and bool(own) == bool(mine)]
    space = sum(area(one.outline) for one in mine) if mine else _workspace_area(model)
    where = quoted([one.name for one in mine]) if mine else "the workspace"
    filled = sum(area(spec.shapes[one].footprint) for one in things) / space
    return {"standing": len(things), "filled": filled, "where": where}


def _blocking_shares(model: GrowthModel, end: PlacementFailed) -> tuple[float, list[tuple[str, Span | None, float]]]:
    """The share of the poses in the object's room that footprints refuse; and of those that distances do which the
    spec asks for by name, with the text of each clause."""
    thing, particles = model.order[end.stage], end.particles
    some = np.arange(min(PROBED_POSES, particles.count))
    scenes, cell = particles.scenes[:, some], particles.cell[some]
    poses = model.room(thing, end.stage).boxes(scenes, cell, Effort()).draw(PROBED_POSES, np.random.default_rng(0))
    rows: list[Array] = list(scenes)
    for row, values in zip(model.constraints[thing].rows, poses, strict=True):
        rows[row] = values
    placed = set(model.order[: end.stage + 1])
    pairs = [pair for pair in model.graph.pairs if thing in pair.objects and pair.objects <= placed]
    by_footprints, found = np.zeros((PROBED_POSES, len(some)), dtype=bool), []
    for pair in pairs:
        ends = [
            [rows[row_of(end, axis)] for axis in FLAT] if isinstance(end, int) else end
            for end in (pair.first, pair.second)
        ]
        gap = PRIMITIVES["gap"].evaluate(NUMPY, *pair.shapes, *ends[0], *ends[1])
        refused = gap < (pair.low[cell] if len(pair.low) > 1 else pair.low[0])
        if pair.shapes == (POINT, POINT):
            found.append((*_clause_text(model.problem.core, pair.node), float(np.mean(refused))))
        else:
            by_footprints |= refused
    return float(np.mean(by_footprints)), sorted(found, key=lambda one: -one[2])


def _refusing_clauses(model: GrowthModel, end: PlacementFailed) -> list[tuple[str, Span | None, float]]:
    """The clauses other than pairs that touch the object, with the share of poses of its box that each refuses."""
    thing = model.order[end.stage]
    constraints = model.constraints[thing]
    clauses = constraints.clauses_at(end.stage)
    if not clauses:
        return []
    particles, rng = end.particles, np.random.default_rng(0)
    some = np.arange(min(PROBED_POSES, particles.count))
    cell = particles.cell[some]
    rows: list[Array] = list(particles.scenes[:, some])
    for row in constraints.rows:
        low, high = model.graph.low[row][cell], model.graph.high[row][cell]
        rows[row] = low + rng.random((PROBED_POSES, len(some))) * (high - low)
    values = make_values(model.problem.core, [clause.node for clause in clauses])(rows)
    found = []
    for clause, value in zip(clauses, values, strict=True):
        inside = is_within(value, clause, cell)
        if inside is not None:
            text, span = _clause_text(model.problem.core, clause.node)
            found.append((text, span, 1.0 - float(np.mean(inside))))
    return sorted(found, key=lambda one: -one[2])


def _clause_text(core: Core, node: int) -> tuple[str, Span | None]:
    at = core.nodes[node]
    if isinstance(at, Atom):
        return at.text, at.spans[0] if at.spans else None
    assert isinstance(at, Junction)
    text, span = _clause_text(core, at.args[0])
    return at.text or f"{text} {'and' if at.kind == 'min' else 'or'} ...", span


def _workspace_area(model: GrowthModel) -> float:
    space = model.problem.spec.workspace
    return (space.x[1] - space.x[0]) * (space.y[1] - space.y[0])


# --------------------------------------------------------------------------------------------------------------------
# Proofs that a table, or a surface on which things stand, is too full, from areas alone.
#
# Objects that keep clear of each other hold discs that do so, too. Of points in a convex set with area A and
# perimeter P that are at least d apart, there are no more than 2 A / (sqrt(3) d^2) + P / (2 d) + 1 (Oler 1961, "An
# inequality in the geometry of numbers"). And footprints that do not overlap take no more area than there is. Both
# are held against the boxes that contraction leaves to the objects' places, for all objects and for those of each box
# by themselves; and against the surfaces that the spec lets objects stand on: what can stand on several has the room
# of all of them.


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
        named = quoted([one.name for one in surfaces])
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
