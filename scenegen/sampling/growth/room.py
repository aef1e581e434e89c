"""The room that is left for one object: what contraction makes of its box, scene by scene, given what is placed.

Clauses that attract (near a plate, inside one of three bins, pointing north) leave a small part of the table. For every
scene the object's box is cut into a few branches: the two halves of the circle of headings, so that a heading near 0 is
not held against the whole circle, and the alternatives of small disjunctions. Each branch is contracted by the rules
of `bounds.contract`, all scenes at once. Nothing is lost: where the clauses hold, the pose lies in some branch.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise

import numpy as np
import numpy.typing as npt

from scenegen.errors import quoted
from scenegen.geometry.footprint import POINT, Box, Circle, Footprint, corners, measures, standing_area
from scenegen.lang.check.choices import options_of
from scenegen.lang.formula.core import Apply, Const, Coord, Junction, Node, restricted
from scenegen.lang.spec import CheckedSpec, Support
from scenegen.pose import PLACE, THETA, TWO_PI, X, axis_of, row_of
from scenegen.sampling.growth.graph import Clause, Graph, asked, flat, offset_of, ways_of
from scenegen.sampling.growth.touch import Touch
from scenegen.sampling.problem import Problem
from scenegen.search.contract import SLACK, contract, node_bounds, size_of
from scenegen.search.effort import Effort

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.intp]

BRANCHES = 12  # branches of a room at most
ROUNDS = 2  # of contraction: all other objects stand somewhere, so hardly anything comes of more


@dataclass(frozen=True, slots=True, eq=False)
class Boxes:
    """R rows in J branches for P scenes: `low`, `width` (R, J, P). `volumes` (J, P) are shares of the volume of the
    object's whole box, 0 where a branch is empty.
    `odds` (J, P) are the chances with which branches are drawn from, in proportion to their volumes where None."""

    low: Array
    width: Array
    volumes: Array
    odds: Array | None = None

    def draw(self, tries: int, rng: np.random.Generator) -> Array:
        """Poses uniform over each branch, branches by their odds: (R, tries, P). Anything where there is no room."""
        rows, branches, count = self.low.shape
        if branches == 1:
            return self.low[:, 0, None] + rng.random((rows, tries, count)) * self.width[:, 0, None]
        edges = np.cumsum(self.volumes if self.odds is None else self.odds, axis=0)
        at = rng.random((tries, count)) * edges[-1]
        branch = np.zeros((tries, count), dtype=np.intp)
        for edge in edges[:-1]:
            branch += at >= edge
        scene = np.arange(count)
        return self.low[:, branch, scene] + rng.random((rows, tries, count)) * self.width[:, branch, scene]

    def draw_evenly(self, rng: np.random.Generator) -> Array:
        """A pose for each scene, uniform over one of its branches that are not empty, all of these alike: (R, P)."""
        count = self.low.shape[2]
        open_ = self.volumes > 0.0
        mark = np.floor(rng.random(count) * open_.sum(axis=0))
        branch = np.minimum((np.cumsum(open_, axis=0) <= mark).sum(axis=0), len(open_) - 1)
        scene = np.arange(count)
        return self.low[:, branch, scene] + rng.random((len(self.low), count)) * self.width[:, branch, scene]

    def even_density(self, poses: Array) -> Array:
        """The density of `draw_evenly` at poses (R, P), relative to that over the whole box: (P,)."""
        density = np.zeros(poses.shape[1])
        for branch, volume in enumerate(self.volumes):
            inside = volume > 0.0
            for row, low, width in zip(poses, self.low[:, branch], self.width[:, branch], strict=True):
                inside &= (row >= low) & (row <= low + width)
            density += np.where(inside, 1.0 / np.where(inside, volume, 1.0), 0.0)
        out: Array = density / np.maximum((self.volumes > 0.0).sum(axis=0), 1)
        return out

    def density(self, poses: Array) -> Array:
        """The density of `draw` at poses (R, ..., P), relative to that over the whole box: (..., P), 0 where there is
        no room."""
        total = self.volumes.sum(axis=0)
        if self.odds is None:
            out: Array = self.holding(poses) * np.where(total > 0.0, 1.0 / np.where(total > 0.0, total, 1.0), 0.0)
            return out
        found = np.zeros(poses.shape[1:])
        for low, width, volume, odds in zip(
            self.low.swapaxes(0, 1), self.width.swapaxes(0, 1), self.volumes, self.odds, strict=True
        ):
            each = np.where(volume > 0.0, odds / np.where(volume > 0.0, volume, 1.0), 0.0)
            if not each.any():
                continue
            inside = (poses[0] >= low[0]) & (poses[0] <= low[0] + width[0])
            for row, least, wide in zip(poses[1:], low[1:], width[1:], strict=True):
                inside &= (row >= least) & (row <= least + wide)
            found += inside * each
        return found

    def holding(self, poses: Array) -> Array:
        """How many of the branches that are not empty hold each pose: (R, ..., P) -> (..., P)."""
        if self.low.shape[1] == 1:
            return np.ones(poses.shape[1:])
        found = np.zeros(poses.shape[1:])
        for branch in range(self.low.shape[1]):
            inside = np.broadcast_to(self.volumes[branch] > 0.0, poses.shape[1:]).copy()
            for row, low, width in zip(poses, self.low[:, branch], self.width[:, branch], strict=True):
                inside &= (row >= low) & (row <= low + width)
            found += inside
        return found


@dataclass(frozen=True, slots=True, eq=False)
class FreePoses:
    """The room of one object under some clauses. `nodes` is the part of the tape that is contracted, `dims` its nodes
    of the object's rows, `others` those of other objects' rows. `branches` say, for each branch, which half of the
    circle (-1: all of it) and which ends it adds."""

    touch: Touch
    clauses: tuple[Clause, ...]
    nodes: tuple[Node, ...]
    dims: tuple[int, ...]
    others: tuple[tuple[int, int], ...]
    places: Mapping[int, int]
    branches: tuple[tuple[int, tuple[Clause, ...]], ...]
    scale: float

    def boxes(self, scenes: Array, cell: Index, effort: Effort) -> Boxes:
        """The room in each of P scenes, `scenes` (3N, P), `cell` (P,). Raises what `effort` raises."""
        graph, rows = self.touch.graph, list(self.touch.rows)
        count, branches = scenes.shape[1], len(self.branches)
        base_low, base_high = graph.low[rows][:, cell], graph.high[rows][:, cell]
        full = np.prod(np.maximum(base_high - base_low, 1e-300), axis=0)
        if not self.nodes:
            return Boxes(base_low[:, None], (base_high - base_low)[:, None], np.ones((1, count)))
        lo = np.full((len(self.nodes), branches, count), -np.inf)
        hi = np.full((len(self.nodes), branches, count), np.inf)
        for place, low, high in zip(self.dims, base_low, base_high, strict=True):
            lo[place], hi[place] = low, high
        for place, row in self.others:
            lo[place] = hi[place] = scenes[row]
        for clause in self.clauses:
            self._impose(clause, cell, lo, hi, slice(None))
        for branch, (half, ends) in enumerate(self.branches):
            if half >= 0:
                place = self.dims[-1]
                middle = 0.5 * (lo[place, branch] + hi[place, branch])
                if half:
                    lo[place, branch] = middle
                else:
                    hi[place, branch] = middle
            for clause in ends:
                self._impose(clause, cell, lo[:, branch], hi[:, branch], slice(None))
        shape = (len(self.nodes), branches * count)
        lo, hi = lo.reshape(shape), hi.reshape(shape)
        alive = contract(self.nodes, lo, hi, ROUNDS, effort=effort).reshape(branches, count)
        dims = list(self.dims)
        low, high = lo[dims].reshape(-1, branches, count), hi[dims].reshape(-1, branches, count)
        width = np.where(alive, np.maximum(high - low, 0.0), 0.0)
        return Boxes(np.where(alive, low, 0.0), width, np.prod(width, axis=0) / full)

    def _impose(self, clause: Clause, cell: Index, lo: Array, hi: Array, columns: Index | slice) -> None:
        place = self.places.get(clause.node)
        if place is None:
            return
        low = clause.low[0] if len(clause.low) == 1 else clause.low[cell]
        high = clause.high[0] if len(clause.high) == 1 else clause.high[cell]
        with np.errstate(invalid="ignore"):
            low = low - SLACK * (self.scale + np.abs(low))
            high = high + SLACK * (self.scale + np.abs(high))
        least, most = lo[place], hi[place]  # indexed in two steps: numpy moves columns to the front beside a number
        least[..., columns] = np.fmax(least[..., columns], low)
        most[..., columns] = np.fmin(most[..., columns], high)


def make_room(
    problem: Problem,
    touch: Touch,
    clauses: Sequence[Clause],
    choice: Sequence[tuple[Clause, ...]] = (),
    *,
    halved: bool = False,
) -> FreePoses:
    """The room of an object under clauses whose other objects are placed, with a branch for each way of a `choice`; or
    one for each half of the circle of headings and each way of a choice, where it is to be `halved`."""
    tape, rows = problem.tape, touch.rows
    scale = size_of(problem.lowest, problem.highest)
    splits = [split for clause in clauses if len(split := _alternatives(problem, clause)) > 1]
    splits = [list(choice)] if choice else splits
    turned = bool(rows) and axis_of(rows[-1]) == THETA and _whole_circle(touch, rows[-1]) and bool(clauses or choice)
    halves = (0, 1) if turned and (halved or not choice) else (-1,)
    while splits and not choice and math.prod(map(len, splits)) * len(halves) > BRANCHES:
        splits.pop(max(range(len(splits)), key=lambda place: len(splits[place])))
    branches = tuple(
        (half, tuple(clause for way in ways_ for clause in way))
        for half in halves
        for ways_ in itertools.product(*splits)
    )
    imposed = [
        *clauses,
        *(clause for split in splits for way in split for clause in way),
    ]
    wanted = [tape.where[clause.node] for clause in imposed]
    if not wanted:
        return FreePoses(touch, (), (), (), (), {}, ((-1, ()),), scale)
    dims = [tape.rows[row] for row in rows]
    nodes, number = restricted(tape.nodes, [*wanted, *dims])
    mine = {number[node] for node in dims}
    others = [(place, node.row) for place, node in enumerate(nodes) if isinstance(node, Coord) and place not in mine]
    return FreePoses(
        touch,
        tuple(clauses),
        nodes,
        tuple(number[node] for node in dims),
        tuple(others),
        {clause.node: number[tape.where[clause.node]] for clause in imposed},
        branches,
        scale,
    )


def _whole_circle(touch: Touch, row: int) -> bool:
    graph = touch.graph
    return bool((graph.high[row] - graph.low[row]).max() > 0.99 * TWO_PI)


def _alternatives(problem: Problem, clause: Clause) -> list[tuple[Clause, ...]]:
    """The ways in which a disjunction can hold, each as what it asks for; none for other clauses."""
    core = problem.core
    if not isinstance(core.nodes[clause.node], Junction):
        return []
    ways = (Clause(arg, clause.objects, clause.low, clause.high) for arg in flat(core, clause.node))
    return [
        tuple(Clause(node, clause.objects, low, high) for node, (low, high) in asked(core, way).items()) for way in ways
    ]


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

SAFE = 1e-9  # relative: bounds of contraction are loose by that much
MOST = 64  # distances that are looked at
SEAM = 1e-8  # taken off either end of a choice's part of the switch: there both surfaces would do


@dataclass(frozen=True, slots=True)
class SupportArea:
    """Where some objects are: on the surfaces that are `named`, else on the table. `parts` are the outlines of the
    surfaces, or the box of the centres; all of a footprint is inside those that are walled, elsewhere the centre."""

    where: str
    parts: tuple[tuple[Footprint, bool], ...]
    named: str = ""

    def most(self, least: float, inner: float) -> int:
        """How many centres of discs of radius `inner` are `least` apart at most."""
        found = 0
        for outline, walled in self.parts:
            radius = inner if walled else 0.0
            inside, around = standing_area(Circle(radius), outline), _around_it(outline, radius)
            bound = 2.0 * inside / (math.sqrt(3.0) * least**2) + around / (2.0 * least) + 1.0
            found += math.floor(bound * (1.0 + SAFE) + SAFE)
        return found

    def space(self, reach: float) -> float:
        """The area that footprints can cover which reach no further than `reach` from their centres."""
        each = (
            area(outline) + (0.0 if walled else _around_it(outline, 0.0) * reach + math.pi * reach**2)
            for outline, walled in self.parts
        )
        return sum(each)


def too_full(graph: Graph, spec: CheckedSpec) -> Mapping[str, str]:
    """Why there is no scene, as the facts of TABLE_TOO_FULL; none where that is not proved."""
    of_all: dict[int, Footprint] = {}
    apart, clear = _distances(graph, of_all)
    for things, options, room in _surfaces(spec, graph.objects):
        shapes, near, without = of_all, apart, clear
        if spec.choices.keys() & set(things):
            mine = {thing: spec.shapes[thing].footprint for thing in things}
            inner = {thing: measures(shape).inner for thing, shape in mine.items()}
            most = {(a, b): inner[a] + inner[b] for a, b in combinations(things, 2)}
            if not _overfull(spec, room, things, most | apart, most, mine):
                continue  # not even if none may overlap, which takes longer to find out
            shapes = {}
            near, without = _on_each(graph, spec, things, options, shapes)
        if proof := _overfull(spec, room, things, near, without, shapes):
            return {"proof": proof, "surfaces": room.named}
    places = {thing: _place(graph, thing) for thing in sorted({end for pair in apart for end in pair})}
    for rectangle in dict.fromkeys([*places.values(), _around(places.values())] if places else ()):
        inside = [thing for thing, place in places.items() if _within(place, rectangle)]
        width, height = rectangle[2] - rectangle[0], rectangle[3] - rectangle[1]
        room = SupportArea(f"in {100 * width:.3g} x {100 * height:.3g} cm", ((Box(width, height), False),))
        if proof := _overfull(spec, room, inside, apart, clear, of_all):
            return {"proof": proof}
    return {}


def _overfull(
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
    for value in sorted({round(value, 12) for value in near.values() if value > 0.0}, reverse=True)[:MOST]:
        least = value * (1.0 - SAFE)
        group = _clique(things, near, least)
        inner = min((measures(spec.shapes[thing].footprint).inner for thing in group), default=0.0)
        most = room.most(least, max(0.0, inner))
        if len(group) > most:
            return (
                f"the centres of {len(group)} objects ({_listed(group, spec.objects)}) must be {100 * least:.3g} cm"
                f" apart, {room.where}: no more than {most} can be"
            )
    group = _clique([thing for thing in things if thing in shapes], clear, 0.0)
    space = room.space(max((measures(shapes[thing]).outer for thing in group), default=0.0))
    taken = sum(area(shapes[thing]) for thing in group)
    if taken > space * (1.0 + SAFE):
        where = f" on {'' if all(walled for _, walled in room.parts) else 'and around '}{room.named}"
        return (
            f"the footprints of {len(group)} objects ({_listed(group, spec.objects)}) take {1e4 * taken:.0f} cm2,"
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


def _on_each(
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


def _listed(group: Collection[int], names: Sequence[str]) -> str:
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


def _around_it(footprint: Footprint, inner: float) -> float:
    """The length of the border of what is left of a footprint by moving its sides inwards, at most, in metres."""
    if isinstance(footprint, Circle):
        return math.tau * max(0.0, footprint.radius - inner)
    ring = corners(footprint)
    return max(0.0, sum(math.dist(a, b) for a, b in pairwise((*ring, ring[0]))) - math.tau * inner)
