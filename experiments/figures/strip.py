"""Pictures side by side with words below, the bones of several figures."""

from __future__ import annotations

from collections.abc import Sequence

from PIL import Image, ImageDraw, ImageFont

from experiments.charts import INK, QUIET, small_png

GAP, EDGE, LINE = 10, 16, 20  # pixels
TITLE, TEXT = 17, 14  # sizes of type


def strips(rows: Sequence[tuple[str, Sequence[tuple[Image.Image, Sequence[str]]]]]) -> bytes:
    """A PNG file of rows (heading, pictures with the lines below each); all pictures are of one size."""
    title, text = ImageFont.load_default(size=TITLE), ImageFont.load_default(size=TEXT)
    width, height = rows[0][1][0][0].size
    most = max(len(pictures) for _, pictures in rows)
    deep = [height + LINE * max(len(lines) for _, lines in pictures) for _, pictures in rows]
    head = [TITLE + 12 if heading else 0 for heading, _ in rows]
    total = 2 * EDGE + sum(deep) + sum(head) + 2 * GAP * (len(rows) - 1)
    wide = max(2 * EDGE + most * width + (most - 1) * GAP, *(2 * EDGE + int(title.getlength(one)) for one, _ in rows))
    sheet = Image.new("RGB", (wide, total), "white")
    draw = ImageDraw.Draw(sheet)
    y = EDGE
    for (heading, pictures), depth, above in zip(rows, deep, head, strict=True):
        draw.text((EDGE, y), heading, INK, title)
        y += above
        for column, (picture, lines) in enumerate(pictures):
            x = EDGE + column * (width + GAP)
            sheet.paste(picture, (x, y))
            for number, line in enumerate(lines):
                place = (x + width / 2, y + height + 4 + number * LINE)
                draw.text(place, line, QUIET if number else INK, text, anchor="ma")
        y += depth + 2 * GAP
    return small_png(sheet)
