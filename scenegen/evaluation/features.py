"""Scenes as points: the Euclidean space in which the metrics measure the distance of scenes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from scenegen.errors import DataError
from scenegen.errors.models import ARRAY_NOT_FINITE, DIFFERENT_OBJECTS, TOO_FEW_SCENES, WRONG_SHAPE
from scenegen.pose import SIZE, THETA, TWO_PI, X, Y, along, axis_of, object_count

Array = npt.NDArray[np.float64]


def checked(rows: npt.ArrayLike) -> Array:
    """Poses (3N, B) in metres and radians, as float64. Raises DataError for another shape or values not finite."""
    poses = np.asarray(rows, dtype=np.float64)
    if poses.ndim != 2 or poses.shape[0] % SIZE or not poses.shape[0]:
        raise DataError(WRONG_SHAPE(what="poses", found=str(poses.shape), wanted="(3N, B)"))
    if not np.isfinite(poses).all():
        raise DataError(ARRAY_NOT_FINITE(what="a pose"))
    return poses


def checked_pair(reference: npt.ArrayLike, generated: npt.ArrayLike, least: tuple[int, int]) -> tuple[Array, Array]:
    """Two sets of poses (3N, R) and (3N, G) of the same objects, R and G no smaller than `least`.

    Raises DataError if a set is malformed or too small, or if the numbers of objects differ.
    """
    truth, made = checked(reference), checked(generated)
    if len(truth) != len(made):
        objects, others = object_count(len(truth)), object_count(len(made))
        raise DataError(DIFFERENT_OBJECTS(reference=objects, generated=others))
    for poses, needed, which in ((truth, least[0], "reference"), (made, least[1], "generated")):
        if poses.shape[1] < needed:
            scenes = "one scene" if needed == 1 else f"{needed} scenes"
            raise DataError(TOO_FEW_SCENES(count=poses.shape[1], which=which, needed=scenes))
    return truth, made


def features(rows: npt.ArrayLike, depends: Sequence[int] | None = None) -> Array:
    """Poses (3N, B) in metres and radians -> (B, 4N): x, y, cos(theta) / 2 pi, sin(theta) / 2 pi per object; of the
    storage rows in `depends` alone, where given.

    The angle enters as a circle with a circumference of 1, so that a full turn has the same weight as the unit square's
    edge. Raises DataError for another shape or coordinates that are not finite.
    """
    poses = checked(rows)
    if depends is None:
        x, y, theta = poses[along(X)], poses[along(Y)], poses[along(THETA)]
    else:
        x, y, theta = (poses[[row for row in depends if axis_of(row) == axis]] for axis in (X, Y, THETA))
    return np.concatenate([x, y, np.cos(theta) / TWO_PI, np.sin(theta) / TWO_PI]).T
