"""What training reports after each epoch."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from scenegen.training.validate import Validation


@dataclass(frozen=True, slots=True)
class EpochReport:
    """An epoch that is done: its number (from 1) of how many, the mean of each loss, and the seconds that its steps
    took in this process; how good the model is now, the steps of all epochs so far, the learning rate of the last of
    them, the scenes of an epoch, and the last epoch (from 1) that the model file would hold."""

    epoch: int
    epochs: int
    losses: Mapping[str, float]
    seconds: float
    validation: Validation | None = None
    step: int = 0
    rate: float = 0.0
    scenes: int = 0
    kept: int = 0
