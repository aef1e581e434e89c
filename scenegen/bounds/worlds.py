"""Which surfaces things are on: the box of poses, cut where a choice of a surface changes.

A thing that can be on several surfaces has a coordinate that chooses one, and `pick` nodes make heights of it. A box
that holds several choices has every height between them, so phi seems to pass through values that it jumps over.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from scenegen.lang.core import Apply, Const, Coord, Core
from scenegen.pose import row_of

Array = npt.NDArray[np.float64]

MOST = 64  # boxes
SEAM = 1e-8  # taken off either side of a cut: there both surfaces would do, in scenes that have probability 0


def worlds(core: Core, lowest: Array, highest: Array) -> tuple[Array, Array]:
    """Boxes, (3N, W) each, which together hold the box lowest..highest (3N,) but for the seams, with one choice of a
    surface each for as many things as `MOST` boxes allow; the box alone where nothing is chosen."""
    low, high = lowest[:, None], highest[:, None]
    for row, ends in sorted(_switches(core).items()):
        inner = sorted(end for end in ends if lowest[row] < end < highest[row])
        if not inner or low.shape[1] * (len(inner) + 1) > MOST:
            continue
        seam = SEAM * max(1.0, abs(float(lowest[row])), abs(float(highest[row])))
        begins = np.array([lowest[row], *(end + seam for end in inner)])
        stops = np.array([*(end - seam for end in inner), highest[row]])
        if (begins >= stops).any():
            continue
        parts, count = len(begins), low.shape[1]
        low, high = np.repeat(low, parts, axis=1), np.repeat(high, parts, axis=1)
        low[row], high[row] = np.tile(begins, count), np.tile(stops, count)
    return low, high


def _switches(core: Core) -> dict[int, set[float]]:
    """The rows of coordinates that choose, and where their choices change."""
    found: dict[int, set[float]] = {}
    for node in core.nodes:
        if isinstance(node, Apply) and node.primitive == "pick":
            switch, end = (core.nodes[arg] for arg in node.args[:2])
            if isinstance(switch, Coord) and isinstance(end, Const) and math.isfinite(end.value):
                found.setdefault(row_of(switch.object, switch.axis), set()).add(end.value)
    return found
