"""A cover of a few coupled coordinates by disjoint boxes: branch and prune.

The boxes are over `dims`, coordinates or differences of coordinates. They are contracted, bisected along the edge whose
halves contract best, and dropped where nothing is left, until the boxes' volume stops shrinking.

A search asks for the same grid many times, of objects that other demands do not concern. `Grids` keeps what was made.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from scenegen.arrays import Array, Index
from scenegen.lang.formula.core import Coord, Node
from scenegen.search.contract import CONTRACT_SLACK, SWEEPS, Bounds, contract, forward
from scenegen.search.effort import PYTHON_WORK, Effort
from scenegen.search.tape import BatchedTape, Tape, make_batches


@dataclass(frozen=True, slots=True)
class Alias:
    """K columns of equal width: column k is `own` its first `keep[k]`, and `other[k]` the rest."""

    keep: Array
    other: Index

    def draw(self, count: int, rng: np.random.Generator) -> Index:
        """`count` independent indices."""
        place = rng.random(count)
        place *= len(self.keep)
        column = place.astype(np.intp)
        place -= column
        return np.where(place < self.keep.take(column), column, self.other.take(column))


def make_alias(weights: Array) -> Alias:
    """The tables for weights (K,) >= 0, not all of them 0."""
    count = len(weights)
    keep: list[float] = (weights * (count / weights.sum())).tolist()
    other = list(range(count))
    small = [index for index, value in enumerate(keep) if value < 1.0]
    large = [index for index, value in enumerate(keep) if value >= 1.0]
    while small and large:
        low, high = small.pop(), large[-1]
        other[low] = high
        keep[high] -= 1.0 - keep[low]
        if keep[high] < 1.0:
            small.append(large.pop())
    # What is left of either is 1 but for rounding; a column of weight 0 always has a partner by then.
    for index in (*small, *large):
        keep[index] = 1.0
    return Alias(np.array(keep), np.array(other, dtype=np.intp))


MAX_NUMBERS_AT_A_TIME = 1 << 21  # numbers that one contraction may work on at a time
MAX_VOLUME_LEFT = 0.97  # the volume must shrink to less than this share of it while the boxes double, else it is enough
MIN_SHARE_OF_LARGEST = 0.25  # boxes smaller than this share of the largest are left for a later round
TINY_VOLUME = 1e-300  # for volumes that are not 0, but too small for a number
MAX_CACHED_GRIDS = 64  # grids of one search that are kept


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

    `dims` are the positions to cover, `cuts` those of them along which boxes may be cut, and `names` what the grid
    calls the dims; `given` are those whose intervals are kept when bounds are computed again, `demands` the formula
    nodes with the ends that make a box whole: one that meets all of them is not split further.
    """

    nodes: tuple[Node, ...]
    names: tuple[int, ...]
    lo: Array
    hi: Array
    dims: tuple[int, ...]
    cuts: tuple[int, ...]
    given: tuple[int, ...]
    demands: tuple[tuple[int, float, float], ...]

    @property
    def key(self) -> tuple[object, ...]:
        """The same for the same grids: arrays have no hash."""
        return (
            self.nodes,
            self.names,
            self.lo.tobytes(),
            self.hi.tobytes(),
            self.dims,
            self.cuts,
            self.given,
            self.demands,
        )


@dataclass(frozen=True, slots=True)
class _Tape:
    """What boxes are contracted by, and what makes one whole."""

    what: Coupled
    batches: BatchedTape
    effort: Effort

    def contract(self, lo: Array, hi: Array, rounds: int = SWEEPS) -> npt.NDArray[np.bool_]:
        return contract(self.what.nodes, lo, hi, rounds, batches=self.batches, effort=self.effort)

    def is_settled(self, lo: Array, hi: Array) -> npt.NDArray[np.bool_]:
        """Boxes in which every scene meets the demands, as far as bounds can tell."""
        low, high = forward(self.what.nodes, lo, hi, self.what.given, batches=self.batches, effort=self.effort)
        settled = np.ones(lo.shape[1], dtype=bool)
        for node, least, most in self.what.demands:
            room = 8 * CONTRACT_SLACK * (1.0 + sum(abs(end) for end in (least, most) if np.isfinite(end)))
            settled &= (low[node] >= least - room) & (high[node] <= most + room)
        return settled


