"""The spec's table in the world of a simulator, and quaternions (w, x, y, z)."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Numbers: TypeAlias = Sequence[float] | Array


@dataclass(frozen=True, slots=True)
class Frame:
    """Where the spec's point (0, 0) at the height of the table is, in metres, and by how much the spec's x axis is
    turned against the world's, in radians, counter-clockwise."""

    origin: tuple[float, float, float]
    turn: float = 0.0

    def place(self, pose: Numbers) -> tuple[Array, Array]:
        """A pose x, y, z, qw, qx, qy, qz of the spec's frame: its place and quaternion in the world."""
        x, y, z, qw, qx, qy, qz = pose
        cosine, sine = math.cos(self.turn), math.sin(self.turn)
        at = np.array([cosine * x - sine * y, sine * x + cosine * y, z]) + self.origin
        return at, times((math.cos(self.turn / 2.0), 0.0, 0.0, math.sin(self.turn / 2.0)), (qw, qx, qy, qz))

    def pose(self, at: Numbers, quaternion: Numbers) -> tuple[float, float, float]:
        """The reverse for a body: x, y and heading in the spec's frame. The heading is the turn about the vertical
        that comes nearest to the attitude."""
        x, y = at[0] - self.origin[0], at[1] - self.origin[1]
        cosine, sine = math.cos(self.turn), math.sin(self.turn)
        heading = 2.0 * math.atan2(quaternion[3], quaternion[0]) - self.turn
        return cosine * x + sine * y, cosine * y - sine * x, heading


def times(first: Numbers, second: Numbers) -> Array:
    """The product of two quaternions: the second rotation, then the first."""
    a, b, c, d = first
    w, x, y, z = second
    return np.array(
        [
            a * w - b * x - c * y - d * z,
            a * x + b * w + c * z - d * y,
            a * y - b * z + c * w + d * x,
            a * z + b * y - c * x + d * w,
        ]
    )


def inverse(quaternion: Numbers) -> Array:
    """The reverse rotation of a unit quaternion."""
    w, x, y, z = quaternion
    return np.array([w, -x, -y, -z])


def upright(model: Any) -> Array:
    """The quaternion of an object that stands as it should at heading 0.

    robosuite's objects may have an `init_quat`; many of LIBERO's have to be turned about x or y first: `rotation` is
    then a range of angles in radians for `rotation_axis`, or maps axes to ranges. Turns about z are headings.
    """
    rotation, axis = getattr(model, "rotation", None), getattr(model, "rotation_axis", None)
    turns = rotation if isinstance(rotation, Mapping) else {axis: rotation}
    found = np.array([1.0, 0.0, 0.0, 0.0])
    for index, name in enumerate("xy"):
        angles = turns.get(name)
        if angles is None:
            continue
        half = 0.5 * (float(np.mean([min(angles), max(angles)])) if isinstance(angles, Iterable) else float(angles))
        turn = np.array([math.cos(half), 0.0, 0.0, 0.0])
        turn[1 + index] = math.sin(half)
        found = times(turn, found)
    return times(found, model.init_quat) if getattr(model, "init_quat", None) is not None else found
