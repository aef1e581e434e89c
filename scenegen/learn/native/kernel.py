"""phi of every label of a core formula by machine code, for arrays of scenes."""

from __future__ import annotations

import ctypes
import os
import shlex
import shutil
import subprocess
import tempfile
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from scenegen.geometry.namespace import turning
from scenegen.lang.formula.core import Core, read_rows
from scenegen.lang.formula.headings import bare_rows
from scenegen.lang.formula.interpret import Numbers, fold
from scenegen.learn.native.functions import DOUBLE, SINGLE, preamble
from scenegen.learn.native.numbers import CodeLines, Functions, Number, made
from scenegen.pose import THETA, axis_of, row_count

# --------------------------------------------------------------------------------------------------------------------
# Core formula -> the text of a function in C that computes phi of every label for many scenes.


MOST_LINES = 4_000  # operations of a function


@dataclass(frozen=True, slots=True)
class KernelSource:
    """The text of `long phi(const number *const *rows, number *const *phi, long count)`. `rows` are those of the
    storage that it reads, in this order, and `phi` a row for each of the labels. It returns 0, or something else where
    a coordinate was NaN or an angle too large for it, and phi is not to be used."""

    text: str
    rows: tuple[int, ...]
    labels: int


def write(core: Core, *, single: bool) -> KernelSource:
    """The function for float64, or for float32 if `single`. Raises TooLargeError."""
    read = sorted(read_rows(core))
    lines = CodeLines(MOST_LINES)
    functions = Functions(lines)
    bare = bare_rows(core)
    rows = [Number(lines, f"row{row}") for row in range(row_count(len(core.objects)))]
    for row in bare:
        rows[row] = made(lines, "heading({})", rows[row])
    headings = [rows[row] for row in read if axis_of(row) == THETA]
    values = fold(core.nodes, Numbers(turning(functions, headings), rows))
    results = [made(lines, "{}", values[node]).name for node in core.labels.values()]
    constants = SINGLE if single else DOUBLE
    text = "\n".join(
        (
            preamble(constants),
            "long phi(const number *const *rows, number *const *phi, long count)",
            "{",
            "  bits bad = 0;",
            *(f"  const number *restrict in{row} = rows[{place}];" for place, row in enumerate(read)),
            *(f"  number *restrict out{place} = phi[{place}];" for place in range(len(results))),
            "#pragma omp simd reduction(|: bad)",
            "  for (long i = 0; i < count; i++) {",
            *(f"    number row{row} = in{row}[i];" for row in read),
            *(f"    {line}" for line in lines.lines),
            *(f"    out{place}[i] = {name};" for place, name in enumerate(results)),
            f"    bad |= {_bad([f'row{row}' for row in read], [angle.name for angle in functions.angles])};",
            "  }",
            "  return bad != 0;",
            "}\n",
        )
    )
    return KernelSource(text, tuple(read), len(results))


def _bad(rows: list[str], angles: list[str]) -> str:
    """What says that a row is NaN, or an angle too large (or NaN, too). Two rows take one comparison."""
    rest = [row for row in rows if row not in angles]
    pairs = [f"__builtin_isunordered({a}, {b})" for a, b in zip(rest[::2], [*rest[1::2], *rest[-1:]], strict=False)]
    return " | ".join([*(f"!(FABS({angle}) <= LARGEST)" for angle in angles), *pairs]) or "0"


# --------------------------------------------------------------------------------------------------------------------
# The text of a function in C -> the function, by the C compiler of this machine.


# Vector instructions of this very machine. A product and a sum may become one instruction, which rounds once; nothing
# else changes a result.
FLAGS = (
    "-std=gnu11 -O3 -march=native -fopenmp-simd -ffp-contract=fast -fno-math-errno -fno-trapping-math -fPIC -shared"
).split()
# Instructions in an order that keeps more numbers in registers: a sixth faster. Not every compiler has it.
ORDERED = ["-fschedule-insns", "-fsched-pressure"]
NAMES = ("cc", "gcc", "clang")


class NativeError(Exception):
    """There is no machine code; the message says why."""


def build(text: str, name: str) -> Any:
    """The function of this name. Its library lies in a temporary folder, which is gone before this returns. Raises
    NativeError."""
    compiler = _compiler()
    try:
        with tempfile.TemporaryDirectory(prefix="scenegen-") as folder:
            source, library = Path(folder) / "formula.c", Path(folder) / "formula.so"
            source.write_text(text, encoding="ascii")
            for flags in ([*FLAGS, *ORDERED], FLAGS):
                command = [*compiler, *flags, "-o", str(library), str(source), "-lm"]
                done = subprocess.run(command, check=False, capture_output=True, text=True, stdin=subprocess.DEVNULL)
                if not done.returncode:
                    return getattr(ctypes.CDLL(str(library)), name)
    except OSError as error:
        raise NativeError(str(error)) from None
    said = done.stderr.strip().splitlines() or [f"exit status {done.returncode}"]
    raise NativeError(f"{compiler[0]} failed: {said[0]}")


def _compiler() -> list[str]:
    """The words that call it: those of the variable CC, or the first that is installed. Raises NativeError."""
    given = shlex.split(os.environ.get("CC", ""))
    if given:
        return given
    for name in NAMES:
        if shutil.which(name):
            return [name]
    raise NativeError(f"no C compiler ({', '.join(NAMES)}) is on the PATH")


Array: TypeAlias = npt.NDArray[np.floating[Any]]

LANES = 64  # scenes in float32 of four vectors of 512 bits
SHARE = 16_384  # scenes that are worth a thread of their own
BLOCK = 4096  # scenes whose coordinates are gathered at a time where they lie apart: they stay in cache


class Kernel:
    """The formula's function for one dtype."""

    def __init__(self, source: KernelSource, dtype: np.dtype[Any]) -> None:
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
