"""The process that cuts one mesh: a pickle of vertices, faces and options comes in, one of pieces goes out."""

from __future__ import annotations

import os
import pickle
import sys

import numpy as np


def main() -> None:
    """Read an order from standard input, and answer it on standard output."""
    answer = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what CoACD prints
    vertices, faces, options = pickle.load(sys.stdin.buffer)  # noqa: S301 - from our own parent
    import coacd

    coacd.set_log_level("off")
    pieces = coacd.run_coacd(coacd.Mesh(vertices, faces.astype(np.int32)), **options)
    made = [(np.asarray(v, dtype=np.float64), np.asarray(f, dtype=np.int64)) for v, f in pieces]
    with answer:
        pickle.dump(made, answer, protocol=5)
