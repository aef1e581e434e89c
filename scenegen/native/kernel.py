"""phi of every label of a core formula by machine code, for arrays of scenes."""

from __future__ import annotations

import ctypes
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from scenegen.lang.core import Core
from scenegen.native.build import build
from scenegen.native.source import Source, write

Array: TypeAlias = npt.NDArray[np.floating[Any]]

LANES = 64  # scenes in float32 of four vectors of 512 bits
SHARE = 16_384  # scenes that are worth a thread of their own
BLOCK = 4096  # scenes whose coordinates are gathered at a time where they lie apart: they stay in cache


class Kernel:
    """The formula's function for one dtype."""

    def __init__(self, source: Source, dtype: np.dtype[Any]) -> None:
        self.rows, self._labels, self._dtype = source.rows, source.labels, dtype
        self._phi = build(source.text, "phi")
        self._phi.restype = ctypes.c_long

    def __call__(self, rows: Array, out: Array, threads: int = 1) -> bool:
        """(3N, B) storage of the dtype into `out` (L, B), whose rows are contiguous; the same values whatever the batch
        and the number of threads. Returns False where a coordinate is NaN or an angle too large for the function:
        `out` then holds nothing of use."""
        count = rows.shape[1]
        taken, filled = [rows[row] for row in self.rows], list(out)
        whole = count - count % LANES
        good = True
        if whole:
            good = self._shared(taken, filled, whole, min(threads, whole // SHARE))
        if whole < count:
            # All scenes go through the same vector instructions: the last few, too, beside copies of one of them.
            some = np.empty((len(taken) + len(filled), LANES), self._dtype)
            for row, values in zip(some, taken, strict=False):
                row[: count - whole] = values[whole:]
                row[count - whole :] = values[count - 1]
            found = some[len(taken) :]
            good = self._call(list(some[: len(taken)]), list(found), 0, LANES) and good
            for values, row in zip(filled, found, strict=True):
                values[whole:] = row[: count - whole]
        return good

    def _shared(self, taken: list[Array], filled: list[Array], count: int, threads: int) -> bool:
        if threads < 2:
            return self._call(taken, filled, 0, count)
        share = -(-count // (threads * LANES)) * LANES
        starts = range(0, count, share)
        with ThreadPoolExecutor(threads) as pool:  # ctypes lets other threads run
            return all(pool.map(lambda start: self._call(taken, filled, start, min(start + share, count)), starts))

    def _call(self, taken: list[Array], filled: list[Array], start: int, stop: int) -> bool:
        if all(row.strides[0] == row.itemsize for row in taken):
            return self._run([row[start:stop] for row in taken], [row[start:stop] for row in filled])
        near = np.empty((len(taken), min(BLOCK, stop - start)), self._dtype)
        good = True
        for first in range(start, stop, BLOCK):
            some = slice(first, min(first + BLOCK, stop))
            here = list(near[:, : some.stop - first])
            for row, values in zip(here, taken, strict=True):
                row[:] = values[some]
            good = self._run(here, [row[some] for row in filled]) and good
        return good

    def _run(self, taken: list[Array], filled: list[Array]) -> bool:
        def places(rows: list[Array]) -> Any:
            return (ctypes.c_void_p * len(rows))(*(row.ctypes.data for row in rows))

        bad: int = self._phi(places(taken), places(filled), ctypes.c_long(len(filled[0])))
        return bad == 0


def make_kernel(core: Core, *, single: bool) -> Kernel:
    """The function for float64, or for float32 if `single`. Raises TooLargeError, NativeError."""
    return Kernel(write(core, single=single), np.dtype(np.float32 if single else np.float64))
