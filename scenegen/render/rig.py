"""`cameras.json`: how every view maps the world to pixels, and what the numbers in masks mean."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

from scenegen.formats.folder import scene_name
from scenegen.looks.camera import frame
from scenegen.looks.look import VIEW, Look
from scenegen.looks.record import looks_jsonl
from scenegen.render.files import STEP, PictureOptions
from scenegen.render.picture import FIRST, GROUND, TABLE
from scenegen.scene.data import SceneFile
from scenegen.scene.stage import Stage


def cameras_json(file: SceneFile, stage: Stage, options: PictureOptions, looks: Sequence[Look] = ()) -> bytes:
    """The file's content. World: metres, x to the right, y away from the viewer, z up, 0 the table. Camera: x to the
    right, y down, z ahead. Pixels: u to the right, v down, (0, 0) the upper left corner of the picture, so that the
    middle of the first pixel is (0.5, 0.5)."""
    views: dict[str, Any] = {}
    for view in options.views:
        if view == VIEW:  # a camera for each picture: looks.jsonl has them
            continue
        camera = frame(view, stage.corners(), options.size)
        kind = "orthographic" if camera.orthographic else "perspective"
        views[view] = {
            "kind": kind,
            "intrinsics": camera.intrinsics(),
            "world_to_camera": [[round(value, 12) + 0.0 for value in row] for row in camera.extrinsics().tolist()],
        }
    ids = {GROUND: "ground and walls" if any(look.walls_distance for look in looks) else "ground", TABLE: "table"}
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


def recorded(looks: Sequence[Look], seed: int, stage: Stage, options: PictureOptions) -> bytes:
    """`looks.jsonl`: each scene's pictures and look, with the camera of the view "look" if that is drawn."""
    names = [f"{scene_name(number, len(looks))}_" for number in range(1, len(looks) + 1)]
    files = [("pictures", [f"{name}{view}.png" for view in options.views]) for name in names]
    own = VIEW in options.views
    cameras = [look.camera(stage.corners(), options.size) if own else None for look in looks]
    return looks_jsonl(looks, seed, files, cameras)
