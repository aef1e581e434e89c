"""Independent streams of random numbers from one seed."""

from __future__ import annotations

from enum import IntEnum

import numpy as np
import torch


class Stream(IntEnum):
    """What a stream is for. The numbers are part of what a seed means: never change one."""

    DATA = 0
    WEIGHTS = 1
    ORDER = 2
    NOISE = 3
    VALIDATION = 4
    BRANCHES = 5


def stream(seed: int, *key: int, device: torch.device | str = "cpu") -> torch.Generator:
    """A generator that depends on the seed and the key alone."""
    words = np.random.SeedSequence((seed, *key)).generate_state(1, np.uint64)
    return torch.Generator(device).manual_seed(int(words[0]) >> 1)
