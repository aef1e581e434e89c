"""What a process does that cuts one mesh: CoACD alone, so that it loads nothing else of the assets."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt


def cut(
    order: tuple[npt.NDArray[np.float64], npt.NDArray[np.int64], dict[str, Any]],
) -> list[tuple[npt.NDArray[np.float64], npt.NDArray[np.int64]]]:
    """Vertices (V, 3), faces (F, 3) and CoACD's options -> those of the pieces."""
    import coacd

    vertices, faces, options = order
    coacd.set_log_level("off")
    pieces = coacd.run_coacd(coacd.Mesh(vertices, faces.astype(np.int32)), **options)
    return [(np.asarray(v, dtype=np.float64), np.asarray(f, dtype=np.int64)) for v, f in pieces]
