"""Charts: curves of rarity, and phi over time (the paper's Fig. 3)."""

from __future__ import annotations

import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from PIL import Image, ImageDraw, ImageFont

from scenegen.looks.chart_style import BLUE, GRID, INK, PAPER, QUIET, SCALE, WARM, ticks

Point = tuple[float, float]

WIDTH, HEIGHT = 900, 360  # pixels of a panel
LEFT, RIGHT, HEAD, FOOT = 76, 28, 74, 46  # margins of a panel's axes
TITLE, TEXT = 20, 14  # font sizes
FLOOR_LOG10 = -1.0  # an axis extends at least down to this log10


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
        _curves(draw, panel, number * HEIGHT, f"{title}: {panel.label}")
    out = io.BytesIO()
    image.resize((WIDTH, HEIGHT * len(panels)), Image.Resampling.LANCZOS).save(out, format="PNG")
    return out.getvalue()


def _curves(draw: ImageDraw.ImageDraw, panel: RarityPanel, top: int, title: str) -> None:
    points = [*panel.above, *panel.below]
    low, high = panel.bounds
    if not low < high:
        low, high = low - 0.5, high + 0.5
    floor = min([FLOOR_LOG10, *(math.floor(y) for _, y in points)])

    def place(phi: float, log10: float) -> tuple[float, float]:
        x = LEFT + (phi - low) / (high - low) * (WIDTH - LEFT - RIGHT)
        y = top + HEAD + log10 / floor * (HEIGHT - HEAD - FOOT)
        return x * SCALE, y * SCALE

    head, font = (ImageFont.load_default(size=size * SCALE) for size in (TITLE, TEXT))
    draw.text((LEFT * SCALE, (top + 16) * SCALE), title, INK, head)
    x = float(LEFT * SCALE)
    for words, color in (("log10 P(>= phi)", WARM), ("log10 P(<= phi)", BLUE)):
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
    for curve, color in ((panel.below, BLUE), (panel.above, WARM)):
        if len(curve) > 1:
            draw.line([place(*point) for point in curve], color, 2 * SCALE, joint="curve")


TIME_WIDTH, TIME_HEIGHT = 880, 360  # pixels
TIME_LEFT, TIME_RIGHT, TIME_TOP, TIME_BOTTOM = 76, 24, 44, 52
COLORS = ((24, 94, 168), (196, 84, 32), (36, 120, 88), (140, 60, 140), (120, 110, 30), (90, 90, 90))
TIME_TEXT = 16
SPARSE = 32  # moments up to which each gets a dot


def phi_chart(times: Sequence[float], phi: Mapping[str, Sequence[float]]) -> bytes:
    """phi by label at every moment, as a PNG file; values that are infinite are left out."""
    finite = [value for values in phi.values() for value in values if math.isfinite(value)]
    low, high = min([0.0, *finite]), max([0.0, *finite])
    pad = 0.06 * (high - low or 1.0)
    low, high = low - pad, high + pad
    last = times[-1] or 1.0
    page = Image.new("RGB", (TIME_WIDTH, TIME_HEIGHT), PAPER)
    draw, font = ImageDraw.Draw(page), ImageFont.load_default(size=TIME_TEXT)

    def pixel(t: float, value: float) -> tuple[float, float]:
        x = TIME_LEFT + (TIME_WIDTH - TIME_LEFT - TIME_RIGHT) * t / last
        return x, TIME_TOP + (TIME_HEIGHT - TIME_TOP - TIME_BOTTOM) * (high - value) / (high - low)

    for value in ticks(low, high):
        (x0, y), (x1, _) = pixel(0.0, value), pixel(last, value)
        draw.line((x0, y, x1, y), fill=QUIET if value == 0.0 else (224, 224, 222), width=2 if value == 0.0 else 1)
        draw.text((TIME_LEFT - 10, y), f"{value:g}", INK, font, anchor="rm")
    for value in ticks(0.0, last):
        x, y = pixel(value, low)
        draw.line((x, y, x, y + 5), fill=QUIET)
        draw.text((x, y + 10), f"{value:g}", INK, font, anchor="ma")
    draw.text((TIME_WIDTH - TIME_RIGHT, TIME_HEIGHT - 8), "t in seconds", QUIET, font, anchor="rs")
    place = float(TIME_LEFT)
    for number, (name, values) in enumerate(phi.items()):
        color = COLORS[number % len(COLORS)]
        points = [pixel(t, value) for t, value in zip(times, values, strict=True) if math.isfinite(value)]
        if len(points) > 1:
            draw.line(points, fill=color, width=3, joint="curve")
        for x, y in points if len(points) <= SPARSE else ():
            draw.ellipse((x - 3, y - 3, x + 3, y + 3), fill=color)
        draw.rectangle((place, 18, place + 18, 22), fill=color)
        text = f"phi of {name}"
        draw.text((place + 26, 20), text, INK, font, anchor="lm")
        place += 26 + draw.textlength(text, font) + 28
    out = io.BytesIO()
    page.save(out, format="PNG", compress_level=7)
    return out.getvalue()
