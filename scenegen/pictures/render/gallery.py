"""Pictures of the asset library: every asset alone on a piece of table, and all of them on one sheet."""

from __future__ import annotations

import contextlib
import io
import math
from bisect import bisect_left
from collections.abc import Mapping, Sequence

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from scenegen.geometry import Circle
from scenegen.looks.camera import VIEW_ANGLES
from scenegen.looks.chart_style import INK, PAPER, QUIET
from scenegen.looks.stage import TABLE_MARGIN, PictureObject, PictureSetup
from scenegen.pictures.figures.sheet import EDGE, GAP, SMALL, TEXT, TITLE
from scenegen.pictures.render.files import PictureOptions
from scenegen.pictures.render.scenes import draw
from scenegen.processes.process import cores
from scenegen.things import ASSETS, Shape, shape_of
from scenegen.things.library import Asset, cabinet_shape

TABLE_SIDES = (0.08, 0.10, 0.13, 0.16, 0.19, 0.24, 0.33, 0.44, 0.62)  # metres: sides of the pieces of table
RISES = (0.05, 0.4, 0.8, 1.2)  # heights above the far edge, in sides of the table: limits between groups
ASSET_HEADING = math.radians(-32.0)  # heading of the assets: to the right, and a little towards the viewer
ASSET_VIEW = "perspective"
OUT_OF_VIEW = 50.0  # metres: the place of assets that are not in the picture
COLUMNS, GALLERY_WIDTH = 8, 170  # of the sheet, and pixels of a picture on it


def gallery(names: Sequence[str], size: tuple[int, int], workers: int | None = None) -> dict[str, bytes]:
    """Name -> PNG file of the asset alone, for names of the library. It stands on a piece of table of about its size,
    and the picture has about its height: assets of similar size and height share these."""
    groups: dict[tuple[float, int], list[str]] = {}
    for name in names:
        side = next((side for side in TABLE_SIDES if _reach(ASSETS[name]) <= side), TABLE_SIDES[-1])
        rise = bisect_left(RISES, _room(ASSETS[name], side) / side)
        groups.setdefault((side, rise), []).append(name)
    found: dict[str, bytes] = {}
    for (side, _), group in groups.items():
        found |= _draw_group(group, side, size, workers)
    return {name: found[name] for name in names}


def _extent(asset: Asset) -> tuple[float, float]:
    """How much an asset covers of the table along x and y, in metres, with the heading of these pictures."""
    if isinstance(asset.footprint, Circle):
        return asset.footprint.extent
    (length, width), cos, sin = asset.footprint.extent, abs(math.cos(ASSET_HEADING)), abs(math.sin(ASSET_HEADING))
    return length * cos + width * sin, length * sin + width * cos


def _reach(asset: Asset) -> float:
    """The side of an asset's piece of table, in metres; larger for tall assets, whose table would otherwise look like a
    pillar."""
    return max(*_extent(asset), 0.45 * asset.height)


def _room(asset: Asset, side: float) -> float:
    """How far a picture must extend above the far edge of such a piece of table, in metres, to show the asset's top."""
    slope = 0.5 * math.tan(math.radians(VIEW_ANGLES[ASSET_VIEW][1]))  # half of the side: nearer objects look larger
    return max(asset.height - (side - _extent(asset)[1]) / 2.0 * slope, 0.0)


def _draw_group(names: Sequence[str], side: float, size: tuple[int, int], workers: int | None) -> dict[str, bytes]:
    half = 0.5 * side
    edge = half + TABLE_MARGIN * side
    things = tuple(PictureObject(_asset_shape(name), ASSETS[name].color) for name in names)
    tallest = max(_room(ASSETS[name], side) for name in names)
    stage = PictureSetup((-half, -half, half, half), (-edge, -edge, edge, edge), tallest, things)
    poses = np.tile(np.array([OUT_OF_VIEW, OUT_OF_VIEW, 0.0]), (len(names), len(names), 1))
    poses[range(len(names)), range(len(names))] = (0.0, 0.0, ASSET_HEADING)
    options = PictureOptions((ASSET_VIEW,), size)
    with contextlib.closing(draw(stage, poses, options, min(workers or cores(), len(names)))) as scenes:
        return {name: files[ASSET_VIEW, ".png"] for name, files in zip(names, scenes, strict=True)}


def _asset_shape(name: str) -> Shape:
    """An asset as the picture shows it: of a cabinet, a drawer is a little open."""
    return cabinet_shape((0.0, 0.0, 0.4)) if name == "cabinet" else shape_of(name)


def library_sheet(pictures: Mapping[str, bytes]) -> bytes:
    """All pictures with names and sizes as a PNG file."""
    images = {}
    for name, data in pictures.items():
        with Image.open(io.BytesIO(data)) as picture:
            scale = GALLERY_WIDTH / picture.size[0]
            height = round(picture.size[1] * scale)
            images[name] = picture.convert("RGB").resize((GALLERY_WIDTH, height), Image.Resampling.LANCZOS)
    font, small, title = (ImageFont.load_default(size=size) for size in (TEXT, SMALL - 2, TITLE))
    columns = min(COLUMNS, len(images))
    depth = height + TEXT + SMALL + 18 + GAP
    rows = math.ceil(len(images) / columns)
    head = EDGE + TITLE + 18
    extent = (2 * EDGE + columns * GALLERY_WIDTH + (columns - 1) * GAP, head + rows * depth - GAP + EDGE)
    sheet = Image.new("RGB", (max(extent[0], 320), extent[1]), PAPER)
    draw_on = ImageDraw.Draw(sheet)
    draw_on.text((EDGE, EDGE), f"{len(images)} objects", INK, title)
    for number, (name, image) in enumerate(images.items()):
        x, y = EDGE + number % columns * (GALLERY_WIDTH + GAP), head + number // columns * depth
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
    mass = f"{1000 * asset.mass:g} g" if asset.mass < 1.0 else f"{asset.mass:g} kg"
    return f"{sizes} cm, {mass}"
