"""How large and how far away things may be. The language keeps to it; files can hold any number (sizes.py)."""

from __future__ import annotations

LARGEST, SMALLEST = 1e3, 1e-6  # metres: sizes of objects and regions
FARTHEST = 1e6  # metres from the origin; rounding is then still far below a micrometre
BOARD = 0.01  # metres: how thick a region at a height is, where the table leaves room for that
WIDEST = 2.0 * FARTHEST  # metres: what has its corners no further out
