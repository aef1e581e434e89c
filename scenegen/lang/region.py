"""A named part of the table."""

from __future__ import annotations

from dataclasses import dataclass

from scenegen.geometry.footprint import Footprint

Pose = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Region:
    """A named part of the table: its footprint at a fixed place, (x, y, heading). With a `height` above the table it is
    the top of a board."""

    name: str
    footprint: Footprint
    pose: Pose
    height: float = 0.0
