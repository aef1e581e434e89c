"""The process that draws: one job as a line of JSON on standard input, files on standard output.

pybullet writes its banner to standard output from C code. Here that stream is turned into standard error before
pybullet is imported, and pictures go out through a copy of it that nothing else knows.
"""

from __future__ import annotations

import os
import struct
from dataclasses import replace
from typing import Any

import numpy as np
from pydantic import TypeAdapter

from scenegen.render.files import Wanted, encode
from scenegen.render.names import write_names
from scenegen.render.stage import Stage

LENGTH = struct.Struct("<Q")  # goes before every file: its size in bytes


def main(job: dict[str, Any]) -> None:
    """Draw `places` (scenes, objects, 4) of a job; for every scene, view by view, its files as `Wanted` lists them."""
    channel = os.dup(1)
    os.dup2(2, 1)
    from scenegen.render.painter import Painter

    wanted, stage = TypeAdapter(Wanted).validate_python(job["wanted"]), Stage.from_json(job["stage"])
    with (
        Painter(
            stage,
            wanted.views,
            wanted.size,
            transparent=wanted.transparent,
            renderer=wanted.renderer,
        ) as painter,
        os.fdopen(channel, "wb") as out,
    ):
        for rows in job["places"]:
            places = np.array(rows, dtype=np.float64).reshape(-1, 4)
            shots = painter.paint(places)
            for view in wanted.views:
                shot = shots[view]
                if wanted.names:
                    shot = replace(shot, color=write_names(shot.color, stage, painter.camera(view), places))
                for data in encode(shot, wanted):
                    out.write(LENGTH.pack(len(data)) + data)
            out.flush()
