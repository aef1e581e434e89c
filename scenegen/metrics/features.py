"""Scenes as points: the Euclidean space in which the metrics measure how far two scenes are apart."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from scenegen.errors import DataError, Diagnostic

Array = npt.NDArray[np.float64]

TURN = 2.0 * np.pi


def checked(rows: npt.ArrayLike) -> Array:
    """Poses (3N, B) in metres and radians, as float64. Raises DataError for another shape or values not finite."""
    poses = np.asarray(rows, dtype=np.float64)
    if poses.ndim != 2 or poses.shape[0] % 3 or not poses.shape[0]:
        raise DataError(Diagnostic(f"poses of shape {poses.shape}; expected (3N, B)"))
    if not np.isfinite(poses).all():
        raise DataError(Diagnostic("a pose is not finite", help="check the scenes for NaN and infinity"))
    return poses


def checked_pair(reference: npt.ArrayLike, generated: npt.ArrayLike, least: tuple[int, int]) -> tuple[Array, Array]:
    """Two sets of poses (3N, R) and (3N, G) of the same objects, R and G no smaller than `least`.

    Raises DataError where a set is malformed or too small, or where the numbers of objects differ.
    """
    truth, made = checked(reference), checked(generated)
    if len(truth) != len(made):
        title = f"the reference has {len(truth) // 3} objects per scene, the generated scenes {len(made) // 3}"
        raise DataError(Diagnostic(title, help="compare scenes of the same spec"))
    for poses, needed, which in ((truth, least[0], "reference"), (made, least[1], "generated")):
        if poses.shape[1] < needed:
            scenes = "one scene" if needed == 1 else f"{needed} scenes"
            raise DataError(
                Diagnostic(f"{poses.shape[1]} {which} scenes are too few", help=f"this metric needs at least {scenes}")
            )
    return truth, made


def features(rows: npt.ArrayLike) -> Array:
    """Poses (3N, B) in metres and radians -> (B, 4N): x, y, cos(theta) / 2 pi, sin(theta) / 2 pi per object.

    The angle enters as a circle with a circumference of 1, so that a full turn weighs as much as the unit square's
    edge. Raises DataError for another shape or coordinates that are not finite.
    """
    poses = checked(rows)
    x, y, theta = poses[0::3], poses[1::3], poses[2::3]
    return np.concatenate([x, y, np.cos(theta) / TURN, np.sin(theta) / TURN]).T
