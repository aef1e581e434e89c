"""How cameras see objects of the library: in slices of what is drawn of them, upright prisms on each other."""

from __future__ import annotations

from functools import cache
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from scenegen.geometry.footprint import Circle, Footprint, Polygon, Stack
from scenegen.things.bodies import parts_of
from scenegen.things.library import PLAIN, Shape, entry_of
from scenegen.things.mesh import Mesh, join
from scenegen.things.outline import MeshError, Shadow, corners_of, simplify

CUTS = 24  # through a body, at equal distances
SLICES = 5  # that stand for it at most: neighbours become one, those that are most alike first
# once there are at most SLICES, neighbours still become one that differ by less than this share of all reaches
ALIKE = 0.02
WAYS = 16  # in which cuts are compared
SLICE_CORNERS = 12  # of a slice that is not round, at most
MANY, ROUND = 16, 0.04  # an outline with so many corners, whose distances from the axis differ by less, is a disc
DISC_SIDES = 24  # of the polygon that stands for a disc where it is compared
ANY_COLOR = (0.5, 0.5, 0.5)


@cache
def visible_body(shape: Shape) -> Footprint:
    """What a camera sees of an object, in its frame: the footprint of a prism, or a stack."""
    if shape.asset in PLAIN or entry_of(shape) is None:
        return shape.footprint
    slices = slices_of(join([part.mesh for part in parts_of(shape, ANY_COLOR)]))
    if len(slices) < 2:
        return shape.footprint
    return Stack(tuple(corners_of(shape.footprint, DISC_SIDES, DISC_SIDES)), slices)


def slices_of(mesh: Mesh) -> tuple[tuple[Footprint, float, float], ...]:
    """Convex prisms that stand for a mesh, from the bottom up, each with the heights of its ends above the lowest
    point, in metres. Each is a cut through the mesh, the one that is nearest to the average over its height."""
    low, high = float(mesh.vertices[:, 2].min()), float(mesh.vertices[:, 2].max())
    step = (high - low) / CUTS
    cuts = [_cut(mesh, low + (number + 0.5) * step) for number in range(CUTS)]
    reaches = np.array([_reach(one) for one in cuts])
    ends = list(range(CUTS + 1))  # of the slices, in cuts

    def spread(start: int, stop: int) -> float:
        some = reaches[start:stop]
        return float(np.abs(some - some.mean(axis=0)).sum())

    while len(ends) > 2:
        runs = list(zip(ends, ends[1:], ends[2:], strict=False))
        lost = [spread(a, c) - spread(a, b) - spread(b, c) for a, b, c in runs]
        start, middle, stop = runs[lost.index(min(lost))]
        if len(ends) <= SLICES + 1 and spread(start, stop) > ALIKE * float(reaches.sum()):
            break
        ends.remove(middle)
    found = []
    for start, stop in pairwise(ends):
        away = np.abs(reaches[start:stop] - reaches[start:stop].mean(axis=0)).sum(axis=1)
        outline = cuts[start + int(away.argmin())]
        if outline is not None:
            found.append((outline, start * step, stop * step))
    return tuple(found)


def _cut(mesh: Mesh, z: float) -> Footprint | None:
    """The convex outline of a mesh at a height; None where there is nothing."""
    corners = [mesh.vertices[mesh.faces[:, corner]] for corner in range(3)]
    points = []
    for start, stop in zip(corners, (*corners[1:], corners[0]), strict=True):
        crosses = (start[:, 2] > z) != (stop[:, 2] > z)
        start, stop = start[crosses], stop[crosses]
        points.append(start + (z - start[:, 2:]) / (stop[:, 2:] - start[:, 2:]) * (stop - start))
    shadow, found = Shadow(), np.concatenate(points)
    if not len(found):
        return None
    shadow.points(np.eye(3), np.zeros(3), found)
    try:
        outline = shadow.footprint()
    except MeshError:  # a line
        return None
    if not isinstance(outline, Polygon):
        return outline
    away = np.hypot(*np.array(outline.vertices).T)
    if len(away) >= MANY and float(np.ptp(away)) < ROUND * float(away.max()):
        return Circle(float(away.mean()))
    return Polygon(simplify(outline.vertices, SLICE_CORNERS))


def _reach(outline: Footprint | None) -> npt.NDArray[np.float64]:
    """How far an outline reaches in each of some directions, (WAYS,); nowhere where there is none."""
    if outline is None:
        return np.zeros(WAYS)
    turns = np.linspace(0.0, 2.0 * np.pi, WAYS, endpoint=False)
    found = np.array(corners_of(outline, DISC_SIDES)) @ np.stack([np.cos(turns), np.sin(turns)])
    return np.asarray(np.maximum(found.max(axis=0), 0.0))
