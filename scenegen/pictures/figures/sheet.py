"""The contact sheet: small pictures of the scenes with their phi, and the requested ranges."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence

from PIL import Image, ImageDraw, ImageFont

from scenegen.looks.chart_style import INK, PAPER, QUIET, WARM
from scenegen.looks.stage import overlaps_of
from scenegen.sampling.request import Ends
from scenegen.scenes.blocks import element
from scenegen.scenes.data import CountData, SceneData, SceneFile

MAX_THUMBNAILS = 64  # maximum number of scenes
EDGE, GAP, LINE = 28, 18, 20  # pixels: margin of the sheet, space between pictures, height of a caption line
CAPTION_LINES = 8
MAX_SHEET_WIDTH = 2000  # width in pixels of a sheet with one more column than necessary
OVERLAPS = 3  # maximum number of caption lines about overlaps
TITLE, TEXT, SMALL = 24, 16, 15  # font sizes

Font = ImageFont.FreeTypeFont | ImageFont.ImageFont
Item = tuple[str, tuple[int, int, int]]


def describe_ranges(phi: dict[str, Ends]) -> str:
    """The target ranges in words: `task 0.05..0.2, safe >= 0`."""
    words = []
    for label, (low, high) in phi.items():
        if low is not None and high is not None:
            words.append(f"{label} {low:g}..{high:g}")
        elif low is not None:
            words.append(f"{label} >= {low:g}")
        elif high is not None:
            words.append(f"{label} <= {high:g}")
        else:
            words.append(f"{label} any")
    return ", ".join(words) or "nothing in particular"


def thumbnail_size(size: tuple[int, int], scenes: int) -> tuple[int, int]:
    """The size of the pictures on a sheet of that many scenes."""
    width = 320 if min(scenes, MAX_THUMBNAILS) <= 20 else 240
    alike = math.sqrt(0.75 * width * width / (size[0] * size[1]))  # the same number of pixels for any aspect ratio
    scale = min(alike, width * 1.6 / size[0], width * 0.9 / size[1])
    return max(1, round(size[0] * scale)), max(1, round(size[1] * scale))


def cut(text: str, font: Font, width: float) -> str:
    """The text, shortened with an ellipsis if it is wider than `width` pixels."""
    if font.getlength(text) <= width:
        return text
    while text and font.getlength(text + "...") > width:
        text = text[:-1]
    return text + "..."


def flow(items: Sequence[Item], font: Font, width: float, space: str) -> list[list[Item]]:
    """The items on as many lines of `width` pixels as they need, none wider than a line."""
    lines: list[list[Item]] = [[]]
    used = 0.0
    for text, color in items:
        short = cut(text, font, width)
        length = font.getlength(short)
        if lines[-1] and used + font.getlength(space) + length > width:
            lines.append([])
            used = 0.0
        used += (font.getlength(space) if lines[-1] else 0.0) + length
        lines[-1].append((short, color))
    return lines


def _caption(
    number: int, scene: SceneData, drawn: Sequence[CountData], overlaps: Sequence[str], font: Font, width: float
) -> list[list[Item]]:
    items: list[Item] = [(f"#{number}", QUIET)]
    items += [(cut(element(one, (scene.counts or {})[one.name]), font, width), QUIET) for one in drawn]
    for label, value in scene.phi.items():
        figure = f" {round(value, 3) + 0.0:g}" if abs(value) >= 5e-4 or value == 0 else f" {value:.1g}"
        # A long label is shortened, its number is not.
        items.append((cut(label, font, width - font.getlength(figure)) + figure, INK if value >= 0 else WARM))
    lines = flow(items, font, width, "   ")
    shown = overlaps if len(overlaps) <= OVERLAPS else [*overlaps[: OVERLAPS - 1], f"{len(overlaps)} overlaps in all"]
    lines += flow([(text, WARM) for text in shown], font, width, "   ") if shown else []
    if len(lines) > CAPTION_LINES:
        left = sum(map(len, lines[CAPTION_LINES - 1 :]))
        lines = [*lines[: CAPTION_LINES - 1], [(f"and {left} more", QUIET)]]
    return lines


def write(draw: ImageDraw.ImageDraw, at: tuple[float, float], line: list[Item], font: Font, space: str) -> None:
    """A line from the upper left corner `at`, with `space` between its items."""
    x, y = at
    for text, color in line:
        draw.text((x, y), text, fill=color, font=font)
        x += font.getlength(text + space)


def _method(file: SceneFile) -> str:
    method, model = file.sampler.get("method", "unknown"), file.sampler.get("model")
    return f"{method} ({model})" if model else str(method)


def contact_sheet(file: SceneFile, thumbnails: Sequence[Image.Image], *, planned: bool = True) -> bytes:
    """The sheet as a PNG file; `thumbnails` are the pictures of the first scenes, all of one size. Of scenes that are
    not as they were `planned` it does not say what overlaps."""
    title_font, font, small = (ImageFont.load_default(size=size) for size in (TITLE, TEXT, SMALL))
    count, total = len(thumbnails), len(file.scenes)
    width, height = thumbnails[0].size
    cell = max(width, 200)
    columns = min(count, max(2, math.ceil(math.sqrt(count * (height + 2 * LINE) / cell))), 8)
    if count % columns and count % (columns + 1) == 0 and (columns + 1) * (cell + GAP) <= MAX_SHEET_WIDTH:
        columns += 1  # no row with gaps
    inner = max(columns * cell + (columns - 1) * GAP, 480)
    some = file.model_copy(update={"scenes": file.scenes[:count]})
    overlaps = overlaps_of(some) if planned else [[] for _ in some.scenes]
    captions = [_caption(k + 1, file.scenes[k], file.counts, overlaps[k], small, cell) for k in range(count)]
    rows = [captions[start : start + columns] for start in range(0, count, columns)]

    many = f"{total} scene{'s' * (total != 1)}"
    shown = many if count == total else f"first {count} of {many}"
    facts = [f"target: {describe_ranges(file.request.phi)}", f"method: {_method(file)}"]
    if file.sampler.get("raw"):
        facts.append("raw model output")
    title = file.spec.title
    heading = title.rstrip(".") or shown[0].upper() + shown[1:]
    facts = [shown, *facts] if title else facts
    head = flow([(word, INK) for word in heading.split()], title_font, inner, " ")[:3]
    note = flow([(word, QUIET) for word in "  |  ".join(facts).split()], font, inner, " ")[:6]

    top = EDGE + len(head) * (TITLE + 8) + 4 + len(note) * (TEXT + 6) + 16
    depths = [height + 8 + LINE * max(map(len, row)) + GAP for row in rows]
    sheet = Image.new("RGB", (inner + 2 * EDGE, top + sum(depths) - GAP + EDGE), PAPER)
    draw = ImageDraw.Draw(sheet)
    y = EDGE
    for line in head:
        write(draw, (EDGE, y), line, title_font, " ")
        y += TITLE + 8
    y += 4
    for line in note:
        write(draw, (EDGE, y), line, font, " ")
        y += TEXT + 6
    y = top
    for start, row, depth in zip(range(0, count, columns), rows, depths, strict=True):
        for column, caption in enumerate(row):
            x = EDGE + column * (cell + GAP)
            sheet.paste(thumbnails[start + column], (x, y))
            for number, line in enumerate(caption):
                write(draw, (x + 2, y + height + 7 + number * LINE), line, small, "   ")
        y += depth
    out = io.BytesIO()
    sheet.save(out, format="PNG", compress_level=5)
    return out.getvalue()
