"""Sets of scenes as the arrays and tables of other libraries. Each is imported when it is asked for."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from scenegen.errors import RequestError
from scenegen.errors.requests import NOT_INSTALLED
from scenegen.formats.columns import COUNT, columns
from scenegen.needs import need
from scenegen.pose import row_count

if TYPE_CHECKING:
    import pandas
    import torch

    from scenegen.api.scene_arrays import SceneArrays

Array = npt.NDArray[np.float64]


def to_numpy(scenes: SceneArrays) -> tuple[Array, Array]:
    """Poses (n, N, 3) and phi (n, L), both float64 and copies: what is done to them leaves the scenes alone."""
    phi = np.empty((len(scenes), len(scenes.phi)))
    for column, values in enumerate(scenes.phi.values()):
        phi[:, column] = values
    return scenes.poses.copy(), phi


def to_torch(
    scenes: SceneArrays, dtype: torch.dtype | None, device: torch.device | str | None
) -> tuple[torch.Tensor, torch.Tensor]:
    """The same as tensors. Raises RequestError where torch is not installed."""
    need("torch", "for `to_torch()`")
    import torch

    poses, phi = (torch.from_numpy(array) for array in to_numpy(scenes))
    return poses.to(device, dtype), phi.to(device, dtype)


def to_pandas(scenes: SceneArrays) -> pandas.DataFrame:
    """One row per scene, the columns of the Parquet files: `mug.x`, `mug.y`, `mug.theta`, ..., `phi.task`.

    Raises RequestError where pandas is not installed, OutputError where two columns would share a name.
    """
    try:
        import pandas
    except ModuleNotFoundError as error:
        known = {"package": "pandas", "purpose": "for data frames", "command": "pip install pandas"}
        raise RequestError(NOT_INSTALLED(**known)) from error
    names = columns(scenes.header, tuple(scenes.phi))
    poses, phi = to_numpy(scenes)
    on = [] if scenes.on is None else [scenes.on]
    counts = scenes.counts
    each = [number[:, None].astype(np.float64) for number in counts.values()]
    table = np.concatenate([poses.reshape(len(scenes), row_count(len(scenes.objects))), *on, *each, phi], axis=1)
    return pandas.DataFrame(table, columns=names).astype({f"{COUNT}{name}": np.int64 for name in counts})
