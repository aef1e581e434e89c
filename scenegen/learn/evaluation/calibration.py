"""Target phi against reached phi as a picture: a panel per label, a dot per scene, and the line where both agree."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw, ImageFont

from scenegen.looks.chart_style import BLUE, GRID, INK, PAPER, QUIET, SCALE, WARM, ticks

AXIS_LENGTH = 380  # pixels of a panel's axes
LEFT, RIGHT, HEAD, FOOT = 70, 20, 64, 56  # margins
MAX_ACROSS = 3  # panels in a row
TITLE, TEXT = 18, 13  # font sizes
MARGIN_SHARE = 0.03  # margin around the dots, as a share of the range
DOT_RADIUS = 1.1  # pixels, radius


@dataclass(frozen=True, slots=True)
class CalibrationPanel:
    """A label, target and reached phi (n,), and the text below its name."""

    label: str
    wanted: npt.NDArray[np.float64]
    reached: npt.NDArray[np.float64]
    note: str = ""


def calibration(panels: Sequence[CalibrationPanel]) -> bytes:
    """The panels in rows, as a PNG file. Both axes span the target phi; a scene beyond that is drawn at the edge.
    Raises ValueError if there are no panels."""
    if not panels:
        raise ValueError("no panels")
    width, height = LEFT + AXIS_LENGTH + RIGHT, HEAD + AXIS_LENGTH + FOOT
    across = min(MAX_ACROSS, len(panels))
    size = width * across, height * -(-len(panels) // across)
    image = Image.new("RGB", (size[0] * SCALE, size[1] * SCALE), PAPER)
    draw = ImageDraw.Draw(image)
    for number, panel in enumerate(panels):
        _dots(draw, panel, number % across * width, number // across * height)
    out = io.BytesIO()
    image.resize(size, Image.Resampling.LANCZOS).save(out, format="PNG", optimize=True)
    return out.getvalue()


def _dots(draw: ImageDraw.ImageDraw, panel: CalibrationPanel, left: int, top: int) -> None:
    low, high = float(panel.wanted.min()), float(panel.wanted.max())
    room = MARGIN_SHARE * (high - low) or 0.5
    low, high = low - room, high + room

    def place(wanted: float, reached: float) -> tuple[float, float]:
        x = left + LEFT + (wanted - low) / (high - low) * AXIS_LENGTH
        y = top + HEAD + AXIS_LENGTH - (reached - low) / (high - low) * AXIS_LENGTH
        return x * SCALE, y * SCALE

    head, font = (ImageFont.load_default(size=size * SCALE) for size in (TITLE, TEXT))
    draw.text(((left + LEFT) * SCALE, (top + 12) * SCALE), panel.label, INK, head)
    draw.text(((left + LEFT) * SCALE, (top + 38) * SCALE), panel.note, QUIET, font)
    for phi in ticks(low, high):
        for line in ([place(phi, low), place(phi, high)], [place(low, phi), place(high, phi)]):
            draw.line(line, QUIET if phi == 0.0 else GRID, SCALE)
        (x, y), (x0, y0) = place(phi, low), place(low, phi)
        draw.text((x, y + 6 * SCALE), f"{phi:g}", INK, font, anchor="ma")
        draw.text((x0 - 6 * SCALE, y0), f"{phi:g}", INK, font, anchor="rm")
    draw.line([place(low, low), place(high, high)], WARM, SCALE)
    for wanted, reached in zip(panel.wanted.tolist(), panel.reached.clip(low, high).tolist(), strict=True):
        x, y = place(wanted, reached)
        draw.ellipse(
            [x - DOT_RADIUS * SCALE, y - DOT_RADIUS * SCALE, x + DOT_RADIUS * SCALE, y + DOT_RADIUS * SCALE], BLUE
        )
    foot = (top + HEAD + AXIS_LENGTH + FOOT - 10) * SCALE
    draw.text(((left + LEFT + AXIS_LENGTH) * SCALE, foot), "wanted phi", QUIET, font, anchor="rs")
    draw.text(((left + LEFT) * SCALE, foot), "reached phi upwards", QUIET, font, anchor="ls")
