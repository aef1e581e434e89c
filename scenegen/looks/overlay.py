"""What views from above show of robots and cameras: the ring that an arm reaches, the frame of a camera's picture on
the table, and the hand over what it grasps."""

from __future__ import annotations

import math
from dataclasses import dataclass

from scenegen.geometry.footprint import Point, Rectangle, cut_at_line, signed_area
from scenegen.lang.check.arms import hand_boxes
from scenegen.lang.spec import CheckedSpec, Pose, SpecCamera
from scenegen.things.arms import Arm


@dataclass(frozen=True, slots=True)
class Ring:
    """Where an arm's fingertips get to, in its frame, the hand turned as is best for that: from `nearest` to `farthest`
    metres from the first axis, at the bearings between these two, in radians; None: at all. Where an arm leans back
    over its base is left out."""

    nearest: float
    farthest: float
    bearing: tuple[float, float] | None


def ring_of(arm: Arm, foot: float = 0.0) -> Ring:
    """The ring at the table, or as near to that as the hand gets, of an arm that stands `foot` metres above it."""
    ring = arm.ring
    nearest, farthest = ring.reach_at(-foot)  # beyond the heights that the hand gets to, that of the nearest of these
    ahead, back = (ring.tip_distance(arm.offset, away) for away in (0.0, math.pi))
    return Ring(max(nearest - back, 0.0), farthest + ahead, None if ring.turns_freely else ring.bearing)


@dataclass(frozen=True, slots=True)
class CameraFrame:
    """What a camera pictures of the table's plane, seen from above: the corners, counter-clockwise, none where it
    pictures nothing near the view; and its eye and level heading. An eye that is `outside` is shown where the view
    ends."""

    name: str
    corners: tuple[Point, ...]
    eye: Pose
    outside: bool


EYE_INSET = 0.025  # of the view's longer side, from its border: where eyes that are outside are shown
BEYOND = 1.0  # sizes of the view on each side: what is pictured further away, up to the horizon, is cut off there


def frame_of(camera: SpecCamera, view: Rectangle) -> CameraFrame:
    """The frame of a camera in a view from (x, y) to (x, y)."""
    (left, low, right, high), (x, y, _) = view, camera.eye
    wide, deep = BEYOND * (right - left), BEYOND * (high - low)
    corners = _view_of(camera, (left - wide, low - deep, right + wide, high + deep))
    outside = not (left <= x <= right and low <= y <= high)
    if outside:
        inset = EYE_INSET * max(right - left, high - low)
        x, y = min(max(x, left + inset), right - inset), min(max(y, low + inset), high - inset)
    heading = math.atan2(camera.ahead[1], camera.ahead[0])
    return CameraFrame(camera.name, tuple(corners), (x, y, heading), outside)


def share_of_area(camera: SpecCamera, area: Rectangle) -> float:
    """The share of an area of the table that a camera pictures, were it empty."""
    found = _view_of(camera, area)
    return signed_area(found) / ((area[2] - area[0]) * (area[3] - area[1])) if found else 0.0


def _view_of(camera: SpecCamera, area: Rectangle) -> list[Point]:
    """The corners of the part of an area of the table that a camera pictures, counter-clockwise."""
    (left, low, right, high), eye = area, camera.eye
    corners: list[Point] = [(left, low), (right, low), (right, high), (left, high)]
    for nx, ny, nz in camera.sides:
        depths = [nx * (x - eye[0]) + ny * (y - eye[1]) - nz * eye[2] for x, y in corners]
        corners = cut_at_line(corners, depths)
    return corners


def hand_outlines(spec: CheckedSpec, thing: int, robot: int, yaw: float) -> tuple[tuple[Point, ...], ...]:
    """The fingers and the palm of a robot's open hand over a thing, in the thing's frame."""
    arm = spec.shapes[robot].arm
    assert arm is not None
    return tuple(box.vertices for box in hand_boxes(spec.shapes[thing].footprint, arm, yaw))
