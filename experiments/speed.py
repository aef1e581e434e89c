"""CPU seconds on one thread."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable

import torch

from scenegen.learn.model import Model
from scenegen.processes.pool import one_thread


def per_second(work: Callable[[], int], repeats: int) -> float:
    """What `work` makes, by its own count, per CPU second: the median over the repeats, after one that does not count
    where there are several."""
    if repeats > 1:
        work()
    rates = []
    for _ in range(repeats):
        began = time.process_time()
        made = work()
        rates.append(made / max(time.process_time() - began, 1e-9))
    return statistics.median(rates)


def model_speed(model: Model, wanted: torch.Tensor, repeats: int) -> float:
    """Scenes a second of a model's raw output for phi (L, n), on one core."""
    generator = torch.Generator().manual_seed(0)

    def draw() -> int:
        return model.trained.propose(wanted, generator).shape[1]

    with one_thread():
        return per_second(draw, repeats)
