"""The outlines of a start drawn into a picture of the table, where each object is to stand; beside it the start as it
is rendered, seen by the same camera."""

from __future__ import annotations

import io
import math
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from scenegen.arrays import Array
from scenegen.errors import DataError
from scenegen.geometry.footprint import measures
from scenegen.looks.camera import from_place
from scenegen.looks.chart_style import INK, PAPER
from scenegen.play.stage.camera import Photograph, StageCamera
from scenegen.play.stage.check import check_poses, describe_shift
from scenegen.play.stage.measure import check_table, pose_by_tag, poses_by_tags
from scenegen.play.stage.stage import TableStage, outline_at
from scenegen.play.suites.suite import GradedStart

OUTLINE_COLORS = ((255, 140, 0), (0, 190, 255), (255, 70, 170), (150, 220, 40), (255, 225, 60), (170, 130, 255))
PANE_HEIGHT, MOST_PANE_WIDTH = 900, 1400  # pixels
DRAWN_LARGER = 3  # lines are drawn so much larger, then scaled down
FIELD_LIMITS = (5.0, 100.0)  # degrees that the renderer takes
AIR = 0.04  # around the grid, of its size in the picture
ARROW_HEAD_SHARE = 0.35  # of an arrow: how long its head is, and how wide
MOST_EDGES = 12  # of an outline whose upright edges are drawn
SHOWN_ERROR = 0.005  # metres: an object that is off by more gets an arrow
Project = Callable[[Array], Array]  # points (P, 3) of the mat's frame -> places (P, 2) in a pane


def draw_overlay(
    stage: TableStage,
    start: GradedStart,
    photo: Photograph,
    camera: StageCamera,
    said: str = "",
    beside: Image.Image | None = None,
) -> bytes:
    """A PNG: the part of the picture with the grid, with each object's outline on the table and at its top, its name
    and place, and the arrow of its heading; from where it stands to where it should, where its tag is seen. Below it
    what is `said` of it, on the right what `render_start` made."""
    seen = camera.project(_frame_corners(stage, start))
    low, high = _crop(seen, photo.picture.shape[1], photo.picture.shape[0])
    zoom = min(PANE_HEIGHT / (high[1] - low[1]), MOST_PANE_WIDTH / (high[0] - low[0]))
    size = round((high[0] - low[0]) * zoom), round((high[1] - low[1]) * zoom)
    picture = Image.fromarray(photo.picture).convert("RGB").resize(size, Image.Resampling.LANCZOS, (*low, *high))
    pane = _Pane(picture, lambda points: (camera.project(points) + 0.5 - low) * zoom)
    moves = {}
    for which, (thing, height) in enumerate(stage.tops(start)):
        if thing.tag in photo.tags:
            stood, _ = pose_by_tag(thing, height, photo, camera)
            off = start.task.scenes.poses[start.row][which] - stood
            if math.hypot(*off[:2]) > SHOWN_ERROR:
                moves[which] = stood, f"move it {describe_shift(*off[:2].tolist())}"
    pane.draw_start(stage, start, moves)
    title = f"episode {start.number}: {start.task.name}, {start.band}. {start.task.instruction}"
    sink = io.BytesIO()
    _join([pane.finish(), *([] if beside is None else [beside])], [title, said]).save(sink, "PNG")
    return sink.getvalue()


def judge_picture(stage: TableStage, start: GradedStart, photo: Photograph, camera: StageCamera) -> str:
    """The last line of what `scenegen stage check` says of a picture, or why it says nothing."""
    try:
        poses = poses_by_tags(stage, start, photo, camera)
        check_table(stage, start, poses)
        return check_poses(start, poses).lines(stage)[-1]
    except DataError as error:
        return error.diagnostics[0].text("title")


def render_start(stage: TableStage, start: GradedStart, camera: StageCamera) -> Image.Image:
    """A start in 3D as the camera of a photograph would see it, with names and arrows. Raises RequestError without
    pybullet."""
    eye, target, size, field, roll = _view_of(stage, start, camera)
    with tempfile.TemporaryDirectory() as folder:
        looks = Path(folder) / "camera.toml"
        looks.write_text(
            f"[camera]\nposition = {eye.tolist()}\nlook_at = {target.tolist()}\nfov = {field}\nroll = {roll}\n"
        )
        drawn = start.task.scenes[[start.row]].render(Path(folder) / "drawn", size=size, looks=looks, workers=1)
        with Image.open(drawn.pictures[0]) as opened:
            picture = opened.convert("RGB")
    pane = _Pane(picture, from_place(_frame_corners(stage, start), size, eye, target, field, roll).project)
    pane.draw_start(stage, start)
    return pane.finish()


