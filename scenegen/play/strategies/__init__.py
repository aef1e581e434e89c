"""Strategies: which phi the next episode begins with. numpy only; any learner, any environment."""

from __future__ import annotations

from typing import Any

import numpy as np

from scenegen.errors import RequestError
from scenegen.errors.requests import UNKNOWN_CHOICE
from scenegen.play.strategies.alp_gmm import AlpGmm
from scenegen.play.strategies.base import Base
from scenegen.play.strategies.cells import Exp3S, Learnability, Replay, Teacher
from scenegen.play.strategies.levels import Linear, Ordered, Reverse, SelfPaced, Uniform
from scenegen.play.tasks import PhiBox

__all__ = ["STRATEGIES", "strategy"]

# docs/curriculum.md says where each is from; the contract test picks up new ones
STRATEGIES: dict[str, type[Base]] = {
    kind.name: kind
    for kind in (
        Uniform,
        Ordered,
        Linear,
        SelfPaced,
        Reverse,
        Learnability,
        AlpGmm,
        Replay,
        Teacher,
        Exp3S,
    )
}


def strategy(name: str, space: PhiBox, rng: np.random.Generator, **settings: Any) -> Base:
    """A strategy by name, over all the phi in `space`; it draws from `rng`, which nothing else should use if the
    strategy is to be saved. Raises RequestError for an unknown strategy or setting (with the nearest name), for a value
    out of its range, and for an invalid space."""
    if not isinstance(name, str) or name not in STRATEGIES:
        raise RequestError(UNKNOWN_CHOICE(what="strategy", plural="strategies", name=str(name), known=STRATEGIES))
    return STRATEGIES[name](space, rng, **settings)
