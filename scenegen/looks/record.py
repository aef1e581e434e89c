"""`looks.jsonl`: the look of each scene, as it was drawn."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

from scenegen.looks.camera import Camera
from scenegen.looks.look import Look
from scenegen.version import __version__

LOOKS = "looks.jsonl"


def looks_jsonl(
    looks: Sequence[Look], seed: int, files: Sequence[tuple[str, Any]], cameras: Sequence[Camera | None]
) -> bytes:
    """A line for each scene: its number, a key and value that name its files, the seed, all values of its look, and if
    there is a camera of its own, `size`, `intrinsics` (3, 3) in pixels and `world_to_camera` (4, 4), in the frames of
    cameras.json."""
    lines = []
    for number, (look, (key, names), camera) in enumerate(zip(looks, files, cameras, strict=True), start=1):
        record: dict[str, Any] = {"scene": number, key: names, "seed": seed, "version": __version__}
        record["look"] = look.as_json()
        if camera is not None:
            k = camera.intrinsics()
            record["size"] = list(camera.size)
            record["intrinsics"] = [[k["fx"], 0.0, k["cx"]], [0.0, k["fy"], k["cy"]], [0.0, 0.0, 1.0]]
            record["world_to_camera"] = [
                [round(value, 12) + 0.0 for value in row] for row in camera.extrinsics().tolist()
            ]
        lines.append(json.dumps(record))
    return ("\n".join(lines) + "\n").encode()
