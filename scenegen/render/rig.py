"""`cameras.json`: how every view maps the world to pixels, and what the numbers in masks mean."""

from __future__ import annotations

import json
from typing import Any

from scenegen.render.camera import frame
from scenegen.render.files import STEP, PictureOptions
from scenegen.render.picture import FIRST, GROUND, TABLE
from scenegen.scene.data import SceneFile
from scenegen.scene.stage import Stage


def cameras_json(file: SceneFile, stage: Stage, options: PictureOptions) -> bytes:
    """The file's content. World: metres, x to the right, y away from the viewer, z up, 0 the table. Camera: x to the
    right, y down, z ahead. Pixels: u to the right, v down, (0, 0) the upper left corner of the picture, so that the
    middle of the first pixel is (0.5, 0.5)."""
    views: dict[str, Any] = {}
    for view in options.views:
        camera = frame(view, stage.corners(), options.size)
        kind = "orthographic" if camera.orthographic else "perspective"
        views[view] = {
            "kind": kind,
            "intrinsics": camera.intrinsics(),
            "world_to_camera": [[round(value, 12) + 0.0 for value in row] for row in camera.extrinsics().tolist()],
        }
    ids = {GROUND: "ground", TABLE: "table"}
    boards = [region.name for region in file.regions if region.height]
    ids |= dict(enumerate([*(item.name for item in file.objects), *boards], FIRST))
    data = {
        "size": list(options.size),
        "formula": {
            "perspective": "u = fx x / z + cx, v = fy y / z + cy",
            "orthographic": "u = fx x + cx, v = fy y + cy",
        },
        "depth": {"png_unit_in_metres": STEP, "of": "z of the camera's frame at the middle of each pixel"},
        "views": views,
        "ids": {str(number): name for number, name in ids.items()},
    }
    return (json.dumps(data, indent=2, ensure_ascii=False) + "\n").encode()
