"""Motions as CSV, a row for each moment: numbers alone, without spec and shapes. Other tools read it; scenegen reads
its columns `t`, `mug.x`, ... as a trajectory."""

from __future__ import annotations

import io
import math
from typing import IO

import numpy as np

from scenegen.scenes.blocks import COUNT
from scenegen.scenes.formats.motions.table import MotionArrays, columns


def write(sink: IO[bytes], motions: MotionArrays, ending: str) -> None:
    """Floats are written so that they read back bit for bit; cells of objects that are not there are empty."""
    found = columns(motions)
    sink.write(",".join(name for name, _ in found).encode() + b"\n")
    text = io.StringIO()
    whole = [name == "motion" or name.startswith(COUNT) for name, _ in found]
    for row in np.array([values for _, values in found]).T.tolist():
        text.write(",".join(_cell(x, is_whole) for x, is_whole in zip(row, whole, strict=True)))
        text.write("\n")
    sink.write(text.getvalue().encode())


def _cell(value: float, whole: bool) -> str:
    return str(int(value)) if whole else "" if math.isnan(value) else repr(value)