def _view_of(
    stage: TableStage, start: GradedStart, camera: StageCamera
) -> tuple[Array, Array, tuple[int, int], float, float]:
    """Of a picture as large as a pane: where the camera is and what it looks at (3,), the size in pixels, and its field
    and roll in degrees."""
    points = _frame_corners(stage, start)
    eye, target = -camera.turn.T @ camera.shift, np.array([sum(stage.x) / 2.0, sum(stage.y) / 2.0, 0.0])
    right = from_place(points, (2, 2), eye, target, 60.0).extrinsics()[:2, :3] @ camera.turn[0]
    roll = math.degrees(math.atan2(right[1], right[0]))
    turned = from_place(points, (2, 2), eye, target, 60.0, roll).extrinsics()
    across, down, ahead = turned[:3, :3] @ points.T + turned[:3, 3:]
    wide, high = (float((1.0 + AIR) * np.abs(slope / ahead).max()) for slope in (across, down))
    size = min(MOST_PANE_WIDTH, round(PANE_HEIGHT * wide / high)), PANE_HEIGHT
    field = 2.0 * math.degrees(math.atan(max(high, wide * size[1] / size[0])))
    return eye, target, size, min(max(field, FIELD_LIMITS[0]), FIELD_LIMITS[1]), roll


class _Pane:
    """A picture to be drawn on: lines in a layer that is larger, so that they are smooth."""

    def __init__(self, picture: Image.Image, project: Project) -> None:
        self.picture = picture
        self._project, self._unit = project, DRAWN_LARGER * picture.height / PANE_HEIGHT
        size = DRAWN_LARGER * picture.width, DRAWN_LARGER * picture.height
        self._layer = Image.new("RGBA", size)
        self._draw = ImageDraw.Draw(self._layer)
        self._font = ImageFont.load_default(size=17.0 * self._unit)
        self._taken: list[tuple[float, float, float, float]] = []

    def draw_start(
        self, stage: TableStage, start: GradedStart, moves: dict[int, tuple[Array, str]] | None = None
    ) -> None:
        """All objects of a start, of which nothing but a heading is to be seen without `moves`; of those in `moves`,
        the pose where one stands, and words."""
        spec, labels = start.task.spec.checked, []
        for which, pose in enumerate(start.task.scenes.poses[start.row]):
            shape, base = spec.shapes[which], float(start.poses[which, 2])
            color = OUTLINE_COLORS[which % len(OUTLINE_COLORS)]
            floor, top = (self._places(outline_at(shape, pose), base + high) for high in (0.0, shape.height))
            if moves is not None:
                self._draw.polygon(floor, fill=(*color, 60))
                for corners in zip(floor, top, strict=True) if len(floor) <= MOST_EDGES else ():
                    self._line([*corners], color, 1.4)
                self._line([*floor, floor[0]], color, 3.0)
            self._line([*top, top[0]], color, 1.4)
            if not stage.thing(spec, which).is_round:
                way = 1.5 * measures(shape.footprint).outer * np.array([math.cos(pose[2]), math.sin(pose[2])])
                self._arrow(pose[:2], pose[:2] + way, base + shape.height, color)
            words = [f"{start.objects[which]}: {stage.name_place(*pose[:2].tolist())}"]
            if moves and which in moves:
                stood, move = moves[which]
                self._arrow(stood[:2], pose[:2], base, (255, 255, 255))
                words.append(move)
            ends = np.array([*floor, *top])
            box = (*ends.min(axis=0).tolist(), *ends.max(axis=0).tolist())
            self._taken.append(box)
            labels.append((box, words, color))
        for box, words, color in labels:
            self._label(box, words, color)

    def finish(self) -> Image.Image:
        layer = self._layer.resize(self.picture.size, Image.Resampling.LANCZOS)
        return Image.alpha_composite(self.picture.convert("RGBA"), layer).convert("RGB")

    def _places(self, flat: Array, height: float) -> list[tuple[float, float]]:
        points = self._project(np.column_stack([flat, np.full(len(flat), height)]))
        return [(DRAWN_LARGER * float(u), DRAWN_LARGER * float(v)) for u, v in points]

    def _line(self, places: list[tuple[float, float]], color: tuple[int, int, int], wide: float) -> None:
        """A line with a dark edge, which is seen on light and dark alike."""
        for fill, width in (((*INK, 190), wide + 1.6), ((*color, 255), wide)):
            self._draw.line(places, fill, round(width * self._unit), joint="curve")

    def _arrow(self, begin: Array, tip: Array, height: float, color: tuple[int, int, int]) -> None:
        way = tip - begin
        side = ARROW_HEAD_SHARE * np.array([-way[1], way[0]]) / 2.0
        neck = tip - ARROW_HEAD_SHARE * way
        self._line(self._places(np.array([begin, neck]), height), color, 3.0)
        corners = self._places(np.array([tip, neck + side, neck - side]), height)
        self._line([*corners, corners[0]], color, 1.5)
        self._draw.polygon(corners, fill=(*color, 255))

    def _label(self, box: tuple[float, ...], words: list[str], color: tuple[int, int, int]) -> None:
        """Words beside a box where least else is."""
        text, pad = "\n".join(words), 7.0 * self._unit
        left, top, right, bottom = self._draw.multiline_textbbox((0, 0), text, self._font, spacing=pad)
        width, height = right - left + 2.0 * pad, bottom - top + 2.0 * pad
        spots = [self._inside(x, y, width, height) for x, y in _spots(box, width, height, 12.0 * self._unit)]
        spot = min(spots, key=lambda one: sum(_overlap(one, other) for other in self._taken))
        self._taken.append(spot)
        self._draw.rounded_rectangle(spot, pad, (*INK, 225), (*color, 255), round(1.5 * self._unit))
        place = spot[0] + pad - left, spot[1] + pad - top
        self._draw.multiline_text(place, text, (255, 255, 255, 255), self._font, spacing=pad)

    def _inside(self, x: float, y: float, width: float, height: float) -> tuple[float, float, float, float]:
        x = max(0.0, min(x, self._layer.width - width))
        y = max(0.0, min(y, self._layer.height - height))
        return x, y, x + width, y + height


