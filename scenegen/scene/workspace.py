"""The part of the table on which objects are placed."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

TWO_PI = 2.0 * math.pi
AXES = ("x", "y", "theta")  # the three rows of an object in (3N, B) storage


@dataclass(frozen=True, slots=True)
class Workspace:
    """A rectangle in metres; x to the right, y away from the viewer. Poses are (x, y, theta), theta in [0, 2 pi)."""

    x: tuple[float, float] = (0.0, 1.0)
    y: tuple[float, float] = (0.0, 1.0)

    @property
    def width(self) -> float:
        return self.x[1] - self.x[0]

    @property
    def height(self) -> float:
        return self.y[1] - self.y[0]

    def box(self, objects: int) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        """Lowest and highest value of every row of (3N, B) storage, each of shape (3N,); theta ends at 2 pi."""
        lowest = np.tile(np.array([self.x[0], self.y[0], 0.0]), objects)
        highest = np.tile(np.array([self.x[1], self.y[1], TWO_PI]), objects)
        return lowest, highest

    def contains(self, rows: npt.NDArray[np.float64]) -> npt.NDArray[np.bool_]:
        """Which of B scenes, stored as (3N, B), have every centre in the workspace and every theta in [0, 2 pi)."""
        x, y, theta = rows[0::3], rows[1::3], rows[2::3]
        inside = (x >= self.x[0]) & (x <= self.x[1]) & (y >= self.y[0]) & (y <= self.y[1])
        return np.asarray((inside & (theta >= 0.0) & (theta < TWO_PI)).all(axis=0))


def turned(rows: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """(3N, B) storage with every theta in [0, 2 pi), the same array where that is so already."""
    theta = rows[2::3]
    outside = (theta < 0.0) | (theta >= TWO_PI)
    if not outside.any():
        return rows
    rest = np.mod(theta, TWO_PI)
    rows = rows.copy()
    rows[2::3] = np.where(outside, np.where(rest < TWO_PI, rest, 0.0), theta)  # that of -1e-17 is rounded up
    return rows
