"""Work on a store that may fail for a while: tried again with growing waits, told once, and failures in few words."""

from __future__ import annotations

import contextlib
import re
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TypeVar

import pyarrow

T = TypeVar("T")

PATIENCE = 60.0  # seconds for which a store that fails is asked again
FIRST_WAIT, LONGEST_WAIT = 0.25, 8.0  # seconds between tries, doubled each time
FAILURES = (OSError, pyarrow.ArrowException)
# Of the answers of object stores, those that another try cannot change. pyarrow has no types for them.
_FINAL = re.compile(r"ACCESS_DENIED|NO_SUCH_BUCKET|INVALID_ACCESS_KEY|SIGNATURE_DOES_NOT|NoSuchBucket|AccessDenied")

_SAID = {
    "NO_SUCH_BUCKET": "there is no such bucket",
    "ACCESS_DENIED": "access denied",
    "INVALID_ACCESS_KEY": "the access key is not known there",
    "SIGNATURE_DOES_NOT": "the secret key is wrong",
    "SLOW_DOWN": "the store is too busy",
    "SERVICE_UNAVAILABLE": "the store is unavailable",
    "HTTP status 503": "the store is unavailable",
    "NETWORK_CONNECTION": "the store does not answer",
    "INTERNAL_FAILURE": "the store failed",
}


@dataclass(slots=True)
class Attempts:
    """One piece of work and its tries, within `patience` seconds. `tell` is called once, with the first error that
    another try may mend."""

    patience: float
    tell: Callable[[Exception], None]
    tries: int = 0
    started: float = field(default_factory=lambda: time.monotonic())

    @property
    def seconds(self) -> float:
        """Since the first try."""
        return time.monotonic() - self.started

    def run(self, work: Callable[[], T]) -> T:
        """The result of the work. Raises its last error."""
        wait = FIRST_WAIT
        while True:
            self.tries += 1
            try:
                return work()
            except FAILURES as error:
                if final(error) or self.seconds + wait > self.patience:
                    raise
                if self.tries == 1:
                    self.tell(error)
            time.sleep(wait)
            wait = min(2.0 * wait, LONGEST_WAIT)


def final(error: Exception) -> bool:
    """Whether another try cannot change an answer."""
    return isinstance(error, FileNotFoundError | PermissionError) or _FINAL.search(str(error)) is not None


def reason_of(error: Exception) -> str:
    """An error in few words. Those of pyarrow are for programmers, and long; AWS's names in capitals are in them."""
    said = next((words for name, words in _SAID.items() if name in str(error)), None)
    if said is not None:
        return said
    if isinstance(error, OSError) and error.strerror:
        return error.strerror.lower()
    line = (str(error).splitlines() or [type(error).__name__])[0].rstrip(".")
    with contextlib.suppress(ValueError):
        line = line[: line.index(" Detail: ")]
    return line if len(line) <= 160 else f"{line[:157]}..."