@dataclass(frozen=True, slots=True)
class _GridBoxes:
    """K disjoint boxes: the intervals lo, hi (T, K) of all nodes, which boxes are worth a cut, `open_`, and how much
    they cover, `volume`. `whole` (c,) is how wide they were along the c cuts before the first."""

    lo: Array
    hi: Array
    open_: npt.NDArray[np.bool_]
    volume: Array
    whole: Array

    @property
    def count(self) -> int:
        return len(self.volume)


@dataclass(frozen=True, slots=True)
class BuiltGrid:
    """A grid, its work, and the budgets for which it is the same."""

    grid: Grid
    work: float
    budgets: range


@dataclass(frozen=True, slots=True)
class Grids:
    """The latest grids that a search has made, by what they cover."""

    _kept: dict[tuple[object, ...], BuiltGrid] = field(default_factory=dict)

    def grid(self, what: Coupled, budget: int, effort: Effort) -> Grid:
        """The grid of `make_grid`. The same work is counted for what is at hand, so that what a search finds does not
        depend on what is kept."""
        key = what.key
        known = self._kept.get(key)
        if known is not None and budget in known.budgets and effort.allows(known.work):
            effort.spend(known.work)
            return known.grid
        made = make_grid(what, budget, effort)
        self._kept[key] = made
        if len(self._kept) > MAX_CACHED_GRIDS:
            del self._kept[next(iter(self._kept))]
        return made.grid


def make_grid(what: Coupled, budget: int, effort: Effort) -> BuiltGrid:
    """A cover by at most `budget` boxes. An empty grid proves that there is no solution. Raises what `effort`
    raises."""
    used = effort.used
    tape = _Tape(what, make_batches(what.nodes), effort)
    boxes = _first(tape)
    full = False  # whether a larger budget would have made another grid
    while boxes.open_.any() and boxes.count < budget:
        largest = boxes.volume[boxes.open_].max()
        chosen = np.flatnonzero(boxes.open_ & (boxes.volume >= MIN_SHARE_OF_LARGEST * largest))
        if largest <= 0.0:
            break
        most = MAX_NUMBERS_AT_A_TIME // (2 * len(what.cuts) * len(what.nodes))
        room = max(1, min(budget - boxes.count, most))
        if len(chosen) > room:
            full |= room < most
            chosen = np.sort(chosen[np.argsort(-boxes.volume[chosen], kind="stable")[:room]])
        before = float(boxes.volume.sum())
        boxes = _cut(tape, boxes, chosen)
        # A cut of a share of the boxes can take off no more than that share of what cutting them all would.
        least = 1.0 - (1.0 - MAX_VOLUME_LEFT) * len(chosen) / max(1, boxes.count)
        if len(chosen) >= 32 and boxes.volume.sum() > least * before:
            break
    else:
        full |= bool(boxes.open_.any())
    total = max(float(boxes.volume.sum()), TINY_VOLUME if boxes.count else 0.0)
    alias = make_alias(boxes.volume if total > TINY_VOLUME else np.ones(max(boxes.count, 1)))
    where = list(what.dims)
    grid = Grid(what.names, boxes.lo[where], boxes.hi[where], total, alias)
    return BuiltGrid(grid, effort.used - used, range(budget, budget + 1 if full else sys.maxsize))


def _first(tape: _Tape) -> _GridBoxes:
    """The one box that all begins with, or none."""
    lo, hi = tape.what.lo[:, None].copy(), tape.what.hi[:, None].copy()
    alive = tape.contract(lo, hi)
    lo, hi = lo[:, alive], hi[:, alive]
    whole = np.maximum((hi - lo)[list(tape.what.cuts)].max(axis=1, initial=0.0), 1e-300)
    return _GridBoxes(lo, hi, ~tape.is_settled(lo, hi), _volume(lo, hi, tape.what.dims), whole)


def _cut(tape: _Tape, boxes: _GridBoxes, chosen: npt.NDArray[np.intp]) -> _GridBoxes:
    """The boxes with both halves of those `chosen` (C,) in their place, as far as there is something left of them."""
    lo, hi = _split(tape, boxes.lo[:, chosen], boxes.hi[:, chosen], boxes.whole)
    kept = np.ones(boxes.count, dtype=bool)
    kept[chosen] = False
    open_ = np.concatenate([boxes.open_[kept], ~tape.is_settled(lo, hi)])
    volume = np.concatenate([boxes.volume[kept], _volume(lo, hi, tape.what.dims)])
    lo, hi = np.concatenate([boxes.lo[:, kept], lo], axis=1), np.concatenate([boxes.hi[:, kept], hi], axis=1)
    return _GridBoxes(lo, hi, open_, volume, boxes.whole)


