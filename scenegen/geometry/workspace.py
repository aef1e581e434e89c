"""The part of the table on which objects are placed, and poses there: headings, and attitudes of what may be tilted."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scenegen.pose import AXES, EVERY, NAMES, THETA, TWO_PI, X, Y, object_count, row_of, rows_along, wrap_heading


@dataclass(frozen=True, slots=True)
class Workspace:
    """A rectangle in metres; x to the right, y away from the viewer. Poses are (x, y, theta), theta in [0, 2 pi).

    `own` has the objects whose centres have another rectangle, because they stand on something: (index, x, y).
    """

    x: tuple[float, float] = (0.0, 1.0)
    y: tuple[float, float] = (0.0, 1.0)
    own: tuple[tuple[int, tuple[float, float], tuple[float, float]], ...] = ()

    @property
    def width(self) -> float:
        return self.x[1] - self.x[0]

    @property
    def height(self) -> float:
        return self.y[1] - self.y[0]

    @property
    def ranges(self) -> tuple[tuple[float, float], ...]:
        """Lowest and highest value of a coordinate along each axis of a pose; theta ends at 2 pi."""
        of = {"x": self.x, "y": self.y, "theta": (0.0, TWO_PI)}
        return tuple(of[name] for name in NAMES)

    @property
    def scales(self) -> tuple[float, ...]:
        """A large step along each axis of a pose: across the workspace, or a radian."""
        return tuple(1.0 if AXES[axis].is_angle else high - low for axis, (low, high) in enumerate(self.ranges))

    def box(self, objects: int) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        """Lowest and highest value of every row of (3N, B) storage, each of shape (3N,); theta ends at 2 pi."""
        lowest, highest = np.array(self.ranges).T
        low, high = np.tile(lowest, objects), np.tile(highest, objects)
        for which, x, y in self.own:
            (low[row_of(which, X)], high[row_of(which, X)]), (low[row_of(which, Y)], high[row_of(which, Y)]) = x, y
        return low, high

    def log_excess(self, lowest: npt.NDArray[np.float64], highest: npt.NDArray[np.float64], things: int) -> float:
        """How much more room the first `things` objects have than the workspace, as the natural logarithm of a share of
        volumes: what stands on something has a rectangle of its own. Rows whose ends, (3N,) each, are equal are held
        and do not count."""
        total = 0.0
        for which, *_ in (one for one in self.own if one[0] < things):
            for axis, whole in ((X, self.width), (Y, self.height)):
                low, high = lowest[row_of(which, axis)], highest[row_of(which, axis)]
                total += math.log((high - low) / whole) if low < high else 0.0
        return total

    def ends(self, axis: int, objects: int) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        """Lowest and highest value along an axis for each object, each of shape (N,)."""
        low, high = self.box(objects)
        return low[rows_along(axis)], high[rows_along(axis)]

    def contains(self, rows: npt.NDArray[np.float64]) -> npt.NDArray[np.bool_]:
        """Which of B scenes, stored as (3N, B), have every centre in its rectangle and every theta in [0, 2 pi)."""
        inside = np.ones(rows.shape[1:], dtype=bool)
        for axis in EVERY:
            low, high = (ends[:, None] for ends in self.ends(axis, object_count(len(rows))))
            value = rows[rows_along(axis)]
            below = value < high if AXES[axis].is_angle else value <= high
            inside &= ((value >= low) & below).all(axis=0)
        return inside


def wrap_headings(rows: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """(3N, B) storage with every theta in [0, 2 pi), the same array where that is so already."""
    theta = rows[rows_along(THETA)]
    outside = (theta < 0.0) | (theta >= TWO_PI)
    if not outside.any():
        return rows
    rows = rows.copy()
    rows[rows_along(THETA)] = np.where(outside, wrap_heading(np, theta), theta)
    return rows


LARGEST, SMALLEST = 1e3, 1e-6  # metres: sizes of objects and regions
MAX_COORDINATE = 1e6  # metres from the origin; rounding is then still far below a micrometre
BOARD = 0.01  # metres: how thick a region at a height is, where the table leaves room for that
MAX_WORKSPACE_WIDTH = 2.0 * MAX_COORDINATE  # metres: what has its corners no further out


Floats = npt.NDArray[np.float64]


def standing(places: Floats) -> Floats:
    """(..., 7): place and quaternion of objects that stand upright at (..., 4): x, y, theta, z."""
    poses = np.zeros((*places.shape[:-1], 7))
    poses[..., :3] = places[..., [0, 1, 3]]
    poses[..., 3], poses[..., 6] = np.cos(places[..., 2] / 2.0), np.sin(places[..., 2] / 2.0)
    return poses


def turn_between(one: Floats, other: Floats) -> Floats:
    """(...,): the angle of the one rotation that leads from attitudes (..., 4) to others, in degrees, 0 to 180."""
    aw, av, bw, bv = one[..., :1], one[..., 1:], other[..., :1], other[..., 1:]
    # From sine and cosine of half the angle: the arc cosine alone would lose small angles.
    cos = np.abs((one * other).sum(axis=-1))
    sin = np.linalg.norm(aw * bv - bw * av - np.cross(av, bv), axis=-1)
    return np.asarray(np.degrees(2.0 * np.arctan2(sin, cos)))


def upright(poses: Floats) -> Floats:
    """(..., 3): x, y and theta of poses (..., 7); theta is the heading of the upright attitude that is nearest.

    It is the turn about the vertical that remains when the tilt, a turn about a horizontal axis, is taken away. For
    what lies on its head there is none, and theta is 0.
    """
    theta = 2.0 * np.arctan2(poses[..., 6], poses[..., 3])
    return np.concatenate([poses[..., :2], np.remainder(theta, 2.0 * np.pi)[..., None]], axis=-1)
