"""What a run without a terminal says while scenes are gathered: a line now and then, with numbers and what is left."""

from __future__ import annotations

import time
from collections.abc import Callable

from scenegen.training.recipes import GATHERING, SECONDS

FIRST, EVERY = 3.0, 10.0  # seconds: what is quickly done says nothing


class GatheringLines:
    """Called as `scenegen.training.datasets.gathering` says; returns the line that is due, or None. `used` are seconds
    of CPU."""

    def __init__(
        self, clock: Callable[[], float] = time.monotonic, used: Callable[[], float] = time.process_time
    ) -> None:
        self._clock, self._used, self._first = clock, used, used()
        self._began = self._due = clock()
        self._due += FIRST
        self._stage = ""
        self._seen: tuple[float, int] = (self._began, 0)  # when, and how many: of the last line of this stage

    def used(self) -> float:
        """Seconds of CPU so far, SECONDS at most."""
        return min(SECONDS, self._used() - self._first)

    def __call__(self, stage: str, done: int, wanted: int) -> str | None:
        now = self._clock()
        if stage != self._stage:
            self._stage, self._seen = stage, (now, 0)
        if now < self._due:
            return None
        self._due = now + EVERY
        if not wanted:
            return f"{stage}, {now - self._began:.0f} s so far"
        if stage == GATHERING:
            return f"{stage}: {done:,} of {wanted:,}, at most {SECONDS - self.used():.0f} s of CPU time left"
        (then, before), self._seen = self._seen, (now, done)
        # The pace since the last line, not the mean: the last scenes are often the rarest.
        pace = (done - before) / (now - then) if now > then else 0.0
        left = f"about {(wanted - done) / pace:.0f} s left" if pace > 0.0 else "none found lately"
        return f"{stage}: {done:,} of {wanted:,}, {left}"
