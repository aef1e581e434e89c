"""Motions as CSV, a row for each moment: numbers alone, without spec and shapes. Other tools read it; scenegen reads
its columns `t`, `mug.x`, ... as a trajectory."""

from __future__ import annotations

import io
from typing import IO

import numpy as np

from scenegen.formats.motions.table import MotionArrays, columns


def write(sink: IO[bytes], motions: MotionArrays, ending: str) -> None:
    """Floats are written so that they read back bit for bit."""
    found = columns(motions)
    sink.write(",".join(name for name, _ in found).encode() + b"\n")
    text = io.StringIO()
    whole = [name == "motion" for name, _ in found]
    for row in np.array([values for _, values in found]).T.tolist():
        text.write(",".join(str(int(x)) if is_whole else repr(x) for x, is_whole in zip(row, whole, strict=True)))
        text.write("\n")
    sink.write(text.getvalue().encode())
