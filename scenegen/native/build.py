"""The text of a function in C -> the function, by the C compiler of this machine."""

from __future__ import annotations

import ctypes
import os
import shlex
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Any

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
