"""What figures share: the colours of paper and ink, and round values for an axis."""

from __future__ import annotations

import math

PAPER, INK, QUIET, WARM = (250, 250, 249), (38, 40, 44), (112, 116, 124), (178, 58, 44)
BLUE, GRID = (43, 96, 158), (226, 227, 229)
SCALE = 2  # charts are drawn larger and scaled down, because Pillow's lines are not antialiased
TICKS = 8  # about how many on an axis


def ticks(low: float, high: float, most: int = TICKS) -> list[float]:
    """Round values between two ends, at most about `most` of them, in steps of 1, 2 or 5 times a power of ten."""
    rough = (high - low) / most
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(factor * power for factor in (1.0, 2.0, 5.0, 10.0) if factor * power >= rough * (1.0 - 1e-9))
    first = math.ceil(low / step - 1e-9)
    return [round(place * step, 12) for place in range(first, math.floor(high / step + 1e-9) + 1)]
