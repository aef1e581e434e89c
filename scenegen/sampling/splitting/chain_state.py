"""The state of the chains and its phi: the poses that phi depends on, stored as one array per row.

Rows that phi does not read (headings that no label mentions, objects that no label names) are independent of all else
and uniform: chains leave them out, and they are redrawn for every returned scene. Everything here is numpy in
float64: on chunks that stay in cache a call costs less than in torch, and it rounds like the final scoring.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from scenegen.arrays import Array, Bool
from scenegen.geometry import NUMPY, PRIMITIVES, Namespace
from scenegen.geometry.namespace import turning
from scenegen.lang.formula.core import Apply, Atom, Coord, Core, Junction, last_uses, needed_nodes, part_of, read_rows
from scenegen.lang.formula.interpret import Numbers, fold
from scenegen.pose import THETA, TWO_PI, X, Y, axis_of, is_angle, owner, rows_of
from scenegen.search.effort import NEVER, Stop

if TYPE_CHECKING:
    from scenegen.sampling.problem import Problem


MAX_CHOICES, MAX_CHOICE_ARGS = 2, 8  # number of junctions whose choice is tracked, and the most arguments of one
MAX_LIVE_VALUES = 1 << 24  # up to so many nodes times scenes, all scenes are computed at once
MAX_WATCHED_NODES = 48  # atoms, and junctions, whose correlation is tracked; larger specs have many of a kind


@dataclass(frozen=True, slots=True)
class ChainObject:
    """One object of a chain: the index of each axis among the moving rows, None for an axis at rest."""

    at: tuple[int | None, ...]

    @property
    def x(self) -> int | None:
        return self.at[X]

    @property
    def y(self) -> int | None:
        return self.at[Y]

    @property
    def theta(self) -> int | None:
        return self.at[THETA]

    @property
    def rows(self) -> tuple[int, ...]:
        return tuple(row for row in self.at if row is not None)


@dataclass(frozen=True, slots=True)
class ChainState:
    """The D moving rows of a problem.

    `rows` are their indices in (3N, B) storage; `low`, `high` (D,) their box; `circular` (D,) marks headings that may
    wrap. `parts` are the objects with a moving row. `core` is the gated core, `resting` the values of the other rows.
    """

    core: Core
    rows: tuple[int, ...]
    low: Array
    high: Array
    circular: Bool
    parts: tuple[ChainObject, ...]
    resting: Array

    @property
    def dimension(self) -> int:
        return len(self.rows)

    def draw(self, count: int, rng: np.random.Generator) -> list[Array]:
        """`count` poses from the uniform distribution over the box, one (count,) array per moving row."""
        return [rng.random(count) * (high - low) + low for low, high in zip(self.low, self.high, strict=True)]

    def complete(self, moving: Sequence[Array], lowest: Array, highest: Array, rng: np.random.Generator) -> Array:
        """Whole scenes (3N, B) from the moving rows; the rows that phi does not read are drawn at random."""
        count = len(moving[0]) if moving else 0
        out = np.empty((len(lowest), count))
        place = {row: index for index, row in enumerate(self.rows)}
        for row in range(len(lowest)):
            if row in place:
                out[row] = moving[place[row]]
            elif lowest[row] == highest[row]:
                out[row] = lowest[row]
            else:
                fresh = rng.random(count) * (highest[row] - lowest[row]) + lowest[row]
                out[row] = np.minimum(fresh, np.nextafter(highest[row], lowest[row]))
        return out


def chain_state_of(problem: Problem) -> ChainState:
    """The moving rows of a problem: those that a label (or the requirement) reads and whose interval has a width."""
    return make_chain_state(problem.core, problem.lowest, problem.highest)


def make_chain_state(core: Core, lowest: Array, highest: Array) -> ChainState:
    """The moving rows of a core over a box of poses, (3N,) each."""
    rows = tuple(sorted(row for row in read_rows(core) if lowest[row] < highest[row]))
    index = {row: place for place, row in enumerate(rows)}
    objects = sorted({owner(row) for row in rows})
    parts = tuple(ChainObject(tuple(index.get(row) for row in rows_of(thing))) for thing in objects)
    chosen = list(rows)
    low, high = lowest[chosen], highest[chosen]
    circular = np.array([is_angle(row) for row in rows], dtype=bool) & (np.abs(high - low - TWO_PI) < 1e-12)
    return ChainState(core, rows, low, high, circular, parts, lowest.copy())


def watched_core(core: Core) -> Core:
    """The core whose labels are its atoms, conjunctions and disjunctions (evenly chosen if there are many): more
    statistics that must decorrelate. A disjunct's value can distinguish modes of a spec when no single atom does."""
    formulas = [[index for index, node in enumerate(core.nodes) if isinstance(node, kind)] for kind in (Atom, Junction)]
    chosen = [index for kind in formulas for index in kind[:: max(1, -(-len(kind) // MAX_WATCHED_NODES))]]
    return replace(core, labels={str(index): index for index in chosen}, requirement=None)


def choice_cores(core: Core) -> list[tuple[Junction, Core]]:
    """A few junctions, the last ones on the tape, which are nearest to the labels, each with a core whose labels are
    the junction's arguments: which argument is the least or the greatest distinguishes modes."""
    few = [node for node in core.nodes if isinstance(node, Junction) and len(node.args) <= MAX_CHOICE_ARGS]
    return [
        (node, replace(core, labels={str(place): arg for place, arg in enumerate(node.args)}, requirement=None))
        for node in few[: -1 - MAX_CHOICES : -1]
    ]


class _ChainNumbers(Numbers):
    """Nodes as arrays; `stop` is checked before every primitive. `places` has, for each row of storage, the index of a
    moving row among `rows`, or the value of a resting one."""

    def __init__(
        self, namespace: Namespace, rows: Sequence[Array], places: Mapping[int, int | np.float64], stop: Stop
    ) -> None:
        super().__init__(namespace, rows)
        self._places, self._stop = places, stop

    def coordinate(self, index: int, node: Coord) -> Any:
        where = self._places[node.row]
        return self.rows[where] if isinstance(where, int) else where

    def apply(self, index: int, node: Apply, args: list[Any]) -> Any:
        self._stop.check()
        return PRIMITIVES[node.primitive].evaluate(self.namespace, *node.shapes, *args)


class ChainTape:
    """phi of the labels of a core over the moving rows of a chain_state. `stop` is checked before every primitive."""

    def __init__(self, chain_state: ChainState, core: Core | None = None, stop: Stop = NEVER) -> None:
        self._stop = stop
        core = chain_state.core if core is None else core
        read = needed_nodes(core)
        self._core = core if len(read) == len(core.nodes) else part_of(core, tuple(core.labels))
        self._dead = last_uses(self._core)
        self.length = len(read)
        place = {row: index for index, row in enumerate(chain_state.rows)}
        self._coords: dict[int, int | np.float64] = {
            node.row: place.get(node.row, chain_state.resting[node.row])
            for node in self._core.nodes
            if isinstance(node, Coord)
        }
        self._headings = [place[row] for row in chain_state.rows if axis_of(row) == THETA]

    def __call__(self, rows: Sequence[Array]) -> list[Array]:
        """D arrays of shape (B,) -> one (B,) array per label. Raises StoppedError if time is up.

        With thousands of nodes only some scenes are computed at a time, because a conjunction keeps all its parts in
        memory until it is done.
        """
        count = rows[0].size if rows else 1
        if self.length * count <= MAX_LIVE_VALUES:
            return self._values(rows)
        size = max(64, MAX_LIVE_VALUES // 4 // self.length)
        parts = [self._values([row[start : start + size] for row in rows]) for start in range(0, count, size)]
        return [np.concatenate(values) for values in zip(*parts, strict=True)]

    def _values(self, rows: Sequence[Array]) -> list[Array]:
        namespace = turning(NUMPY, [rows[place] for place in self._headings])
        values = fold(self._core.nodes, _ChainNumbers(namespace, rows, self._coords, self._stop), dead=self._dead)
        shape = rows[0].shape if rows else ()
        return [np.broadcast_to(values[node], shape) for node in self._core.labels.values()]
