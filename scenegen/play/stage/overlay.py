"""The outlines of a start drawn into a picture of the table: where each object is to stand."""

from __future__ import annotations

import io
import math
import tempfile
from typing import TYPE_CHECKING

import numpy as np

from scenegen.arrays import Array
from scenegen.geometry.footprint import measures
from scenegen.needs import is_installed
from scenegen.play.stage.camera import Photograph, StageCamera
from scenegen.play.stage.stage import TableStage, outline_at
from scenegen.play.suites.suite import GradedStart

if TYPE_CHECKING:
    from PIL import Image

BASE_COLOR, TOP_COLOR = (255, 120, 0), (0, 200, 255)  # RGB
LINE_SHARE = 700  # the picture's width over that of lines
RENDERED_SIZE = (640, 480)  # pixels


def draw_overlay(
    stage: TableStage, start: GradedStart, photo: Photograph, camera: StageCamera, *, rendered: bool = True
) -> bytes:
    """A PNG: the picture with each object's outline on the table and at its top, its name, and the arrow of its
    heading; with `rendered` beside it the start in 3D, where pybullet is installed."""
    from PIL import Image, ImageDraw

    picture = Image.fromarray(np.asarray(photo.grey)).convert("RGB")
    draw, wide = ImageDraw.Draw(picture), max(2, picture.width // LINE_SHARE)
    spec = start.task.spec.checked
    for which, pose in enumerate(start.task.scenes.poses[start.row]):
        shape, base = spec.shapes[which], float(start.poses[which, 2])
        outline = outline_at(shape, pose)
        for height, color in ((base, BASE_COLOR), (base + shape.height, TOP_COLOR)):
            seen = _pixels(camera, outline, height)
            draw.line([*seen, seen[0]], fill=color, width=wide)
        if not stage.thing(spec, which).is_round:
            tip = pose[:2] + measures(shape.footprint).outer * np.array([math.cos(pose[2]), math.sin(pose[2])])
            draw.line(_pixels(camera, np.array([pose[:2], tip]), base), fill=BASE_COLOR, width=wide)
        draw.text(_pixels(camera, pose[None, :2], base)[0], start.objects[which], fill=BASE_COLOR, font_size=14 * wide)
    if rendered and is_installed("pybullet"):
        picture = _join(picture, _render(start))
    sink = io.BytesIO()
    picture.save(sink, "PNG")
    return sink.getvalue()


def _pixels(camera: StageCamera, flat: Array, height: float) -> list[tuple[float, float]]:
    points = np.column_stack([flat, np.full(len(flat), height)])
    return [(float(u), float(v)) for u, v in camera.project(points)]


def _render(start: GradedStart) -> Image.Image:
    from PIL import Image

    with tempfile.TemporaryDirectory() as folder:
        some = start.task.scenes[[start.row]]
        drawn = some.render(folder, views=("perspective",), size=RENDERED_SIZE, workers=1)
        with Image.open(drawn.pictures[0]) as picture:
            return picture.convert("RGB")


def _join(picture: Image.Image, other: Image.Image) -> Image.Image:
    """Two pictures, the second at the height of the first."""
    from PIL import Image

    other = other.resize((round(other.width * picture.height / other.height), picture.height))
    both = Image.new("RGB", (picture.width + other.width, picture.height))
    both.paste(picture, (0, 0))
    both.paste(other, (picture.width, 0))
    return both
