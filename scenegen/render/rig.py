"""`cameras.json`: how every view maps the world to pixels, and what the numbers in masks mean."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

from scenegen.formats.folder import scene_name
from scenegen.render.camera import frame
from scenegen.render.files import STEP, PictureOptions
from scenegen.render.looks import VIEW, Look, Looks
from scenegen.render.picture import FIRST, GROUND, TABLE
from scenegen.scene.data import SceneFile
from scenegen.scene.stage import Stage
from scenegen.version import __version__


def cameras_json(file: SceneFile, stage: Stage, options: PictureOptions) -> bytes:
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


def drawn_looks(looks: Looks, seed: int, count: int) -> list[Look]:
    """The looks of `count` scenes."""
    return [looks.at(seed, index) for index in range(count)]


def looks_jsonl(looks: Sequence[Look], seed: int, stage: Stage, options: PictureOptions) -> bytes:
    """A line for each scene: the pictures' names, all values of its look, and if the view "look" is drawn, its camera:
    `intrinsics` (3, 3) in pixels and `world_to_camera` (4, 4), in the frames of cameras.json."""
    lines = []
    for number, look in enumerate(looks, start=1):
        names = [f"{scene_name(number, len(looks))}_{view}.png" for view in options.views]
        record: dict[str, Any] = {"scene": number, "pictures": names, "seed": seed, "version": __version__}
        record["look"] = look.as_json()
        if VIEW in options.views:
            camera = look.camera(stage.corners(), options.size)
            k = camera.intrinsics()
            record["size"] = list(options.size)
            record["intrinsics"] = [[k["fx"], 0.0, k["cx"]], [0.0, k["fy"], k["cy"]], [0.0, 0.0, 1.0]]
            record["world_to_camera"] = [
                [round(value, 12) + 0.0 for value in row] for row in camera.extrinsics().tolist()
            ]
        lines.append(json.dumps(record))
    return ("\n".join(lines) + "\n").encode()
