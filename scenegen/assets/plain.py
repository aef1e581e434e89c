"""Plain shapes with sizes of their own: boxes, cylinders and prisms, with an arrow head on top for their heading."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from scenegen.assets.mesh import Floats, Mesh, loft, revolve
from scenegen.assets.outline import simplified
from scenegen.assets.palette import RGB, mix
from scenegen.assets.parts import DARK, WHITE, Part, pip
from scenegen.primitives.footprint import Box, Circle, Footprint, Polygon
from scenegen.primitives.hull import Point, centroid

BEVEL = 0.05  # of the smallest size: what edges lose
RAISED = 0.02  # of the smallest size: how far the mark stands out
LARGEST_MARK = 0.06  # metres
DRAWN = 64  # corners of a prism at most; one with more is drawn as one round it


def plain(footprint: Footprint, height: float, color: RGB) -> tuple[Part, ...]:
    """Footprint x height as closed meshes: the body in its colour, and the mark. Sizes in metres."""
    light = sum(color) / 3 > 0.55
    ink = mix(color, DARK, 0.55) if light else mix(color, WHITE, 0.65)
    match footprint:
        case Circle(radius):
            smallest = min(2.0 * radius, height)
            body = _round(radius, height - RAISED * smallest, BEVEL * smallest)
            long = wide = min(radius, LARGEST_MARK)
            x, y = 0.0, 0.0
        case Box(length, width):
            smallest = min(length, width, height)
            corners = [(-length, -width), (length, -width), (length, width), (-length, width)]
            half = np.array(corners) / 2.0
            body = _upright(half, 1.0 - 2.0 * BEVEL * smallest / np.array([length, width]), height, smallest)
            # In the middle of a cube, at the front of what is longer or larger.
            long = wide = min(0.5 * min(length, width), LARGEST_MARK)
            x, y = length / 2.0 - 0.25 * min(length, width) - long / 2.0, 0.0
        case Polygon(vertices):
            outline = simplified(vertices, DRAWN)
            x, y, room = _middle(outline)
            smallest = min(2.0 * room, height)
            centred = np.array(outline) - (x, y)
            body = _upright(centred, np.full(2, 1.0 - BEVEL * smallest / room), height, smallest).moved(x, y)
            long = wide = min(room, LARGEST_MARK)
    raised = RAISED * smallest
    mark = pip(long, wide, height - 2.0 * raised, height).moved(x, y)
    return Part(body, color), Part(mark, ink)


def _round(radius: float, height: float, bevel: float) -> Mesh:
    return revolve(
        [
            (0.0, 0.0),
            (radius - bevel, 0.0),
            (radius, bevel),
            (radius, height - bevel),
            (radius - bevel, height),
            (0.0, height),
        ]
    )


def _upright(outline: Floats, inset: Floats, height: float, smallest: float) -> Mesh:
    """A convex outline (K, 2) round the origin, extruded; `inset` scales it at its bevelled ends."""
    bevel, top = BEVEL * smallest, height - RAISED * smallest
    levels = [(0.0, inset), (bevel, np.ones(2)), (top - bevel, np.ones(2)), (top, inset)]
    return loft(np.stack([np.column_stack([outline * scale, np.full(len(outline), z)]) for z, scale in levels]))


def _middle(outline: Sequence[Point]) -> tuple[float, float, float]:
    """The centroid of a convex polygon, counter-clockwise, and its distance from the nearest edge."""
    x, y = centroid(Polygon(tuple(outline)))
    edges = zip(outline, (*outline[1:], outline[0]), strict=True)
    room = min(
        ((bx - ax) * (y - ay) - (by - ay) * (x - ax)) / math.hypot(bx - ax, by - ay) for (ax, ay), (bx, by) in edges
    )
    return x, y, room
