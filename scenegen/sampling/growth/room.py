"""The room that is left for one object: what contraction makes of its box, scene by scene, given what is placed; of
what stands on a surface, the places there.

Clauses that attract (near a plate, inside one of three bins, pointing north) leave a small part of the table. For every
scene the object's box is cut into a few branches: the two halves of the circle of headings, so that a heading near 0 is
not held against the whole circle, and the alternatives of small disjunctions. Each branch is contracted by the rules
of `bounds.contract`, all scenes at once. Nothing is lost: where the clauses hold, the pose lies in some branch.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from scenegen.arrays import Array, Bool, Index
from scenegen.lang.formula.core import Coord, Junction, Node, restrict
from scenegen.pose import THETA, TWO_PI, axis_of
from scenegen.sampling.growth.constraints import ObjectConstraints
from scenegen.sampling.growth.graph import Clause, demands_of, flat_args, narrows_any
from scenegen.sampling.problem import Problem
from scenegen.search.contract import CONTRACT_SLACK, contract, size_of
from scenegen.search.effort import Effort
from scenegen.search.surfaces import Stand, Step, step_for

MAX_ROOM_BRANCHES = 12  # branches of a room at most
ROOM_ROUNDS = 2  # of contraction: all other objects stand somewhere, so hardly anything comes of more


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
            density += np.where(self._holds(branch, poses), 1.0 / np.where(volume > 0.0, volume, 1.0), 0.0)
        out: Array = density / np.maximum((self.volumes > 0.0).sum(axis=0), 1)
        return out

    def density(self, poses: Array) -> Array:
        """The density of `draw` at poses (R, ..., P), relative to that over the whole box: (..., P), 0 where there is
        no room."""
        total = self.volumes.sum(axis=0)
        if self.odds is None:
            out: Array = self.branches_with(poses) * np.where(total > 0.0, 1.0 / np.where(total > 0.0, total, 1.0), 0.0)
            return out
        found = np.zeros(poses.shape[1:])
        for branch, (volume, odds) in enumerate(zip(self.volumes, self.odds, strict=True)):
            each = np.where(volume > 0.0, odds / np.where(volume > 0.0, volume, 1.0), 0.0)
            if each.any():
                found += self._holds(branch, poses) * each
        return found

    def branches_with(self, poses: Array) -> Array:
        """How many of the branches that are not empty hold each pose: (R, ..., P) -> (..., P)."""
        if self.low.shape[1] == 1:
            return np.ones(poses.shape[1:])
        found = np.zeros(poses.shape[1:])
        for branch in range(self.low.shape[1]):
            found += self._holds(branch, poses)
        return found

    def _holds(self, branch: int, poses: Array) -> Bool:
        """Whether a branch that is not empty holds each pose: (R, ..., P) -> (..., P)."""
        inside: Bool = np.broadcast_to(self.volumes[branch] > 0.0, poses.shape[1:]).copy()
        for row, low, width in zip(poses, self.low[:, branch], self.width[:, branch], strict=True):
            inside &= (row >= low) & (row <= low + width)
        return inside


@dataclass(frozen=True, slots=True, eq=False)
class FreePoses:
    """The room of one object under some clauses. `nodes` is the part of the tape that is contracted, `dims` its nodes
    of the object's rows, `others` those of other objects' rows. `branches` say, for each branch, which half of the
    circle (-1: all of it) and which ends it adds."""

    constraints: ObjectConstraints
    clauses: tuple[Clause, ...]
    nodes: tuple[Node, ...]
    dims: tuple[int, ...]
    others: tuple[tuple[int, int], ...]
    places: Mapping[int, int]
    branches: tuple[tuple[int, tuple[Clause, ...]], ...]
    scale: float

    def boxes(self, scenes: Array, cell: Index, effort: Effort) -> Boxes:
        """The room in each of P scenes, `scenes` (3N, P), `cell` (P,). Raises what `effort` raises."""
        graph, rows = self.constraints.graph, list(self.constraints.rows)
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
        alive = contract(self.nodes, lo, hi, ROOM_ROUNDS, effort=effort).reshape(branches, count)
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
            low = low - CONTRACT_SLACK * (self.scale + np.abs(low))
            high = high + CONTRACT_SLACK * (self.scale + np.abs(high))
        least, most = lo[place], hi[place]  # indexed in two steps: numpy moves columns to the front beside a number
        least[..., columns] = np.fmax(least[..., columns], low)
        most[..., columns] = np.fmin(most[..., columns], high)


def make_room(
    problem: Problem,
    constraints: ObjectConstraints,
    clauses: Sequence[Clause],
    choice: Sequence[tuple[Clause, ...]] = (),
    *,
    halved: bool = False,
) -> FreePoses:
    """The room of an object under clauses whose other objects are placed, with a branch for each way of a `choice`; or
    one for each half of the circle of headings and each way of a choice, where it is to be `halved`."""
    tape, rows = problem.tape, constraints.rows
    scale = size_of(problem.lowest, problem.highest)
    clauses = [one for one in clauses if narrows_any(problem, [one], rows)]
    splits = [split for clause in clauses if len(split := _alternatives(problem, clause)) > 1]
    splits = [list(choice)] if choice else splits
    turned = (
        bool(rows)
        and axis_of(rows[-1]) == THETA
        and _is_whole_circle(constraints, rows[-1])
        and bool(clauses or choice)
    )
    halves = (0, 1) if turned and (halved or not choice) else (-1,)
    while splits and not choice and math.prod(map(len, splits)) * len(halves) > MAX_ROOM_BRANCHES:
        splits.pop(max(range(len(splits)), key=lambda place: len(splits[place])))
    branches = tuple(
        (half, tuple(clause for way in ways_ for clause in way))
        for half in halves
        for ways_ in itertools.product(*splits)
    )
    imposed = [*clauses, *(clause for split in splits for way in split for clause in way)]
    wanted = [tape.where[clause.node] for clause in imposed]
    if not wanted:
        return FreePoses(constraints, (), (), (), (), {}, ((-1, ()),), scale)
    dims = [tape.rows[row] for row in rows]
    nodes, number = restrict(tape.nodes, [*wanted, *dims])
    mine = {number[node] for node in dims}
    others = [(place, node.row) for place, node in enumerate(nodes) if isinstance(node, Coord) and place not in mine]
    return FreePoses(
        constraints,
        tuple(clauses),
        nodes,
        tuple(number[node] for node in dims),
        tuple(others),
        {clause.node: number[tape.where[clause.node]] for clause in imposed},
        branches,
        scale,
    )


def _is_whole_circle(constraints: ObjectConstraints, row: int) -> bool:
    graph = constraints.graph
    return bool((graph.high[row] - graph.low[row]).max() > 0.99 * TWO_PI)


def _alternatives(problem: Problem, clause: Clause) -> list[tuple[Clause, ...]]:
    """The ways in which a disjunction can hold, each as what it asks for; none for other clauses."""
    core = problem.core
    if not isinstance(core.nodes[clause.node], Junction):
        return []
    ways = (Clause(arg, clause.objects, clause.low, clause.high) for arg in flat_args(core, clause.node))
    return [
        tuple(Clause(node, clause.objects, low, high) for node, (low, high) in demands_of(core, way).items())
        for way in ways
    ]


@dataclass(frozen=True, slots=True, eq=False)
class SurfacePlaces:
    """The places of an object on its surfaces in P scenes, drawn with its switch in the frame of what carries it, all
    equally likely, so that tries are lost to other things alone: `low`, `width` (R, P) is its box, `volumes` (1, P) the
    share of it that the places take."""

    step: Step
    rows: tuple[int, ...]
    scenes: Array
    low: Array
    width: Array
    volumes: Array

    def draw(self, tries: int, rng: np.random.Generator) -> Array:
        """Poses uniform over all places: (R, tries, P)."""
        shape = (tries, self.scenes.shape[1])
        drawn = self.step.poses(self.scenes, shape, rng)
        rest = [row for row in self.rows if row not in drawn]
        for row, number in zip(rest, rng.random((len(rest), *shape)), strict=True):
            place = self.rows.index(row)
            drawn[row] = self.low[place] + number * self.width[place]
        return np.stack([np.broadcast_to(drawn[row], shape) for row in self.rows])

    def density(self, poses: Array) -> Array:
        """The density of `draw` at poses (R, ..., P) that stand on a surface, relative to that over the whole box:
        (..., P), 0 outside the box."""
        inside: Bool = np.ones(poses.shape[1:], dtype=bool)
        for row, low, width in zip(poses, self.low, self.width, strict=True):
            inside &= (row >= low) & (row <= low + width)
        out: Array = inside / self.volumes[0]
        return out


@dataclass(frozen=True, slots=True, eq=False)
class SupportPoses:
    """The room of what stands. It has no `nodes` to contract, and one branch."""

    constraints: ObjectConstraints
    step: Step

    nodes: tuple[()] = ()
    branches: tuple[None] = (None,)

    def boxes(self, scenes: Array, cell: Index, effort: Effort) -> SurfacePlaces:
        """Its places in each of P scenes, `scenes` (3N, P), `cell` (P,). Raises what `effort` raises."""
        effort.check()
        graph, rows = self.constraints.graph, self.constraints.rows
        low, high = graph.low[list(rows)][:, cell], graph.high[list(rows)][:, cell]
        width = np.maximum(high - low, 1e-300)
        drawn = {*self.step.rows}
        share = math.exp(self.step.log_volume) / np.prod(
            [wide for row, wide in zip(rows, width, strict=True) if row in drawn], axis=0
        )
        return SurfacePlaces(self.step, rows, scenes, low, width, share[None])


def make_support_poses(stand: Stand, constraints: ObjectConstraints) -> SupportPoses | None:
    """The places of what stands; None where it has none, or where not all of its rows are read."""
    graph = constraints.graph
    step = step_for(stand, lambda row: (float(graph.low[row].min()), float(graph.high[row].max())))
    return SupportPoses(constraints, step) if step is not None and {*step.rows} <= {*constraints.rows} else None