def _volume(lo: Array, hi: Array, dims: Sequence[int]) -> Array:
    where = list(dims)
    volume: Array = np.prod(np.maximum(hi[where] - lo[where], 0.0), axis=0)
    return volume


def _split(tape: _Tape, lo: Array, hi: Array, whole: Array) -> tuple[Array, Array]:
    """Both halves of every box, cut where cutting and contracting leaves the least volume, or else along the relatively
    longest edge; empty halves are dropped."""
    cuts = list(tape.what.cuts)
    count, ways = lo.shape[1], len(cuts)
    middle = 0.5 * (lo[cuts] + hi[cuts])
    trial_lo, trial_hi = np.tile(lo, (1, 2 * ways)), np.tile(hi, (1, 2 * ways))
    for way, dim in enumerate(cuts):
        below = slice(2 * way * count, (2 * way + 1) * count)
        above = slice((2 * way + 1) * count, (2 * way + 2) * count)
        trial_hi[dim, below] = middle[way]
        trial_lo[dim, above] = middle[way]
    alive = tape.contract(trial_lo, trial_hi, rounds=2)
    volume = np.where(alive, _volume(trial_lo, trial_hi, tape.what.dims), 0.0).reshape(ways, 2, count)
    left = volume.sum(axis=1)
    relative = (hi[cuts] - lo[cuts]) / whole[:, None]
    # Volumes that differ by a few percent say nothing: the longer edge is then the better cut.
    best = np.argmin(left / np.maximum(left.max(axis=0), 1e-300) - 0.1 * relative / relative.max(axis=0), axis=0)
    column = np.arange(count)
    picked = np.concatenate([(2 * best) * count + column, (2 * best + 1) * count + column])
    picked = picked[alive[picked]]
    return trial_lo[:, picked], trial_hi[:, picked]


# Coordinates along one axis that are tied by differences: x_j - x_i within [l, u] along the edges of a tree.
#
# Chains of `leftOf` are the case in point. Axis-aligned boxes fill such a set badly (sorting seven numbers takes 1/7!
# of their box), but it can be counted: each coordinate's interval is cut into bins, and the tree is summed up from
# its leaves (dynamic programming). What is drawn is uniform over all products of bins that the edges allow, a union
# of disjoint boxes that nobody has to write down; it is larger than the set itself by less than a bin along each
# edge.


PATH_BINS = 256
BIN_SLACK = 1e-9  # of a bin: how far a border may lie off by rounding
SUM_ROUNDING = 2.0**-50  # of a sum along an edge, relative


@dataclass(frozen=True, slots=True)
class DifferenceBound:
    """child - parent lies within [low, high]."""

    parent: int
    child: int
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class Link:
    """What the child can be for each bin of the parent, (BINS,) each: a stretch of `weight` from `offset`, of its
    coordinate where it has no children itself (`leaf`), else of the sum over its bins."""

    parent: int  # positions within Chain.rows
    child: int
    leaf: bool
    offset: Array
    weight: Array


@dataclass(frozen=True, slots=True)
class Chain:
    """A tree of coordinates, parents before children; row `rows[k]` has BINS bins of width `width[k]` from `low[k]`.
    `sums[k]` adds up the weights of its bins; `root` draws a bin of the first."""

    rows: tuple[int, ...]
    low: Array
    width: Array
    sums: tuple[Array, ...]
    links: tuple[Link, ...]
    volume: float
    root: Alias

    def draw(self, count: int, rng: np.random.Generator) -> Array:
        """`count` points uniform over the union of the bins that the edges allow, (d, count)."""
        out = rng.random((len(self.rows), count))
        bins: list[Index] = [np.empty(0, dtype=np.intp)] * len(self.rows)
        bins[0] = self.root.draw(count, rng)
        out[0] += bins[0]
        out[0] *= self.width[0]
        out[0] += self.low[0]
        for link in self.links:
            above = bins[link.parent]
            value = out[link.child]
            value *= link.weight.take(above)
            value += link.offset.take(above)
            if not link.leaf:
                bins[link.child] = self._place(link.child, value, value)
        return out

    def _place(self, which: int, mass: Array, out: Array) -> Index:
        """The bin where the sum reaches `mass`, and the coordinate, uniform in it, into `out`."""
        total = self.sums[which]
        found = np.searchsorted(total, mass, side="right")
        found -= 1
        np.clip(found, 0, PATH_BINS - 1, out=found)
        start = total.take(found)
        # A mass that rounding put at the very end may meet a bin of no weight.
        share = (mass - start) / np.maximum(total.take(found + 1) - start, 1e-300)
        np.clip(share, 0.0, 1.0, out=share)
        share += found
        share *= self.width[which]
        np.add(share, self.low[which], out=out)
        return found


