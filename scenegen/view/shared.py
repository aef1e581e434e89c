"""What all routes of one server share."""

from __future__ import annotations

from dataclasses import dataclass, field

from scenegen.view.opened import Opened
from scenegen.view.workers import Workers


@dataclass(slots=True)
class Shared:
    """`sessions` counts the pages that are open, `downloads` the files being made."""

    opened: Opened
    workers: Workers = field(default_factory=Workers)
    sessions: int = 0
    downloads: int = 0
