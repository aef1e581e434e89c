"""CPU seconds on one thread."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable

import torch

from scenegen.learn.model import Model
from scenegen.processes.pool import one_thread

LONG = 4.0  # CPU seconds: work that takes more is not repeated


def per_second(work: Callable[[], int], repeats: int) -> float:
    """What `work` makes, by its own count, per CPU second: the median over the repeats, after one that counts only
    where it is the only one or takes long."""
    began = time.process_time()
    made = work()
    seconds = time.process_time() - began
    if repeats == 1 or seconds > LONG:
        return made / max(seconds, 1e-9)
    return statistics.median(per_second(work, 1) for _ in range(repeats))


def model_speed(model: Model, wanted: torch.Tensor, repeats: int) -> float:
    """Scenes a second of a model's raw output for phi (L, n), on one core."""
    generator = torch.Generator().manual_seed(0)

    def draw() -> int:
        return model.trained.propose(wanted, generator).shape[1]

    with one_thread():
        return per_second(draw, repeats)
