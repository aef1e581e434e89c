"""A layout that changes from hard to solved: as a strip of pictures, and as an animation."""

from __future__ import annotations

import io
import tempfile
from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path

from PIL import Image, ImageDraw, ImageFont

from scenegen.errors import RequestError
from scenegen.errors.requests import NO_ENCODER
from scenegen.looks.chart_style import INK, PAPER, QUIET, WARM
from scenegen.needs import need
from scenegen.pictures.figures.sheet import SMALL, cut

SATISFIED_COLOR = (36, 120, 88)
EDGE, GAP, FOOT = 20, 12, 54  # pixels: margin, space between pictures, space below a picture
BAR = 6  # height of the bar that shows phi
TEXT, TITLE = 20, 22  # font sizes
LAST_MS = 1400  # milliseconds of an animation's last picture
PAGE_MS = 90  # milliseconds of the others


def strip(
    frames: Sequence[Image.Image],
    phi: Sequence[float],
    label: str,
    title: str,
    notes: Sequence[str] = (),
    times: Sequence[str] = (),
) -> bytes:
    """The frames side by side as a PNG file, each with its phi below and a bar from the lowest phi of all to the
    highest, red while the formula is violated. A note, if any, is beside phi, or the time."""
    width, height = frames[0].size
    head = TITLE + 24 if title else 0
    sheet = Image.new(
        "RGB", (2 * EDGE + len(frames) * width + (len(frames) - 1) * GAP, 2 * EDGE + head + height + FOOT), PAPER
    )
    draw = ImageDraw.Draw(sheet)
    if title:
        draw.text((EDGE, EDGE), title, INK, ImageFont.load_default(size=TITLE))
    for number, (frame, value) in enumerate(zip(frames, phi, strict=True)):
        x, y = EDGE + number * (width + GAP), EDGE + head
        sheet.paste(frame, (x, y))
        _below(draw, (x, y + height), width, value, phi, label, notes[number] if notes else "")
        if times:
            small = ImageFont.load_default(size=SMALL)
            draw.text((x + width - 1, y + height + 23), times[number], QUIET, small, anchor="ra")
    out = io.BytesIO()
    sheet.save(out, format="PNG", compress_level=7)
    return out.getvalue()


def pages(
    frames: Sequence[Image.Image], phi: Sequence[float], label: str, notes: Sequence[str] = ()
) -> list[Image.Image]:
    """The frames of an animation, each with its phi below."""
    width, height = frames[0].size
    shown = []
    for number, (frame, value) in enumerate(zip(frames, phi, strict=True)):
        page = Image.new("RGB", (width, height + FOOT), PAPER)
        page.paste(frame, (0, 0))
        _below(ImageDraw.Draw(page), (GAP, height), width - 2 * GAP, value, phi, label, notes[number] if notes else "")
        shown.append(page)
    return shown


def animation(frames: Sequence[Image.Image], phi: Sequence[float], label: str, notes: Sequence[str] = ()) -> bytes:
    """The frames one after the other as a GIF file that repeats for ever and pauses on the last frame."""
    shown = pages(frames, phi, label, notes)
    width, height = shown[0].size
    # One palette for all, of the first and the last picture: colours that jump from frame to frame look like errors.
    both = Image.new("RGB", (width, 2 * height))
    both.paste(shown[0], (0, 0))
    both.paste(shown[-1], (0, height))
    palette = both.quantize(colors=255, method=Image.Quantize.MEDIANCUT, kmeans=3)  # small objects keep their colours
    few = [page.quantize(palette=palette, dither=Image.Dither.NONE) for page in shown]
    out = io.BytesIO()
    times = [PAGE_MS] * (len(few) - 1) + [LAST_MS]
    few[0].save(out, format="GIF", save_all=True, append_images=few[1:], duration=times, loop=0, optimize=True)
    return out.getvalue()


def _below(
    draw: ImageDraw.ImageDraw,
    at: tuple[int, int],
    width: int,
    value: float,
    phi: Sequence[float],
    label: str,
    note: str,
) -> None:
    """phi as a number and as a bar, below a picture, and a note."""
    x, y = at
    low, high = min(*phi, 0.0), max(*phi, 0.0)
    color = SATISFIED_COLOR if value >= 0.0 else WARM
    draw.rectangle((x, y + 8, x + width - 1, y + 8 + BAR), fill=(228, 228, 226))
    share = (value - low) / (high - low) if high > low else 1.0
    draw.rectangle((x, y + 8, x + max(2, round(share * (width - 1))), y + 8 + BAR), fill=color)
    zero = x + round((0.0 - low) / (high - low) * (width - 1)) if high > low else x
    draw.line((zero, y + 5, zero, y + 11 + BAR), fill=INK, width=2)
    font = ImageFont.load_default(size=TEXT)
    words = f"{label} "
    draw.text((x, y + 20), words, QUIET, font)
    # Two decimals: a value slightly below zero must not look solved.
    figure = f"{value:+.2f}" if abs(value) >= 0.005 else f"{value:+.3f}"
    draw.text((x + font.getlength(words), y + 20), figure, color, font)
    small = ImageFont.load_default(size=SMALL)
    left = width - font.getlength(words + figure) - 2 * GAP
    if note and left > 0:
        draw.text((x + width - 1, y + 23), cut(note, small, left), WARM, small, anchor="ra")


# Pages of an animation as an MP4 file: H.264, which browsers, slides and viewers play.
# PyAV (https://pyav.basswood.io) brings the encoder. One thread and fixed settings: the same pages give the same
# bytes with the same version of PyAV.
ENCODER = "libx264"
QUALITY = "18"  # constant rate factor: edges and small letters stay sharp
PIXEL_MULTIPLE = 2  # pixels: colours of H.264 have half the resolution, so both sides are even


def video(pages: Sequence[Image.Image], step: int, held: int) -> bytes:
    """The pages one after the other, each `step` milliseconds long, and the last one `held`. All have one size; a row
    or column of paper makes it even. Raises RequestError without PyAV, or where it cannot write H.264."""
    need("av", "for MP4 files")
    import av

    if ENCODER not in av.codecs_available:
        raise RequestError(NO_ENCODER(encoder=ENCODER))
    width, height = (size + size % PIXEL_MULTIPLE for size in pages[0].size)
    with tempfile.TemporaryDirectory() as folder:  # the index is moved to the front of a whole file: it plays at once
        path = Path(folder) / "video.mp4"
        with av.open(path, "w", options={"movflags": "+faststart", "fflags": "+bitexact"}) as file:
            stream = file.add_stream(ENCODER, rate=Fraction(1000, step))
            stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
            # Macroblock trees differ once in some thousand runs, on one thread, too.
            stream.options = {"crf": QUALITY, "preset": "slow", "flags": "+bitexact", "x264-params": "mbtree=0"}
            stream.codec_context.thread_count = 1
            for page in [*pages, *[pages[-1]] * (-(-held // step) - 1)]:
                even = page
                if page.size != (width, height):
                    even = Image.new("RGB", (width, height), PAPER)
                    even.paste(page, (0, 0))
                file.mux(stream.encode(av.VideoFrame.from_image(even)))
            file.mux(stream.encode(None))
        return path.read_bytes()
