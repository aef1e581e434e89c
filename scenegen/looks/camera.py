"""Cameras: view and projection matrices, and where a point of the table falls in a picture.

World: metres, x to the right, y away from the viewer, z up. Pictures: (0, 0) is the upper left corner, x grows to the
right and y downwards, in pixels. All conversions between the two are here.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

VIEWS = ("top", "perspective", "front", "three-quarter")
USUAL_VIEWS = ("top", "perspective")  # the default views

PERSPECTIVE_FIELD = math.radians(32.0)  # height of a picture in perspective, as an angle
# Where cameras in perspective stand: degrees to the right of the viewer's side, and down from the horizontal.
VIEW_ANGLES = {"perspective": (0.0, 50.0), "front": (0.0, 24.0), "three-quarter": (38.0, 36.0)}
NEAR_PLANE_SHARE = 0.01  # of the farthest point: what is nearer to a camera in the midst of things is cut off
FRAME_SHARE = 0.955  # share of the picture that the framed points may fill


@dataclass(frozen=True, slots=True)
class Camera:
    """`view` (4, 4) takes world to eye coordinates, `projection` (4, 4) those to clip coordinates; size in pixels."""

    view: Floats
    projection: Floats
    size: tuple[int, int]

    def project(self, points: npt.ArrayLike) -> Floats:
        """(P, 3) points in metres -> (P, 2) pixels, columns then rows, continuous, from the upper left corner."""
        world = np.atleast_2d(np.asarray(points, dtype=np.float64))
        clip = np.column_stack([world, np.ones(len(world))]) @ (self.projection @ self.view).T
        ndc = clip[:, :2] / clip[:, 3:]
        return np.column_stack([(ndc[:, 0] + 1.0) / 2.0 * self.size[0], (1.0 - ndc[:, 1]) / 2.0 * self.size[1]])

    @property
    def orthographic(self) -> bool:
        return bool(self.projection[3, 3] == 1.0)

    def intrinsics(self) -> dict[str, float]:
        """Focal lengths and principal point in pixels (u = fx x / z + cx, v = fy y / z + cy, for the axes of
        `extrinsics`); without perspective, pixels per metre (u = fx x + cx)."""
        width, height = self.size
        fx, fy = (float(self.projection[axis, axis]) * self.size[axis] / 2.0 for axis in (0, 1))
        return {"fx": fx, "fy": fy, "cx": width / 2.0, "cy": height / 2.0}

    def extrinsics(self) -> Floats:
        """(4, 4): from the world to the camera's frame, whose x points to the right, y down and z ahead (OpenCV's)."""
        return np.asarray(np.diag([1.0, -1.0, -1.0, 1.0]) @ self.view)

    @property
    def eye(self) -> Floats:
        """(3,): where the camera is."""
        return np.asarray(-np.linalg.solve(self.view[:3, :3], self.view[:3, 3]))

    def with_size(self, size: tuple[int, int]) -> Camera:
        """The same view with another number of pixels."""
        return Camera(self.view, self.projection, size)

    def centre_pixels(self) -> Camera:
        """The camera whose pixels, sampled at their lower left corners, equal this camera's pixels sampled at their
        centres."""
        shift = np.eye(4)
        shift[:2, 3] = -1.0 / self.size[0], -1.0 / self.size[1]
        return Camera(self.view, shift @ self.projection, self.size)

    def rays(self, columns: npt.ArrayLike, rows: npt.ArrayLike) -> tuple[Floats, Floats]:
        """Origins and directions, (..., 3) each, of the rays of pixels; depth 1 is origin plus direction."""
        ndc_x = 2.0 * np.asarray(columns, dtype=np.float64) / self.size[0] - 1.0
        ndc_y = 1.0 - 2.0 * np.asarray(rows, dtype=np.float64) / self.size[1]
        right, up, back = self.view[:3, :3]
        eye = self.eye
        across, along = ndc_x / self.projection[0, 0], ndc_y / self.projection[1, 1]
        slope = across[..., None] * right + along[..., None] * up
        if self.orthographic:
            return eye + slope, np.broadcast_to(-back, slope.shape)
        return np.broadcast_to(eye, slope.shape), slope - back

    def depth(self, buffer: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
        """Distance along the view direction, in metres, from pybullet's depth buffer, which pybullet fills by the
        formula for perspective for any projection."""
        near, far = self._planes()
        return np.asarray(1.0 / (near - buffer * np.float32(near - far)), dtype=np.float32)

    def for_card(self) -> Floats:
        """The projection for a graphics card, whose depth without perspective is linear, as it should be, and which
        samples pixels at their centres."""
        projection = self.projection.copy()
        if self.orthographic:
            near, far = (1.0 / plane for plane in self._planes())
            projection[2, 2:] = -2.0 / (far - near), -(far + near) / (far - near)
        shift = np.eye(4)
        shift[:2, 3] = 1.0 / self.size[0], 1.0 / self.size[1]
        return np.asarray(shift @ projection)

    def from_card(self, buffer: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
        """Converts a card's depth buffer to that of the software renderer."""
        if not self.orthographic:
            return buffer
        near, far = self._planes()
        depth = 1.0 / near + buffer * np.float32(1.0 / far - 1.0 / near)
        return np.asarray((near - 1.0 / depth) / (near - far), dtype=np.float32)

    def _planes(self) -> tuple[float, float]:
        """Reciprocals of the distances, in metres, of the near and far planes."""
        scale, offset = float(self.projection[2, 2]), float(self.projection[2, 3])
        return (scale - 1.0) / offset, (scale + 1.0) / offset


