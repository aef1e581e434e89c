"""Things with room inside: vessels of revolution and crates, as convex pieces and as the rooms that they leave."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from scenegen.assets.mesh import Mesh, box, loft
from scenegen.primitives import Box, Circle

Rooms = tuple[tuple[Circle | Box, float], ...]

SIDES = 16  # of a vessel's wall
STEP = 0.004  # metres between the heights at which a sloping wall is looked at


@dataclass(frozen=True, slots=True)
class Vessel:
    """A surface of revolution with an inside: rows (z, outer radius, inner radius) from the bottom up, in metres; the
    inner radius is 0 as long as it is solid."""

    rows: tuple[tuple[float, float, float], ...]

    def pieces(self) -> tuple[Mesh, ...]:
        """Convex closed meshes: the solid bottom, and the wall cut into `SIDES` sectors."""
        out = []
        for (z0, outer0, inner0), (z1, outer1, inner1) in pairwise(self.rows):
            if z1 == z0:
                continue
            if inner0 == inner1 == 0.0:
                out.append(loft([_ring(outer0, z0), _ring(outer1, z1)]))
                continue
            for k in range(SIDES):
                a, b = (math.tau * turn / SIDES for turn in (k, k + 1))
                out.append(loft([_sector(inner0, outer0, a, b, z0), _sector(inner1, outer1, a, b, z1)]))
        return tuple(out)

    def rooms(self) -> Rooms:
        """What fits inside, and how high it then stands: the deepest first. A wall of flat pieces takes a little."""
        found: dict[float, float] = {}
        for (z0, _, inner0), (z1, _, inner1) in pairwise(self.rows):
            if inner0 == 0.0 and inner1 > 0.0:
                found.setdefault(z1, inner1)
                continue
            if inner1 > inner0:
                for share in np.linspace(0.0, 1.0, 1 + math.ceil((z1 - z0) / STEP)):
                    found.setdefault(z0 + float(share) * (z1 - z0), inner0 + float(share) * (inner1 - inner0))
        flat = math.cos(math.pi / SIDES)
        return tuple((Circle(radius * flat), z) for z, radius in sorted(found.items()))


@dataclass(frozen=True, slots=True)
class Crate:
    """A box without a lid: sizes of its outside, and how thick its walls and its floor are, in metres."""

    length: float
    width: float
    height: float
    wall: float
    floor: float

    def pieces(self) -> tuple[Mesh, ...]:
        """The floor and the four walls, as boxes."""
        long, wide, tall = self.length, self.width, self.height - self.floor
        side, end = box(long, self.wall, tall), box(self.wall, wide - 2.0 * self.wall, tall)
        y, x = (wide - self.wall) / 2.0, (long - self.wall) / 2.0
        walls = [side.moved(y=s * y, z=self.floor) for s in (-1.0, 1.0)]
        walls += [end.moved(x=s * x, z=self.floor) for s in (-1.0, 1.0)]
        return box(long, wide, self.floor), *walls

    def rooms(self) -> Rooms:
        return ((Box(self.length - 2.0 * self.wall, self.width - 2.0 * self.wall), self.floor),)


Hollow = Vessel | Crate


def _ring(radius: float, z: float) -> list[list[float]]:
    turns = [math.tau * k / SIDES for k in range(SIDES)]
    return [[radius * math.cos(turn), radius * math.sin(turn), z] for turn in turns]


def _sector(inner: float, outer: float, a: float, b: float, z: float) -> list[list[float]]:
    return [[r * math.cos(turn), r * math.sin(turn), z] for r, turn in ((inner, a), (outer, a), (outer, b), (inner, b))]
