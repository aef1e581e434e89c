"""How phi is distributed towards either end, from chains that are restricted level by level."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from scenegen.bounds.effort import NEVER, Stop, StoppedError
from scenegen.sampling.interval import Estimate, ratio
from scenegen.sampling.splitting.chains import Region

Array = npt.NDArray[np.float64]

ISLANDS = 16  # estimates whose scatter is the error bar
KEPT, CLIMB = 0.5, 0.1  # share of the chains that makes a level; the same once levels are not counted any more
NEAR, TOP = 0.01, 0.001  # how near to the end levels are counted, and searched: shares of the way from the median
LEVELS, SEARCH = 400, 30  # maximum number of counted levels, and of levels in the search for the end after them
COUNTED = 0.8  # share of the effort after which levels are not counted any more, so that some is left for the search
ROUNDS = 2  # rounds of moves on a level: after one, copies have parted, but resemble each other
NONE = 3.0  # scenes that may be missed at 95 % where none of a large number was
FEW = 8  # minimum number of scenes behind an estimate


class Population(Protocol):
    """Chains of scenes or of motions, in islands of equally many: their scores (rows, P), and where they may go."""

    @property
    def phi(self) -> Sequence[Array]: ...

    @property
    def region(self) -> Region: ...

    @property
    def evaluations(self) -> int: ...

    def narrow(self, region: Region, islands: int = 1) -> float: ...


@dataclass(frozen=True, slots=True)
class Tail:
    """One run: `sign` is 1 towards the highest phi, -1 towards the lowest.

    `levels` (K,) are each stage's lower limit of sign * phi, the first -inf; `values` are the chains' sign * phi, K
    arrays (islands, chains of an island) in rising order; `weights` (K, islands) are the probabilities of the stages by
    island. `end` is the furthest phi that was found; `whole` says that levels were counted until hardly any scenes were
    left, and did not end because the effort was used up.
    """

    sign: int
    levels: Array
    values: tuple[Array, ...]
    weights: Array
    end: float
    whole: bool

    def __call__(self, phi: float) -> Estimate | None:
        """log10 P(phi' >= phi) for a run upwards, log10 P(phi' <= phi) downwards; None if there are too few scenes."""
        place = self.sign * phi
        stage = int(np.searchsorted(self.levels, place, side="right")) - 1
        values = self.values[stage]
        hits = values.shape[1] - np.array([np.searchsorted(island, place, side="left") for island in values])
        if hits.sum() < FEW:
            return None
        if stage == 0 and hits.sum() == values.size and values.shape[1] > 1:
            # Of all that are not there, the share is at most 3 / n at 95 % (the rule of three). Copies tell nothing.
            return Estimate(0.0, -math.log10(1.0 - NONE / max(2.0 * NONE, len(np.unique(values)))))
        return ratio(self.weights[stage] * hits / values.shape[1], self.weights[0])

    def quantile(self, share: float) -> float:
        """The phi beyond which, in the direction of the run, about that share of the scenes lies."""
        first = np.sort(self.values[0].ravel())
        return self.sign * float(first[max(0, len(first) - max(1, round(share * len(first))))])


class Run(Protocol):
    """One direction of a label's distribution: a `Tail`, or a mixture of them; see there."""

    @property
    def sign(self) -> int: ...

    @property
    def levels(self) -> Array: ...

    @property
    def end(self) -> float: ...

    @property
    def whole(self) -> bool: ...

    def __call__(self, phi: float) -> Estimate | None: ...

    def quantile(self, share: float) -> float: ...


@dataclass(frozen=True, slots=True)
class Reach:
    """The distribution of a label's phi among the scenes that satisfy the requirement."""

    up: Run
    down: Run
    evaluations: int


@dataclass(frozen=True, slots=True)
class Rarity:
    """The runs of a spec: `reaches` by label, and how rare the requirement is (None: nothing is required)."""

    reaches: dict[str, Reach]
    requirement: Estimate | None
    evaluations: int


@dataclass(frozen=True, slots=True)
class OutOfReach:
    """No scene that satisfies the requirement was found; `best` is its largest margin."""

    best: float
    evaluations: int


def constant(phi: float) -> Reach:
    """The result for a label whose phi is the same in all scenes."""
    weights = np.ones((1, ISLANDS))
    tails = [
        Tail(sign, np.array([-np.inf]), (np.full((ISLANDS, 1), sign * phi),), weights, phi, True) for sign in (1, -1)
    ]
    return Reach(tails[0], tails[1], 1)


def climb(
    state: Population,
    move: Callable[[], object],
    weights: Array,
    sign: int,
    work: int,
    check: Callable[[], None],
    row: int = 0,
    stop: Stop = NEVER,
) -> tuple[Tail, int]:
    """Restrict the chains step by step towards one end of the phi of a row, with at most about `work` evaluations.
    `move` is one round of moves. Where `stop` or a move raises StoppedError, the run ends with what it has."""
    phi = margins(state, sign, row)
    levels, values, shares = [-np.inf], [_sorted(phi)], [weights]
    middle, end = float(np.median(phi)), float(phi.max())
    counting, searched, whole = True, 0, False
    while state.evaluations < work and searched < SEARCH:
        check()
        here = sign * (state.region.low if sign > 0 else state.region.high)[row]
        whole = whole or (counting and bool(end - here <= NEAR * (end - middle)))
        counting = counting and not whole and len(levels) < LEVELS and state.evaluations < COUNTED * work
        level = next_level(phi, here, KEPT if counting else CLIMB)
        if level is None or end - level <= TOP * (end - middle):
            whole = whole or counting
            break
        try:
            stop.check()
            kept = restrict(state, level, sign, row)
            for _ in range(ROUNDS if counting else 1):
                move()
        except StoppedError:
            break
        phi = margins(state, sign, row)
        end = max(end, float(phi.max()))
        if counting:
            weights = weights * kept
            levels.append(level)
            values.append(_sorted(phi))
            shares.append(weights)
        else:
            searched += 1
    return Tail(sign, np.array(levels), tuple(values), np.array(shares), sign * end, whole), state.evaluations


def margins(state: Population, sign: int, row: int = 0) -> Array:
    """sign * phi of a row, (P,); NaN counts as the lowest."""
    phi = sign * state.phi[row]
    return np.where(np.isnan(phi), -np.inf, phi)


def _sorted(phi: Array) -> Array:
    return np.sort(phi.reshape(ISLANDS, -1), axis=1)


def next_level(phi: Array, here: float, kept: float) -> float | None:
    """The next level above `here`: the one that `kept` of the chains reach, or the lowest above; None at the top."""
    level = float(np.quantile(phi, 1.0 - kept, method="higher"))
    if level > here:
        return level
    above = phi[phi > here]
    return float(above.min()) if len(above) else None


def restrict(state: Population, level: float, sign: int, row: int = 0) -> Array:
    """Restrict the chains to sign * phi >= level in a row; returns the share of each island that survived."""
    low, high = state.region.low.copy(), state.region.high.copy()
    (low if sign > 0 else high)[row] = sign * level
    region = Region(low, high)
    alive: Array = region.holds(state.phi).reshape(ISLANDS, -1).mean(axis=1)
    state.narrow(region, ISLANDS)
    return alive
