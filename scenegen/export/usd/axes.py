"""Principal axes of inertia, as USD wants them: three moments, and the rotation of their axes."""

from __future__ import annotations

import itertools
import math

import numpy as np

from scenegen.assets.mesh import Floats

Quaternion = tuple[float, float, float, float]  # w, x, y, z
STILL: Quaternion = (1.0, 0.0, 0.0, 0.0)


def principal(moments: Floats) -> tuple[tuple[float, float, float], Quaternion]:
    """The principal moments of a symmetric matrix (3, 3), and the rotation from their axes to the matrix's.

    Of the 24 rotations that do it, the one closest to none: a matrix that is diagonal keeps its axes.
    """
    if not (moments - np.diag(np.diag(moments))).any():
        xx, yy, zz = np.diag(moments).tolist()
        return (xx, yy, zz), STILL
    values, vectors = np.linalg.eigh(moments)
    best, closest = -math.inf, np.eye(3)
    order: tuple[int, ...] = (0, 1, 2)
    for tried in itertools.permutations(range(3)):
        for signs in itertools.product((1.0, -1.0), repeat=3):
            turn = vectors[:, tried] * np.array(signs)
            near = round(float(np.trace(turn)), 9)  # ties are not decided by rounding
            if np.linalg.det(turn) > 0.0 and near > best:
                best, closest, order = near, turn, tried
    a, b, c = values[list(order)].tolist()
    return (a, b, c), _quaternion(closest)


def _quaternion(turn: Floats) -> Quaternion:
    """Of a rotation by less than 63 degrees, the most that `principal` needs."""
    w = math.sqrt(1.0 + float(np.trace(turn))) / 2.0
    x, y, z = turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]
    return w, float(x / (4.0 * w)), float(y / (4.0 * w)), float(z / (4.0 * w))