def make_chain(edges: Sequence[DifferenceBound], intervals: Mapping[int, tuple[float, float]]) -> Chain:
    """The chain of a tree of edges, parents first, over rows with the given intervals. Its volume is 0 where no point
    meets all edges, and where it is too small for a number."""
    rows = [edges[0].parent, *(edge.child for edge in edges)]
    at = {row: position for position, row in enumerate(rows)}
    low = np.array([intervals[row][0] for row in rows])
    width = np.array([max(intervals[row][1] - intervals[row][0], 0.0) / PATH_BINS for row in rows])
    weight = [np.full(PATH_BINS, wide) for wide in width]
    sums: list[Array] = [np.empty(0)] * len(rows)
    links: list[Link] = []
    inner = {edge.parent for edge in edges}
    for edge in reversed(edges):
        parent, child = at[edge.parent], at[edge.child]
        leaf = edge.child not in inner
        borders = low[parent] + width[parent] * np.arange(PATH_BINS + 1)
        if leaf:
            offset = np.maximum(low[child], borders[:-1] + edge.low)
            inside = np.minimum(low[child] + PATH_BINS * width[child], borders[1:] + edge.high) - offset
            np.maximum(inside, 0.0, out=inside)
            weight[parent] = weight[parent] * inside
            links.append(Link(parent, child, True, offset, inside))
            continue
        sums[child] = _sum(weight[child])
        step = width[child] if width[child] > 0.0 else 1.0
        first = np.floor((borders[:-1] + edge.low - low[child]) / step - BIN_SLACK)
        last = np.ceil((borders[1:] + edge.high - low[child]) / step + BIN_SLACK)
        first, last = np.clip(first, 0, PATH_BINS).astype(np.intp), np.clip(last, 0, PATH_BINS).astype(np.intp)
        offset = sums[child][first]
        inside = np.where(last > first, sums[child][last] - offset, 0.0)
        weight[parent] = weight[parent] * inside
        links.append(Link(parent, child, False, offset, inside))
    volume = float(weight[0].sum())
    root = make_alias(weight[0] if volume > 0.0 else np.ones(1))
    return Chain(tuple(rows), low, width, tuple(sums), tuple(reversed(links)), volume, root)


def empty(edges: Sequence[DifferenceBound], intervals: Mapping[int, tuple[float, float]]) -> bool:
    """Whether it is proved that no point meets all edges of a tree: from its leaves to its root, what each child leaves
    to its parent."""
    left = dict(intervals)
    for edge in reversed(edges):
        (low, high), (least, most) = left[edge.parent], left[edge.child]
        left[edge.parent] = max(low, least - edge.high), min(high, most - edge.low)
    room = SUM_ROUNDING * len(edges) * max(abs(end) for ends in intervals.values() for end in ends)
    return any(low > high + room for low, high in left.values())


def _sum(weight: Array) -> Array:
    return np.concatenate([np.zeros(1), np.cumsum(weight)])


@dataclass(frozen=True, slots=True)
class Open:
    """A formula node of the tape whose demand its box does not settle."""

    core: int
    node: int
    low: float
    high: float
    support: frozenset[int]


def open_nodes(tape: Tape, demand: Mapping[int, Bounds], lo: Array, hi: Array, effort: Effort) -> list[Open]:
    """The demands (by core node) that do not hold everywhere in one contracted box, lo and hi (T,)."""
    low, high = forward(
        tape.nodes, lo[:, None], hi[:, None], tuple(tape.differences), batches=tape.batches, effort=effort
    )
    found = []
    for index, (least, most) in demand.items():
        node = tape.where[index]
        room = 8 * CONTRACT_SLACK * (1.0 + sum(abs(end) for end in (least, most) if math.isfinite(end)))
        if low[node, 0] < least - room or high[node, 0] > most + room:
            support = tape.support(node)
            effort.spend(PYTHON_WORK * (1 + len(support)))
            found.append(Open(index, node, least, most, support))
    return found


@dataclass(slots=True)
class Forest:
    """A forest over rows along differences: `up[row]` is (parent row, difference node)."""

    up: dict[int, tuple[int, int]] = field(default_factory=dict)
    order: list[int] = field(default_factory=list)  # children, parents before them

    def path(self, row: int) -> tuple[int, list[int]]:
        """The root above a row and the differences on the way."""
        way = []
        while row in self.up:
            row, node = self.up[row]
            way.append(node)
        return row, way


