"""What a top view shows, as plain data: lengths in metres, angles in radians."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from scenegen.primitives import Box, Footprint, Polygon

Point = tuple[float, float]
Pose = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Thing:
    """An object, or with `zone` a region: its footprint, pose and name. `tint` is a colour of SVG, if given; `inside`
    are thin lines in its frame: the cells of a rack, the drawers of a cabinet."""

    name: str
    footprint: Footprint
    pose: Pose
    zone: bool = False
    tint: str = ""
    inside: tuple[Box | Polygon, ...] = ()


@dataclass(frozen=True, slots=True)
class Dimension:
    """A dimension line with its measured value; green if `good`, else red."""

    start: Point
    end: Point
    text: str
    good: bool = True


@dataclass(frozen=True, slots=True)
class Turn:
    """The angle at `center` from the heading `start` to the heading `stop`."""

    center: Point
    start: float
    stop: float
    text: str
    good: bool = True


@dataclass(frozen=True, slots=True)
class Guide:
    """A thin dashed line: an axis, a mirror, an extension line."""

    start: Point
    end: Point


Mark = Dimension | Turn | Guide


@dataclass(frozen=True, slots=True)
class View:
    """A scene and its text: `x` and `y` are the ends of the workspace, `caption` the lines below."""

    things: Sequence[Thing]
    x: tuple[float, float] = (0.0, 1.0)
    y: tuple[float, float] = (0.0, 1.0)
    marks: Sequence[Mark] = ()
    caption: Sequence[str] = ()
    good: bool | None = None
