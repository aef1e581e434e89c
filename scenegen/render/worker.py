"""The process that draws: one job as a line of JSON on standard input, PNG files on standard output.

pybullet writes its banner to standard output from C code. Here that stream is turned into standard error before
pybullet is imported, and pictures go out through a copy of it that nothing else knows.
"""

from __future__ import annotations

import io
import os
import struct
from typing import Any

import numpy as np
import numpy.typing as npt
from PIL import Image

from scenegen.render.stage import Stage

LENGTH = struct.Struct("<Q")  # goes before every picture: its size in bytes


def png(picture: npt.NDArray[np.uint8]) -> bytes:
    """(height, width, 3) as a PNG file."""
    out = io.BytesIO()
    Image.fromarray(picture).save(out, format="PNG", compress_level=5)
    return out.getvalue()


def main(job: dict[str, Any]) -> None:
    """Draw `poses` (scenes, objects, 3) of a job; for every scene, the pictures follow in the order of `views`."""
    channel = os.dup(1)
    os.dup2(2, 1)
    from scenegen.render.painter import Painter

    views = tuple(job["views"])
    with Painter(Stage.from_json(job["stage"]), views, tuple(job["size"])) as painter, os.fdopen(channel, "wb") as out:
        for poses in job["poses"]:
            pictures = painter.paint(np.array(poses, dtype=np.float64).reshape(-1, 3))
            for view in views:
                data = png(pictures[view])
                out.write(LENGTH.pack(len(data)) + data)
            out.flush()
