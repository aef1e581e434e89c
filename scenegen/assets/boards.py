"""What furniture is made of: upright pieces, and surfaces. In the object's frame, with its front along +x; metres."""

from __future__ import annotations

import math
from dataclasses import dataclass

from scenegen.primitives import Footprint, Polygon


@dataclass(frozen=True, slots=True)
class Pull:
    """How far a drawer is open: the share of its length `full`, and how much of that can be reached from above; what
    juts out above it hides the rest. `reach` is negative where more is hidden than is open."""

    share: float
    reach: float
    full: float
    width: float

    def least(self, need: float) -> float:
        """The share from which on `need` metres can be reached, whatever else stays as it is; may be above 1."""
        return self.share + (need - self.reach) / self.full


@dataclass(frozen=True, slots=True)
class Surface:
    """A flat part that other things can stand on.

    `height` is above the object's lowest point and `clear` the free height above the surface. On a `walled` surface
    things stand with all of their footprint, elsewhere with their centre: they may reach over the edge. `pull` says of
    a cabinet's drawer how far it is open, and `far` how far from the origin a thing's centre can be, where the surface
    was made for this thing (`nesting.py`).
    """

    name: str
    outline: Footprint
    height: float
    clear: float = math.inf
    walled: bool = False
    pull: Pull | None = None
    far: float | None = None


@dataclass(frozen=True, slots=True)
class Slab:
    """An upright piece: a rectangle of the object's frame, (x lowest, y lowest, x highest, y highest), and the heights
    of its bottom and its top."""

    box: tuple[float, float, float, float]
    low: float
    high: float

    @property
    def footprint(self) -> Polygon:
        x0, y0, x1, y1 = self.box
        return Polygon(((x0, y0), (x1, y0), (x1, y1), (x0, y1)))


@dataclass(frozen=True, slots=True)
class Unit:
    """Boards between two sides and a back, open in front; sizes in metres. `levels` are the tops of the boards, of
    which the last is the lid."""

    depth: float
    width: float
    levels: tuple[float, ...]
    side: float = 0.018
    back: float = 0.008
    board: float = 0.018

    def slabs(self) -> tuple[Slab, ...]:
        x, y, top = self.depth / 2.0, self.width / 2.0, self.levels[-1]
        sides = [Slab((-x, low, x, low + self.side), 0.0, top) for low in (-y, y - self.side)]
        inner = (-x, self.side - y, x, y - self.side)
        back = Slab((-x, self.side - y, self.back - x, y - self.side), 0.0, top)
        return (*sides, back, *(Slab(inner, level - self.board, level) for level in self.levels))


UNITS = {"shelfunit": Unit(0.260, 0.640, (0.018, 0.240, 0.450, 0.640))}