def _spots(box: tuple[float, ...], width: float, height: float, gap: float) -> Iterator[tuple[float, float]]:
    """Upper left corners of labels around a box: above, below, to the right and to the left."""
    left, top, right, bottom = box
    x, y = (left + right - width) / 2.0, (top + bottom - height) / 2.0
    yield from ((x, top - gap - height), (x, bottom + gap), (right + gap, y), (left - gap - width, y))


def _overlap(one: tuple[float, ...], other: tuple[float, ...]) -> float:
    width, height = (min(one[axis + 2], other[axis + 2]) - max(one[axis], other[axis]) for axis in (0, 1))
    return max(0.0, width) * max(0.0, height)


def _frame_corners(stage: TableStage, start: GradedStart) -> Array:
    """(8, 3): what a pane shows: the grid with its names, and as high as the highest object."""
    x, y = ((low - stage.margin, high + stage.margin) for low, high in (stage.x, stage.y))
    high = max(height for _, height in stage.tops(start))
    return np.array([(u, v, z) for u in x for v in y for z in (0.0, high)])


def _crop(seen: Array, width: int, height: int) -> tuple[Array, Array]:
    """Corners of a part of a picture around places (P, 2) in it."""
    air = AIR * np.ptp(seen, axis=0).max()
    low = np.clip(seen.min(axis=0) - air, 0.0, (width - 1.0, height - 1.0))
    return low, np.clip(seen.max(axis=0) + air, low + 1.0, (width, height))


def _join(panes: list[Image.Image], lines: list[str]) -> Image.Image:
    """Pictures of one height side by side, and lines below them."""
    tall = panes[0].height
    panes = [one.resize((round(one.width * tall / one.height), tall), Image.Resampling.LANCZOS) for one in panes]
    gap, font = 12, ImageFont.load_default(size=20)
    whole = Image.new("RGB", (sum(one.width for one in panes) + gap * (len(panes) - 1), tall + 36 * len(lines)), PAPER)
    x = 0
    for one in panes:
        whole.paste(one, (x, 0))
        x += one.width + gap
    draw = ImageDraw.Draw(whole)
    for k, line in enumerate(lines):
        draw.text((10, tall + 6 + 34 * k), line, INK, font)
    return whole
