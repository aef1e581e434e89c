"""Multilevel splitting: chains that are narrowed to a range level by level, of scenes or of motions.

A level is a range of phi for every label. Levels narrow from "anything" to the requested range; the part of the chains
that is nearest to the range determines the next level (adaptive multilevel splitting, Cerou and Guyader 2007). What the
spec requires comes first. The shares of all levels multiply to the probability of requirement and range under the base
distribution.

A plan is one descent of one ensemble of chains, which records its stages (`Descent`). A piece is an ensemble of its own
that follows these stages (`follow`), wherever it runs. The chains of scenes are in `chains`, those of motions in
`scenegen.sampling.motions.schedule`, each with their moves.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeAlias, TypeVar

import numpy as np

from scenegen.arrays import Array, Bool, Index
from scenegen.sampling.cells import Cells

Scores: TypeAlias = "Sequence[Array] | Array"  # one row of (B,) for each label, and for what else is held

MAX_LEVELS = 1000  # of a descent at most
MIN_BEYOND = 16  # chains beyond a value that most of them share, for a level to leave it behind
STALLED_LEVELS = 20  # if so many levels shrink the distance by less than 1 %, the range counts as unreachable


@dataclass(frozen=True, slots=True)
class Region:
    """Where chains may go: scores, the phi of every label, from `low` to `high`, (L,) each.

    `weights` (cells,) favour cells of the range: chains then follow the base distribution times the weight of their
    cell, and a cell of weight 0 is closed. None if all scenes have the same weight.
    """

    low: Array
    high: Array
    weights: Array | None = None

    def holds(self, scores: Scores) -> Bool:
        """Which of B scenes lie within; NaN does not."""
        inside = np.ones(scores[0].shape, dtype=bool)
        for value, low, high in zip(scores, self.low, self.high, strict=True):
            if low > -np.inf:
                inside &= value >= low
            if high < np.inf:
                inside &= value <= high
        return inside

    def weigh(self, scores: Scores, cells: Cells) -> Array:
        """The weight of B scenes. Those outside the region get an arbitrary weight."""
        assert self.weights is not None
        return self.weights[which_cell(scores, cells)]


def which_cell(scores: Scores, cells: Cells) -> Index:
    """The cell of B scenes, (B,); scenes out of the range get the nearest cell. Cells have equal widths along a
    label."""
    found = np.zeros(scores[0].shape, dtype=np.intp)
    for label, edge in zip(cells.bounded, cells.edges, strict=True):
        count = len(edge) - 1
        along = (scores[label] - edge[0]) * (count / (edge[-1] - edge[0]))
        along = np.nan_to_num(along, nan=0.0, posinf=count, neginf=0.0)
        found = found * count + np.clip(along, 0, count - 1).astype(np.intp)
    return found


class ChainPopulation(Protocol):
    """Chains, many of them: their scores (rows, P), and where they may go."""

    @property
    def scores(self) -> Scores: ...

    @property
    def region(self) -> Region: ...

    @property
    def evaluations(self) -> int: ...

    def narrow(self, region: Region, islands: int = 1) -> float:
        """Restrict the chains to a region. Returns the share that survived (0: none did, and the chains are
        unchanged)."""

    def run(self, moves: int, tuning: Any) -> float:
        """That many moves of every chain. Returns the share that was taken."""


@dataclass(frozen=True, slots=True)
class Stage:
    """Restrict the chains to a region (None: to none in addition), then make `moves` moves by `tuning`. `counts` says
    whether the share that survives is a factor of the probability: not between cells."""

    region: Region | None
    tuning: Any
    moves: int
    counts: bool = False


@dataclass(frozen=True, slots=True)
class Schedule:
    """Everything that pieces need. The first `levels` stages are factors of the probability; `cells` are those that get
    scenes. A piece has `chains` chains and takes `takes` scenes from each, `thinning` moves apart; `left` is the
    correlation that remains after so many moves."""

    stages: tuple[Stage, ...]
    levels: int
    cells: frozenset[int] | tuple[int, ...]
    chains: int
    left: float
    evaluations: int
    takes: int = 1
    thinning: int = 0


def follow(chains: ChainPopulation, stages: Sequence[Stage]) -> tuple[float, float]:
    """A piece: chains at the base distribution go through the stages. Returns their estimate of the probability, 0 if
    none survived, unbiased because the stages are fixed; and the share of moves taken in the last one."""
    probability, taken = 1.0, 0.0
    for stage in stages:
        if stage.region is not None:
            share = chains.narrow(stage.region)
            if stage.counts or not share:
                probability *= share
            if not probability:
                return 0.0, taken
        taken = chains.run(stage.moves, stage.tuning)
    return probability, taken


ChainsType = TypeVar("ChainsType", bound=ChainPopulation)


class Descent(ABC, Generic[ChainsType]):
    """One descent of one ensemble of chains, which records its stages. `kept` is the share of the chains that makes a
    level."""

    kept: float

    def __init__(self, chains: ChainsType) -> None:
        self.chains = chains
        self.stages: list[Stage] = []

    @abstractmethod
    def move(self) -> tuple[Any, int]:
        """Move the chains until copies differ. Returns the tuning that does the same in a piece, and how many moves."""

    def is_over(self) -> bool:
        """Whether to end early."""
        return False

    def look(self, distance: Array, last: bool) -> None:
        """The chains are so far from the range (P,): of the request, if that is the `last` one."""

    def reach(self, cells: Cells, gates: Sequence[int]) -> bool:
        """Restrict the chains to scores of at least 0 in each of the gates, rows of scores, then to the range of the
        request. Returns whether they have arrived."""
        low, high = np.full(len(self.chains.scores), -np.inf), np.full(len(self.chains.scores), np.inf)
        held = low
        for gate in gates:
            low = held.copy()
            low[gate] = 0.0
            if not self._descend(low, high, held):
                return False
            held = low
        return self._descend(cells.low, cells.high, held, last=True)

    def _descend(self, low: Array, high: Array, held: Array, *, last: bool = False) -> bool:
        """Restrict the chains to scores from `low` to `high`, level by level; `held` are lower ends that always
        hold."""
        scale, history = _scales(self.chains.scores, low, high), list[float]()
        while not self.is_over():
            distance = _distance(self.chains.scores, low, high, scale)
            self.look(distance, last)
            level = float(np.quantile(distance, self.kept, method="lower"))
            if not np.isfinite(level):  # phi is undefined in most scenes: leave those first
                level = float(distance[np.isfinite(distance)].max(initial=-1.0))
            elif history and level >= history[-1]:  # most share one value, say of an alternative that is a constant
                beyond = distance[distance < level]
                level = float(beyond.max()) if len(beyond) >= MIN_BEYOND else level
            history.append(level)
            stuck = len(history) > STALLED_LEVELS and level > 0.99 * history[-1 - STALLED_LEVELS]
            if level < 0.0 or (level > 0.0 and (stuck or len(history) > MAX_LEVELS)):
                return False
            slack = level * (1.0 + 1e-9) * scale  # rounding must not exclude chains exactly on the level
            region = Region(np.maximum(low - slack, held) if level else low.copy(), high + slack)
            self.chains.narrow(region)
            self.stages.append(Stage(region, *self.move(), True))
            if level == 0.0:
                return True
        return False


def _scales(scores: Scores, low: Array, high: Array) -> Array:
    """The typical distance of each score from its range, which makes metres and radians comparable."""
    out = np.ones(len(scores))
    for row, values in enumerate(scores):
        off = np.maximum(low[row] - values, values - high[row])
        off = off[np.isfinite(off) & (off > 0.0)]
        if len(off):
            out[row] = np.median(off)
    return out


def _distance(scores: Scores, low: Array, high: Array, scale: Array) -> Array:
    """How far (P,) the chains are from the range, 0 within; infinite if a score is NaN."""
    worst = np.zeros(scores[0].shape)
    for values, least, most, unit in zip(scores, low, high, scale, strict=True):
        below = least - values if least > -np.inf else -np.inf
        above = values - most if most < np.inf else -np.inf
        worst = np.maximum(worst, np.maximum(below, above) / unit)
        worst = np.where(np.isnan(values), np.inf, worst)
    return worst
