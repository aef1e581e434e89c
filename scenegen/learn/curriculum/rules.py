"""The dynamics, for any number of tables at once: what a step does, and when an episode ends."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
import numpy.typing as npt
from gymnasium import Space, error, spaces

from scenegen.api.spec import Spec, load, parse
from scenegen.errors import RequestError, ScenegenError, quoted
from scenegen.errors.learning import ACTION_OUT_OF_RANGE, NOTHING_TO_MOVE, UNKNOWN_ACTION, WRONG_ACTION
from scenegen.errors.requests import (
    CHOICES_NOT_HERE,
    HELD_BY_SPEC,
    MISSING_ARGUMENT,
    OUT_OF_RANGE,
    UNKNOWN_OBJECT,
    WRONG_VALUE,
)
from scenegen.errors.time import TIME_NOT_HERE
from scenegen.geometry import PRIMITIVES, Circle
from scenegen.lang.formula.core import Apply, Atom, Coord, Core, gated, part_of
from scenegen.lang.spec import CheckedSpec, chosen, members_of
from scenegen.learn.curriculum.goal import Goal, Scorer, make_goal, names, number, one_of, refused
from scenegen.learn.curriculum.library import Sampler
from scenegen.learn.curriculum.register import MOTION_ID
from scenegen.pose import FLAT, LENGTHS, NAMES, PLACE, SIZE, THETA, TWO_PI, X, axis_of, is_angle, owner, row_of
from scenegen.sampling.request import Range

# --------------------------------------------------------------------------------------------------------------------
# The rewards.


Array = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]
RewardKind = Literal["sparse", "dense"]

SATISFIED, OFF = 10.0, -10.0  # the paper's, section V


class Reward:
    """`sparse`: 10 if the goal is satisfied, -10 if an object left the table, 0 otherwise, as in the paper. `dense`
    adds the increase of the goal's phi, in steps. Without discount these increases sum up to phi of the last scene
    minus that of the first. (This is a potential in the sense of Ng, Harada and Russell, 1999, except that the last
    scene's phi is rewarded too: an end well inside the goal earns more than one at its edge.) Raises
    gymnasium.error.Error for another kind."""

    def __init__(self, kind: str, step: float) -> None:
        one_of("reward", kind, get_args(RewardKind))
        self._scale = 1.0 / step if kind == "dense" else 0.0

    def __call__(self, before: Array, after: Array, success: Mask, off: Mask) -> Array:
        """(B,) phi of the goal before and after a step, and how it ended -> (B,)."""
        paid = SATISFIED * success + OFF * off
        return paid + self._scale * (after - before) if self._scale else paid


# --------------------------------------------------------------------------------------------------------------------
# The actions: objects move step by step, in four directions on a grid, or continuously.


Kind = Literal["grid", "continuous"]

STEPS = 20  # from one edge of the workspace to the other, along its shorter side
TURN = math.pi / 8.0  # radians; less than the prelude's tolerance for headings is wide, so that a grid has one in it
WIDTHS = {"number": 1, "place": len(PLACE), "footprint": len(FLAT)}  # numbers of an argument of a primitive
LENIENT = 1e-6  # tolerance of the range for float32 actions


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
    nodes = part_of(core, tuple(core.labels)).nodes
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
) -> tuple[ActionMoves, float]:
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
    return ActionMoves(literal, np.array(rows, dtype=np.intp), np.array(amounts), tuple(called)), step


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


# --------------------------------------------------------------------------------------------------------------------
# Observations of a scene.


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


LOOK = 512  # scenes that satisfy a goal, and starts, of which surfaces are compared
EDGE = 1e-9  # metres by which a centre may be over the edge, because twenty steps of 5 cm are not exactly a metre


@dataclass(frozen=True, slots=True, eq=False)
class Tables:
    """B scenes: `rows` (3N, B) and phi (D, B). `slack` (B,) is the lowest allowed margin of the requirement: 0, or
    slightly less in a scene that was rounded."""

    rows: Array
    phi: Array
    slack: Array


@dataclass(frozen=True, slots=True, eq=False)
class Transition:
    """The tables after a step, and for each, (B,): the reward and how the step ended."""

    tables: Tables
    reward: Array
    success: Mask
    off: Mask
    blocked: Mask


@dataclass(frozen=True, slots=True, eq=False)
class Rules:
    """What all environments of a spec share. `flat` are the rows of x and y that moves change, `low` and `high` (F, 1)
    their limits at the edges of the table; `turning` are the rows of headings."""

    target: Goal
    score: Scorer
    moves: ActionMoves
    reward: Reward
    views: ObservationEncoder
    flat: npt.NDArray[np.intp]
    low: Array
    high: Array
    turning: npt.NDArray[np.intp]

    def success(self, tables: Tables) -> Mask:
        """Which scenes (B,) satisfy the goal."""
        return np.asarray(tables.phi[self.target.goal] >= 0.0)

    def step(self, tables: Tables, actions: npt.NDArray[Any]) -> Transition:
        """Do checked actions. An object that leaves the table stays at its edge and ends the episode; a move that would
        violate the requirement is not made at all."""
        rows = self.moves.apply(tables.rows, actions)
        flat = rows[self.flat]
        kept = np.minimum(np.maximum(flat, self.low), self.high)
        off: Mask = np.asarray((np.abs(flat - kept) > EDGE).any(axis=0))
        rows[self.flat] = kept
        if len(self.turning):
            theta = np.mod(rows[self.turning], TWO_PI)
            rows[self.turning] = np.where(theta >= TWO_PI, 0.0, theta)  # the remainder of -1e-17 is rounded up
        phi = self.score(rows)
        blocked = np.zeros(len(off), dtype=np.bool_)
        if self.score.requires:
            phi, margin = phi[:-1], phi[-1]
            blocked = np.asarray((margin < tables.slack) & ~off)
            if blocked.any():
                rows, phi = np.where(blocked, tables.rows, rows), np.where(blocked, tables.phi, phi)
        goal = self.target.goal
        success = np.asarray((phi[goal] >= 0.0) & ~off)
        reward = self.reward(tables.phi[goal], phi[goal], success, off)
        return Transition(Tables(rows, phi, tables.slack), reward, success, off, blocked)


def load_spec(spec: Spec | str | Path | None) -> Spec:
    """A spec as users give it: a Spec, the path of a file, or a text. Raises gymnasium.error.MissingArgument for None,
    gymnasium.error.Error, with the diagnostics, for one with mistakes."""
    if spec is None:
        question = 'say what the table is about: spec="leftOf(mug, plate)", or the path of a spec file'
        raise refused(MISSING_ARGUMENT(argument="spec", question=question), error.MissingArgument)
    if isinstance(spec, Spec):
        return spec
    try:
        if isinstance(spec, Path) or (
            isinstance(spec, str) and "\n" not in spec and spec.rstrip().lower().endswith(".spec")
        ):
            return load(spec)
        if isinstance(spec, str):
            return parse(spec)
    except ScenegenError as problem:
        raise error.Error(str(problem)) from problem
    wanted = "a Spec, the path of a spec file or its text"
    raise refused(WRONG_VALUE(argument="spec", value=f"of type {type(spec).__name__}", wanted=wanted))


def _refuse_surfaces(target: Goal) -> None:
    """Raises gymnasium.error.Error where the goal is met only with an object on other surfaces than starts have it on:
    moves go along x and y and never from one surface to another, so no episode from there could succeed."""
    label, source = target.names[target.goal], Sampler(target)
    try:
        met, starts = (source.draw({label: ends}, LOOK, 0, "base").poses for ends in (Range(0.0), Range(None, 0.0)))
    except RequestError:
        return  # there is no goal, or no start: the first reset says why
    spec = target.spec.drawn
    good, begun = (np.stack([chosen(one, each.T) for one in spec.choices.values()], axis=1) for each in (met, starts))
    together = set(map(tuple, good.tolist()))
    lost = float(np.mean([tuple(one) not in together for one in begun.tolist()]))
    if lost == 0.0 or len(met) < LOOK or len(together) > LOOK // 16:  # so many ways to stand are not all seen
        return
    column = next((k for k in range(good.shape[1]) if set(begun[:, k]) - set(good[:, k])), None)
    which = list(spec.choices)[column or 0]
    if column is None:
        name, where = quoted([spec.objects[one] for one in spec.choices]), "together on such surfaces"
    else:
        options = spec.choices[which].options
        name, where = f"`{spec.objects[which]}`", quoted([options[k].name for k in sorted(set(good[:, column]))])
    found = f"in {LOOK} scenes that satisfy `{label}`, {name} " + (
        f"never stand {where} as in {lost:.0%} of the starts" if column is None else f"is always on {where}"
    )
    why = f"no move takes {name} to another surface, and {found}"
    raise refused(CHOICES_NOT_HERE(what="an environment", name=spec.objects[which], why=why))


def _refuse_idle(target: Goal, move: object, rows: npt.NDArray[np.intp]) -> None:
    """Raises gymnasium.error.Error where no object that moves has a part in phi of the goal: it would stay what it is
    at the start. Others may move beside those that do: they can be in the way."""
    spec, label = target.spec.drawn, target.names[target.goal]
    cores = [one.core for one in spec.members or (spec,)]
    read = {
        core.objects[node.object] for core in cores for node in part_of(core, (label,)).nodes if isinstance(node, Coord)
    }
    decide = [name for name in spec.objects if name in read]
    if read.isdisjoint(spec.objects[owner(row)] for row in rows.tolist()):
        wanted = f"an object that phi of `{label}` depends on: {quoted(decide)}" if decide else "another goal"
        raise refused(WRONG_VALUE(argument="move", value=repr(move), wanted=wanted))


def make_rules(
    spec: Spec,
    *,
    goal: str | Sequence[str] | None,
    moves: str,
    move: str | Sequence[str] | None,
    step: float | None,
    turn: float | None,
    reward: str,
) -> Rules:
    """See TableTop for the arguments. Raises gymnasium.error.Error for invalid ones."""
    if spec.over_time is not None:
        raise refused(TIME_NOT_HERE(file=spec.declared.name), more=f"to learn motions make {MOTION_ID}")
    target = make_goal(spec, goal)
    if spec.drawn.choices:
        _refuse_surfaces(target)
    made, length = make_moves(spec.drawn, moves, move, step, turn)
    changed = np.unique(made.rows)
    if move is not None:
        _refuse_idle(target, move, changed)
    angles = np.array([is_angle(row) for row in changed], dtype=bool)
    flat, turning = changed[~angles], changed[angles]
    low, high = (ends[flat][:, None] for ends in spec.drawn.box())
    paid, seen = Reward(reward, length), make_views(spec.drawn)
    return Rules(target, Scorer(target), made, paid, seen, flat, low, high, turning)
