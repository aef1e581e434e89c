"""Where each object is placed: the centres of many scenes, overlaid on the table seen from above, one panel per
object."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from scenegen.geometry import Box, Circle
from scenegen.looks.chart_style import INK, PAPER, QUIET
from scenegen.looks.stage import PictureSetup, poses_of, stage_of
from scenegen.pictures.figures.sheet import EDGE, GAP, TEXT, TITLE, flow, write
from scenegen.pose import THETA, X, Y, places
from scenegen.scenes.data import SceneFile
from scenegen.things.library import RGB
from scenegen.things.outline import Floats
from scenegen.things.palette import mix

PANEL_SIDE = 300  # pixels of a panel's longer side
GRID_CELLS = 150  # cells of the grid along the longer side
BLUR, FEW = 0.014, 0.20  # of the longer side: blur of one scene's place, larger for fewer scenes
MAX_PANELS = 24  # maximum number of panels
BARE_TABLE_COLOR = (246, 240, 230)
LINE = (150, 140, 125)
ARROW = 0.045  # of the longer side: length of the mark of the mean heading


def heatmap(file: SceneFile, *, distinct: bool = False) -> bytes:
    """A PNG file. A panel's darkest places are where its object is most often; outlines are the spec's regions, the
    arrow is the mean heading if there is one. Raises DataError like `stage_of`."""
    stage, poses = stage_of(file, distinct=distinct), poses_of(file)
    names = [item.name for item in file.objects][:MAX_PANELS]
    x0, y0, x1, y1 = stage.workspace
    scale = PANEL_SIDE / stage.side
    width, height = max(1, round((x1 - x0) * scale)), max(1, round((y1 - y0) * scale))
    columns = min(len(names), 4 if len(names) != 5 and len(names) != 6 and len(names) != 9 else 3)
    font, title_font = ImageFont.load_default(size=TEXT), ImageFont.load_default(size=TITLE)
    line = TEXT + 12
    rows = math.ceil(len(names) / columns)
    inner = columns * width + (columns - 1) * GAP
    title = file.spec.title.rstrip(".") or "Where the objects go"
    lines = flow([(word, INK) for word in title.split()], title_font, max(inner, 320), " ")[:3]
    head = EDGE + len(lines) * (TITLE + 8) + 6 + TEXT + 18
    sheet = Image.new("RGB", (max(inner, 320) + 2 * EDGE, head + rows * (line + height + GAP) - GAP + EDGE), PAPER)
    draw = ImageDraw.Draw(sheet)
    for number, words in enumerate(lines):
        write(draw, (EDGE, EDGE + number * (TITLE + 8)), words, title_font, " ")
    many = f"{len(poses):,} scene{'s' * (len(poses) != 1)} overlaid: the darker, the more often"
    draw.text((EDGE, EDGE + len(lines) * (TITLE + 8) + 4), many, QUIET, font)
    for number, name in enumerate(names):
        x = EDGE + number % columns * (width + GAP)
        y = head + number // columns * (line + height + GAP)
        draw.text((x, y), name, INK, font)
        here = poses[~np.isnan(poses[:, number, 0]), number]
        panel = _panel(stage, here, stage.things[number].color, (width, height))
        sheet.paste(panel, (x, y + line))
    out = io.BytesIO()
    sheet.save(out, format="PNG", compress_level=7)
    return out.getvalue()


def density(poses: Floats, workspace: Sequence[float], cells: tuple[int, int], blur: float) -> Floats:
    """(rows, columns): how often centres (P, 3) fall near each cell of the workspace, scaled to a maximum of 1; the
    first row is the one furthest from the viewer. `blur` is the radius of the blur in metres."""
    x0, y0, x1, y1 = workspace
    found, _, _ = np.histogram2d(poses[:, Y], poses[:, X], bins=cells, range=((y0, y1), (x0, x1)))
    image = found[::-1]
    for axis, length in ((0, y1 - y0), (1, x1 - x0)):
        spread = blur / (length / cells[axis])
        far = min(math.ceil(3 * spread), cells[axis])  # in a very narrow workspace, at most its width
        reach = np.arange(-far, far + 1)
        kernel = np.exp(-0.5 * (reach / max(spread, 1e-9)) ** 2)
        image = np.array([_spread(row, kernel) for row in np.moveaxis(image, axis, -1)])
        image = np.moveaxis(image, -1, axis)
    top = float(image.max(initial=0.0))
    return np.asarray(image / top if top > 0.0 else image)


def _spread(row: Floats, kernel: Floats) -> Floats:
    half = len(kernel) // 2
    return np.convolve(row, kernel / kernel.sum())[half : half + len(row)]


def _panel(stage: PictureSetup, poses: Floats, color: RGB, size: tuple[int, int]) -> Image.Image:
    """The bare table with one object's places in its colour."""
    width, height = size
    cells = max(2, round(GRID_CELLS * height / PANEL_SIDE)), max(2, round(GRID_CELLS * width / PANEL_SIDE))
    blur = (BLUR + FEW / math.sqrt(max(len(poses), 1))) * stage.side
    share = density(poses, stage.workspace, cells, blur) ** 0.6
    bare = Image.new("RGB", size, BARE_TABLE_COLOR)
    _regions(stage, bare)
    # Pale or grey colours would not be visible on paper.
    strong = mix(color, (0.16, 0.27, 0.45), 0.75 if sum(color) > 1.9 else 0.10)
    ink = Image.new("RGB", size, (round(255 * strong[0]), round(255 * strong[1]), round(255 * strong[2])))
    cover = Image.fromarray(np.rint(235.0 * share).astype(np.uint8)).resize(size, Image.Resampling.BICUBIC)
    bare.paste(ink, mask=cover)
    draw = ImageDraw.Draw(bare)
    draw.rectangle((0, 0, width - 1, height - 1), outline=LINE)
    _heading(draw, stage, poses, size)
    return bare


