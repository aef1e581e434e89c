"""What an arm reaches from above: between which radii about its first axis, at each height, a point of the hand can be
while the hand points straight down.

The joints between the first and the last decide radius, height and where the hand points; the first joint then turns
all of it about the vertical, the last turns the hand. Postures that point down at a height are found from random ones by
damped Gauss-Newton steps within the limits of the joints. From the innermost and the outermost of them, others are
followed along the set of such postures as far as it goes; gaps are searched in the same way. What does not end at the
height, straight down and within all limits is dropped, so every radius found is reached by a posture that is known.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scenegen.things.chain import ArmError, Chain, rotations
from scenegen.things.outline import Floats

REACH_SEED = 0
REACH_STARTS = 60_000  # random postures
REACH_LINES = 120  # heights at which the radii are measured
MAX_TILT = 1e-4  # radians off the vertical that count as straight down
MAX_HEIGHT_ERROR = 1e-6  # metres
DAMPING = 1e-6  # of the Gauss-Newton steps, squared
MAX_TURN = 0.4  # radians that a joint turns in one step
CLIMBERS, CLIMBS = 24, 60  # postures that are followed to each end of each height; the steps
VERTICAL = 1e-6  # how far the cosine of an axis to the vertical may be from 1


@dataclass(frozen=True, slots=True)
class Reach:
    """Radii (m) at heights (m) above the base link's origin, ascending, and the bearings (rad) from its x-axis that are
    reached at all of them. `step` (m) is how far apart postures lie between the radii; `axis` (x, y) where the first
    axis stands in the base link's frame; `split` (m) the heights at which further radii are reached beyond a gap."""

    heights: tuple[float, ...]
    nearest: tuple[float, ...]
    farthest: tuple[float, ...]
    bearing: tuple[float, float]
    step: float
    axis: tuple[float, float]
    split: tuple[float, ...]


@dataclass(slots=True, eq=False)
class Postures:
    """Angles (N, M) of the joints between first and last: where the hand is, as columns of N."""

    angles: Floats
    pointing: Floats  # (N, 3) the direction of the hand
    at: Floats  # (N, 3) the point on the last joint's axis beside the tip; the first axis is x = y = 0
    axes: Floats  # (N, M, 3)
    centers: Floats  # (N, M, 3)

    @property
    def radii(self) -> Floats:
        return np.hypot(self.at[:, 0], self.at[:, 1])


