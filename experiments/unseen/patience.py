"""A limit of CPU time for the exact samplers: what is found within it does not depend on what else the machine does."""

from __future__ import annotations

import time
from dataclasses import dataclass, field

from scenegen.search.effort import GRACE_SECONDS, Budget

SLOWEST = 20.0  # times as long as its CPU time anything may take, so that a starved process ends, too


@dataclass(frozen=True, slots=True)
class CpuBudget(Budget):
    """Of `seconds` of CPU time of this process, in which all the work has to be done (`workers=1`)."""

    used: float = field(default_factory=time.process_time)
    """CPU time when it began."""

    @property
    def ends(self) -> float:
        return time.monotonic() + SLOWEST * (self.used + self.seconds - time.process_time())

    @property
    def is_spent(self) -> bool:
        return time.process_time() - self.used >= self.seconds

    @property
    def overdrawn(self) -> bool:
        return time.process_time() - self.used >= self.seconds + GRACE_SECONDS
