"""A cover of a few coupled coordinates by disjoint boxes: branch and prune.

The boxes are over `dims`, coordinates or differences of coordinates. They are contracted, bisected along the edge whose
halves contract best, and dropped where nothing is left, until the boxes' volume stops shrinking.

A search asks for the same grid many times: of objects that other demands do not concern, and with more boxes than are
of use. `Grids` keeps what was made.
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
KEPT = 64  # grids of one search that are kept


@dataclass(frozen=True, slots=True)
class Grid:
    """K disjoint boxes lo..hi, (d, K), over the tape's nodes `dims`, and their volumes together."""

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
class Grids:
    """The latest grids that a search has made, by what they cover: with their work, and the budgets for which they are
    the same."""

    _kept: dict[tuple[object, ...], tuple[Grid, float, range]] = field(default_factory=dict)

    def grid(self, what: Coupled, budget: int, effort: Effort) -> Grid:
        """The grid of `make_grid`. The same work is counted for one that is at hand, so that what a search finds does
        not depend on what is kept."""
        key = what.key
        grid, work, budgets = self._kept.get(key, (None, 0.0, range(0)))
        if grid is not None and budget in budgets and effort.allows(work):
            effort.spend(work)
            return grid
        used = effort.used
        grid, cramped = make_grid(what, budget, effort)
        self._kept[key] = grid, effort.used - used, range(budget, budget + 1 if cramped else sys.maxsize)
        if len(self._kept) > KEPT:
            del self._kept[next(iter(self._kept))]
        return grid


def make_grid(what: Coupled, budget: int, effort: Effort) -> tuple[Grid, bool]:
    """A cover by at most `budget` boxes, and whether a larger budget could give another one. An empty grid proves that
    there is no solution. Raises what `effort` raises."""
    lo, hi = what.lo[:, None].copy(), what.hi[:, None].copy()
    tape = _Tape(what, make_batches(what.nodes), effort)
    alive = tape.contract(lo, hi)
    lo, hi = lo[:, alive], hi[:, alive]
    where = list(what.dims)
    whole_width = np.maximum((hi - lo)[where].max(axis=1, initial=0.0), 1e-300)
    open_ = ~tape.settled(lo, hi)
    volume = _volume(lo, hi, where)
    cramped = False
    while open_.any() and lo.shape[1] < budget:
        largest = volume[open_].max()
        chosen = np.flatnonzero(open_ & (volume >= SHARE * largest))
        if largest <= 0.0:
            break
        most = LARGEST // (2 * len(where) * len(what.nodes))
        room = max(1, min(budget - lo.shape[1], most))
        if len(chosen) > room:
            cramped |= room < most
            chosen = np.sort(chosen[np.argsort(-volume[chosen], kind="stable")[:room]])
        before = float(volume.sum())
        new_lo, new_hi = _split(tape, lo[:, chosen], hi[:, chosen], where, whole_width)
        kept = np.ones(lo.shape[1], dtype=bool)
        kept[chosen] = False
        settled = tape.settled(new_lo, new_hi)
        lo, hi = np.concatenate([lo[:, kept], new_lo], axis=1), np.concatenate([hi[:, kept], new_hi], axis=1)
        open_ = np.concatenate([open_[kept], ~settled])
        volume = np.concatenate([volume[kept], _volume(new_lo, new_hi, where)])
        # A cut of a share of the boxes can take off no more than that share of what cutting them all would.
        if len(chosen) >= 32 and volume.sum() > (1.0 - (1.0 - FEWEST) * len(chosen) / max(1, lo.shape[1])) * before:
            break
    else:
        cramped |= bool(open_.any())
    total = float(volume.sum())
    alias = make_alias(volume if total > 0.0 else np.ones(1))
    return Grid(what.names, lo[where], hi[where], total, alias), cramped


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
