"""Curves of rarity as a picture: one panel per label, log10 of a probability over phi."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from dataclasses import dataclass

from PIL import Image, ImageDraw, ImageFont

from scenegen.show.figures.sheet import INK, PAPER, QUIET, WARM

Point = tuple[float, float]

WIDTH, HEIGHT = 900, 360  # pixels of a panel
LEFT, RIGHT, HEAD, FOOT = 76, 28, 74, 46  # margins of a panel's axes
SCALE = 2  # drawn larger and scaled down, because Pillow's lines are not antialiased
COOL, GRID = (43, 96, 158), (226, 227, 229)
TITLE, TEXT = 20, 14  # font sizes
TICKS = 8  # about how many on an axis
DEEPEST = -1.0  # an axis extends at least down to this log10


@dataclass(frozen=True, slots=True)
class RarityPanel:
    """A label with its bounds of phi, and the points (phi, log10 P) of P(>= phi) and P(<= phi)."""

    label: str
    bounds: tuple[float, float]
    above: Sequence[Point]
    below: Sequence[Point]


def plot(panels: Sequence[RarityPanel], title: str) -> bytes:
    """The panels one below the other as a PNG file."""
    image = Image.new("RGB", (WIDTH * SCALE, HEIGHT * SCALE * len(panels)), PAPER)
    draw = ImageDraw.Draw(image)
    for number, panel in enumerate(panels):
        _panel(draw, panel, number * HEIGHT, f"{title}: {panel.label}")
    out = io.BytesIO()
    image.resize((WIDTH, HEIGHT * len(panels)), Image.Resampling.LANCZOS).save(out, format="PNG")
    return out.getvalue()


def ticks(low: float, high: float, most: int = TICKS) -> list[float]:
    """Round values between two ends, at most about `most` of them, in steps of 1, 2 or 5 times a power of ten."""
    rough = (high - low) / most
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(factor * power for factor in (1.0, 2.0, 5.0, 10.0) if factor * power >= rough * (1.0 - 1e-9))
    first = math.ceil(low / step - 1e-9)
    return [round(place * step, 12) for place in range(first, math.floor(high / step + 1e-9) + 1)]


def _panel(draw: ImageDraw.ImageDraw, panel: RarityPanel, top: int, title: str) -> None:
    points = [*panel.above, *panel.below]
    low, high = panel.bounds
    if not low < high:
        low, high = low - 0.5, high + 0.5
    floor = min([DEEPEST, *(math.floor(y) for _, y in points)])

    def place(phi: float, log10: float) -> tuple[float, float]:
        x = LEFT + (phi - low) / (high - low) * (WIDTH - LEFT - RIGHT)
        y = top + HEAD + log10 / floor * (HEIGHT - HEAD - FOOT)
        return x * SCALE, y * SCALE

    head, font = (ImageFont.load_default(size=size * SCALE) for size in (TITLE, TEXT))
    draw.text((LEFT * SCALE, (top + 16) * SCALE), title, INK, head)
    x = float(LEFT * SCALE)
    for words, color in (("log10 P(>= phi)", WARM), ("log10 P(<= phi)", COOL)):
        draw.text((x, (top + 46) * SCALE), words, color, font)
        x += font.getlength(words) + 24 * SCALE
    for phi in ticks(low, high):
        line = [place(phi, 0.0), place(phi, floor)]
        draw.line(line, QUIET if phi == 0.0 else GRID, SCALE)
        draw.text((line[1][0], line[1][1] + 6 * SCALE), f"{phi:g}", INK, font, anchor="ma")
    for log10 in ticks(floor, 0.0, 6):
        line = [place(low, log10), place(high, log10)]
        draw.line(line, GRID, SCALE)
        draw.text((line[0][0] - 8 * SCALE, line[0][1]), f"{log10:g}", INK, font, anchor="rm")
    draw.text(((WIDTH - RIGHT) * SCALE, (top + HEIGHT - 8) * SCALE), "phi", QUIET, font, anchor="rs")
    for curve, color in ((panel.below, COOL), (panel.above, WARM)):
        if len(curve) > 1:
            draw.line([place(*point) for point in curve], color, 2 * SCALE, joint="curve")
