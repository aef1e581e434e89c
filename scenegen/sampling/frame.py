"""What a chain moves, and how its phi is computed: the poses that phi depends on, held as one array per row.

Rows that phi does not read (headings that no label mentions, objects that no label names) are independent of all else
and uniform: chains leave them out, and they are drawn afresh for every scene that is handed out. Everything here is
numpy in float64: on chunks that stay in cache it takes less per call than torch, and it rounds like the final scoring.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from scenegen.bounds.effort import NEVER, Stop
from scenegen.lang.core import Apply, Atom, Const, Coord, Core, Junction, children, last_uses
from scenegen.primitives import NUMPY, PRIMITIVES
from scenegen.primitives.namespace import turning
from scenegen.scene.workspace import TWO_PI

if TYPE_CHECKING:
    from scenegen.sampling.problem import Problem

Array = npt.NDArray[np.float64]

_CHOICES, _FEW = 2, 8  # junctions whose choice is watched, and the most arguments they have
LIVE = 1 << 24  # nodes times scenes up to which all scenes are taken at once
_WATCHED = 48  # atoms, and junctions, that are watched for correlation; specs with more have many of a kind


@dataclass(frozen=True, slots=True)
class Part:
    """One object as chains see it: where its x, y and heading stand among the moving rows, None for those that rest."""

    x: int | None
    y: int | None
    theta: int | None

    @property
    def rows(self) -> tuple[int, ...]:
        return tuple(row for row in (self.x, self.y, self.theta) if row is not None)


@dataclass(frozen=True, slots=True)
class Frame:
    """The D moving rows of a problem.

    `rows` are their places in (3N, B) storage; `low`, `high` (D,) their box; `circular` (D,) tells headings that may
    wrap. `parts` are the objects with a moving row. `core` is the gated core, `resting` the value of the other rows.
    """

    core: Core
    rows: tuple[int, ...]
    low: Array
    high: Array
    circular: npt.NDArray[np.bool_]
    parts: tuple[Part, ...]
    resting: Array

    @property
    def dimension(self) -> int:
        return len(self.rows)

    def draw(self, count: int, rng: np.random.Generator) -> list[Array]:
        """`count` poses from the uniform distribution over the box, one (count,) array per moving row."""
        return [rng.random(count) * (high - low) + low for low, high in zip(self.low, self.high, strict=True)]

    def complete(self, moving: Sequence[Array], lowest: Array, highest: Array, rng: np.random.Generator) -> Array:
        """Whole scenes (3N, B) around the moving rows; the rows that phi does not read are drawn afresh."""
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


def frame_of(problem: Problem) -> Frame:
    """The moving rows of a problem: those that some label (or the requirement) reads and that have room to move."""
    return make_frame(problem.core, problem.lowest, problem.highest)


def make_frame(core: Core, lowest: Array, highest: Array) -> Frame:
    """The moving rows of a core over a box of poses, (3N,) each."""
    rows = tuple(sorted(row for row in read_rows(core) if lowest[row] < highest[row]))
    index = {row: place for place, row in enumerate(rows)}
    objects = sorted({row // 3 for row in rows})
    parts = tuple(Part(*(index.get(3 * thing + axis) for axis in range(3))) for thing in objects)
    chosen = list(rows)
    low, high = lowest[chosen], highest[chosen]
    circular = np.array([row % 3 == 2 for row in rows], dtype=bool) & (np.abs(high - low - TWO_PI) < 1e-12)
    return Frame(core, rows, low, high, circular, parts, lowest.copy())


def read_rows(core: Core) -> set[int]:
    """The rows of (3N, B) storage that phi of any label depends on."""
    needed = set(core.labels.values())
    rows = set()
    for index in range(len(core.nodes) - 1, -1, -1):
        if index in needed:
            node = core.nodes[index]
            needed.update(children(node))
            if isinstance(node, Coord):
                rows.add(node.row)
    return rows


def watched(core: Core) -> Core:
    """The core whose labels are its atoms and its conjunctions and disjunctions (an even choice of them): what chains
    are to forget, too. A disjunct's value tells the modes of a spec apart where no single atom does."""
    formulas = [[index for index, node in enumerate(core.nodes) if isinstance(node, kind)] for kind in (Atom, Junction)]
    chosen = [index for kind in formulas for index in kind[:: max(1, -(-len(kind) // _WATCHED))]]
    return replace(core, labels={str(index): index for index in chosen}, requirement=None)


def choices(core: Core) -> list[tuple[Junction, Core]]:
    """A few junctions, those last on the tape and so nearest to the labels, each with a core whose labels are what it
    takes the least or the greatest of: which one that is tells modes apart."""
    few = [node for node in core.nodes if isinstance(node, Junction) and len(node.args) <= _FEW]
    return [
        (node, replace(core, labels={str(place): arg for place, arg in enumerate(node.args)}, requirement=None))
        for node in few[: -1 - _CHOICES : -1]
    ]


class Tape:
    """phi of the labels of a core over the moving rows of a frame. `stop` is checked before every primitive."""

    def __init__(self, frame: Frame, core: Core | None = None, stop: Stop = NEVER) -> None:
        self._stop = stop
        self._core = frame.core if core is None else core
        self._dead = last_uses(self._core)
        needed = set(self._core.labels.values())
        for index in range(len(self._core.nodes) - 1, -1, -1):
            if index in needed:
                needed.update(children(self._core.nodes[index]))
        self._steps = [(index, self._core.nodes[index]) for index in sorted(needed)]
        self.length = len(self._steps)
        place = {row: index for index, row in enumerate(frame.rows)}
        self._coords: dict[int, int | np.float64] = {
            index: place.get(node.row, frame.resting[node.row])
            for index, node in self._steps
            if isinstance(node, Coord)
        }
        self._headings = [place[row] for row in frame.rows if row % 3 == 2]

    def __call__(self, rows: Sequence[Array]) -> list[Array]:
        """D arrays of shape (B,) -> one (B,) array per label. Raises StoppedError where time is up.

        Thousands of nodes are computed for some scenes at a time: a conjunction keeps all its parts until it is done.
        """
        count = rows[0].size if rows else 1
        if self.length * count <= LIVE:
            return self._values(rows)
        size = max(64, LIVE // 4 // self.length)
        parts = [self._values([row[start : start + size] for row in rows]) for start in range(0, count, size)]
        return [np.concatenate(values) for values in zip(*parts, strict=True)]

    def _values(self, rows: Sequence[Array]) -> list[Array]:
        values: list[Any] = [None] * len(self._core.nodes)
        namespace = turning(NUMPY, [rows[place] for place in self._headings])
        for index, node in self._steps:
            match node:
                case Const(value):
                    values[index] = value
                case Coord():
                    where = self._coords[index]
                    values[index] = rows[where] if isinstance(where, int) else where
                case Apply(primitive, args, shapes):
                    self._stop.check()
                    evaluate = PRIMITIVES[primitive].evaluate
                    values[index] = evaluate(namespace, *shapes, *[values[arg] for arg in args])
                case Atom(margin):
                    values[index] = values[margin]
                case Junction(kind, args):
                    fold = np.minimum if kind == "min" else np.maximum
                    value = values[args[0]]
                    for arg in args[1:]:
                        value = fold(value, values[arg])
                    values[index] = value
            for child in self._dead[index]:
                values[child] = None
        shape = rows[0].shape if rows else ()
        return [np.broadcast_to(values[node], shape) for node in self._core.labels.values()]
