"""Poses as simulators take them: a place and a quaternion."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from scenegen.assets import ASSETS, PLAIN, UNKNOWN, Shape
from scenegen.assets.support import base_heights
from scenegen.errors import RequestError
from scenegen.errors.requests import UNKNOWN_CHOICE
from scenegen.needs import need
from scenegen.pose import THETA, X, Y
from scenegen.scene.data import SceneFile, footprint_of
from scenegen.scene.standing import heights_of

DTYPES = ("float32", "float64")


def poses7(
    header: SceneFile,
    poses: npt.NDArray[np.float64],
    on: npt.NDArray[np.float64] | None,
    rest: npt.NDArray[np.float64] | None = None,
    *,
    tensor: bool,
    dtype: str,
) -> Any:
    """(n, N, 7) of poses (n, N, 3): x, y, z, qw, qx, qy, qz; `on` and `rest` as SceneArrays has them. Raises
    RequestError."""
    if dtype not in DTYPES:
        raise RequestError(UNKNOWN_CHOICE(what="dtype", name=dtype, known=DTYPES))
    shapes = [
        Shape(
            one.shape.asset if one.shape.asset in {*ASSETS, *PLAIN} else UNKNOWN,
            footprint_of(one.shape.footprint),
            one.shape.height,
            open=tuple(one.shape.open),
        )
        for one in header.objects
    ]
    found = np.zeros((*poses.shape[:2], 7))
    found[..., 0], found[..., 1] = poses[..., X], poses[..., Y]
    found[..., 2] = base_heights(
        shapes, poses, declared=heights_of(header, np.empty((len(poses), 0)) if on is None else on)
    )
    found[..., 3], found[..., 6] = np.cos(poses[..., THETA] / 2.0), np.sin(poses[..., THETA] / 2.0)
    found[np.isnan(poses[..., X])] = np.nan
    found = (found if rest is None else rest).astype(dtype)
    if not tensor:
        return found
    need("torch", "for tensors")
    from torch import from_numpy

    return from_numpy(found)
