"""Pictures of the asset library: every asset alone on a piece of table, and all of them on one sheet."""

from __future__ import annotations

import contextlib
import io
import math
from collections.abc import Mapping, Sequence

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from scenegen.assets import ASSETS, shape_of
from scenegen.assets.library import Asset
from scenegen.render.files import Wanted
from scenegen.render.pool import draw
from scenegen.render.process import cores
from scenegen.render.sheet import EDGE, GAP, INK, PAPER, QUIET, SMALL, TEXT, TITLE
from scenegen.render.stage import MARGIN, Stage, Thing

TABLES = (
    0.10,
    0.135,
    0.18,
    0.24,
    0.34,
    0.46,
)  # metres: sides of the pieces of table; each asset gets the smallest
TURN = math.radians(-32.0)  # of the headings: to the right, and a little towards the viewer
ASIDE = 50.0  # metres: where the other assets wait
COLUMNS = 8


def gallery(names: Sequence[str], size: tuple[int, int], workers: int | None = None) -> dict[str, bytes]:
    """Name -> PNG file of the asset on its own, for names of the library."""
    found: dict[str, bytes] = {}
    for side, low in zip(TABLES, (0.0, *TABLES), strict=False):
        last = side == TABLES[-1]
        group = [name for name in names if low < _reach(ASSETS[name]) and (last or _reach(ASSETS[name]) <= side)]
        if group:
            found |= _drawn(group, side, size, workers)
    return {name: found[name] for name in names}


def _reach(asset: Asset) -> float:
    """How large a piece of table an asset wants, in metres; what is tall wants more to be seen whole."""
    return max(max(asset.footprint.extent) + 0.25 * asset.height, asset.height / 0.9)


def _drawn(names: Sequence[str], side: float, size: tuple[int, int], workers: int | None) -> dict[str, bytes]:
    half = 0.5 * side
    edge = half + MARGIN * side
    things = tuple(Thing(shape_of(name), ASSETS[name].color) for name in names)
    # The highest points are in the middle: from the viewer's side they take less room than at the table's far edge.
    tallest = 0.8 * max(thing.shape.height for thing in things)
    stage = Stage((-half, -half, half, half), (-edge, -edge, edge, edge), tallest, things)
    poses = np.tile(np.array([ASIDE, ASIDE, 0.0]), (len(names), len(names), 1))
    poses[range(len(names)), range(len(names))] = (0.0, 0.0, TURN)
    wanted = Wanted(("perspective",), size)
    with contextlib.closing(draw(stage, poses, wanted, min(workers or cores(), len(names)))) as scenes:
        return {name: files["perspective", ".png"] for name, files in zip(names, scenes, strict=True)}


def library_sheet(pictures: Mapping[str, bytes], width: int = 150) -> bytes:
    """All pictures with names and sizes as a PNG file."""
    images = {}
    for name, data in pictures.items():
        with Image.open(io.BytesIO(data)) as picture:
            scale = width / picture.size[0]
            height = round(picture.size[1] * scale)
            images[name] = picture.convert("RGB").resize((width, height), Image.Resampling.LANCZOS)
    font, small, title = (ImageFont.load_default(size=size) for size in (TEXT, SMALL - 2, TITLE))
    columns = min(COLUMNS, len(images))
    depth = height + TEXT + SMALL + 18 + GAP
    rows = math.ceil(len(images) / columns)
    head = EDGE + TITLE + 18
    extent = (2 * EDGE + columns * width + (columns - 1) * GAP, head + rows * depth - GAP + EDGE)
    sheet = Image.new("RGB", (max(extent[0], 320), extent[1]), PAPER)
    draw_on = ImageDraw.Draw(sheet)
    draw_on.text((EDGE, EDGE), f"{len(images)} objects", INK, title)
    for number, (name, image) in enumerate(images.items()):
        x, y = EDGE + number % columns * (width + GAP), head + number // columns * depth
        sheet.paste(image, (x, y))
        draw_on.text((x, y + height + 5), name, INK, font)
        draw_on.text((x, y + height + TEXT + 9), measures(ASSETS[name]), QUIET, small)
    out = io.BytesIO()
    sheet.save(out, format="PNG", optimize=True)
    return out.getvalue()


def measures(asset: Asset) -> str:
    """`25 x 25 x 2.2 cm, 450 g`."""
    length, width = asset.footprint.extent
    sizes = " x ".join(f"{100 * value:g}" for value in (length, width, asset.height))
    return f"{sizes} cm, {1000 * asset.mass:g} g"
