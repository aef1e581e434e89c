"""The process that draws one scene at a time: places on standard input, pixels on standard output.

A request is a count of objects and as many (x, y, theta, height) in float64; the answer is (height, width, 3) bytes.
pybullet writes its banner to standard output from C code; here that stream is turned into standard error before
pybullet is imported.
"""

from __future__ import annotations

import os
import struct
import sys
from typing import Any

import numpy as np

from scenegen.render.names import write_names
from scenegen.render.stage import Stage

REQUEST = struct.Struct("<Q")


def main(job: dict[str, Any]) -> None:
    """Answer requests until standard input ends."""
    channel = os.dup(1)
    os.dup2(2, 1)
    from scenegen.render.painter import Painter

    stage, view = Stage.from_json(job["stage"]), str(job["view"])
    width, height = job["size"]
    requests = sys.stdin.buffer
    with Painter(stage, (view,), (width, height)) as painter, os.fdopen(channel, "wb") as answers:
        while head := requests.read(REQUEST.size):
            data = requests.read(REQUEST.unpack(head)[0] * 32)
            places = np.frombuffer(data).reshape(-1, 4)
            shot = painter.paint(places)[view]
            color = write_names(shot.color, stage, painter.camera(view), places)
            answers.write(np.ascontiguousarray(color[..., :3], dtype=np.uint8).tobytes())
            answers.flush()
