"""Pieces that begin while their plan is still being made, each as far as it has come."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Generic, Protocol, TypeVar

import numpy as np

Stage = TypeVar("Stage", contravariant=True)


class Begun(Protocol[Stage]):
    """A piece that can be pickled after any of its stages."""

    def follow(self, stage: Stage) -> None:
        """One more stage."""


@dataclass(slots=True)
class Pieces(Generic[Stage]):
    """The job of `processes.ahead`: `begin` makes piece k before its first stage, and can be pickled."""

    begin: Callable[[int], Begun[Stage]]
    begun: dict[int, Any] = field(default_factory=dict)

    def __call__(self, order: tuple[int, Stage | None]) -> bytes | None:
        number, stage = order
        if stage is None:
            return pickle.dumps(self.begun[number], protocol=5)
        with np.errstate(all="ignore"):
            if number not in self.begun:
                self.begun[number] = self.begin(number)
            self.begun[number].follow(stage)
        return None
