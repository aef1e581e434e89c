"""Regions of the table, painted on it as thin cloths: they are part of the table's colour, so there is no
z-fighting."""

from __future__ import annotations

import math
from functools import reduce

import numpy as np

from scenegen.assets.palette import RGB
from scenegen.assets.surfaces import reach_of
from scenegen.looks.camera import Floats
from scenegen.primitives.footprint import Box, Circle, Footprint
from scenegen.scene.stage import WOOD, Patch, Stage

# Widths, relative to the workspace's side; each is limited to a share of the region's size.
BORDER, HEM, SEAM, THREAD = 0.0045, 0.0110, 0.0020, 0.0060
OPAQUE, EDGE = 0.50, 0.85  # opacity of the cloth and of its border


def cover(stage: Stage, x: Floats, y: Floats, wood: Floats, table: RGB = WOOD) -> Floats:
    """(h, w, 3): factors of the table's own colour at the visible points (x, y) (h, w), in metres.

    `table` is that colour, `wood` (h, w, 3) are the factors of the bare table. Regions that overlap show through each
    other, later ones on top.
    """
    tint = wood.copy()
    pixel = np.maximum(np.abs(np.gradient(x, axis=1)), np.abs(np.gradient(y, axis=0)))
    flat, sizes, columns, rows = tint.reshape(-1, 3), pixel.ravel(), x.ravel(), y.ravel()
    for patch in stage.patches:
        if patch.height:  # a board, which is a body of its own
            continue
        across, along, theta = patch.pose
        far = reach_of(patch.footprint)
        near = np.flatnonzero((np.abs(columns - across) <= far) & (np.abs(rows - along) <= far))
        dx, dy = columns[near] - across, rows[near] - along
        cos, sin = math.cos(theta), math.sin(theta)
        alpha, light = _cloth(patch, dx * cos + dy * sin, dy * cos - dx * sin, sizes[near], stage.side)
        color = np.array(patch.color) / np.array(table)
        flat[near] = flat[near] * (1.0 - alpha[:, None]) + (alpha * light)[:, None] * color
    return tint


def _cloth(patch: Patch, x: Floats, y: Floats, pixel: Floats, side: float) -> tuple[Floats, Floats]:
    """Opacity and brightness of the cloth at (x, y) (P,) in its own frame, for pixels of that size."""
    inside = _inside(patch.footprint, x, y)
    narrow = min(patch.footprint.extent)

    def band(start: float, end: float) -> Floats:
        """1 if the distance from the edge lies between two widths, else 0, with smooth transitions."""
        low, high = (min(width * side, share * narrow) for width, share in ((start, 0.12), (end, 0.15)))
        return np.clip((inside - low) / pixel + 0.5, 0.0, 1.0) * np.clip((high - inside) / pixel + 0.5, 0.0, 1.0)

    covered = np.clip(inside / pixel + 0.5, 0.0, 1.0)
    border = band(0.0, BORDER)
    seam = band(HEM, HEM + SEAM)
    turns = math.tau / (THREAD * side)
    shown = np.clip(THREAD * side / (3.0 * pixel) - 0.5, 0.0, 1.0)  # threads finer than pixels would cause aliasing
    weave = 0.03 * shown * (np.sin(turns * x) + np.sin(turns * y))
    return covered * (
        OPAQUE + (EDGE - OPAQUE) * np.maximum(border, 0.5 * seam)
    ), 1.0 + weave - 0.30 * border - 0.15 * seam


def _inside(footprint: Footprint, x: Floats, y: Floats) -> Floats:
    """Distance from the edge, positive inside; outside it is a lower bound."""
    match footprint:
        case Circle(radius):
            return np.asarray(radius - np.hypot(x, y))
        case Box(length, width):
            return np.minimum(length / 2.0 - np.abs(x), width / 2.0 - np.abs(y))
        case _:
            corners = footprint.vertices
            edges = zip(corners, (*corners[1:], corners[0]), strict=True)
            return reduce(np.minimum, (_left(a, b, x, y) for a, b in edges))


def _left(a: tuple[float, float], b: tuple[float, float], x: Floats, y: Floats) -> Floats:
    """Distance from the line through a and b, positive on the left of the way from a to b."""
    (ax, ay), (bx, by) = a, b
    return np.asarray(((bx - ax) * (y - ay) - (by - ay) * (x - ax)) / math.hypot(bx - ax, by - ay))
