"""The examination: random unsatisfied scenes, the same for everybody, none of them met in training."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from experiments.deep.tasks import Task
from experiments.measure import Array, rows_of
from scenegen.api.sample import sample
from scenegen.play.environments.rules import Rules, Tables

SEED = 2**31 + 7
Policy = Callable[[npt.NDArray[np.float32]], npt.NDArray[Any]]
"""Observations (B, K) -> actions (B, A)."""


@functools.lru_cache(maxsize=8)
def random_scenes(task: Task, count: int, seed: int) -> tuple[Array, Array]:
    """Unsatisfied scenes as they come, (3N, count), and phi (count,) of the one label there is. Not to be changed."""
    spec = task.load()
    (label,) = spec.labels
    scenes = sample(spec, {label: (None, math.nextafter(0.0, -1.0))}, count, seed=seed, spread="base", workers=1)
    return rows_of(scenes), scenes.phi[label]


def success(rules: Rules, scenes: Array, policy: Policy, horizon: int) -> float:
    """The share of the scenes (3N, n) that a policy solves within `horizon` steps, moving nothing off the table. The
    spec requires nothing."""
    tables = Tables(scenes, rules.score(scenes), np.zeros(scenes.shape[1]))
    solved = 0
    for _ in range(horizon):
        actions = rules.moves.as_actions(policy(rules.views(tables.rows)), tables.rows.shape[1])
        after, done = rules.step(tables, actions)
        solved += int(done.success.sum())
        on = ~done.terminated
        if not on.any():
            break
        tables = Tables(after.rows[:, on], after.phi[:, on], after.slack[on])
    return solved / int(scenes.shape[1])
