"""The dynamics of a table, for any number of tables at once: what a step does, and when an episode ends."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np
import numpy.typing as npt

from scenegen.api.spec import Spec
from scenegen.arrays import Array
from scenegen.errors import RequestError, quote_names
from scenegen.errors.requests import CHOICES_NOT_HERE, TIME_NOT_HERE, WRONG_VALUE
from scenegen.lang.formula.core import Coord, part_of
from scenegen.lang.spec import chosen_options
from scenegen.play.environments.goal import Goal, Scorer, make_goal
from scenegen.play.environments.gym_errors import as_choice, gym_error
from scenegen.play.environments.library import Sampler
from scenegen.play.environments.spaces import ActionMoves, ObservationEncoder, make_moves, make_views
from scenegen.pose import TWO_PI, is_angle, owner
from scenegen.sampling.request import Range

Mask = npt.NDArray[np.bool_]
RewardKind = Literal["sparse", "dense"]

REWARD_SATISFIED, REWARD_OFF = 10.0, -10.0  # the paper's, section V
OFF_TABLE = 1e-9  # metres by which a centre may be over the edge, because twenty steps of 5 cm are not exactly a metre
SURFACE_SCENES = 512  # scenes that satisfy a goal, and starts, of which surfaces are compared


@dataclass(frozen=True, slots=True)
class StepOutcome:
    """What a step did, (B,) each. Of tables whose episode was over before it means nothing. `flags` are further entries
    of the info."""

    reward: Array
    success: Mask
    terminated: Mask
    flags: Mapping[str, Mask]


@dataclass(frozen=True, slots=True, eq=False)
class Tables:
    """B scenes: `rows` (3N, B) and phi (D, B). `slack` (B,) is the lowest allowed margin of the requirement: 0, or
    slightly less in a scene that was rounded."""

    rows: Array
    phi: Array
    slack: Array


@dataclass(frozen=True, slots=True, eq=False)
class Rules:
    """What all environments of a spec share. `flat` are the rows of x and y that moves change, `low` and `high` (F, 1)
    their limits at the edges of the table; `turning` are the rows of headings.

    The reward is 10 if the goal is satisfied, -10 if an object left the table, 0 otherwise, as in the paper. The dense
    one adds `gain` times the increase of the goal's phi, which is that increase in steps. Without discount these sum
    up to phi of the last scene minus that of the first. (This is a potential in the sense of Ng, Harada and Russell,
    1999, except that the last scene's phi is rewarded too: an end well inside the goal earns more than one at its
    edge.)"""

    target: Goal
    score: Scorer
    moves: ActionMoves
    gain: float
    views: ObservationEncoder
    flat: npt.NDArray[np.intp]
    low: Array
    high: Array
    turning: npt.NDArray[np.intp]

    def success(self, tables: Tables) -> Mask:
        """Which scenes (B,) satisfy the goal."""
        return np.asarray(tables.phi[self.target.goal] >= 0.0)

    def step(self, tables: Tables, actions: npt.NDArray[Any]) -> tuple[Tables, StepOutcome]:
        """Do checked actions. An object that leaves the table stays at its edge and ends the episode; a move that would
        violate the requirement is not made at all."""
        rows = self.moves.apply(tables.rows, actions)
        flat = rows[self.flat]
        kept = np.minimum(np.maximum(flat, self.low), self.high)
        off: Mask = np.asarray((np.abs(flat - kept) > OFF_TABLE).any(axis=0))
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
        reward = REWARD_SATISFIED * success + REWARD_OFF * off
        if self.gain:
            reward = reward + self.gain * (phi[goal] - tables.phi[goal])
        return Tables(rows, phi, tables.slack), StepOutcome(
            reward, success, success | off, {"off_table": off, "blocked": blocked}
        )


def make_rules(
    spec: Spec,
    *,
    goal: str | Sequence[str] | None = None,
    moves: str = "grid",
    move: str | Sequence[str] | None = None,
    step: float | None = None,
    turn: float | None = None,
    reward: str = "sparse",
) -> Rules:
    """See TableTop for the arguments. Raises gymnasium.error.Error for invalid ones."""
    if spec.over_time is not None:
        raise gym_error(TIME_NOT_HERE(file=spec.definition.name))
    target = make_goal(spec, goal)
    if spec.require_scenes().choices:
        _refuse_surfaces(target)
    made, length = make_moves(spec.require_scenes(), moves, move, step, turn)
    changed = np.unique(made.rows)
    if move is not None:
        _refuse_idle(target, move, changed)
    angles = np.array([is_angle(row) for row in changed], dtype=bool)
    flat, turning = changed[~angles], changed[angles]
    low, high = (ends[flat][:, None] for ends in spec.require_scenes().box())
    as_choice("reward", reward, get_args(RewardKind))
    gain = 1.0 / length if reward == "dense" else 0.0
    return Rules(target, Scorer(target), made, gain, make_views(spec.require_scenes()), flat, low, high, turning)


def _refuse_surfaces(target: Goal) -> None:
    """Raises gymnasium.error.Error where the goal is met only with an object on other surfaces than starts have it on:
    moves go along x and y and never from one surface to another, so no episode from there could succeed."""
    label, source = target.names[target.goal], Sampler(target)
    try:
        solved, starts = (
            source.draw({label: ends}, SURFACE_SCENES, 0, "base").poses for ends in (Range(0.0), Range(None, 0.0))
        )
    except RequestError:
        return  # there is no goal, or no start: the first reset says why
    spec = target.spec.require_scenes()
    good, begun = (
        np.stack([chosen_options(one, each.T) for one in spec.choices.values()], axis=1) for each in (solved, starts)
    )
    together = set(map(tuple, good.tolist()))
    lost = float(np.mean([tuple(one) not in together for one in begun.tolist()]))
    if lost == 0.0 or len(solved) < SURFACE_SCENES:
        return
    if len(together) > SURFACE_SCENES // 16:  # so many ways to stand are not all seen
        return
    column = next((k for k in range(good.shape[1]) if set(begun[:, k]) - set(good[:, k])), None)
    which = list(spec.choices)[column or 0]
    if column is None:
        name, where = quote_names([spec.objects[one] for one in spec.choices]), "together on such surfaces"
    else:
        options = spec.choices[which].options
        name, where = f"`{spec.objects[which]}`", quote_names([options[k].name for k in sorted(set(good[:, column]))])
    found = f"in {SURFACE_SCENES} scenes that satisfy `{label}`, {name} " + (
        f"never stand {where} as in {lost:.0%} of the starts" if column is None else f"is always on {where}"
    )
    why = f"no move takes {name} to another surface, and {found}"
    raise gym_error(CHOICES_NOT_HERE(what="an environment", name=spec.objects[which], why=why))


def _refuse_idle(target: Goal, move: object, rows: npt.NDArray[np.intp]) -> None:
    """Raises gymnasium.error.Error where no object that moves has a part in phi of the goal: it would stay what it is
    at the start. Others may move beside those that do: they can be in the way."""
    spec, label = target.spec.require_scenes(), target.names[target.goal]
    cores = [one.core for one in spec.members or (spec,)]
    read = {
        core.objects[node.object] for core in cores for node in part_of(core, (label,)).nodes if isinstance(node, Coord)
    }
    decide = [name for name in spec.objects if name in read]
    if read.isdisjoint(spec.objects[owner(row)] for row in rows.tolist()):
        wanted = f"an object that phi of `{label}` depends on: {quote_names(decide)}" if decide else "another goal"
        raise gym_error(WRONG_VALUE(argument="move", value=repr(move), wanted=wanted))
