"""The least that a policy can be: random actions.

scenegen suite run SUITE --policy examples/policies/random_actions.py:Random --world ...
"""

from typing import Any

import numpy as np


class Random:
    """`reset(seed)` is called as each episode begins, so that the same suite gives the same outcomes."""

    def reset(self, seed: int) -> None:
        self.random = np.random.default_rng(seed)

    def __call__(self, observation: Any, instruction: str) -> np.ndarray:
        return self.random.uniform(-1.0, 1.0, 7)
