"""A cover of a few coupled coordinates by disjoint boxes: branch and prune.

The boxes are over `dims`, coordinates or differences of coordinates. They are contracted, bisected along the edge whose
halves contract best, and dropped where nothing is left, until the boxes' volume stops shrinking.

A search asks for the same grid many times: of objects that other demands do not concern, and with more boxes than
before. `Grids` keeps what was made.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from scenegen.bounds.alias import Alias, make_alias
from scenegen.bounds.batches import Batches, make_batches
from scenegen.bounds.contract import ROUNDS, SLACK, contract, forward
from scenegen.bounds.effort import Effort
from scenegen.lang.core import Node

Array = npt.NDArray[np.float64]

LARGEST = 1 << 21  # numbers that one contraction may work on at a time
FEWEST = 0.97  # the volume must shrink to less than this share of it while the boxes double, else it is enough
SHARE = 0.25  # boxes smaller than this share of the largest are left for a later round
TINY = 1e-300  # for volumes that are not 0, but too small for a number
KEPT = 64  # grids of one search that are kept


@dataclass(frozen=True, slots=True)
class Grid:
    """K disjoint boxes lo..hi, (d, K), over the tape's nodes `dims`, and their volumes together: TINY where that is
    no number; only no boxes at all have no volume."""

    dims: tuple[int, ...]
    lo: Array
    hi: Array
    volume: float
    alias: Alias

    def draw(self, count: int, rng: np.random.Generator) -> Array:
        """`count` points uniform over the union of the boxes, (d, count)."""
        out: Array = rng.random((len(self.dims), count))
        width = self.hi - self.lo
        if len(self.alias.keep) == 1:
            out *= width
            out += self.lo
            return out
        box = self.alias.draw(count, rng)
        for values, wide, low in zip(out, width, self.lo, strict=True):
            values *= wide.take(box)
            values += low.take(box)
        return out


@dataclass(frozen=True, slots=True)
class Coupled:
    """What a grid covers: what is left of one contracted box of the tape `nodes`, whose intervals are lo, hi (T,).

    `dims` are the positions to cover, and `names` what the grid calls them, `given` those whose intervals are kept when
    bounds are computed again, `demands` the formula nodes with the ends that make a box whole: one that meets all of
    them is not split further.
    """

    nodes: tuple[Node, ...]
    names: tuple[int, ...]
    lo: Array
    hi: Array
    dims: tuple[int, ...]
    given: tuple[int, ...]
    demands: tuple[tuple[int, float, float], ...]

    @property
    def key(self) -> tuple[object, ...]:
        """The same for the same grids: arrays have no hash."""
        return self.nodes, self.names, self.lo.tobytes(), self.hi.tobytes(), self.dims, self.given, self.demands


@dataclass(frozen=True, slots=True)
class _Tape:
    """What boxes are contracted by, and what makes one whole."""

    what: Coupled
    batches: Batches | None
    effort: Effort

    def contract(self, lo: Array, hi: Array, rounds: int = ROUNDS) -> npt.NDArray[np.bool_]:
        return contract(self.what.nodes, lo, hi, rounds, batches=self.batches, effort=self.effort)

    def settled(self, lo: Array, hi: Array) -> npt.NDArray[np.bool_]:
        """Boxes in which every scene meets the demands, as far as bounds can tell."""
        low, high = forward(self.what.nodes, lo, hi, self.what.given, batches=self.batches, effort=self.effort)
        settled = np.ones(lo.shape[1], dtype=bool)
        for node, least, most in self.what.demands:
            room = 8 * SLACK * (1.0 + sum(abs(end) for end in (least, most) if np.isfinite(end)))
            settled &= (low[node] >= least - room) & (high[node] <= most + room)
        return settled


@dataclass(frozen=True, slots=True)
class _Boxes:
    """K disjoint boxes: the intervals lo, hi (T, K) of all nodes, which boxes are worth a cut, `open_`, and how much
    they cover, `volume`. `whole` (d,) is how wide they were before the first cut."""

    lo: Array
    hi: Array
    open_: npt.NDArray[np.bool_]
    volume: Array
    whole: Array

    @property
    def count(self) -> int:
        return len(self.volume)


@dataclass(frozen=True, slots=True)
class Made:
    """A grid, its work, and the budgets for which it is the same. With a larger one, it goes on from the boxes of
    `last`, which took the work beside them; None where they are not kept."""

    grid: Grid
    work: float
    budgets: range
    last: tuple[_Boxes, float] | None = None


@dataclass(frozen=True, slots=True)
class Grids:
    """The latest grids that a search has made, by what they cover."""

    _kept: dict[tuple[object, ...], Made] = field(default_factory=dict)

    def grid(self, what: Coupled, budget: int, effort: Effort) -> Grid:
        """The grid of `make_grid`. The same work is counted for what is at hand, so that what a search finds does not
        depend on what is kept."""
        key = what.key
        known = self._kept.get(key)
        if known is not None and budget in known.budgets and effort.allows(known.work):
            effort.spend(known.work)
            return known.grid
        made = make_grid(what, budget, effort, known)
        self._kept[key] = made
        if len(self._kept) > KEPT:
            del self._kept[next(iter(self._kept))]
        return made.grid


def make_grid(what: Coupled, budget: int, effort: Effort, smaller: Made | None = None) -> Made:
    """A cover by at most `budget` boxes. An empty grid proves that there is no solution. `smaller` may be one of the
    same: it is continued, which gives the same grid and counts as the same work as one from the start. Raises what
    `effort` raises."""
    used = effort.used
    tape = _Tape(what, make_batches(what.nodes), effort)
    begun = None if smaller is None or smaller.budgets.start >= budget else smaller.last
    if begun is not None and effort.allows(begun[1]):
        boxes, work = begun
        effort.spend(work)
    else:
        begun, boxes = None, _first(tape)
    last: tuple[_Boxes, float] | None = None
    while boxes.open_.any() and boxes.count < budget:
        largest = boxes.volume[boxes.open_].max()
        chosen = np.flatnonzero(boxes.open_ & (boxes.volume >= SHARE * largest))
        if largest <= 0.0:
            break
        most = LARGEST // (2 * len(what.dims) * len(what.nodes))
        room = max(1, min(budget - boxes.count, most))
        if len(chosen) > room:
            if room < most and last is None:
                last = boxes, effort.used - used
            chosen = np.sort(chosen[np.argsort(-boxes.volume[chosen], kind="stable")[:room]])
        before = float(boxes.volume.sum())
        boxes = _cut(tape, boxes, chosen)
        # A cut of a share of the boxes can take off no more than that share of what cutting them all would.
        least = 1.0 - (1.0 - FEWEST) * len(chosen) / max(1, boxes.count)
        if len(chosen) >= 32 and boxes.volume.sum() > least * before:
            break
    else:
        if boxes.open_.any() and last is None:
            last = boxes, effort.used - used
    total = max(float(boxes.volume.sum()), TINY if boxes.count else 0.0)
    alias = make_alias(boxes.volume if total > TINY else np.ones(max(boxes.count, 1)))
    where = list(what.dims)
    grid = Grid(what.names, boxes.lo[where], boxes.hi[where], total, alias)
    budgets = range(budget, sys.maxsize if last is None else budget + 1)
    # A search asks for two budgets: the boxes of the second would be kept for nothing.
    return Made(grid, effort.used - used, budgets, last if begun is None else None)


def _first(tape: _Tape) -> _Boxes:
    """The one box that all begins with, or none."""
    lo, hi = tape.what.lo[:, None].copy(), tape.what.hi[:, None].copy()
    alive = tape.contract(lo, hi)
    lo, hi = lo[:, alive], hi[:, alive]
    where = list(tape.what.dims)
    whole = np.maximum((hi - lo)[where].max(axis=1, initial=0.0), 1e-300)
    return _Boxes(lo, hi, ~tape.settled(lo, hi), _volume(lo, hi, where), whole)


def _cut(tape: _Tape, boxes: _Boxes, chosen: npt.NDArray[np.intp]) -> _Boxes:
    """The boxes with both halves of those `chosen` (C,) in their place, as far as there is something left of them."""
    where = list(tape.what.dims)
    lo, hi = _split(tape, boxes.lo[:, chosen], boxes.hi[:, chosen], where, boxes.whole)
    kept = np.ones(boxes.count, dtype=bool)
    kept[chosen] = False
    open_ = np.concatenate([boxes.open_[kept], ~tape.settled(lo, hi)])
    volume = np.concatenate([boxes.volume[kept], _volume(lo, hi, where)])
    lo, hi = np.concatenate([boxes.lo[:, kept], lo], axis=1), np.concatenate([boxes.hi[:, kept], hi], axis=1)
    return _Boxes(lo, hi, open_, volume, boxes.whole)


def _volume(lo: Array, hi: Array, dims: Sequence[int]) -> Array:
    volume: Array = np.prod(np.maximum(hi[dims] - lo[dims], 0.0), axis=0)
    return volume


def _split(tape: _Tape, lo: Array, hi: Array, dims: list[int], whole: Array) -> tuple[Array, Array]:
    """Both halves of every box, cut where cutting and contracting leaves the least volume, or else along the relatively
    longest edge; empty halves are dropped."""
    count, ways = lo.shape[1], len(dims)
    middle = 0.5 * (lo[dims] + hi[dims])
    trial_lo, trial_hi = np.tile(lo, (1, 2 * ways)), np.tile(hi, (1, 2 * ways))
    for way, dim in enumerate(dims):
        below = slice(2 * way * count, (2 * way + 1) * count)
        above = slice((2 * way + 1) * count, (2 * way + 2) * count)
        trial_hi[dim, below] = middle[way]
        trial_lo[dim, above] = middle[way]
    alive = tape.contract(trial_lo, trial_hi, rounds=2)
    volume = np.where(alive, _volume(trial_lo, trial_hi, dims), 0.0).reshape(ways, 2, count)
    left = volume.sum(axis=1)
    relative = (hi[dims] - lo[dims]) / whole[:, None]
    # Volumes that differ by a few percent say nothing: the longer edge is then the better cut.
    best = np.argmin(left / np.maximum(left.max(axis=0), 1e-300) - 0.1 * relative / relative.max(axis=0), axis=0)
    column = np.arange(count)
    picked = np.concatenate([(2 * best) * count + column, (2 * best + 1) * count + column])
    picked = picked[alive[picked]]
    return trial_lo[:, picked], trial_hi[:, picked]
