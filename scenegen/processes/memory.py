"""Memory that is kept for the next arrays.

Arrays of some MB come and go all the time. By default glibc gives their pages back to the system each time, and takes
them again one by one: 7 of 22 s of a request with many small pieces (100,000 scenes of tea_party). Programs of ours
therefore keep up to 256 MB that are free, and share them among their threads, whose own ones glibc would give back
all the same. Python programs that use scenegen decide for themselves.
"""

from __future__ import annotations

import ctypes
import gc
import os

GARBAGE = 200_000  # objects that are made between two searches for cycles
KEPT = 1 << 28  # bytes
VARIABLES = {  # for processes to be started
    "MALLOC_MMAP_THRESHOLD_": str(KEPT),
    "MALLOC_TRIM_THRESHOLD_": str(KEPT),
    "MALLOC_ARENA_MAX": "1",
}
_TRIM_THRESHOLD, _MMAP_THRESHOLD, _ARENA_MAX = -1, -3, -8  # of mallopt


def keep_memory() -> None:
    """The same for this process, unless its environment says otherwise. Other C libraries know nothing of it."""
    if not VARIABLES.keys().isdisjoint(os.environ):
        return
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None) if os.name == "posix" else None
    if mallopt is not None:
        mallopt(_TRIM_THRESHOLD, KEPT)
        mallopt(_MMAP_THRESHOLD, KEPT)
        mallopt(_ARENA_MAX, 1)


def seldom_search() -> None:
    """Search for cycles of garbage less often than Python does by itself. Loading makes a hundred thousand objects that
    stay: to search among them is a tenth of a small request. Lines of text are made a fifth faster."""
    gc.set_threshold(GARBAGE)
