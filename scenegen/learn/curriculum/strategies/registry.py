"""The table of strategies. A new one is one file and one line here; the contract test picks it up."""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from scenegen.errors import RequestError
from scenegen.errors.requests import UNKNOWN_CHOICE

if TYPE_CHECKING:
    import numpy as np

    from scenegen.learn.curriculum.strategies.base import Base
    from scenegen.learn.curriculum.tasks import PhiBox

PACKAGE = "scenegen.learn.curriculum.strategies"


@dataclass(frozen=True, slots=True)
class Entry:
    """A strategy's class, what it does, and its source."""

    path: str
    about: str
    source: str

    def load(self) -> type[Base]:
        """The class."""
        module, _, name = self.path.partition(":")
        found: type[Base] = getattr(importlib.import_module(f"{PACKAGE}.{module}"), name)
        return found


STRATEGIES: dict[str, Entry] = {
    "uniform": Entry("uniform:Uniform", "all of the reach at all times: the baseline", "none"),
    "ordered": Entry("ordered:Ordered", "a set of scenes, sorted from easy to hard", "the paper; Bengio et al. 2009"),
    "linear": Entry("linear:Linear", "one level after another, by the clock", "the paper, Fig. 5"),
    "self_paced": Entry("self_paced:SelfPaced", "the newest levels, until they succeed",
                        "the paper, Fig. 5; Kumar et al. 2010"),
    "reverse": Entry("reverse:Reverse", "outwards from the goal, where success is neither rare nor sure",
                     "Florensa et al. 2017"),
    "learnability": Entry("learnability:Learnability", "where success is a toss-up, p (1 - p)",
                          "Tzannetos et al. 2023; Rutherford et al. 2024"),
    "alp_gmm": Entry("alp_gmm:AlpGmm", "where success changes, by a mixture of Gaussians", "Portelas et al. 2019"),
    "replay": Entry("replay:Replay", "cells that surprise, and cells not seen for long", "Jiang et al. 2021"),
    "teacher": Entry("teacher:Teacher", "the cell whose success rate has the steepest slope", "Matiisen et al. 2017"),
    "exp3s": Entry("exp3s:Exp3S", "a bandit over cells, rewarded with progress", "Graves et al. 2017"),
}  # fmt: skip


def strategy(name: str, space: PhiBox, rng: np.random.Generator, **settings: Any) -> Base:
    """A strategy by name, over all the phi in `space`; it draws from `rng`, which nothing else should use if the
    strategy is to be saved. Raises RequestError for an unknown strategy or setting (with the nearest name), for a value
    out of its range, and for an invalid space."""
    if not isinstance(name, str) or name not in STRATEGIES:
        raise RequestError(UNKNOWN_CHOICE(what="strategy", plural="strategies", name=str(name), known=STRATEGIES))
    return STRATEGIES[name].load()(space, rng, **settings)
