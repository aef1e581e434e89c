"""A chest of drawers, each open by a share of its length; and one drawer alone.

Sizes in metres. The carcass is one solid piece: what is in it can neither be seen nor reached. A drawer's surface is
the part of its floor that is out, clear of all that juts out above it: whatever stands there has free height above it.
"""

from __future__ import annotations

from dataclasses import dataclass

from scenegen.things.parts import DrawerPull, Slab, SupportSurface

WIDTH = 0.440
BODY = 0.320  # from the back to the fronts of closed drawers
FRONT = 0.018  # how thick a drawer's front is; the top reaches as far
GRIP = 0.022  # how far handles stand out
PLINTH, PITCH, TOP = 0.030, 0.100, 0.020  # heights: below the drawers, of each, of the board above them
FULL = 0.300  # how far a drawer comes out at most
WALL, FLOOR = 0.012, 0.008  # how thick a drawer's sides and its floor are
SUNK, SIDE, SEAM = 0.010, 0.062, 0.003  # a drawer's underside and height; the gap round its front
LEDGE = 0.0001  # of a drawer's outline that nothing can stand on
HANDLE, BAR = (0.050, 0.062), 0.130  # heights of a handle above the seam, and how long it is
DRAWERS = 3  # where a spec does not say how many
MOST = 6
CLOSED = (0.0,) * DRAWERS


@dataclass(frozen=True, slots=True)
class Cabinet:
    """`open` has the share of each drawer, the lowest first."""

    open: tuple[float, ...] = CLOSED

    @property
    def length(self) -> float:
        """From the back to the handle that is farthest out."""
        return BODY + FRONT + GRIP + max(self.open) * FULL

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
        return tuple(self.back + BODY + share * FULL for share in self.open)

    def slabs(self) -> tuple[Slab, ...]:
        """The carcass; of each drawer the handle, and of one that is open its floor, its sides and its front."""
        face, y = self.back + BODY + FRONT, WIDTH / 2.0
        found = [Slab((self.back, -y, face, y), 0.0, self.height)]
        for number, front in enumerate(self.fronts()):
            low = PLINTH + number * PITCH
            grip = front + FRONT
            found.append(Slab((grip, -BAR / 2.0, grip + GRIP, BAR / 2.0), low + HANDLE[0], low + HANDLE[1]))
            if grip > face:
                found.append(Slab((max(front, face), SEAM - y, grip, y - SEAM), low + SEAM, low + PITCH - SEAM))
            if front > face:
                found += _box(face, front, low + SUNK)
        return tuple(found)

    def surfaces(self) -> tuple[SupportSurface, ...]:
        """The top, and the drawers from the lowest up."""
        face, y = self.back + BODY + FRONT, WIDTH / 2.0
        found = [SupportSurface("top", Slab((self.back, -y, face, y), 0.0, 0.0).footprint, self.height)]
        fronts = self.fronts()
        for number, front in enumerate(fronts):
            above = fronts[number + 1 :]
            start = max(face, *(one + FRONT + GRIP for one in above)) if above else face
            inner = (min(start, front - LEDGE), -_inner(), front, _inner())
            height = PLINTH + number * PITCH + SUNK + FLOOR
            pull = DrawerPull(self.open[number], front - start, FULL, 2.0 * _inner())
            outline = Slab(inner, 0.0, 0.0).footprint
            found.append(SupportSurface(f"drawer[{number + 1}]", outline, height, walled=True, pull=pull))
        return tuple(found)


@dataclass(frozen=True, slots=True)
class Drawer:
    """A drawer alone: floor, back, sides, front and handle."""

    length: float = WALL + FULL - FRONT + FRONT + GRIP
    width: float = WIDTH - 2.0 * SEAM
    height: float = PITCH - 2.0 * SEAM
    rim: float = PITCH - 2.0 * SEAM

    def slabs(self) -> tuple[Slab, ...]:
        back, front = -self.length / 2.0, self.length / 2.0 - GRIP - FRONT
        y = self.width / 2.0
        side = _inner() + WALL
        return (
            *_box(back, front, 0.0),
            Slab((back, WALL - side, back + WALL, side - WALL), FLOOR, SIDE),
            Slab((front, -y, front + FRONT, y), 0.0, self.height),
            Slab((front + FRONT, -BAR / 2.0, front + FRONT + GRIP, BAR / 2.0), *HANDLE),
        )

    def surfaces(self) -> tuple[SupportSurface, ...]:
        inner = (WALL - self.length / 2.0, -_inner(), self.length / 2.0 - GRIP - FRONT, _inner())
        return (SupportSurface("inside", Slab(inner, 0.0, 0.0).footprint, FLOOR, walled=True),)


def _inner() -> float:
    """Half of a drawer's width inside."""
    return WIDTH / 2.0 - 0.018 - WALL


def _box(start: float, stop: float, low: float) -> tuple[Slab, ...]:
    """The floor and the sides of a drawer between two x, from the height `low` up."""
    y = _inner()
    sides = [Slab((start, at, stop, at + WALL), low + FLOOR, low + SIDE) for at in (-y - WALL, y)]
    return Slab((start, -y - WALL, stop, y + WALL), low, low + FLOOR), *sides


# --------------------------------------------------------------------------------------------------------------------
# A rack for bottles and glasses: six cells between low boards, and a bar to carry it by. Metres.


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