class _Arm:
    """The chain as the search sees it."""

    def __init__(self, chain: Chain, approach: Floats, beyond: float) -> None:
        first, *self.inner, last = chain.hinges
        upright = float((first.frame.turn @ first.axis)[2])
        if abs(abs(upright) - 1.0) > VERTICAL:
            raise ArmError(f"its first joint, `{first.name[:60]}`, does not turn about the vertical", "name the link that stands on the table as the base")
        ahead = chain.tip.turn @ approach
        along = float(last.axis @ ahead)
        if abs(abs(along) - 1.0) > VERTICAL:
            raise ArmError(f"its last joint, `{last.name[:60]}`, does not turn the hand about the direction in which it points", "name that direction with <approach>: x, y, z, -x, -y or -z of the tip link")
        if last.span < math.pi:
            raise ArmError(f"its last joint, `{last.name[:60]}`, turns by less than half a turn: a hand that points down cannot have every heading", "such arms have no ring that holds for all headings")
        self.last, self.first = last, first
        tip = chain.tip.at + beyond * ahead
        self.end = last.axis * float(last.axis @ tip)
        self.offset = float(np.linalg.norm(tip - self.end))
        self.pointing = last.axis * math.copysign(1.0, along)
        self.low, self.high = (np.array(one) for one in zip(*(_range(one.low, one.high) for one in self.inner), strict=True))
        self.axis = first.frame.at[0], first.frame.at[1]
        low, high = _range(first.low, first.high)
        self.bearing = (low, high) if upright > 0.0 else (-high, -low)
        self.length = sum(float(np.linalg.norm(one.frame.at)) for one in (*self.inner[1:], last)) + float(np.linalg.norm(self.end))

    def place(self, angles: Floats) -> Postures:
        """Forward kinematics of angles (N, M), the first joint at 0."""
        count = len(angles)
        turn = np.broadcast_to(self.first.frame.turn, (count, 3, 3))
        at = np.broadcast_to(self.first.frame.at - [*self.axis, 0.0], (count, 3))
        axes, centers = np.empty((count, len(self.inner), 3)), np.empty((count, len(self.inner), 3))
        for number, hinge in enumerate(self.inner):
            at = at + turn @ hinge.frame.at
            turn = turn @ hinge.frame.turn
            axes[:, number], centers[:, number] = turn @ hinge.axis, at
            turn = turn @ rotations(hinge.axis, angles[:, number])
        at = at + turn @ (self.last.frame.at + self.last.frame.turn @ self.end)
        pointing = turn @ (self.last.frame.turn @ self.pointing)
        return Postures(angles, pointing, at, axes, centers)

    def errors(self, now: Postures, heights: Floats) -> Floats:
        """(N, 3): the turn about x and y that makes the hand point down, and the height that it lacks."""
        x, y, z = now.pointing.T
        sine = np.maximum(np.hypot(x, y), 1e-12)
        scale = np.arctan2(sine, -z) / sine
        return np.column_stack([-y * scale, x * scale, heights - now.at[:, 2]])

    def slopes(self, now: Postures) -> tuple[Floats, Floats]:
        """(N, 3, M): how turn and height change with the angles; (N, M): how the radius does."""
        moves = np.cross(now.axes, now.at[:, None, :] - now.centers)
        rows = np.stack([now.axes[:, :, 0], now.axes[:, :, 1], moves[:, :, 2]], axis=1)
        outward = now.at[:, None, :2] / np.maximum(now.radii, 1e-9)[:, None, None]
        return rows, (moves[:, :, :2] * outward).sum(axis=2)

    def settle(self, angles: Floats, heights: Floats, steps: int) -> Postures:
        """Gauss-Newton steps to postures that point down at these heights, within the limits."""
        now = self.place(angles)
        for _ in range(steps):
            rows, _ = self.slopes(now)
            errors = self.errors(now, heights)
            move = _least(rows, errors)
            stuck = self.stuck(now.angles, move)
            move = _least(np.where(stuck[:, None, :], 0.0, rows), errors)
            now = self.place(self.clip(now.angles + np.clip(move, -MAX_TURN, MAX_TURN)))
        return now

    def stuck(self, angles: Floats, move: Floats) -> Floats:
        return ((angles <= self.low) & (move < 0.0)) | ((angles >= self.high) & (move > 0.0))

    def clip(self, angles: Floats) -> Floats:
        return np.clip(angles, self.low, self.high)

    def holds(self, now: Postures, heights: Floats) -> Floats:
        """(N,): which point straight down at their height. Angles are within limits wherever they are clipped."""
        tilt = np.hypot(now.pointing[:, 0], now.pointing[:, 1])
        level = np.abs(now.at[:, 2] - heights) <= MAX_HEIGHT_ERROR
        return (tilt <= MAX_TILT) & (now.pointing[:, 2] < 0.0) & level

    def follow(self, angles: Floats, heights: Floats, goals: Floats) -> tuple[Floats, Floats]:
        """From postures that hold towards the radius of each goal, steps that keep pointing and height: the angles they
        end at, and all (height, radius, bearing) that they come through."""
        now = self.place(angles)
        size = np.full(len(angles), 0.1)
        trail = []
        for _ in range(CLIMBS):
            rows, slope = self.slopes(now)
            wish = (goals - now.radii)
            want = slope * np.sign(wish)[:, None]
            free = np.ones_like(want, dtype=bool)
            for _ in range(2):
                masked = np.where(free[:, None, :], rows, 0.0)
                along = np.where(free, want - _least(masked, np.einsum("nij,nj->ni", masked, np.where(free, want, 0.0))), 0.0)
                free &= ~self.stuck(now.angles, along)
            along = np.where(free, along, 0.0)
            steep = np.linalg.norm(along, axis=1)
            length = np.minimum(size, np.abs(wish) / np.maximum(steep, 1e-6))
            move = along * (length / np.maximum(steep, 1e-9))[:, None]
            tried = self.settle(self.clip(now.angles + move), heights, 3)
            better = self.holds(tried, heights) & (np.abs(goals - tried.radii) < np.abs(goals - now.radii))
            now = self.place(np.where(better[:, None], tried.angles, now.angles))
            size = np.clip(np.where(better, size * 1.4, size * 0.4), 1e-7, MAX_TURN)
            trail.append(self.marks(tried, heights)[better])
        return now.angles, np.concatenate(trail)

    def marks(self, now: Postures, heights: Floats) -> Floats:
        """(N, 3): height, radius, bearing."""
        return np.column_stack([heights, now.radii, np.arctan2(now.at[:, 1], now.at[:, 0])])


def _range(low: float, high: float) -> tuple[float, float]:
    """Limits of an angle of which whole turns do not matter."""
    return (-math.pi, math.pi) if high - low >= math.tau else (low, high)


def _least(rows: Floats, errors: Floats) -> Floats:
    """The smallest moves (N, M) with rows (N, 3, M) @ move = errors (N, 3), damped."""
    square = rows @ rows.transpose(0, 2, 1) + DAMPING * np.eye(3)
    solved: Floats = np.linalg.solve(square, errors[:, :, None])
    return (rows.transpose(0, 2, 1) @ solved)[:, :, 0]
