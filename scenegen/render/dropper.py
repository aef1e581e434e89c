"""The process that drops scenes: the bodies as its job, then scenes on standard input, motions on standard output.

A request is a count of scenes and as many (objects, 4) float64 places; the answer is (objects, 2) float64 motions of
each. pybullet writes its banner to standard output from C code; here that stream is turned into standard error before
pybullet is imported.
"""

from __future__ import annotations

import os
import struct
import sys
from typing import Any

import numpy as np
from pydantic import TypeAdapter

from scenegen.render.bodies import Body

COUNT = struct.Struct("<Q")


def main(job: dict[str, Any]) -> None:
    """Answer requests until standard input ends."""
    channel = os.dup(1)
    os.dup2(2, 1)
    from scenegen.render.drop import World

    bodies = TypeAdapter(list[Body]).validate_python(job["bodies"])
    requests = sys.stdin.buffer
    with World(bodies) as world, os.fdopen(channel, "wb") as answers:
        while head := requests.read(COUNT.size):
            count: int = COUNT.unpack(head)[0]
            data = requests.read(count * len(bodies) * 32)
            if len(data) < count * len(bodies) * 32:
                return  # the parent has died
            for places in np.frombuffer(data).reshape(count, len(bodies), 4):
                answers.write(world.drop(places).tobytes())
            answers.flush()
