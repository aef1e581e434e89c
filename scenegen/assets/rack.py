"""A rack for bottles and glasses: six cells between low boards, and a bar to carry it by. Metres."""

from __future__ import annotations

from dataclasses import dataclass

from scenegen.assets.boards import Slab, Surface

CELL = 0.094  # the side of a cell
ROWS, COLUMNS = 2, 3
WALL, FLOOR = 0.012, 0.010
SPINE, RIB = 0.022, 0.008  # how thick the dividers between the rows, and those in a row, are
RIM, LOW = 0.100, 0.080  # heights of the boards outside, and of the dividers
POST, BAR = 0.056, 0.022  # how wide the end boards are further up, and how thick the bar is


@dataclass(frozen=True, slots=True)
class Rack:
    """The cells `slot[1]` to `slot[3]` are the row in front, from left to right, `slot[4]` to `slot[6]` the other."""

    length: float = ROWS * CELL + SPINE + 2.0 * WALL
    width: float = COLUMNS * CELL + (COLUMNS - 1) * RIB + 2.0 * WALL
    height: float = 0.290
    rim: float = RIM

    def slabs(self) -> tuple[Slab, ...]:
        x, y = self.length / 2.0, self.width / 2.0
        found = [Slab((-x, -y, x, y), 0.0, FLOOR)]
        for side in (-x, x - WALL):
            found.append(Slab((side, -y, side + WALL, y), FLOOR, RIM))
        for end in (-y, y - WALL):
            found.append(Slab((WALL - x, end, x - WALL, end + WALL), FLOOR, RIM))
            found.append(Slab((-POST / 2.0, end, POST / 2.0, end + WALL), RIM, self.height))
        found.append(Slab((-SPINE / 2.0, WALL - y, SPINE / 2.0, y - WALL), FLOOR, LOW))
        found.append(Slab((-BAR / 2.0, WALL - y, BAR / 2.0, y - WALL), self.height - BAR - 0.006, self.height - 0.006))
        for start, stop in ((WALL - x, -SPINE / 2.0), (SPINE / 2.0, x - WALL)):
            for column in range(1, COLUMNS):
                rib = WALL - y + column * CELL + (column - 1) * RIB
                found.append(Slab((start, rib, stop, rib + RIB), FLOOR, LOW))
        return tuple(found)

    def surfaces(self) -> tuple[Surface, ...]:
        found: list[Surface] = []
        for start in (SPINE / 2.0, -SPINE / 2.0 - CELL):  # the row in front first
            for column in range(COLUMNS):
                left = WALL - self.width / 2.0 + column * (CELL + RIB)
                cell = Slab((start, left, start + CELL, left + CELL), 0.0, 0.0).footprint
                found.append(Surface(f"slot[{len(found) + 1}]", cell, FLOOR, walled=True))
        return tuple(found)
