"""Attitudes as quaternions (qw, qx, qy, qz): how far one is turned against another, and which heading is nearest."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]


def standing(places: Floats) -> Floats:
    """(..., 7): place and quaternion of objects that stand upright at (..., 4): x, y, theta, z."""
    poses = np.zeros((*places.shape[:-1], 7))
    poses[..., :3] = places[..., [0, 1, 3]]
    poses[..., 3], poses[..., 6] = np.cos(places[..., 2] / 2.0), np.sin(places[..., 2] / 2.0)
    return poses


def turn_between(one: Floats, other: Floats) -> Floats:
    """(...,): the angle of the one rotation that leads from attitudes (..., 4) to others, in degrees, 0 to 180."""
    aw, av, bw, bv = one[..., :1], one[..., 1:], other[..., :1], other[..., 1:]
    # From sine and cosine of half the angle: the arc cosine alone would lose small angles.
    cos = np.abs((one * other).sum(axis=-1))
    sin = np.linalg.norm(aw * bv - bw * av - np.cross(av, bv), axis=-1)
    return np.asarray(np.degrees(2.0 * np.arctan2(sin, cos)))


def upright(poses: Floats) -> Floats:
    """(..., 3): x, y and theta of poses (..., 7); theta is the heading of the upright attitude that is nearest.

    It is the turn about the vertical that remains when the tilt, a turn about a horizontal axis, is taken away. For
    what lies on its head there is none, and theta is 0.
    """
    theta = 2.0 * np.arctan2(poses[..., 6], poses[..., 3])
    return np.concatenate([poses[..., :2], np.remainder(theta, 2.0 * np.pi)[..., None]], axis=-1)
