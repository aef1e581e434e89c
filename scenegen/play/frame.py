"""The spec's table in the world of a simulator: poses of scenes there, and back."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from scenegen.arrays import Array
from scenegen.errors import RequestError
from scenegen.errors.requests import UNKNOWN_CHOICE, WRONG_VALUE
from scenegen.scenes.data import SceneFile
from scenegen.validation import as_number, as_point

Origins: TypeAlias = Literal["base", "middle"] | Mapping[str, float]
"""Where the origin of an object is: in its lowest point under the middle, in the middle of its height, or so many
metres above its lowest point, by name; 0 for names that are left out."""
Axis: TypeAlias = Literal["x", "y", "z"]
"""The axis of a body's own frame that points up where it stands."""

POSE_ORDERS = {"wxyz": [0, 1, 2, 3, 4, 5, 6], "xyzw": [0, 1, 2, 4, 5, 6, 3]}
# quaternions (w, x, y, z) that turn the axis up: x about y by -90 degrees, y about x by 90 degrees
UP_TURNS = {
    "x": (math.sqrt(0.5), 0.0, -math.sqrt(0.5), 0.0),
    "y": (math.sqrt(0.5), math.sqrt(0.5), 0.0, 0.0),
    "z": (1.0, 0.0, 0.0, 0.0),
}


def poses_in_world(
    header: SceneFile,
    poses: Array,
    origin: Sequence[float],
    turn: float,
    origins: Origins,
    up: Mapping[str, Axis],
) -> Array:
    """(n, N, 7): x, y, z in metres and qw, qx, qy, qz, in the world, of `poses` (n, N, 7) in the spec's frame.

    `origin` is where the spec's point (0, 0) at the height of the table is; `turn` turns the spec's x axis
    counter-clockwise, in radians; `up` names the axis of a body's own frame that points up, "z" where it does not say.
    Raises RequestError.
    """
    frame, poses = TableFrame(as_point("origin", origin), as_number("turn", turn)), poses.copy()
    objects = [one.name for one in header.objects]
    poses[..., 2] += lifts(header, origins)
    at, quaternions = frame.place(np.moveaxis(poses, -1, 0))
    for name, axis in up.items():
        if name not in objects:
            raise RequestError(UNKNOWN_CHOICE(what="object", name=str(name), known=objects))
        if axis not in UP_TURNS:
            raise RequestError(UNKNOWN_CHOICE(what="axis", plural="axes", name=str(axis), known=tuple(UP_TURNS)))
        which = objects.index(name)
        quaternions[..., which] = times(quaternions[..., which], UP_TURNS[axis])
    return np.moveaxis(np.concatenate([at, quaternions]), 0, -1)


def quaternion_order(name: str) -> list[int]:
    """Where the numbers of a pose, which are x, y, z, qw, qx, qy, qz here, go. Raises RequestError."""
    if name not in POSE_ORDERS:
        orders = "orders of a quaternion"
        raise RequestError(
            UNKNOWN_CHOICE(what="order of a quaternion", plural=orders, name=str(name), known=tuple(POSE_ORDERS))
        )
    return POSE_ORDERS[name]


def lifts(header: SceneFile, origins: Origins) -> Array:
    """(N,): how far the origin of each object is above its lowest point. Raises RequestError."""
    if isinstance(origins, Mapping):
        objects = [one.name for one in header.objects]
        for name in origins:
            if name not in objects:
                raise RequestError(UNKNOWN_CHOICE(what="object", name=str(name), known=objects))
        return np.array([as_number(f"origins[{name!r}]", origins.get(name, 0.0)) for name in objects])
    if origins not in ("base", "middle"):
        wanted = '"base", "middle" or metres by name'
        raise RequestError(WRONG_VALUE(argument="origins", value=repr(origins), wanted=wanted))
    half = 0.5 if origins == "middle" else 0.0
    return half * np.array([one.shape.height for one in header.objects])


Numbers: TypeAlias = Sequence[float] | Array


@dataclass(frozen=True, slots=True)
class TableFrame:
    """Where the spec's point (0, 0) at the height of the table is, in metres, and by how much the spec's x axis is
    turned against the world's, in radians, counter-clockwise."""

    origin: tuple[float, float, float]
    turn: float = 0.0

    def place(self, pose: Numbers) -> tuple[Array, Array]:
        """A pose x, y, z, qw, qx, qy, qz of the spec's frame, or many, (7, ...): their place and quaternion in the
        world."""
        x, y, z, *quaternion = pose
        cosine, sine = math.cos(self.turn), math.sin(self.turn)
        left, away, up = self.origin
        at = np.array([cosine * x - sine * y + left, sine * x + cosine * y + away, z + up])
        return at, times((math.cos(self.turn / 2.0), 0.0, 0.0, math.sin(self.turn / 2.0)), quaternion)

    def pose(self, at: Numbers, quaternion: Numbers) -> tuple[float, float, float]:
        """The reverse for a body: x, y and heading in the spec's frame. The heading is the turn about the vertical
        that comes nearest to the attitude."""
        x, y = at[0] - self.origin[0], at[1] - self.origin[1]
        cosine, sine = math.cos(self.turn), math.sin(self.turn)
        return cosine * x + sine * y, cosine * y - sine * x, float(heading_of(quaternion)) - self.turn


def times(first: Numbers, second: Numbers) -> Array:
    """The product of two quaternions (w, x, y, z), or of many, (4, ...): the second rotation, then the first."""
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


def rotate(quaternion: Numbers, vector: Numbers) -> Array:
    """A vector (3,), turned by a quaternion."""
    return times(times(quaternion, [0.0, *vector]), inverse(quaternion))[1:]


def heading_of(quaternion: Numbers) -> Array:
    """The turn about the vertical that comes nearest to an attitude, or to each of many, (..., 4), in radians."""
    found = np.asarray(quaternion)
    return np.asarray(2.0 * np.arctan2(found[..., 3], found[..., 0]))


def flat(poses: Array) -> Array:
    """(..., 3), x, y and heading of poses (..., 7)."""
    return np.concatenate([poses[..., :2], heading_of(poses[..., 3:])[..., None]], axis=-1)


def upright(quaternion: Numbers) -> Array:
    """An attitude at heading 0: without the turn about the vertical that comes nearest to it."""
    half = float(heading_of(quaternion)) / 2.0
    return times((math.cos(half), 0.0, 0.0, -math.sin(half)), quaternion)
