"""The actions of an environment over time: steps no longer than the spec allows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium import Space, spaces

from scenegen.curriculum.errors import number, one_of
from scenegen.curriculum.errors import refused as refusal
from scenegen.curriculum.moves import Moves
from scenegen.errors.learning import NOTHING_TO_MOVE
from scenegen.errors.requests import OUT_OF_RANGE
from scenegen.motions.problem import MotionProblem
from scenegen.pose import NAMES, PLACE, THETA, TWO_PI, along, axis_of, owner, row_of

Array = npt.NDArray[np.float64]

KINDS = ("grid", "continuous")
WITHIN = 1.0 - 1e-9  # of the bound of a step: a distance computed from rounded poses must not exceed it
WAIT = "wait"


class MotionMoves:
    """Steps of a motion. "grid": action 0 waits, every other moves one object along x or y, or turns it, by
    `names`. "continuous": one number in [-1, 1] per object and coordinate, in units of what a step of the object may
    be; a displacement outside of the disc is shortened to it, and where one object moves in each step it is the one
    with the largest part of its bound, the others stay."""

    def __init__(self, problem: MotionProblem, kind: str, share: float) -> None:
        """`share` of the bound of each object is one move. Raises gymnasium.error.Error for another kind, a share that
        is not above 0 and at most 1, and where nothing can move."""
        one_of("moves", kind, KINDS)
        share = number("share", share, "steps")
        if not 0.0 < share <= 1.0:
            raise refusal(OUT_OF_RANGE(argument="share", value=f"{share:g}", wanted="more than 0 and at most 1"))
        if not len(problem.movable):
            raise refusal(NOTHING_TO_MOVE(reason="the spec allows no object a step"))
        self._one = problem.moves == "one"
        self._lowest, self._highest = problem.lowest.reshape(-1), problem.highest.reshape(-1)
        rows: list[int] = []
        amounts: list[float] = []
        names: list[str] = []
        for thing in problem.movable.tolist():
            reach = [(axis, problem.radius[thing]) for axis in PLACE] + [(THETA, problem.turn[thing])]
            for axis, most in reach:
                for sign in ((1.0, -1.0) if kind == "grid" else (1.0,)) if most > 0.0 else ():
                    rows.append(row_of(thing, axis))
                    amounts.append(sign * float(most) * share * WITHIN)
                    way = "" if kind == "continuous" else " +" if sign > 0 else " -"
                    names.append(f"{problem.names[thing]} {NAMES[axis]}{way}")
        if kind == "grid":  # waiting is a move of nothing
            rows, amounts, names = [rows[0], *rows], [0.0, *amounts], [WAIT, *names]
        self._moves = Moves("grid" if kind == "grid" else "continuous", np.array(rows), np.array(amounts), tuple(names))
        self.names: Sequence[str] = names

    def space(self) -> Space[int] | spaces.Box:
        found: Space[int] | spaces.Box = self._moves.space()
        return found

    def checked(self, actions: object, count: int) -> npt.NDArray[Any]:
        """B actions as an array. Raises gymnasium.error.InvalidAction."""
        return self._moves.checked(actions, count)

    def after(self, rows: Array, actions: npt.NDArray[Any]) -> Array:
        """Poses (3N, B) after checked actions: centres stay within their limits."""
        if self._moves.kind == "continuous":
            actions = self._shortened(actions)
        moved = self._moves.apply(rows, actions)
        for axis in PLACE:
            at = along(axis)
            moved[at] = np.clip(moved[at], self._lowest[at, None], self._highest[at, None])
        at = along(THETA)
        theta = np.mod(moved[at], TWO_PI)
        moved[at] = np.where(moved[at] == rows[at], rows[at], np.where(theta < TWO_PI, theta, 0.0))
        return moved

    def _shortened(self, parts: Array) -> Array:
        """Displacements (B, K) within the unit disc, of one object alone where one moves in each step."""
        whose = np.array([owner(row) for row in self._moves.rows.tolist()])
        turns = np.array([axis_of(row) == THETA for row in self._moves.rows.tolist()])
        size = np.zeros((len(parts), whose.max() + 1))
        out = parts.copy()
        for thing in np.unique(whose):
            flat = (whose == thing) & ~turns
            far = np.hypot(*parts[:, flat].T) if flat.any() else np.zeros(len(parts))
            out[:, flat] /= np.maximum(far, 1.0)[:, None]
            turn = np.abs(parts[:, (whose == thing) & turns]).max(axis=1, initial=0.0)
            size[:, thing] = np.maximum(np.minimum(far, 1.0), turn)
        if self._one:
            out[whose != size.argmax(axis=1)[:, None]] = 0.0
        return out
