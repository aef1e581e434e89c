"""Curves on the terminal: braille dots if the terminal shows them, plain characters in a pipe."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

Point = tuple[float, float]

ROWS = 9  # lines of text of a plot
WIDEST, NARROWEST = 100, 40  # columns
_DOTS = ((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80))  # of a braille character, by row and column (Unicode)
_COLORS = ("\x1b[36m", "\x1b[33m")


def curves(
    lines: Sequence[Sequence[Point]], marks: str, *, ends: Point, floor: float, columns: int, fancy: bool, color: bool
) -> list[str]:
    """A plot of up to two lines of points (x, y): x over `ends`, y from `floor` up to 0, as lines of text no wider than
    `columns`. A plain plot shows each line by its character of `marks`; where they meet, the later one wins."""
    gutter = len(f"{floor / 2.0:g}") + 2
    width = max(NARROWEST, min(columns, WIDEST)) - gutter - 1
    across, down = (2, 4) if fancy else (1, 1)
    grid = [[0] * width for _ in range(ROWS)]
    owner = [[-1] * width for _ in range(ROWS)]
    for number, line in enumerate(lines):
        for x, y in _trace(line, ends, floor, width * across, ROWS * down):
            row, column = y // down, x // across
            grid[row][column] |= _DOTS[y % down][x % across] if fancy else 1
            owner[row][column] = number
    text = []
    for row in range(ROWS):
        tick = f"{floor * row / (ROWS - 1) + 0.0:g}" if row % 4 == 0 else ""
        cells = []
        for dots, mine in zip(grid[row], owner[row], strict=True):
            char = " " if not dots else chr(0x2800 + dots) if fancy else marks[mine]
            cells.append(f"{_COLORS[mine]}{char}\x1b[0m" if color and dots else char)
        bar = "\u2502" if fancy else "|"
        text.append(f"{tick:>{gutter - 1}} {bar}{''.join(cells)}".rstrip())
    text.append(" " * gutter + ("\u2514" + "\u2500" * width if fancy else "+" + "-" * width))
    text.append(" " * (gutter + 1) + _axis(ends, width))
    return text


def _trace(line: Sequence[Point], ends: Point, floor: float, width: int, height: int) -> list[tuple[int, int]]:
    """The dots of a line, one or more for every column that it crosses; x from the left, y from the top."""
    dots: list[tuple[int, int]] = []
    places = [
        ((x - ends[0]) / (ends[1] - ends[0]) * (width - 1), min(y / floor, 1.0) * (height - 1))
        for x, y in line
        if y >= floor
    ]
    for (x0, y0), (x1, y1) in pairwise(places):
        steps = max(1, math.ceil(max(abs(x1 - x0), abs(y1 - y0))))
        for step in range(steps + 1):
            share = step / steps
            dots.append((round(x0 + share * (x1 - x0)), round(y0 + share * (y1 - y0))))
    return dots


def _axis(ends: Point, width: int) -> str:
    """The numbers below the axis: both ends, and 0 if there is space for it."""
    left, right = f"{ends[0]:.4g}", f"{ends[1]:.4g}"
    line = [" "] * width
    if ends[0] < 0.0 < ends[1]:
        place = round(-ends[0] / (ends[1] - ends[0]) * (width - 1))
        if len(left) + 1 < place < width - len(right) - 2:
            line[place] = "0"
    line[: len(left)] = left
    line[width - len(right) :] = right
    return "".join(line)
