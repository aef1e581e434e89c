"""The mat of a stage, and the tags of its things, as drawings at 1:1."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from scenegen.arrays import Bool
from scenegen.needs import need
from scenegen.play.stage.pdf import PAPER_EDGE, PAPERS, PaperDrawing, Stroke, Words
from scenegen.play.stage.stage import TAG_CELLS, StageThing, TableStage, square_corners

RULER = 0.1  # metres
LINE_GREY, LABEL_GREY = 0.75, 0.35
TAG_ROOM = 0.012  # metres around a tag that is to be cut out


def tag_cells(tag: int) -> Bool:
    """(8, 8): which cells of a tag are black, the row at the top first. Raises RequestError without OpenCV."""
    need("cv2", "for tags")
    import cv2

    family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    found: Bool = np.asarray(cv2.aruco.generateImageMarker(family, tag, TAG_CELLS)) == 0
    return found


def draw_mat(stage: TableStage, name: str, paper: str) -> PaperDrawing:
    """The mat: tags, grid, and a ruler. Raises RequestError without OpenCV."""
    low, high = ((stage.x[0], stage.y[0]), (stage.x[1], stage.y[1]))
    low, high = (low[0] - stage.edge, low[1] - stage.edge), (high[0] + stage.edge, high[1] + stage.edge)
    parts: list[Stroke | Words] = [*draw_grid(stage), *_ruler(low[0] + stage.tag * 1.5, low[1] + stage.tag / 2.0)]
    for tag, corners in enumerate(stage.tag_corners()):
        x, y = corners.mean(axis=0).tolist()
        parts += _tag(tag, x, y, stage.tag)
    title = f"scenegen stage: mat of {name}, 1:1 (print at 100 %, not fitted to the page)"
    return PaperDrawing(low, high, parts, paper, title)


def draw_grid(stage: TableStage) -> Iterator[Stroke | Words]:
    """Lines with names, and the frame of the workspace."""
    (left, right), (near, far) = stage.x, stage.y
    letter, gap = min(0.4 * stage.step, 0.006), min(stage.margin / 2.0, 0.01)
    for name, x in stage.lines(0):
        yield Stroke([(x, near), (x, far)], 0.0002, LINE_GREY)
        for y in (near - gap, far + gap):
            yield Words(x, y, name, letter, LABEL_GREY)
    for name, y in stage.lines(1):
        yield Stroke([(left, y), (right, y)], 0.0002, LINE_GREY)
        for x in (left - gap, right + gap):
            yield Words(x, y, name, letter, LABEL_GREY)
    yield Stroke([(left, near), (right, near), (right, far), (left, far), (left, near)], 0.0005, LABEL_GREY)


def _ruler(x: float, y: float) -> Iterator[Stroke | Words]:
    yield Stroke([(x, y), (x + RULER, y)])
    for mm in range(0, 101, 5):
        yield Stroke([(x + mm / 1000.0, y), (x + mm / 1000.0, y + (0.004 if mm % 10 else 0.007))])
    yield Words(x + RULER / 2.0, y - 0.006, "this ruler is 10 cm long, or the printer has changed the size", 0.003)


def _tag(tag: int, x: float, y: float, side: float) -> Iterator[Stroke]:
    """A tag around its middle: a black square, and the white runs of its rows."""
    corners = [(x + dx, y + dy) for dx, dy in square_corners(side).tolist()]
    yield Stroke(corners, grey=0.0, fill=True)
    cell = side / TAG_CELLS
    for row, cells in enumerate(tag_cells(tag)):
        ends = np.flatnonzero(np.diff(cells.astype(int)))  # the frame is black: runs of white begin and end
        top = y + side / 2.0 - row * cell
        for begin, end in zip(ends[::2] + 1, ends[1::2] + 1, strict=True):
            low, high = x - side / 2.0 + begin * cell, x - side / 2.0 + end * cell
            yield Stroke([(low, top), (high, top), (high, top - cell), (low, top - cell)], grey=1.0, fill=True)


def draw_tags(stage: TableStage, name: str, paper: str = "a4") -> Iterator[PaperDrawing]:
    """Pages with the tags of things, each with its name and the arrow of its heading, to cut out along the frame."""
    width, height = ((side - 2.0 * PAPER_EDGE) / 1000.0 for side in PAPERS[paper])
    title = f"scenegen stage: tags of {name}, 1:1; glue each onto the middle of its thing, the arrow along the heading"
    parts: list[Stroke | Words] = []
    x = y = row = 0.0
    for thing in stage.things:
        side = thing.side * (1.0 + 2.0 / TAG_CELLS)
        if x + side + 2.0 * TAG_ROOM > width:
            x, y, row = 0.0, y + row, 0.0
        if y + side + 2.0 * TAG_ROOM > height and parts:
            yield PaperDrawing((0.0, -height), (width, 0.0), parts, paper, title)
            parts, x, y, row = [], 0.0, 0.0, 0.0
        parts += _cut_out(thing, x + side / 2.0 + TAG_ROOM, -y - side / 2.0 - TAG_ROOM, side)
        x, row = x + side + 2.0 * TAG_ROOM, max(row, side + 2.0 * TAG_ROOM)
    yield PaperDrawing((0.0, -height), (width, 0.0), parts, paper, title)


def _cut_out(thing: StageThing, x: float, y: float, side: float) -> Iterator[Stroke | Words]:
    yield from _tag(thing.tag, x, y, thing.side)
    ring = [(x + dx, y + dy) for dx, dy in square_corners(side).tolist()]
    yield Stroke([*ring, ring[0]], 0.0001, LINE_GREY)
    tip = x + side / 2.0 + 0.008
    yield Stroke([(x + side / 2.0, y), (tip, y), (tip - 0.002, y + 0.0015), (tip, y), (tip - 0.002, y - 0.0015)])
    yield Words(x, y - side / 2.0 - 0.004, f"{thing.name} ({1000.0 * thing.side:.0f} mm)", 0.003)
