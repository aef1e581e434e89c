"""The dynamics, for any number of tables at once: what a step does, and when an episode ends."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium import error

from scenegen.api.spec import Spec, load, parse
from scenegen.curriculum.errors import refused
from scenegen.curriculum.goal import Goal, Scorer, make_goal
from scenegen.curriculum.moves import Moves, make_moves
from scenegen.curriculum.register import MOTION_ID
from scenegen.curriculum.rewards import Reward
from scenegen.curriculum.sources import Sampler
from scenegen.curriculum.views import Views, make_views
from scenegen.errors import RequestError, ScenegenError, quoted
from scenegen.errors.requests import CHOICES_NOT_HERE, MISSING_ARGUMENT, WRONG_VALUE
from scenegen.errors.temporal import TIME_NOT_HERE
from scenegen.lang.core import Coord, part
from scenegen.lang.levels import chosen
from scenegen.pose import TWO_PI, is_angle, owner
from scenegen.sampling.request import Range

Array = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]

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
class Stepped:
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
    moves: Moves
    reward: Reward
    views: Views
    flat: npt.NDArray[np.intp]
    low: Array
    high: Array
    turning: npt.NDArray[np.intp]

    def success(self, tables: Tables) -> Mask:
        """Which scenes (B,) satisfy the goal."""
        return np.asarray(tables.phi[self.target.goal] >= 0.0)

    def step(self, tables: Tables, actions: npt.NDArray[Any]) -> Stepped:
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
        return Stepped(Tables(rows, phi, tables.slack), reward, success, off, blocked)


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
        core.objects[node.object] for core in cores for node in part(core, (label,)).nodes if isinstance(node, Coord)
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
