"""What holds and carries other things, in numbers: vessels, crates, shelf units, cabinets, drawers and racks.

In the object's own frame: metres, z = 0 its lowest point, heading along +x, which is where furniture has its front.
Nothing here makes a mesh, so specs are checked without: `bodies` has the pieces that collide, `storage` those drawn.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from scenegen.geometry.footprint import Box, Circle, Footprint, Polygon


@dataclass(frozen=True, slots=True)
class DrawerPull:
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
class SupportSurface:
    """A flat part that other things can stand on.

    `height` is above the object's lowest point and `clear` the free height above the surface. On a `walled` surface
    things stand with all of their footprint, elsewhere with their centre: they may reach over the edge. `pull` says of
    a cabinet's drawer how far it is open, and `far` how far from the origin a thing's centre can be, where the surface
    was made for this thing (`surfaces.py`).
    """

    name: str
    outline: Footprint
    height: float
    clear: float = math.inf
    walled: bool = False
    pull: DrawerPull | None = None
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
class ShelfUnit:
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


Rooms = tuple[tuple[Circle | Box, float], ...]

WALL_SIDES = 16  # of a vessel's wall
WALL_STEP = 0.004  # metres between the heights at which a sloping wall is looked at


@dataclass(frozen=True, slots=True)
class Vessel:
    """A surface of revolution with an inside: rows (z, outer radius, inner radius) from the bottom up, in metres; the
    inner radius is 0 as long as it is solid. `handle`: from x, to x; lowest z, highest z."""

    rows: tuple[tuple[float, float, float], ...]
    handle: tuple[float, float, float, float] | None = None

    def rooms(self) -> Rooms:
        """What fits inside, and how high it then stands: the deepest first. A wall of flat pieces takes a little."""
        found: dict[float, float] = {}
        for (z0, _, inner0), (z1, _, inner1) in pairwise(self.rows):
            if inner0 == 0.0 and inner1 > 0.0:
                found.setdefault(z1, inner1)
                continue
            if inner1 > inner0:
                for share in np.linspace(0.0, 1.0, 1 + math.ceil((z1 - z0) / WALL_STEP)):
                    found.setdefault(z0 + float(share) * (z1 - z0), inner0 + float(share) * (inner1 - inner0))
        flat = math.cos(math.pi / WALL_SIDES)
        return tuple((Circle(radius * flat), z) for z, radius in sorted(found.items()))


@dataclass(frozen=True, slots=True)
class Crate:
    """A box without a lid: sizes of its outside, and how thick its walls and its floor are, in metres."""

    length: float
    width: float
    height: float
    wall: float
    floor: float

    def rooms(self) -> Rooms:
        return ((Box(self.length - 2.0 * self.wall, self.width - 2.0 * self.wall), self.floor),)


Rows = tuple[tuple[float, float], ...]


@dataclass(frozen=True, slots=True)
class RoundSolid:
    """A solid of revolution: rows (z, radius) from the bottom up, in metres; a height that occurs twice is a step."""

    rows: Rows


# A chest of drawers, each open by a share of its length; and one drawer alone.
# The carcass is one solid piece: what is in it can neither be seen nor reached. A drawer's surface is the part of its
# floor that is out, clear of all that juts out above it: whatever stands there has free height above it.
CABINET_WIDTH = 0.440
CABINET_DEPTH = 0.320  # from the back to the fronts of closed drawers
DRAWER_FRONT = 0.018  # how thick a drawer's front is; the top reaches as far
HANDLE_DEPTH = 0.022  # how far handles stand out
PLINTH, PITCH, TOP = 0.030, 0.100, 0.020  # heights: below the drawers, of each, of the board above them
MAX_PULL = 0.300  # how far a drawer comes out at most
WALL, FLOOR = 0.012, 0.008  # how thick a drawer's sides and its floor are
SUNK, SIDE, SEAM = 0.010, 0.062, 0.003  # a drawer's underside and height; the gap round its front
LEDGE = 0.0001  # of a drawer's outline that nothing can stand on
HANDLE, BAR = (0.050, 0.062), 0.130  # heights of a handle above the seam, and how long it is
DRAWERS = 3  # where a spec does not say how many
MAX_DRAWERS = 6
CLOSED = (0.0,) * DRAWERS


@dataclass(frozen=True, slots=True)
class Cabinet:
    """`open` has the share of each drawer, the lowest first."""

    open: tuple[float, ...] = CLOSED

    @property
    def length(self) -> float:
        """From the back to the handle that is farthest out."""
        return CABINET_DEPTH + DRAWER_FRONT + HANDLE_DEPTH + max(self.open) * MAX_PULL

    @property
    def height(self) -> float:
        return PLINTH + PITCH * len(self.open) + TOP

    @property
    def rim(self) -> float:
        """The upper edge of the highest drawer that is open; of a closed cabinet, its top."""
        out = [number for number, share in enumerate(self.open, 1) if share > 0.0]
        return PLINTH + PITCH * max(out) - SEAM if out else self.height

    @property
    def back(self) -> float:
        """x of the back; the frame's origin is the middle of all that covers the table."""
        return -self.length / 2.0

    def fronts(self) -> tuple[float, ...]:
        """x of the inner side of each drawer's front."""
        return tuple(self.back + CABINET_DEPTH + share * MAX_PULL for share in self.open)

    def slabs(self) -> tuple[Slab, ...]:
        """The carcass; of each drawer the handle, and of one that is open its floor, its sides and its front."""
        face, y = self.back + CABINET_DEPTH + DRAWER_FRONT, CABINET_WIDTH / 2.0
        found = [Slab((self.back, -y, face, y), 0.0, self.height)]
        for number, front in enumerate(self.fronts()):
            low = PLINTH + number * PITCH
            grip = front + DRAWER_FRONT
            found.append(Slab((grip, -BAR / 2.0, grip + HANDLE_DEPTH, BAR / 2.0), low + HANDLE[0], low + HANDLE[1]))
            if grip > face:
                found.append(Slab((max(front, face), SEAM - y, grip, y - SEAM), low + SEAM, low + PITCH - SEAM))
            if front > face:
                found += _box(face, front, low + SUNK)
        return tuple(found)

    def surfaces(self) -> tuple[SupportSurface, ...]:
        """The top, and the drawers from the lowest up."""
        face, y = self.back + CABINET_DEPTH + DRAWER_FRONT, CABINET_WIDTH / 2.0
        found = [SupportSurface("top", Slab((self.back, -y, face, y), 0.0, 0.0).footprint, self.height)]
        fronts = self.fronts()
        for number, front in enumerate(fronts):
            above = fronts[number + 1 :]
            start = max(face, *(one + DRAWER_FRONT + HANDLE_DEPTH for one in above)) if above else face
            inner = (min(start, front - LEDGE), -_inner(), front, _inner())
            height = PLINTH + number * PITCH + SUNK + FLOOR
            pull = DrawerPull(self.open[number], front - start, MAX_PULL, 2.0 * _inner())
            outline = Slab(inner, 0.0, 0.0).footprint
            found.append(SupportSurface(f"drawer[{number + 1}]", outline, height, walled=True, pull=pull))
        return tuple(found)


