"""Mass properties: centre and moments of closed meshes, by the divergence theorem."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scenegen.assets.mesh import Floats, Mesh

LEAST = 1e-19  # cubic metres


@dataclass(frozen=True, slots=True)
class Inertia:
    """For one kilogram: `center` (3,) in metres, and `moments` (3, 3) about it, in m^2, along the object's axes."""

    center: Floats
    moments: Floats


def inertia(meshes: Sequence[Mesh]) -> Inertia:
    """The inertia of closed meshes of one density; overlaps count twice. Raises ValueError if there is no volume.

    A tetrahedron from the origin to a triangle (a, b, c) has the volume det/6, the first moment det/24 (a + b + c) and
    the second det/120 (s s' + a a' + b b' + c c') with s = a + b + c; those of a mesh are their sums. The origin is
    moved to the middle of the corners, to avoid cancellation.
    """
    middle = np.concatenate([mesh.vertices for mesh in meshes]).mean(axis=0)
    volume, first, second = 0.0, np.zeros(3), np.zeros((3, 3))
    for mesh in meshes:
        corners = (mesh.vertices - middle)[mesh.faces]
        det = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2]))
        total = corners.sum(axis=1)
        volume += float(det.sum()) / 6.0
        first += det @ total / 24.0
        second += (
            np.einsum("t,ti,tj->ij", det, total, total) + np.einsum("t,tki,tkj->ij", det, corners, corners)
        ) / 120
    if not volume > LEAST:
        raise ValueError("a solid without volume")
    center = first / volume
    spread = second / volume - np.outer(center, center)
    moments = np.trace(spread) * np.eye(3) - spread
    # Values that are zero up to rounding are set to zero, so files do not depend on a machine's order of summation.
    size = math.sqrt(float(np.trace(moments)))
    return Inertia(_clean(center + middle, size), _clean(moments, size**2))


def _clean(values: Floats, size: float) -> Floats:
    return np.where(np.abs(values) < 1e-9 * size, 0.0, values)
