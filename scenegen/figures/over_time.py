"""phi over time as a chart (the paper's Fig. 3): a line for each label, and the line of 0."""

from __future__ import annotations

import io
import math
from collections.abc import Mapping, Sequence

from PIL import Image, ImageDraw, ImageFont

from scenegen.figures.plot import ticks
from scenegen.figures.sheet import INK, PAPER, QUIET

WIDTH, HEIGHT = 880, 360  # pixels
LEFT, RIGHT, TOP, BOTTOM = 76, 24, 44, 52
COLORS = ((24, 94, 168), (196, 84, 32), (36, 120, 88), (140, 60, 140), (120, 110, 30), (90, 90, 90))
TEXT = 16
SPARSE = 32  # moments up to which each gets a dot


def over_time(times: Sequence[float], phi: Mapping[str, Sequence[float]]) -> bytes:
    """phi by label at every moment, as a PNG file; values that are infinite are left out."""
    finite = [value for values in phi.values() for value in values if math.isfinite(value)]
    low, high = min([0.0, *finite]), max([0.0, *finite])
    pad = 0.06 * (high - low or 1.0)
    low, high = low - pad, high + pad
    last = times[-1] or 1.0
    page = Image.new("RGB", (WIDTH, HEIGHT), PAPER)
    draw, font = ImageDraw.Draw(page), ImageFont.load_default(size=TEXT)

    def at(t: float, value: float) -> tuple[float, float]:
        x = LEFT + (WIDTH - LEFT - RIGHT) * t / last
        return x, TOP + (HEIGHT - TOP - BOTTOM) * (high - value) / (high - low)

    for value in ticks(low, high):
        (x0, y), (x1, _) = at(0.0, value), at(last, value)
        draw.line((x0, y, x1, y), fill=QUIET if value == 0.0 else (224, 224, 222), width=2 if value == 0.0 else 1)
        draw.text((LEFT - 10, y), f"{value:g}", INK, font, anchor="rm")
    for value in ticks(0.0, last):
        x, y = at(value, low)
        draw.line((x, y, x, y + 5), fill=QUIET)
        draw.text((x, y + 10), f"{value:g}", INK, font, anchor="ma")
    draw.text((WIDTH - RIGHT, HEIGHT - 8), "t in seconds", QUIET, font, anchor="rs")
    place = float(LEFT)
    for number, (name, values) in enumerate(phi.items()):
        color = COLORS[number % len(COLORS)]
        points = [at(t, value) for t, value in zip(times, values, strict=True) if math.isfinite(value)]
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
