"""Footprints: what objects and regions cover of the table, convex, in the frame of their own pose (x, y, heading)."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Circle:
    """A round footprint; `radius` in metres, 0 for a point. A handle counts: the circle is the one that it sweeps."""

    radius: float

    @property
    def extent(self) -> tuple[float, float]:
        """Size along and across the heading, in metres."""
        return 2.0 * self.radius, 2.0 * self.radius


@dataclass(frozen=True, slots=True)
class Box:
    """A rectangular footprint: `length` along the heading, `width` across it, in metres."""

    length: float
    width: float

    @property
    def extent(self) -> tuple[float, float]:
        """Size along and across the heading, in metres."""
        return self.length, self.width


@dataclass(frozen=True, slots=True)
class Polygon:
    """A convex polygon: corners (x, y) in metres, counter-clockwise, x along the heading."""

    vertices: tuple[tuple[float, float], ...]

    @property
    def extent(self) -> tuple[float, float]:
        """Size along and across the heading, in metres."""
        x, y = zip(*self.vertices, strict=True)
        return max(x) - min(x), max(y) - min(y)


Footprint = Circle | Box | Polygon

POINT = Circle(0.0)
