"""Postures of an arm, many at once: where its hand is and points, and steps that bring it to point straight down at a
height, and at a radius about the first axis.

Only the joints between the first and the last move here. The first turns everything about the vertical; the last turns
the hand about the direction in which it points.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scenegen.things.chain import ChainError, JointChain, rotations
from scenegen.things.outline import Floats

Flags = npt.NDArray[np.bool_]

MAX_LEAN = 1e-4  # radians off the vertical that count as straight down
MAX_MISS = 1e-6  # metres off a height or radius that count as there
STEP_DAMPING = 1e-6  # of the Gauss-Newton steps, squared
MAX_JOINT_STEP = 0.4  # radians that a joint turns in one step
VERTICAL = 1e-6  # how far the cosine of the angle between two axes may be from 1


@dataclass(frozen=True, slots=True, eq=False)
class Postures:
    """`angles` (N, M) of the joints between the first, which is at 0, and the last. `at` (N, 3) is the point of the
    last axis that is nearest to the tip, with the first axis at x = y = 0; `pointing` (N, 3) the direction of the hand;
    `closing` (N, 3) that in which it closes, the last joint at 0; `axes` and `centers` (N, M, 3) are those of the
    joints."""

    angles: Floats
    pointing: Floats
    closing: Floats
    at: Floats
    axes: Floats
    centers: Floats

    @property
    def radii(self) -> Floats:
        """(N,)"""
        return np.hypot(self.at[:, 0], self.at[:, 1])

    @property
    def bearings(self) -> Floats:
        """(N,) radians from the base link's x-axis."""
        return np.arctan2(self.at[:, 1], self.at[:, 0])

    @property
    def turns(self) -> Floats:
        """(N,) radians from the direction away from the first axis to that in which the hand closes."""
        return np.arctan2(self.closing[:, 1], self.closing[:, 0]) - self.bearings


