"""The actions: objects move step by step, in four directions on a grid, or continuously."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice
from typing import Any, Literal, get_args

import numpy as np
import numpy.typing as npt
from gymnasium import Space, error, spaces

from scenegen.curriculum.errors import names, number, one_of, refused
from scenegen.errors import quoted
from scenegen.errors.learning import ACTION_OUT_OF_RANGE, NOTHING_TO_MOVE, UNKNOWN_ACTION, WRONG_ACTION
from scenegen.errors.requests import HELD_BY_SPEC, OUT_OF_RANGE, UNKNOWN_OBJECT, WRONG_VALUE
from scenegen.lang.core import Apply, Atom, Coord, Core, gated, part
from scenegen.lang.spec import CheckedSpec
from scenegen.pose import FLAT, NAMES, PLACE, THETA, TWO_PI, row_of
from scenegen.primitives import PRIMITIVES, Circle

Array = npt.NDArray[np.float64]
Kind = Literal["grid", "continuous"]

STEPS = 20  # from one edge of the workspace to the other, along its shorter side
TURN = math.pi / 8.0  # radians; less than the prelude's tolerance for headings is wide, so that a grid has one in it
WIDTHS = {"number": 1, "place": len(PLACE), "footprint": len(FLAT)}  # numbers of an argument of a primitive
LENIENT = 1e-6  # tolerance of the range for float32 actions


@dataclass(frozen=True, slots=True)
class Moves:
    """`rows` are the rows of (3N, B) storage that the K actions (grid) or components of an action (continuous) move,
    `amounts` by how much, in metres and radians, and `names` describe them."""

    kind: Kind
    rows: npt.NDArray[np.intp]
    amounts: Array
    names: tuple[str, ...]

    def space(self) -> Space[Any]:
        """That of one action."""
        if self.kind == "grid":
            return spaces.Discrete(len(self.rows))
        return spaces.Box(-1.0, 1.0, (len(self.rows),), np.float32)

    def checked(self, actions: Any, count: int) -> npt.NDArray[Any]:
        """B actions as an array, (B,) of numbers or (B, K). Raises gymnasium.error.InvalidAction."""
        try:
            given = np.asarray(actions)
        except ValueError:  # ragged
            given = np.empty(0, dtype=object)
        if self.kind == "grid":
            given = given.reshape(count) if given.size == count else given
            if given.shape != (count,) or given.dtype.kind not in "iu":
                what = "an action is a whole number" if count == 1 else f"{count} actions are needed, whole numbers"
                wanted = f"{what} from 0 to {len(self.rows) - 1}"
                raise refused(WRONG_ACTION(wanted=wanted, value=str(actions)), error.InvalidAction)
            if ((given < 0) | (given >= len(self.rows))).any():
                bad = given[(given < 0) | (given >= len(self.rows))][0]
                raise refused(UNKNOWN_ACTION(number=bad, last=len(self.rows) - 1), error.InvalidAction)
            return given
        given = given.reshape(count, -1) if given.ndim == 1 and count == 1 else given
        if given.shape != (count, len(self.rows)) or given.dtype.kind not in "iuf":
            what = "an action is" if count == 1 else f"{count} actions are needed, each"
            wanted = f"{what} {len(self.rows)} numbers ({', '.join(self.names)})"
            raise refused(WRONG_ACTION(wanted=wanted, value=str(actions)), error.InvalidAction)
        wrong = ~(np.abs(given) <= 1.0 + LENIENT)
        if wrong.any():
            table, place = (int(index) for index in np.argwhere(wrong)[0])
            whose = "the action" if count == 1 else f"the action on table {table}"
            value = given[wrong][0]
            amount = None if np.isnan(value) else value
            raise refused(ACTION_OUT_OF_RANGE(name=self.names[place], whose=whose, amount=amount), error.InvalidAction)
        return np.asarray(np.clip(given, -1.0, 1.0), dtype=np.float64)

    def apply(self, rows: Array, actions: npt.NDArray[Any]) -> Array:
        """Scenes (3N, B) after checked actions; objects may have left the table, and headings the circle."""
        moved = rows.copy()
        if self.kind == "grid":
            moved[self.rows[actions], np.arange(len(actions))] += self.amounts[actions]
        else:
            moved[self.rows] += actions.T * self.amounts[:, None]
        return moved


def headings(core: Core) -> set[int]:
    """The objects on whose heading a label depends: a round footprint is the same in any."""
    nodes = part(core, tuple(core.labels)).nodes
    read: set[int] = set()
    for node in nodes:
        if isinstance(node, Atom):
            read.add(node.margin)
        elif isinstance(node, Apply):
            shapes, args = iter(node.shapes), iter(node.args)
            for kind in PRIMITIVES[node.primitive].params if node.shapes else ():
                taken = list(islice(args, WIDTHS[kind]))
                read.update(taken[:THETA] if kind == "footprint" and isinstance(next(shapes), Circle) else taken)
            read.update(args)
    found = ((index, node) for index, node in enumerate(nodes) if isinstance(node, Coord) and node.axis == THETA)
    return {node.object for index, node in found if index in read}


def headings_of(spec: CheckedSpec, requirement: bool = False) -> set[int]:
    """The objects of a spec on whose heading a label depends, or what is required, whatever the number of things."""
    place = {name: number for number, name in enumerate(spec.core.objects)}
    found: set[int] = set()
    for one in spec.members or (spec,):
        core = gated(one.core) if requirement else one.core
        found |= {place[core.objects[which]] for which in headings(core)}
    return found


def make_moves(
    spec: CheckedSpec, kind: str, move: str | Sequence[str] | None, step: float | None, turn: float | None
) -> tuple[Moves, float]:
    """The moves, and the step in metres. Raises gymnasium.error.Error for invalid arguments."""
    one_of("moves", kind, get_args(Kind))
    shorter = min(spec.workspace.width, spec.workspace.height)
    step = shorter / STEPS if step is None else number("step", step, "metres")
    turn = TURN if turn is None else number("turn", turn, "radians")
    for name, value, most in (("step", step, max(spec.workspace.width, spec.workspace.height)), ("turn", turn, TWO_PI)):
        if not 0.0 < value <= most:
            unit = "metres" if name == "step" else "radians"
            wanted = f"more than 0 and at most {most:g} {unit}"
            raise refused(OUT_OF_RANGE(argument=name, value=f"{value:g}", wanted=wanted))
    turned = headings_of(spec)
    rows, amounts, called = [], [], []
    for index in _movable(spec, move):
        for axis in FLAT if index in turned else PLACE:
            amount = turn if axis == THETA else step
            for sign in (1.0, -1.0) if kind == "grid" else (1.0,):
                rows.append(row_of(index, axis))
                amounts.append(sign * amount)
                way = "" if kind == "continuous" else " +" if sign > 0 else " -"
                called.append(f"{spec.objects[index]} {NAMES[axis]}{way}")
    literal: Kind = "grid" if kind == "grid" else "continuous"
    return Moves(literal, np.array(rows, dtype=np.intp), np.array(amounts), tuple(called)), step


def _movable(spec: CheckedSpec, move: str | Sequence[str] | None) -> list[int]:
    free = [index for index in range(len(spec.objects)) if index not in spec.fixed]
    if not free:
        what = f"`at` holds {quoted(spec.objects)} in place" if spec.objects else "the spec has no objects"
        raise refused(NOTHING_TO_MOVE(reason=what))
    if move is None:
        return free
    chosen = []
    for name in names("move", move, "an object"):
        if name not in spec.objects:
            raise refused(UNKNOWN_OBJECT(name=name, known=spec.objects))
        if spec.objects.index(name) not in free:
            raise refused(HELD_BY_SPEC(name=name))
        chosen.append(spec.objects.index(name))
    if not chosen:
        raise refused(WRONG_VALUE(argument="move", value="empty", wanted="an object, or leave it out to move all"))
    return chosen