@dataclass(frozen=True, slots=True)
class Drawer:
    """A drawer alone: floor, back, sides, front and handle."""

    length: float = WALL + MAX_PULL - DRAWER_FRONT + DRAWER_FRONT + HANDLE_DEPTH
    width: float = CABINET_WIDTH - 2.0 * SEAM
    height: float = PITCH - 2.0 * SEAM
    rim: float = PITCH - 2.0 * SEAM

    def slabs(self) -> tuple[Slab, ...]:
        back, front = -self.length / 2.0, self.length / 2.0 - HANDLE_DEPTH - DRAWER_FRONT
        y = self.width / 2.0
        side = _inner() + WALL
        return (
            *_box(back, front, 0.0),
            Slab((back, WALL - side, back + WALL, side - WALL), FLOOR, SIDE),
            Slab((front, -y, front + DRAWER_FRONT, y), 0.0, self.height),
            Slab((front + DRAWER_FRONT, -BAR / 2.0, front + DRAWER_FRONT + HANDLE_DEPTH, BAR / 2.0), *HANDLE),
        )

    def surfaces(self) -> tuple[SupportSurface, ...]:
        inner = (WALL - self.length / 2.0, -_inner(), self.length / 2.0 - HANDLE_DEPTH - DRAWER_FRONT, _inner())
        return (SupportSurface("inside", Slab(inner, 0.0, 0.0).footprint, FLOOR, walled=True),)


