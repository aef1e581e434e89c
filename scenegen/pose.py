"""The layout of a pose: the numbers that place an object, their order, and where storage keeps them.

N objects have row_count(N) coordinates: those of the first object, then those of the second, and so on. Storage holds
B scenes with one row per coordinate; docstrings call its shape (3N, B). Poses are the same numbers by scene and object,
(B, N, 3). A further coordinate is one more entry of AXES, and every array, box and file column has it; what an axis
means is said where it matters: the workspace's ranges, the language's units. x, y and theta come first: they place a
footprint in the plane, and whatever works in the plane takes them out of longer poses (`flat`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # the language's own processes start without numpy
    import numpy.typing as npt

TWO_PI = 2.0 * math.pi
BELOW_TURN = math.nextafter(TWO_PI, 0.0)  # the largest heading


@dataclass(frozen=True, slots=True)
class Axis:
    """One number of a pose. `symbol` is its name in messages; `period` is that of an angle, in radians, None for a
    length in metres."""

    name: str
    symbol: str
    period: float | None = None

    @property
    def is_angle(self) -> bool:
        return self.period is not None


AXES = (Axis("x", "x"), Axis("y", "y"), Axis("theta", "θ", TWO_PI))
NAMES = tuple(axis.name for axis in AXES)
SIZE = len(AXES)

X, Y, THETA = (NAMES.index(name) for name in ("x", "y", "theta"))
PLACE = (X, Y)  # the axes of a point on the table
FLAT = (X, Y, THETA)  # the axes of a footprint; primitives take these numbers, in this order
EVERY = tuple(range(SIZE))
ANGLES = tuple(index for index, axis in enumerate(AXES) if axis.is_angle)
LENGTHS = tuple(index for index, axis in enumerate(AXES) if not axis.is_angle)


def row_count(objects: int) -> int:
    """How many coordinates so many objects have."""
    return SIZE * objects


def object_count(rows: int) -> int:
    """How many objects so many rows are of; a rest is left out."""
    return rows // SIZE


def row_of(thing: int, axis: int) -> int:
    """The row of one coordinate of the object with this index."""
    return SIZE * thing + axis


def rows_of(thing: int) -> range:
    """The rows of an object, in the order of AXES."""
    return range(SIZE * thing, SIZE * thing + SIZE)


def span_of(thing: int, count: int = SIZE) -> slice:
    """The rows of an object, as a slice of storage; of its first axes, where a pose says no more: (x, y) or FLAT."""
    return slice(SIZE * thing, SIZE * thing + count)


def rows_along(axis: int) -> slice:
    """The rows of all objects along one axis, as a slice of storage."""
    return slice(axis, None, SIZE)


def owner(row: int) -> int:
    """The index of the object that a row belongs to."""
    return row // SIZE


def axis_of(row: int) -> int:
    """The axis of a row: an index of AXES."""
    return row % SIZE


def is_angle(row: int) -> bool:
    """Whether a row holds angles."""
    return row % SIZE in ANGLES


def wrap_heading(namespace: Any, theta: Any) -> Any:
    """Headings in [0, 2 pi), an array of `namespace`, which is numpy or torch; the remainder of -1e-17 is rounded up to
    2 pi, and counts as 0."""
    rest = namespace.remainder(theta, TWO_PI)
    return namespace.where(rest >= TWO_PI, 0.0, rest)


def keep_below_turn(rows: npt.NDArray[Any]) -> None:
    """In (3N, B) storage, headings that rounding brought to 2 pi become the largest below, in place."""
    for axis in ANGLES:
        rows[rows_along(axis)].clip(None, BELOW_TURN, out=rows[rows_along(axis)])


def as_poses(rows: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Storage (3N, B) as poses (B, N, 3), or the rows of one scene (3N,) as (N, 3); a view where numpy can make one."""
    return rows.T.reshape(*rows.shape[1:], len(rows) // SIZE, SIZE)


def as_rows(poses: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Poses (B, N, 3) as storage (3N, B), or those of one scene (N, 3) as (3N,); a view where numpy can make one."""
    return poses.reshape(*poses.shape[:-2], poses.shape[-2] * SIZE).T


def flat(poses: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """x, y and theta of poses (..., SIZE): (..., 3), a view."""
    return poses[..., : len(FLAT)]


def places(poses: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """x and y of poses (..., SIZE): (..., 2), a view."""
    return poses[..., : len(PLACE)]
