"""A task on a grid, from a spec: one object moves cell by cell, the others stand still."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from experiments.errors import GRID_TASK
from scenegen.api.spec import Spec
from scenegen.errors import RequestError, quote_names
from scenegen.errors.requests import OUT_OF_RANGE, UNKNOWN_OBJECT
from scenegen.geometry import NUMPY
from scenegen.lang.formula.interpret import phi as score

Array = npt.NDArray[np.float64]
Cells = npt.NDArray[np.int64]

MOVES = {"right": (1, 0), "left": (-1, 0), "down": (0, -1), "up": (0, 1)}
ORDER = tuple(MOVES)  # which move is action 0, 1, 2, 3
FREE, GOAL, OFF = 0, 1, 2
CLOSE = 1e-9  # of a cell: rounding does not make a level
MOST = 2_000_000  # cells


class Board(NamedTuple):
    """What compiled code sees: `kind` of every cell, FREE, GOAL or OFF (int8), row by row of x with a frame of cells
    off the table around it, and by how much each of the four actions changes the index (int64)."""

    kind: npt.NDArray[np.int8]
    moves: Cells


@dataclass(frozen=True, slots=True, eq=False)
class GridTask:
    """A spec's table cut into `across` by `deep` cells. All arrays are over the cells of the board, frame included:
    `phi` in metres (least of all labels; nan in the frame), `level`: 0 where phi >= 0, else phi / edge rounded away
    from 0, -1 in the frame."""

    spec: Spec
    moved: int
    across: int
    deep: int
    edge: float
    held: Array
    board: Board
    phi: Array
    level: Cells

    @property
    def levels(self) -> int:
        """The hardest level."""
        return int(self.level.max())

    @property
    def unsatisfied(self) -> Cells:
        """The indices of the free cells."""
        return np.flatnonzero(self.board.kind == FREE)

    def cell_of(self, poses: Array) -> Cells:
        """The cells (n,) in which the moved object stands, of scenes (n, N, 3)."""
        (left, _), (bottom, _) = self.spec.workspace.x, self.spec.workspace.y
        column = np.clip(np.floor((poses[:, self.moved, 0] - left) / self.edge), 0, self.across - 1)
        row = np.clip(np.floor((poses[:, self.moved, 1] - bottom) / self.edge), 0, self.deep - 1)
        found: Cells = ((column + 1) * (self.deep + 2) + row + 1).astype(np.int64)
        return found

    def place_of(self, cells: Cells) -> Array:
        """x and y (n, 2) of the middle of cells."""
        return _places(self.spec, self.deep, self.edge, cells)


def grid_task(
    spec: Spec,
    across: int,
    *,
    moved: str | None = None,
    held: Mapping[str, tuple[float, float]] | None = None,
    order: Sequence[str] = ORDER,
) -> GridTask:
    """Cut a spec's table into `across` columns of square cells; what moves stands in the middle of its cell, heading 0.

    `moved` is the object that moves; left out, the one that the spec does not fix and `held` does not place. `held`
    places others, x and y in metres. The paper's tasks have 2M + 1 columns, the other object in the middle one
    (Sec. V-B). Raises RequestError for a grid too large, an object that is unknown or has no place, and where no cell
    or every cell satisfies the spec.
    """
    if sorted(order) != sorted(MOVES):
        wanted = f"{quote_names(MOVES)}, each once"
        raise RequestError(GRID_TASK(problem=f"the moves {quote_names(order)}", remedy=f"name {wanted}"))
    poses, number = _standing(spec, moved, dict(held or {}))
    (left, right), (bottom, top) = spec.workspace.x, spec.workspace.y
    if across < 2:
        raise RequestError(OUT_OF_RANGE(argument="across", value=across, wanted="2 or more columns"))
    edge = (right - left) / across
    deep = round((top - bottom) / edge)
    if deep < 1 or across * deep > MOST:
        remedy = f"ask for columns that make 1 to {MOST:,} cells"
        raise RequestError(GRID_TASK(problem=f"a grid of {across} by {deep} cells", remedy=remedy))
    width = deep + 2
    inside = (np.arange(1, across + 1)[:, None] * width + np.arange(1, deep + 1)[None, :]).ravel()
    places = _places(spec, deep, edge, inside)
    rows = [np.full(len(inside), value) for value in poses.ravel()]
    rows[3 * number], rows[3 * number + 1] = places[:, 0], places[:, 1]
    values = score(spec.checked.core, rows, NUMPY)
    least = np.minimum.reduce([np.broadcast_to(values[label], len(inside)) for label in spec.labels])
    phi = np.full((across + 2) * width, np.nan)
    phi[inside] = least
    level = np.full(len(phi), -1, np.int64)
    level[inside] = np.maximum(np.ceil(-least / edge - CLOSE), 0.0)
    kind = np.full(len(phi), OFF, np.int8)
    kind[inside] = np.where(level[inside] == 0, GOAL, FREE)
    for what, which in (("no", GOAL), ("every", FREE)):
        if not (kind == which).any():
            problem = f"{what} cell of a grid of {across} by {deep} satisfies {spec.checked.name}"
            remedy = "take more columns, or other places of the objects that stand"
            raise RequestError(GRID_TASK(problem=problem, remedy=remedy))
    moves = np.array([dx * width + dy for dx, dy in (MOVES[name] for name in order)], np.int64)
    return GridTask(spec, number, across, deep, edge, poses, Board(kind, moves), phi, level)


def _places(spec: Spec, deep: int, edge: float, cells: Cells) -> Array:
    (left, _), (bottom, _) = spec.workspace.x, spec.workspace.y
    column, row = np.divmod(cells, deep + 2)
    return np.stack([left + (column - 0.5) * edge, bottom + (row - 0.5) * edge], axis=1)


def _standing(spec: Spec, moved: str | None, held: dict[str, tuple[float, float]]) -> tuple[Array, int]:
    """The poses (N, 3) of the objects that stand, and which one moves."""
    names, fixed = spec.objects, spec.checked.fixed
    for name in [*held, *([] if moved is None else [moved])]:
        if name not in names:
            raise RequestError(UNKNOWN_OBJECT(name=name, known=names))
    if spec.checked.core.requirement is not None:
        problem = f"{spec.checked.name} requires something, which a grid cannot keep"
        remedy = "leave the requirement out, or make it a part of the formula"
        raise RequestError(GRID_TASK(problem=problem, remedy=remedy))
    free = [name for number, name in enumerate(names) if name not in held and number not in fixed]
    if moved is None:
        if len(free) != 1:
            problem = f"{quote_names(free)} could move" if free else "every object has its place"
            raise RequestError(GRID_TASK(problem=problem, remedy="name the one that moves, and places for the others"))
        moved = free[0]
    poses = np.zeros((len(names), 3))
    for number, name in enumerate(names):
        if name in held:
            poses[number, :2] = held[name]
        elif number in fixed:
            poses[number] = fixed[number]
        elif name != moved:
            raise RequestError(GRID_TASK(problem=f"`{name}` has no place", remedy="place it: held={name: (x, y)}"))
    return poses, names.index(moved)