def _inner() -> float:
    """Half of a drawer's width inside."""
    return CABINET_WIDTH / 2.0 - 0.018 - WALL


def _box(start: float, stop: float, low: float) -> tuple[Slab, ...]:
    """The floor and the sides of a drawer between two x, from the height `low` up."""
    y = _inner()
    sides = [Slab((start, at, stop, at + WALL), low + FLOOR, low + SIDE) for at in (-y - WALL, y)]
    return Slab((start, -y - WALL, stop, y + WALL), low, low + FLOOR), *sides


CELL = 0.094  # the side of a cell
ROWS, COLUMNS = 2, 3
BOARD, BASE = 0.012, 0.010
SPINE, RIB = 0.022, 0.008  # how thick the dividers between the rows, and those in a row, are
RIM, LOW = 0.100, 0.080  # heights of the boards outside, and of the dividers
POST, THICK = 0.056, 0.022  # how wide the end boards are further up, and how thick the bar is


@dataclass(frozen=True, slots=True)
class Rack:
    """The cells `slot[1]` to `slot[3]` are the row in front, from left to right, `slot[4]` to `slot[6]` the other."""

    length: float = ROWS * CELL + SPINE + 2.0 * BOARD
    width: float = COLUMNS * CELL + (COLUMNS - 1) * RIB + 2.0 * BOARD
    height: float = 0.290
    rim: float = RIM

    def slabs(self) -> tuple[Slab, ...]:
        x, y = self.length / 2.0, self.width / 2.0
        found = [Slab((-x, -y, x, y), 0.0, BASE)]
        for side in (-x, x - BOARD):
            found.append(Slab((side, -y, side + BOARD, y), BASE, RIM))
        for end in (-y, y - BOARD):
            found.append(Slab((BOARD - x, end, x - BOARD, end + BOARD), BASE, RIM))
            found.append(Slab((-POST / 2.0, end, POST / 2.0, end + BOARD), RIM, self.height))
        found.append(Slab((-SPINE / 2.0, BOARD - y, SPINE / 2.0, y - BOARD), BASE, LOW))
        found.append(
            Slab((-THICK / 2.0, BOARD - y, THICK / 2.0, y - BOARD), self.height - THICK - 0.006, self.height - 0.006)
        )
        for start, stop in ((BOARD - x, -SPINE / 2.0), (SPINE / 2.0, x - BOARD)):
            for column in range(1, COLUMNS):
                rib = BOARD - y + column * CELL + (column - 1) * RIB
                found.append(Slab((start, rib, stop, rib + RIB), BASE, LOW))
        return tuple(found)

    def surfaces(self) -> tuple[SupportSurface, ...]:
        found: list[SupportSurface] = []
        for start in (SPINE / 2.0, -SPINE / 2.0 - CELL):  # the row in front first
            for column in range(COLUMNS):
                left = BOARD - self.width / 2.0 + column * (CELL + RIB)
                cell = Slab((start, left, start + CELL, left + CELL), 0.0, 0.0).footprint
                found.append(SupportSurface(f"slot[{len(found) + 1}]", cell, BASE, walled=True))
        return tuple(found)


Form = Vessel | Crate | RoundSolid | ShelfUnit | Cabinet | Drawer | Rack
