"""How large an experiment is, where it writes, and whom it tells."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from experiments.cache import Cache


@dataclass(frozen=True, slots=True)
class Sizes:
    """What decides the cost of an experiment. None leaves a training to its recipe."""

    scenes: int  # a row of a table
    covered: int  # of them, and as many of the truth, for coverage and nearest distances
    draws: int  # of plain rejection
    batch: int  # scenes that a model draws at once where its speed is measured
    repeats: int  # of that measurement
    exact: int  # scenes of the exact sampler where its speed is measured
    epochs: int | None
    training: int | None  # scenes of a training set
    data: str | None  # kind of a training set
    pixels: int  # width of a rendered picture
    overlaid: int  # scenes on top of each other in Fig. 8
    dots: int  # a panel of Fig. 7
    neighbours: int  # of Isomap
    patience: float  # seconds that a model may take for the scenes it hands out


FULL = Sizes(
    scenes=5_000,
    covered=2_000,
    draws=20_000_000,
    batch=16_384,
    repeats=3,
    exact=200_000,
    epochs=None,
    training=None,
    data=None,
    pixels=300,
    overlaid=700,
    dots=500,
    neighbours=12,
    patience=20.0,
)
QUICK = Sizes(
    scenes=128,
    covered=64,
    draws=65_536,
    batch=256,
    repeats=1,
    exact=256,
    epochs=1,
    training=256,
    data="uniform",
    pixels=48,
    overlaid=16,
    dots=24,
    neighbours=6,
    patience=2.0,
)


@dataclass(frozen=True, slots=True)
class Plan:
    """A run: the folder that the reports go to, the seeds of the trainings, processes that train, and who is told.
    `epochs` shortens or lengthens the trainings of random specs; None leaves them to the recipe. `trainings` is how
    many models each random spec gets, and with `kept` only finished ones are reported and nothing is run."""

    out: Path
    seeds: tuple[int, ...]
    quick: bool
    workers: int
    tell: Callable[[str], None]
    epochs: int | None = None
    trainings: int = 1
    kept: bool = False
    engine: str = "local"
    address: str | None = None

    @property
    def sizes(self) -> Sizes:
        return QUICK if self.quick else FULL

    def cache(self) -> Cache:
        """Where runs are kept, made if need be. Raises OutputError."""
        return Cache.beside(self.out)
