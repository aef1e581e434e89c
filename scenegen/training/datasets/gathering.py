"""Gathering a training set: progress, estimates and the time limit.

Time ends a run, it never changes one: a set that is not complete in time is no set.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass

from scenegen.errors import Diagnostic, RequestError
from scenegen.errors.models import NO_TIME_TO_GATHER
from scenegen.sampling.problem import Budget

Tell = Callable[[str, int, int], None]
"""Told what is being done, and how much of how much of it is done; 0 of 0 where that cannot be counted."""


class Gathering:
    """Mutable: `stage` is what is being done, `done` of `wanted` scenes are there. `check` is called often, by
    everything that takes time; it tells, and raises RequestError once `seconds` are over."""

    def __init__(
        self, seconds: float = math.inf, tell: Tell | None = None, note: Callable[[Diagnostic], None] | None = None
    ) -> None:
        self.until = time.monotonic() + seconds
        self.stage = "gathering scenes"
        self.done = self.wanted = 0
        self._seconds = seconds
        self._tell = tell
        self._note = note

    def note(self, problem: Diagnostic) -> None:
        """Something worth saying."""
        if self._note is not None:
            self._note(problem)

    def begin(self, stage: str, wanted: int = 0) -> None:
        """Another thing is being done; of `wanted` scenes, where they are counted."""
        self.stage, self.done, self.wanted = stage, 0, wanted
        self.check()

    def reach(self, done: int) -> None:
        """So many scenes are there."""
        self.done = done
        self.check()

    def check(self) -> None:
        """Tell how far it is. Raises RequestError where time is up."""
        if self._tell is not None:
            self._tell(self.stage, self.done, self.wanted)
        if time.monotonic() >= self.until:
            raise RequestError(NO_TIME_TO_GATHER(seconds=self._seconds, account=self.account))

    @property
    def account(self) -> str:
        """What is being done, in numbers."""
        return f"{self.stage}: {self.done:,} of {self.wanted:,}" if self.wanted else self.stage

    def budget(self) -> Budget:
        """For the exact samplers: `check` ends what takes too long; ask it where they say that time is up."""
        return _Checked(math.inf, gathering=self)


@dataclass(frozen=True, slots=True)
class _Checked(Budget):
    """Samplers look at their budget between all steps: so often is the gathering checked."""

    gathering: Gathering | None = None

    @property
    def ends(self) -> float:
        return math.inf if self.gathering is None else self.gathering.until

    @property
    def spent(self) -> bool:
        if self.gathering is not None:
            self.gathering.check()
        return False

    @property
    def overdrawn(self) -> bool:
        return self.spent
