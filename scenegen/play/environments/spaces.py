"""What an agent does and sees: actions that move objects, and observations of a scene."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import Any, Literal, get_args

import numpy as np
import numpy.typing as npt
from gymnasium import Space, error, spaces

from scenegen.arrays import Array
from scenegen.errors import quoted
from scenegen.errors.learning import NOTHING_TO_MOVE, WRONG_ACTION
from scenegen.errors.requests import CANNOT_BE_HELD, OUT_OF_RANGE, UNKNOWN_OBJECT, WRONG_VALUE
from scenegen.geometry import Circle
from scenegen.geometry.primitives import argument_kinds
from scenegen.lang.formula.core import Apply, Atom, Coord, Core, gate, part_of
from scenegen.lang.spec import CheckedSpec, members_of
from scenegen.play.environments.gym_errors import as_choice, as_names, as_quantity, gym_error
from scenegen.pose import FLAT, LENGTHS, NAMES, PLACE, SIZE, THETA, TWO_PI, X, axis_of, owner, row_of

Kind = Literal["grid", "continuous"]

STEPS_ACROSS = 20  # from one edge of the workspace to the other, along its shorter side
TURN_STEP = (
    math.pi / 8.0
)  # radians; less than the prelude's tolerance for headings is wide, so that a grid has one in it
ARGUMENT_WIDTHS = {"number": 1, "place": len(PLACE), "footprint": len(FLAT)}  # numbers of an argument of a primitive
ACTION_TOLERANCE = 1e-6  # tolerance of the range for float32 actions


@dataclass(frozen=True, slots=True)
class ActionMoves:
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

    def as_actions(self, actions: Any, count: int) -> npt.NDArray[Any]:
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
                raise gym_error(WRONG_ACTION(wanted=wanted, value=str(actions)), error.InvalidAction)
            if ((given < 0) | (given >= len(self.rows))).any():
                bad = given[(given < 0) | (given >= len(self.rows))][0]
                raise gym_error(WRONG_ACTION(number=bad, last=len(self.rows) - 1), error.InvalidAction)
            return given
        given = given.reshape(count, -1) if given.ndim == 1 and count == 1 else given
        if given.shape != (count, len(self.rows)) or given.dtype.kind not in "iuf":
            what = "an action is" if count == 1 else f"{count} actions are needed, each"
            wanted = f"{what} {len(self.rows)} numbers ({', '.join(self.names)})"
            raise gym_error(WRONG_ACTION(wanted=wanted, value=str(actions)), error.InvalidAction)
        wrong = ~(np.abs(given) <= 1.0 + ACTION_TOLERANCE)
        if wrong.any():
            table, place = (int(index) for index in np.argwhere(wrong)[0])
            whose = "the action" if count == 1 else f"the action on table {table}"
            value = given[wrong][0]
            amount = None if np.isnan(value) else value
            raise gym_error(WRONG_ACTION(name=self.names[place], whose=whose, amount=amount), error.InvalidAction)
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
    nodes = part_of(core, tuple(core.labels)).nodes
    read: set[int] = set()
    for node in nodes:
        if isinstance(node, Atom):
            read.add(node.margin)
        elif isinstance(node, Apply):
            shapes, args = iter(node.shapes), iter(node.args)
            for kind in argument_kinds(node.primitive, len(node.shapes)) if node.shapes else ():
                taken = list(islice(args, ARGUMENT_WIDTHS[kind]))
                read.update(taken[:THETA] if kind == "footprint" and isinstance(next(shapes), Circle) else taken)
            read.update(args)
    found = ((index, node) for index, node in enumerate(nodes) if isinstance(node, Coord) and node.axis == THETA)
    return {node.object for index, node in found if index in read}


def headings_of(spec: CheckedSpec, requirement: bool = False) -> set[int]:
    """The objects of a spec on whose heading a label depends, or what is required, whatever the number of things."""
    place = {name: number for number, name in enumerate(spec.core.objects)}
    found: set[int] = set()
    for one in spec.members or (spec,):
        core = gate(one.core) if requirement else one.core
        found |= {place[core.objects[which]] for which in headings(core)}
    return found


def make_moves(
    spec: CheckedSpec, kind: str, move: str | Sequence[str] | None, step: float | None, turn: float | None
) -> tuple[ActionMoves, float]:
    """The moves, and the step in metres. Raises gymnasium.error.Error for invalid arguments."""
    as_choice("moves", kind, get_args(Kind))
    shorter = min(spec.workspace.width, spec.workspace.height)
    step = shorter / STEPS_ACROSS if step is None else as_quantity("step", step, "metres")
    turn = TURN_STEP if turn is None else as_quantity("turn", turn, "radians")
    for name, value, most in (("step", step, max(spec.workspace.width, spec.workspace.height)), ("turn", turn, TWO_PI)):
        if not 0.0 < value <= most:
            unit = "metres" if name == "step" else "radians"
            wanted = f"more than 0 and at most {most:g} {unit}"
            raise gym_error(OUT_OF_RANGE(argument=name, value=f"{value:g}", wanted=wanted))
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
    return ActionMoves(literal, np.array(rows, dtype=np.intp), np.array(amounts), tuple(called)), step


def _movable(spec: CheckedSpec, move: str | Sequence[str] | None) -> list[int]:
    free = [index for index in range(len(spec.objects)) if index not in spec.fixed]
    if not free:
        what = f"`at` holds {quoted(spec.objects)} in place" if spec.objects else "the spec has no objects"
        raise gym_error(NOTHING_TO_MOVE(reason=what))
    if move is None:
        return free
    chosen = []
    for name in as_names("move", move, "an object"):
        if name not in spec.objects:
            raise gym_error(UNKNOWN_OBJECT(name=name, known=spec.objects))
        if spec.objects.index(name) not in free:
            raise gym_error(CANNOT_BE_HELD(name=name))
        chosen.append(spec.objects.index(name))
    if not chosen:
        raise gym_error(WRONG_VALUE(argument="move", value="empty", wanted="an object, or leave it out to move all"))
    return chosen


ONE = np.float32(1.0)


@dataclass(frozen=True, slots=True)
class ObservationEncoder:
    """Observations of a scene, float32 in [-1, 1]: for every object that the spec does not fix, x and y, from edge to
    edge of the workspace, and if phi or the requirement depends on its heading, the heading's cosine and sine; last,
    for every object that stands on one of several surfaces, which, as `on_numbers` say. `names` are their names:
    `mug.x`, `mug.y`, `knife.cos`, ..., `mug.on`.

    An object that may be missing has a further one, `block[4].present`, 1 if it is there; if not, all its numbers are
    0. `spare` are the rows of x of these objects."""

    places: npt.NDArray[np.intp]
    middle: Array
    scale: Array
    turned: npt.NDArray[np.intp]
    order: npt.NDArray[np.intp]
    spare: npt.NDArray[np.intp]
    names: tuple[str, ...]
    switches: tuple[Switch, ...]
    on_numbers: Mapping[str, float]

    def space(self) -> spaces.Box:
        return spaces.Box(-1.0, 1.0, (len(self.names),), np.float32)

    def __call__(self, rows: Array) -> npt.NDArray[np.float32]:
        """(3N, B) -> (B, K)."""
        seen_at = (rows[self.places] - self.middle) * self.scale
        for place, ends, numbers in self.switches:
            on = rows[self.places[place]]
            seen_at[place] = np.where(np.isnan(on), np.nan, numbers[np.searchsorted(ends, on)])
        if len(self.turned) or len(self.spare):
            theta, here = rows[self.turned], ~np.isnan(rows[self.spare])
            seen_at = np.concatenate([seen_at, np.cos(theta), np.sin(theta), here])[self.order]
        if len(self.spare):
            seen_at = np.where(np.isnan(seen_at), 0.0, seen_at)
        seen = np.ascontiguousarray(seen_at.T, dtype=np.float32)
        np.minimum(seen, ONE, out=seen)
        return np.maximum(seen, -ONE, out=seen)


Switch = tuple[int, Array, Array]
"""A row of the observations; up to which number of the switch each surface goes, but the last; what each is seen as."""


def on_numbers(spec: CheckedSpec) -> dict[str, float]:
    """What each surface is seen as that a choice of the spec names, by its name: the same for all objects, evenly from
    -1 to 1 in the order in which the spec names them."""
    names = list(dict.fromkeys(one.name for which in sorted(spec.choices) for one in spec.choices[which].options))
    return dict(zip(names, np.linspace(-1.0, 1.0, len(names)).tolist(), strict=True))


def make_views(spec: CheckedSpec) -> ObservationEncoder:
    """The observations for scenes of a spec."""
    depends = headings_of(spec, requirement=True)
    free = [index for index in range(len(spec.objects)) if index not in spec.fixed]
    places = [row_of(index, axis) for index in free for axis in LENGTHS]
    turned = [row_of(index, THETA) for index in free if index in depends]
    low, high = spec.box()
    shown = {choice.switch: spec.objects[which] for which, choice in spec.choices.items()}
    numbers = on_numbers(spec)
    switches = tuple(
        (place, np.array(one.ends[:-1]), np.array([numbers[each.name] for each in one.options]))
        for place, one in enumerate(spec.choices.values(), len(places))
    )
    places += [row_of(switch, X) for switch in shown]
    spare = [int(row) for row in members_of(spec).spare if owner(int(row)) in free]
    keys = [(owner(row), axis_of(row)) for row in places] + [(owner(row), SIZE + k) for k in range(2) for row in turned]
    keys += [(owner(row), SIZE + 2) for row in spare]
    order = sorted(range(len(keys)), key=lambda place: keys[place])
    called = (*NAMES, "cos", "sin", "present")
    names = tuple(
        f"{shown[thing]}.on" if thing in shown else f"{spec.objects[thing]}.{called[axis]}"
        for thing, axis in (keys[k] for k in order)
    )
    at = np.array(places, dtype=np.intp)
    middle, half = (low[at] + high[at]) / 2.0, (high[at] - low[at]) / 2.0
    turned_ = np.array(turned, dtype=np.intp)
    return ObservationEncoder(
        at,
        middle[:, None],
        1.0 / half[:, None],
        turned_,
        np.array(order, dtype=np.intp),
        np.array(spare, dtype=np.intp),
        names,
        switches,
        numbers,
    )