def row_at(tape: Tape, node: int) -> int:
    at = tape.nodes[node]
    return at.row if isinstance(at, Coord) else -1


def make_forest(tape: Tape, lo: Array, hi: Array, mine: Iterable[Open]) -> Forest:
    """Let coupled rows hang from one another along the narrowest differences; roots are the rows that are held best."""
    nodes = sorted({node for one in mine for node in one.support if node in tape.differences})
    width = {row: float(hi[node] - lo[node]) for row, node in tape.rows.items()}
    joined: dict[int, int] = {}
    near: dict[int, list[tuple[int, int]]] = {}
    for node in sorted(nodes, key=lambda node: (float(hi[node] - lo[node]), node)):
        a, b = tape.differences[node]
        if _find(joined, a) != _find(joined, b):
            joined[_find(joined, a)] = _find(joined, b)
            near.setdefault(a, []).append((b, node))
            near.setdefault(b, []).append((a, node))
    forest = Forest()
    seen: set[int] = set()
    for root in sorted(near, key=lambda row: (width[row], row)):
        if root in seen:
            continue
        seen.add(root)
        waiting = [root]
        while waiting:
            row = waiting.pop(0)
            for other, node in near[row]:
                if other not in seen:
                    seen.add(other)
                    forest.up[other] = row, node
                    forest.order.append(other)
                    waiting.append(other)
    return forest


def _find(joined: dict[int, int], item: int) -> int:
    while item in joined:
        item = joined[item]
    return item


def variables(tape: Tape, forest: Forest, support: Iterable[int]) -> set[int]:
    """The drawn nodes, coordinates of roots and differences to parents, that a set of leaves depends on."""
    found: set[int] = set()
    for node in support:
        pair = tape.differences.get(node)
        if pair is None:
            root, way = forest.path(row_at(tape, node))
            found.update((tape.rows[root], *way))
            continue
        (root_a, way_a), (root_b, way_b) = (forest.path(row) for row in pair)
        if root_a == root_b:
            found.update(set(way_a) ^ set(way_b))
        else:
            found.update((tape.rows[root_a], *way_a, tape.rows[root_b], *way_b))
    return found


def groups_of(tape: Tape, forest: Forest, mine: Iterable[Open], effort: Effort) -> list[set[int]]:
    """The drawn nodes that the demands tie together; every difference of the forest is in one of them."""
    groups: list[set[int]] = []
    for part in (*(variables(tape, forest, one.support) for one in mine), *({node} for _, node in forest.up.values())):
        effort.spend(PYTHON_WORK * (1 + len(part)) + 5 * len(groups))
        touching = [group for group in groups if group & part]
        groups = [group for group in groups if not group & part]
        groups.append(part.union(*touching))
    return sorted((group for group in groups if group), key=min)


def trees(tape: Tape, lo: Array, hi: Array, taken: Collection[int]) -> list[list[DifferenceBound]]:
    """Trees of differences that say more than the rows' own intervals, among the rows that are not taken."""
    edges = []
    for node, (a, b) in tape.differences.items():
        if a in taken or b in taken:
            continue
        at_a, at_b = tape.rows[a], tape.rows[b]
        least, most = lo[at_a] - hi[at_b], hi[at_a] - lo[at_b]
        low, high = max(float(lo[node]), float(least)), min(float(hi[node]), float(most))
        full = float(most - least)
        if full > 0.0 and high - low < (1.0 - 1e-6) * full:
            edges.append(((high - low) / full, a, b, low, high))
    joined: dict[int, int] = {}
    near: dict[int, list[tuple[int, float, float]]] = {}
    for _, a, b, low, high in sorted(edges):
        if _find(joined, a) != _find(joined, b):
            joined[_find(joined, a)] = _find(joined, b)
            near.setdefault(b, []).append((a, low, high))
            near.setdefault(a, []).append((b, -high, -low))
    trees: list[list[DifferenceBound]] = []
    seen: set[int] = set()
    for root in sorted(near):
        if root in seen:
            continue
        seen.add(root)
        tree: list[DifferenceBound] = []
        waiting = [root]
        while waiting:
            row = waiting.pop(0)
            for other, low, high in near[row]:
                if other not in seen:
                    seen.add(other)
                    tree.append(DifferenceBound(row, other, low, high))
                    waiting.append(other)
        trees.append(tree)
    return trees
