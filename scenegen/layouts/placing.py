"""Poses of scenes in the frame of a simulator."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from scenegen.api.poses7 import poses7
from scenegen.api.scene_arrays import SceneArrays
from scenegen.errors import RequestError
from scenegen.errors.requests import UNKNOWN_CHOICE, WRONG_VALUE
from scenegen.validation import as_number, as_point

Array = npt.NDArray[np.float64]
Origins: TypeAlias = Literal["base", "middle"] | Mapping[str, float]
"""Where the origin of an object is: in its lowest point under the middle, in the middle of its height, or so many
metres above its lowest point, by name; 0 for names that are left out."""
Axis: TypeAlias = Literal["x", "y", "z"]
"""The axis of a body's own frame that points up where it stands."""

# quaternions (w, x, y, z) that turn the axis up: x about y by -90 degrees, y about x by 90 degrees
UPRIGHT = {
    "x": (math.sqrt(0.5), 0.0, -math.sqrt(0.5), 0.0),
    "y": (math.sqrt(0.5), math.sqrt(0.5), 0.0, 0.0),
    "z": (1.0, 0.0, 0.0, 0.0),
}


def placed(
    scenes: SceneArrays,
    origin: Sequence[float],
    turn: float,
    origins: Origins,
    up: Mapping[str, Axis] | None = None,
) -> Array:
    """(n, N, 7): x, y, z in metres and qw, qx, qy, qz, in the world.

    `origin` is where the spec's point (0, 0) at the height of the table is; `turn` turns the spec's x axis
    counter-clockwise, in radians; `up` names the axis of a body's own frame that points up, "z" where it does not say.
    Raises RequestError.
    """
    x, y, z = as_point("origin", origin)
    turn = as_number("turn", turn)
    poses: Array = poses7(scenes.header, scenes.poses, scenes.on, tensor=False, dtype="float64")
    poses[..., 2] += lifts(scenes, origins) + z
    cosine, sine = math.cos(turn), math.sin(turn)
    right, away = poses[..., 0].copy(), poses[..., 1].copy()
    poses[..., 0], poses[..., 1] = cosine * right - sine * away + x, sine * right + cosine * away + y
    # the product of a turn about the vertical and a quaternion (w, 0, 0, z)
    cosine, sine = math.cos(turn / 2.0), math.sin(turn / 2.0)
    w, k = poses[..., 3].copy(), poses[..., 6].copy()
    poses[..., 3], poses[..., 6] = cosine * w - sine * k, sine * w + cosine * k
    for name, axis in ({} if up is None else up).items():
        if name not in scenes.objects:
            raise RequestError(UNKNOWN_CHOICE(what="object", name=str(name), known=scenes.objects))
        if axis not in UPRIGHT:
            raise RequestError(UNKNOWN_CHOICE(what="axis", plural="axes", name=str(axis), known=tuple(UPRIGHT)))
        a, b, c, d = UPRIGHT[axis]
        which = scenes.objects.index(name)
        w, k = poses[:, which, 3].copy(), poses[:, which, 6].copy()
        # the product of (w, 0, 0, k) and the turn that stands the body up
        poses[:, which, 3:] = np.stack([w * a - k * d, w * b - k * c, w * c + k * b, w * d + k * a], axis=1)
    return poses


def lifts(scenes: SceneArrays, origins: Origins) -> Array:
    """(N,): how far the origin of each object is above its lowest point. Raises RequestError."""
    if isinstance(origins, Mapping):
        for name in origins:
            if name not in scenes.objects:
                raise RequestError(UNKNOWN_CHOICE(what="object", name=str(name), known=scenes.objects))
        return np.array([as_number(f"origins[{name!r}]", origins.get(name, 0.0)) for name in scenes.objects])
    if origins not in ("base", "middle"):
        wanted = '"base", "middle" or metres by name'
        raise RequestError(WRONG_VALUE(argument="origins", value=repr(origins), wanted=wanted))
    half = 0.5 if origins == "middle" else 0.0
    return half * np.array([one.shape.height for one in scenes.header.objects])