def _orthographic(half_width: float, half_height: float, near: float, far: float) -> Floats:
    return np.array(
        [
            [1.0 / half_width, 0.0, 0.0, 0.0],
            [0.0, 1.0 / half_height, 0.0, 0.0],
            # pybullet computes the planes from this row by the formula for perspective, and ignores the last row.
            [0.0, 0.0, -(far + near) / (far - near), -2.0 * far * near / (far - near)],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )


def _perspective(tan_x: float, tan_y: float, near: float, far: float) -> Floats:
    return np.array(
        [
            [1.0 / tan_x, 0.0, 0.0, 0.0],
            [0.0, 1.0 / tan_y, 0.0, 0.0],
            [0.0, 0.0, -(far + near) / (far - near), -2.0 * far * near / (far - near)],
            [0.0, 0.0, -1.0, 0.0],
        ]
    )


def _view(eye: Floats, right: Floats, up: Floats, forward: Floats) -> Floats:
    view = np.eye(4)
    view[:3, :3] = np.stack([right, up, -forward])
    view[:3, 3] = -view[:3, :3] @ eye
    return view


def downwards(low: Sequence[float], high: Sequence[float], size: tuple[int, int], shear: Sequence[float]) -> Camera:
    """Straight down on the rectangle from (x, y) `low` to `high`, x to the right and y up.

    `shear` shifts points at height z by z * shear, as slanting light shifts shadows. Visible heights are from minus one
    to plus three times the rectangle's longer side.
    """
    width, height = high[0] - low[0], high[1] - low[1]
    longer = max(width, height)
    eye = np.array([(low[0] + high[0]) / 2.0, (low[1] + high[1]) / 2.0, 4.0 * longer])
    view = _view(eye, np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, -1.0]))
    slide = np.eye(4)
    slide[:2, 2] = shear
    return Camera(view @ slide, _orthographic(width / 2.0, height / 2.0, longer, 5.0 * longer), size)


def frame(view: str, points: Floats, size: tuple[int, int]) -> Camera:
    """The camera of a view that shows all of (P, 3) `points` as large as the picture allows."""
    aspect = size[0] / size[1]
    low, high = points.min(axis=0), points.max(axis=0)
    if view == "top":
        centre = (low[:2] + high[:2]) / 2.0
        half = max((high[1] - low[1]) / 2.0, (high[0] - low[0]) / 2.0 / aspect) / FRAME_SHARE
        reach = np.array([half * aspect, half])
        return downwards(list(centre - reach), list(centre + reach), size, (0.0, 0.0))
    return at_angles(points, size, *VIEW_ANGLES[view], math.degrees(PERSPECTIVE_FIELD))


def at_angles(
    points: Floats,
    size: tuple[int, int],
    azimuth: float,
    elevation: float,
    field: float,
    distance: float = 1.0,
    roll: float = 0.0,
) -> Camera:
    """The camera in perspective at these angles, in degrees, that shows all of (P, 3) `points` as large as the picture
    allows, or from `distance` times as far away from their middle (1 or more); then it is turned about its axis by
    `roll`."""
    aspect = size[0] / size[1]
    turn, slope = math.radians(azimuth), math.radians(elevation)
    right = np.array([math.cos(turn), math.sin(turn), 0.0])
    level = np.array([-math.sin(turn), math.cos(turn), 0.0])
    forward = math.cos(slope) * level - np.array([0.0, 0.0, math.sin(slope)])
    up = np.cross(right, forward)
    tan_y = math.tan(math.radians(field) / 2.0)
    tan_x = tan_y * aspect
    ahead = points @ forward

    def fit(axis: Floats, tangent: float) -> tuple[float, float]:
        # All points between the view's two planes of this axis: this gives the eye's distance and its place on the
        # axis.
        along = points @ axis
        above, below = float((along - tangent * ahead).max()), float((-along - tangent * ahead).max())
        return -(above + below) / (2.0 * tangent), (above - below) / 2.0

    back_x, at_x = fit(right, tan_x * FRAME_SHARE)
    back_y, at_y = fit(up, tan_y * FRAME_SHARE)
    back = min(back_x, back_y)
    back -= (distance - 1.0) * (float(ahead.min() + ahead.max()) / 2.0 - back)
    eye = at_x * right + at_y * up + back * forward
    near, far = float(ahead.min()) - back, float(ahead.max()) - back
    view = _view(eye, *_roll(right, up, roll), forward)
    return Camera(view, _perspective(tan_x, tan_y, 0.5 * near, 1.5 * far), size)


def from_place(
    points: Floats, size: tuple[int, int], eye: Floats, target: Floats, field: float, roll: float = 0.0
) -> Camera:
    """The camera in perspective at `eye` (3,) that looks at `target` (3,), another point; angles in degrees. Whatever
    of (P, 3) `points` is ahead of it is between its two planes."""
    forward = (target - eye) / np.linalg.norm(target - eye)
    level = math.hypot(forward[0], forward[1])
    # Straight down, as from the viewer's side.
    right = np.array([forward[1], -forward[0], 0.0]) / level if level > 1e-9 else np.array([1.0, 0.0, 0.0])
    up = np.cross(right, forward)
    tan_y = math.tan(math.radians(field) / 2.0)
    ahead = (points - eye) @ forward
    far = max(float(ahead.max()), 0.1)
    near = min(max(0.5 * float(ahead.min()), NEAR_PLANE_SHARE * far), 0.5 * far)
    view = _view(eye, *_roll(right, up, roll), forward)
    return Camera(view, _perspective(tan_y * size[0] / size[1], tan_y, near, 1.5 * far), size)


def _roll(right: Floats, up: Floats, roll: float) -> tuple[Floats, Floats]:
    if not roll:
        return right, up
    cos, sin = math.cos(math.radians(roll)), math.sin(math.radians(roll))
    return cos * right - sin * up, cos * up + sin * right
