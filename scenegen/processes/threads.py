"""Runs torch on one thread, as a context manager."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Iterator
from typing import Any


@contextlib.contextmanager
def one_thread() -> Iterator[None]:
    """As many threads as in a worker: the number of threads affects how torch splits sums, and so the rounding; and for
    small batches a second thread costs more than it saves. If torch is not loaded, this does not load it."""
    torch: Any = sys.modules.get("torch")
    before = 1 if torch is None else torch.get_num_threads()
    if before == 1:
        yield
        return
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)
