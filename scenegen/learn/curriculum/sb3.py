"""A Stable-Baselines3 callback that logs a curriculum. Importing this loads Stable-Baselines3 and torch."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from typing import Any

import numpy as np
from gymnasium import error

from scenegen.errors.learning import NOT_A_STRATEGY
from scenegen.errors.requests import NOT_INSTALLED
from scenegen.learn.curriculum.goal import count, refused
from scenegen.learn.curriculum.tasks import Strategy

try:
    from stable_baselines3.common.callbacks import BaseCallback
except ImportError as problem:
    missing = NOT_INSTALLED(
        package="stable-baselines3", purpose="for the callback", command='pip install "scenegen[experiments]"'
    )
    raise refused(missing, error.DependencyNotInstalled) from problem

WINDOW = 100  # episodes over which means are taken


class CurriculumCallback(BaseCallback):
    """Logs, for the last `window` episodes of environments in `Curriculum`: the success rate, phi of the first scene
    and of the tasks per label, steps and rewards, all under `curriculum/`; and the strategy's `log()`, if a strategy is
    given and has one. Works with SB3Vector around a `VectorCurriculum`, too. Outcomes arrive from environments in other
    processes as well, but there each process has its own strategy, and `strategy` here gets no outcomes from them."""

    def __init__(self, strategy: Strategy | None = None, *, window: int = WINDOW, verbose: int = 0) -> None:
        if strategy is not None and not callable(getattr(strategy, "next_task", None)):
            raise refused(NOT_A_STRATEGY(value=repr(strategy)))
        window = count("window", window)
        super().__init__(verbose)
        self.outcomes: deque[Mapping[str, Any]] = deque(maxlen=window)
        self.episodes = 0
        self._strategy = strategy

    def _on_step(self) -> bool:
        for info in self.locals["infos"]:
            if "outcome" in info:
                self.outcomes.append(info["outcome"])
                self.episodes += 1
        return True

    def _on_rollout_end(self) -> None:
        if not self.outcomes:
            return
        self.logger.record("curriculum/episodes", self.episodes)
        for name, key in (("success_rate", "success"), ("reward", "total"), ("steps", "steps")):
            self.logger.record(f"curriculum/{name}", float(np.mean([one[key] for one in self.outcomes])))
        for name in ("phi", "low", "high"):
            means = np.mean([one[name] for one in self.outcomes], axis=0)
            for label, value in enumerate(means.tolist()):
                self.logger.record(f"curriculum/{name}" + (f"_{label + 1}" if len(means) > 1 else ""), value)
        log = getattr(self._strategy, "log", None)
        if callable(log):
            for name, value in log().items():
                self.logger.record(f"curriculum/{name}", float(value))
