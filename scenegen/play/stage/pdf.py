"""Drawings in metres on pages of a PDF, at 1:1 or smaller; what is larger than a page is tiled."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from scenegen.errors import RequestError
from scenegen.errors.requests import OUT_OF_RANGE
from scenegen.needs import need

if TYPE_CHECKING:
    from fpdf import FPDF

PAPERS = {  # millimetres
    "a4": (210.0, 297.0),
    "a3": (297.0, 420.0),
    "a2": (420.0, 594.0),
    "a1": (594.0, 841.0),
    "a0": (841.0, 1189.0),
    "letter": (215.9, 279.4),
}
PAPER_EDGE = 10.0  # millimetres that printers leave white
MOST_TILES = 64
POINTS_PER_MM = 72.0 / 25.4


@dataclass(frozen=True, slots=True)
class Stroke:
    """A polyline, or with `fill` a polygon that is filled; `width` of the pen in metres; `grey` from 0, black, to 1."""

    points: Sequence[tuple[float, float]]
    width: float = 0.0003
    grey: float = 0.0
    fill: bool = False


@dataclass(frozen=True, slots=True)
class Words:
    """A line of text whose middle is at (x, y), letters of so many metres; `left`: it begins there."""

    x: float
    y: float
    text: str
    size: float
    grey: float = 0.0
    left: bool = False


@dataclass(frozen=True, slots=True)
class PaperDrawing:
    """Parts in metres, y upwards, within `low` and `high` (x, y) of each; `scale` is 1 for 1:1. `paper` is a name in
    PAPERS; `title` stands in the corner of each page."""

    low: tuple[float, float]
    high: tuple[float, float]
    parts: Sequence[Stroke | Words]
    paper: str
    title: str
    scale: float = 1.0

    @property
    def size(self) -> tuple[float, float]:
        """Width and height on paper, millimetres."""
        width, height = (1000.0 * self.scale * (high - low) for low, high in zip(self.low, self.high, strict=True))
        return width, height


def fitting_scale(low: tuple[float, float], high: tuple[float, float], paper: str) -> float:
    """1, or the 1 over 1.1, 1.2, ... at which a drawing is not larger than a page."""
    size = [high[axis] - low[axis] for axis in (0, 1)]
    ways = [sorted(size), sorted(side - 2.0 * PAPER_EDGE for side in PAPERS[paper])]
    tenths: list[int] = [math.ceil(1e4 * one / room - 1e-9) for one, room in zip(*ways, strict=True)]
    return 10.0 / max(10, *tenths)


def write_pdf(drawings: Iterable[PaperDrawing]) -> bytes:
    """Raises RequestError where fpdf2 is missing, and for a drawing that takes too many pages."""
    need("fpdf", "for PDF files")
    from datetime import UTC, datetime

    from fpdf import FPDF

    pdf = FPDF(unit="mm")
    pdf.set_creation_date(datetime(2000, 1, 1, tzinfo=UTC))  # the same drawing gives the same bytes
    pdf.set_auto_page_break(False)
    for drawing in drawings:
        _pages(pdf, drawing)
    return bytes(pdf.output())


def _pages(pdf: FPDF, drawing: PaperDrawing) -> None:
    """A page, or as many as it takes."""
    ways = (PAPERS[drawing.paper], PAPERS[drawing.paper][::-1])
    tiles = [
        [
            max(1, math.ceil(side / (page - 2.0 * PAPER_EDGE) - 1e-9))
            for side, page in zip(drawing.size, way, strict=True)
        ]
        for way in ways
    ]
    paper, (columns, rows) = min(zip(ways, tiles, strict=True), key=lambda one: one[1][0] * one[1][1])
    if rows * columns > MOST_TILES:
        size = "{:.1f} x {:.1f} m".format(*(side / 1000.0 for side in drawing.size))
        wanted = f"larger: {size} take {rows * columns:,} pages, and {MOST_TILES} are the most"
        raise RequestError(OUT_OF_RANGE(argument="paper", value=drawing.paper, wanted=wanted))
    room = [side - 2.0 * PAPER_EDGE for side in paper]
    for row in range(rows):
        for column in range(columns):
            pdf.add_page(format=paper)
            left, top = PAPER_EDGE - column * room[0], PAPER_EDGE - row * room[1]
            with pdf.rect_clip(PAPER_EDGE, PAPER_EDGE, *room):
                for part in drawing.parts:
                    _draw(pdf, drawing, part, left, top)
            title = drawing.title
            if rows * columns > 1:
                title += f"; row {row + 1} of {rows}, column {column + 1} of {columns}: cut along the frame"
                pdf.set_line_width(0.1)
                pdf.set_draw_color(150)
                pdf.rect(PAPER_EDGE, PAPER_EDGE, room[0], room[1])
            pdf.set_font("helvetica", size=7)
            pdf.set_text_color(0)
            pdf.text(PAPER_EDGE, PAPER_EDGE - 3.0, _latin(title))


def _draw(pdf: FPDF, drawing: PaperDrawing, part: Stroke | Words, left: float, top: float) -> None:
    per_metre = 1000.0 * drawing.scale

    def on_paper(x: float, y: float) -> tuple[float, float]:
        return left + per_metre * (x - drawing.low[0]), top + per_metre * (drawing.high[1] - y)

    grey = round(255 * part.grey)
    if isinstance(part, Words):
        text, height = _latin(part.text), part.size * per_metre
        pdf.set_font("helvetica", size=height * POINTS_PER_MM)
        pdf.set_text_color(grey)
        x, y = on_paper(part.x, part.y)
        pdf.text(x if part.left else x - pdf.get_string_width(text) / 2.0, y + 0.35 * height, text)
        return
    points = [on_paper(x, y) for x, y in part.points]
    if part.fill:
        pdf.set_fill_color(grey)
        pdf.polygon(points, style="F")
    else:
        pdf.set_draw_color(grey)
        pdf.set_line_width(part.width * per_metre)
        pdf.polyline(points)


def _latin(text: str) -> str:
    """What the fonts of every PDF reader have."""
    return text.encode("latin-1", "backslashreplace").decode("latin-1")
