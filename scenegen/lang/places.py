"""Regions and their named points: what `placemat.left` and `workspace.center` stand for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from scenegen.primitives import MATH, PRIMITIVES
from scenegen.primitives.footprint import Box, Circle, Footprint, Polygon
from scenegen.scene.limits import BOARD
from scenegen.scene.workspace import Workspace

Point = tuple[float, float]

SIDES = ("left", "right", "top", "bottom", "center")
CORNERS = ("topLeft", "topRight", "bottomLeft", "bottomRight")
SIZES = ("width", "height")
MEMBERS = (*SIDES, *CORNERS, "corners", *SIZES)


@dataclass(frozen=True, slots=True)
class Area:
    """A part of the table, or a board at a height, as it was written: bounding box (left, bottom, right, top), centre,
    and corners counter-clockwise, in metres. A circle has no corners. `kind` is the word that made it; `z` is how high
    its top is above the table."""

    kind: str
    box: tuple[float, float, float, float]
    center: Point
    corners: tuple[Point, ...]
    z: float = 0.0

    @property
    def footprint(self) -> Footprint:
        """What it covers, in the frame of its centre."""
        left, bottom, right, top = self.box
        match self.kind:
            case "circle":
                return Circle((right - left) / 2.0)
            case "polygon":
                x, y = self.center
                return Polygon(tuple((px - x, py - y) for px, py in self.corners))
            case _:
                return Box(right - left, top - bottom)

    def side(self, name: str) -> Point:
        """The middle of a side of the bounding box, or the centre."""
        left, bottom, right, top = self.box
        x, y = (left + right) / 2.0, (bottom + top) / 2.0
        sides = {"left": (left, y), "right": (right, y), "top": (x, top), "bottom": (x, bottom), "center": self.center}
        return sides[name]

    def corner(self, name: str) -> Point:
        """A corner of a rectangle."""
        left, bottom, right, top = self.box
        return (left if name.endswith("Left") else right), (top if name.startswith("top") else bottom)


def rectangle(left: float, bottom: float, right: float, top: float, kind: str = "rect") -> Area:
    corners = ((left, bottom), (right, bottom), (right, top), (left, top))
    return Area(kind, (left, bottom, right, top), ((left + right) / 2.0, (bottom + top) / 2.0), corners)


def disc(center: Point, radius: float) -> Area:
    x, y = center
    return Area("circle", (x - radius, y - radius, x + radius, y + radius), center, ())


def polygon(corners: Sequence[Point], center: Point) -> Area:
    """A convex polygon; `corners` counter-clockwise."""
    xs, ys = zip(*corners, strict=True)
    return Area("polygon", (min(xs), min(ys), max(xs), max(ys)), center, tuple(corners))


def whole(workspace: Workspace) -> Area:
    """The workspace as a region."""
    (left, right), (bottom, top) = workspace.x, workspace.y
    return rectangle(left, bottom, right, top, "workspace")


def board_gap(one: Area, other: Area) -> float:
    """The clearance of the boards of two regions, in metres: see `apart`."""
    gap = PRIMITIVES["gap"].evaluate
    beside = float(gap(MATH, one.footprint, other.footprint, *one.center, 0.0, *other.center, 0.0))
    return max(beside, one.z - min(BOARD, one.z) - other.z, other.z - min(BOARD, other.z) - one.z)
