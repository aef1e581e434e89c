"""kill -9 at a moment that the tests choose: before or after the n-th change that this process makes to files."""

from __future__ import annotations

import os
import signal
from pathlib import Path

WATCHED = ((os, "fsync"), (Path, "replace"), (Path, "unlink"), (Path, "rmdir"), (Path, "mkdir"), (Path, "open"))


def strike_at(moment):
    """Die at the sixth file operation for 6.0, after it for 6.5; never for None. Returns their counter."""
    count = 0
    os.fsync = lambda file: None  # a kill, unlike a loss of power, leaves to the disk what the system already has

    def watched(call):
        def watch(*args, **options):
            nonlocal count
            count += 1
            if count == moment:
                os.kill(os.getpid(), signal.SIGKILL)
            result = call(*args, **options)
            if count + 0.5 == moment:
                os.kill(os.getpid(), signal.SIGKILL)
            return result

        return watch

    for owner, name in WATCHED:
        setattr(owner, name, watched(getattr(owner, name)))
    return lambda: count