def _pixels(stage: PictureSetup, size: tuple[int, int], x: float, y: float) -> tuple[float, float]:
    x0, y0, x1, y1 = stage.workspace
    return (x - x0) / (x1 - x0) * size[0], (y1 - y) / (y1 - y0) * size[1]


def _regions(stage: PictureSetup, image: Image.Image) -> None:
    draw = ImageDraw.Draw(image)
    for patch in stage.patches:
        x, y, theta = patch.pose
        match patch.footprint:
            case Circle(radius):
                corners = [
                    (radius * math.cos(k * math.tau / 60), radius * math.sin(k * math.tau / 60)) for k in range(60)
                ]
            case Box(length, width):
                corners = [(u * length / 2, v * width / 2) for u, v in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
            case polygon:
                corners = list(polygon.vertices)
        cos, sin = math.cos(theta), math.sin(theta)
        outline = [_pixels(stage, image.size, x + u * cos - v * sin, y + u * sin + v * cos) for u, v in corners]
        pale = mix(patch.color, (1.0, 1.0, 1.0), 0.72)
        draw.polygon(outline, fill=(round(255 * pale[0]), round(255 * pale[1]), round(255 * pale[2])), outline=LINE)


def _heading(draw: ImageDraw.ImageDraw, stage: PictureSetup, poses: Floats, size: tuple[int, int]) -> None:
    """An arrow at the mean place if headings agree: the mean of their unit vectors is longer than a half."""
    if not len(poses):
        return
    cos, sin = float(np.cos(poses[:, THETA]).mean()), float(np.sin(poses[:, THETA]).mean())
    if math.hypot(cos, sin) < 0.5:
        return
    turn = math.atan2(sin, cos)
    x, y = (float(value) for value in np.median(places(poses), axis=0))
    reach = ARROW * stage.side
    tips = [(1.4, 0.0), (-0.9, 0.75), (-0.45, 0.0), (-0.9, -0.75)]
    shape = [
        _pixels(
            stage,
            size,
            x + reach * (u * math.cos(turn) - v * math.sin(turn)),
            y + reach * (u * math.sin(turn) + v * math.cos(turn)),
        )
        for u, v in tips
    ]
    draw.polygon(shape, fill=(255, 255, 255), outline=(40, 40, 44))
