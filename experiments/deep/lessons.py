"""What is compared: the order in which the scenes come, and where they come from."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from scenegen.play.strategies import STRATEGIES, strategy
from scenegen.play.tasks import Outcome, PhiBox, Strategy

EXACT, MODEL = "exact", "model"
SOURCES = {EXACT: "exact sampler", MODEL: "trained model"}
LEVELS = 100  # of a curriculum: the first ones decide, and they have to be narrow
SCHEDULE = 100_000  # episodes of the linear curriculum, more than a run has: faster ones leave the easy scenes too soon
BANDS = 64  # of the reach: how finely phi of random scenes is followed


@dataclass(frozen=True, slots=True)
class Lesson:
    """`strategy` is an entry of STRATEGIES, None for random scenes, with its `settings`; `sources` are where its scenes
    are taken from."""

    key: str
    title: str
    strategy: str | None
    settings: dict[str, Any] = field(default_factory=dict)
    reward: str = "sparse"
    sources: Sequence[str] = (EXACT, MODEL)

    def make(self, space: PhiBox, seed: int, phi: Sequence[float]) -> Strategy:
        """The strategy over a reach. `phi` is that of random scenes, of the one label there is."""
        rng = np.random.default_rng(np.random.SeedSequence([seed, 1]))
        if self.strategy is None:
            return AsTheyCome(space, rng, phi)
        return strategy(self.strategy, space, rng, **self.settings)

    def settled(self) -> dict[str, Any]:
        """All settings of the strategy, its own defaults included."""
        if self.strategy is None:
            return {"bands": BANDS}
        return STRATEGIES[self.strategy].settings_class(**self.settings).model_dump(mode="json")


LESSONS: dict[str, Lesson] = {
    one.key: one
    for one in (
        Lesson("random", "random scenes", None, sources=(EXACT,)),
        Lesson("dense", "random scenes, dense reward", None, reward="dense", sources=(EXACT,)),
        Lesson("uniform", "uniform in phi", "uniform"),
        Lesson("linear", "linear in phi", "linear", {"levels": LEVELS, "episodes": SCHEDULE}),
        Lesson("self_paced", "self-paced", "self_paced", {"levels": LEVELS}),
    )
}


class AsTheyCome:
    """Scenes as plain rejection of satisfied ones would give them: each task is the band of the reach that phi of a
    random scene lies in, so bands are asked for as often as they occur, and within one the sampler is exact."""

    def __init__(self, space: PhiBox, rng: np.random.Generator, phi: Sequence[float]) -> None:
        (low,), (high,) = space.low, space.high
        edges = np.linspace(low, high, BANDS + 1)
        counts, _ = np.histogram(np.clip(phi, low, high), edges)
        self._boxes = [PhiBox((a,), (b,)) for a, b in itertools.pairwise(edges.tolist())]
        self._upto = np.cumsum(counts) / counts.sum()
        self._rng = rng

    def next_task(self) -> PhiBox:
        return self._boxes[int(np.searchsorted(self._upto, self._rng.random(), side="right"))]

    def report(self, outcome: Outcome) -> None:
        """Nothing is learnt from it."""