class PostureSearch:
    """The chain of an arm whose hand points along `approach` (3,), a unit vector in the frame of the tip link, the tip
    being `beyond` metres from that link's origin in this direction, and closes along `closing` (3,), a unit vector
    across that. `offset` (m) is where the tip is from the last axis, along that direction and to its left as the hand
    points down; `bearing` (rad) how far the first joint turns, and `turn` how far the last, counterclockwise. Raises
    ChainError where the first joint does not turn about the vertical, or the last not about the hand's direction."""

    def __init__(self, chain: JointChain, approach: Floats, beyond: float, closing: Floats) -> None:
        if len(chain.hinges) < 4:
            raise ChainError(
                "fewer than four joints move the hand",
                "it takes two to move it, one to turn it, and one to turn the arm",
            )
        self.first, *self.inner, self.last = chain.hinges
        upright = float((self.first.frame.turn @ self.first.axis)[2])
        if abs(abs(upright) - 1.0) > VERTICAL:
            raise ChainError(
                f"its first joint, `{self.first.name[:60]}`, does not turn about the vertical",
                "name the link that stands on the table as the base",
            )
        ahead = chain.tip.turn @ approach
        along = float(self.last.axis @ ahead)
        if abs(abs(along) - 1.0) > VERTICAL:
            raise ChainError(
                f"its last joint, `{self.last.name[:60]}`, does not turn the hand about the direction it points in",
                "name that direction of the tip link as the approach: x, y, z, -x, -y or -z",
            )
        if self.last.span < math.pi:
            raise ChainError(
                f"its last joint, `{self.last.name[:60]}`, turns by less than half a turn: it cannot have all headings",
                "there is no ring of such an arm",
            )
        tip = chain.tip.at + beyond * ahead
        self._end = self.last.axis * float(self.last.axis @ tip)
        self._ahead = self.last.axis * math.copysign(1.0, along)
        self._closing = chain.tip.turn @ closing
        aside = tip - self._end
        self.offset = float(aside @ self._closing), float(aside @ np.cross(self._closing, self._ahead))
        self.axis = float(self.first.frame.at[0]), float(self.first.frame.at[1])
        low, high = self.first.limits
        self.bearing = (low, high) if upright > 0.0 else (-high, -low)
        low, high = self.last.limits
        self.turn = (-high, -low) if along > 0.0 else (low, high)
        limits = np.array([hinge.limits for hinge in self.inner])
        self.low, self.high = limits[:, 0], limits[:, 1]
        links = [hinge.frame.at for hinge in (*self.inner[1:], self.last)]
        self.length = sum(float(np.linalg.norm(link)) for link in (*links, self._end))

    def place(self, angles: Floats) -> Postures:
        """Forward kinematics of angles (N, M)."""
        count = len(angles)
        turn = np.broadcast_to(self.first.frame.turn, (count, 3, 3))
        at = np.broadcast_to(self.first.frame.at - [*self.axis, 0.0], (count, 3))
        axes, centers = np.empty((count, len(self.inner), 3)), np.empty((count, len(self.inner), 3))
        for number, hinge in enumerate(self.inner):
            at = at + turn @ hinge.frame.at
            turn = turn @ hinge.frame.turn
            axes[:, number], centers[:, number] = turn @ hinge.axis, at
            turn = turn @ rotations(hinge.axis, angles[:, number])
        at = at + turn @ (self.last.frame.at + self.last.frame.turn @ self._end)
        pointing, closing = (turn @ (self.last.frame.turn @ one) for one in (self._ahead, self._closing))
        return Postures(angles, pointing, closing, at, axes, centers)

    def settle(
        self, angles: Floats, steps: int, heights: Floats | None = None, radii: Floats | None = None
    ) -> Postures:
        """Damped Gauss-Newton steps, within the limits, from angles (N, M) to postures that point down, at these
        heights (N,) and radii (N,) where they are given. `holds` says which arrive."""
        now = self.place(np.clip(angles, self.low, self.high))
        for _ in range(steps):
            rows, outward = self.slopes(now)
            x, y, z = now.pointing.T
            sine = np.maximum(np.hypot(x, y), 1e-12)
            scale = np.arctan2(sine, -z) / sine  # of the turn that makes the hand point down: about (-y, x)
            errors = [-y * scale, x * scale]
            wanted = [rows[:, :2]]
            if heights is not None:
                errors.append(heights - now.at[:, 2])
                wanted.append(rows[:, 2:])
            if radii is not None:
                errors.append(radii - now.radii)
                wanted.append(outward[:, None])
            all_rows, all_errors = np.concatenate(wanted, axis=1), np.stack(errors, axis=1)
            stuck = self.is_stuck(now.angles, _least(all_rows, all_errors))
            move = np.where(stuck, 0.0, _least(np.where(stuck[:, None, :], 0.0, all_rows), all_errors))
            now = self.place(np.clip(now.angles + np.clip(move, -MAX_JOINT_STEP, MAX_JOINT_STEP), self.low, self.high))
        return now

    def slopes(self, now: Postures) -> tuple[Floats, Floats]:
        """How the hand turns about x and y and how its height changes with the angles, (N, 3, M); how its radius does,
        (N, M)."""
        moves = np.cross(now.axes, now.at[:, None, :] - now.centers)
        rows = np.stack([now.axes[:, :, 0], now.axes[:, :, 1], moves[:, :, 2]], axis=1)
        outward = now.at[:, None, :2] / np.maximum(now.radii, 1e-9)[:, None, None]
        return rows, (moves[:, :, :2] * outward).sum(axis=2)

    def is_stuck(self, angles: Floats, move: Floats) -> Flags:
        """(N, M): which joints are at a limit that the move leads beyond."""
        return ((angles <= self.low) & (move < 0.0)) | ((angles >= self.high) & (move > 0.0))

    def holds(self, now: Postures, heights: Floats | None = None, radii: Floats | None = None) -> Flags:
        """(N,): which point straight down, at these heights and radii. All angles are within their limits."""
        found = (np.hypot(now.pointing[:, 0], now.pointing[:, 1]) <= MAX_LEAN) & (now.pointing[:, 2] < 0.0)
        if heights is not None:
            found &= np.abs(now.at[:, 2] - heights) <= MAX_MISS
        if radii is not None:
            found &= np.abs(now.radii - radii) <= MAX_MISS
        return found

    def follow(self, angles: Floats, heights: Floats, goals: Floats, steps: int) -> Postures:
        """From postures that hold at these heights, towards the radii of the goals (N,) through others that hold, as
        far as they lead in so many steps."""
        now = self.place(angles)
        size = np.full(len(angles), 0.1)  # radians
        for _ in range(steps):
            rows, outward = self.slopes(now)
            wish = goals - now.radii
            want = outward * np.sign(wish)[:, None]
            along = _project(rows, want, np.zeros_like(want, dtype=bool))
            along = _project(rows, want, self.is_stuck(now.angles, along))
            steep = np.maximum(np.linalg.norm(along, axis=1), 1e-9)
            length = np.minimum(size, np.abs(wish) / steep)
            tried = self.settle(now.angles + along * (length / steep)[:, None], 3, heights)
            better = self.holds(tried, heights) & (np.abs(goals - tried.radii) < np.abs(wish))
            now = self.place(np.where(better[:, None], tried.angles, now.angles))
            size = np.clip(np.where(better, size * 1.5, size * 0.4), 1e-7, MAX_JOINT_STEP)
        return now


def _project(rows: Floats, want: Floats, stuck: Flags) -> Floats:
    """The part (N, M) of a move that changes nothing of what the rows (N, K, M) measure, stuck joints at rest."""
    rows, want = np.where(stuck[:, None, :], 0.0, rows), np.where(stuck, 0.0, want)
    return np.where(stuck, 0.0, want - _least(rows, (rows @ want[:, :, None])[:, :, 0]))


def _least(rows: Floats, errors: Floats) -> Floats:
    """The smallest moves (N, M) with rows (N, K, M) @ move = errors (N, K), damped."""
    across = rows.transpose(0, 2, 1)
    solved = np.linalg.solve(rows @ across + STEP_DAMPING * np.eye(rows.shape[1]), errors[:, :, None])
    return (across @ solved)[:, :, 0]
