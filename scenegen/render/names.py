"""Names on pictures, beside the blocks that represent objects which are not in the library."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from scenegen.looks.camera import Camera, Floats
from scenegen.render.picture import Picture
from scenegen.scene.stage import Stage

INK, PAPER = (38, 40, 44), (255, 255, 255)
LEAST, SHARE = 10, 32  # minimum font size in pixels, and the height of a picture in lines


def write_names(color: Picture, stage: Stage, camera: Camera, places: Floats) -> Picture:
    """A picture (h, w, 3 or 4) with the label of every object that has one, above it; places are (objects, 4)."""
    labels = [(thing, place) for thing, place in zip(stage.things, places, strict=True) if thing.label]
    if not labels:
        return color
    image = Image.fromarray(color)
    draw = ImageDraw.Draw(image)
    size = max(LEAST, camera.size[1] // SHARE)
    font = ImageFont.load_default(size=size)
    for thing, (x, y, _, z) in labels:
        if np.isnan(x):  # it is not there
            continue
        top = (x, y, z + thing.shape.height)
        reach = max(thing.shape.footprint.extent) / 2.0
        at, beyond = camera.project([top, (x, y + reach, top[2])])
        if not _seen([at, beyond], camera.size):
            continue
        spot = float(at[0]), float(min(at[1], beyond[1])) - 0.25 * size
        draw.text(spot, thing.label, INK, font, anchor="ms", stroke_width=max(1, size // 6), stroke_fill=PAPER)
    return np.asarray(image)


def _seen(points: Sequence[Floats], size: tuple[int, int]) -> bool:
    return all(bool((point >= 0.0).all() and (point < size).all()) for point in points)
