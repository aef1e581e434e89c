"""Assembles the candidates of pieces into blocks of scenes that are spread evenly over the cells.

How n scenes are spread over the cells although no process ever holds more than a few blocks of them:

* Scene number i of the output (before the shuffle within its block) belongs to cell i mod C of the C reached cells in a
  fixed order. With groups of cells it belongs to group i mod G, and there to the next cell; a group of weight w has w
  turns of a round. So every block of 65,536
  is spread as evenly as integers allow, and so are all n together; the order of the cells (multiples of the golden
  ratio) determines which cells get an additional scene, at even distances.
* Candidates are offered in the order of the pieces. A cell keeps the first ones, as many as the current block and the
  next one need; the others are dropped. That depends on counts per cell only, never on the scenes, so within a cell the
  kept ones follow the same distribution as the offered ones.
* A block is finished when every cell has its share of it; it is then shuffled with a seed of its own. With a single
  cell there is nothing to shuffle: candidates come in random order. Where pieces are small, its blocks leave in parts,
  so that little is left to be checked and written after the last piece.

A shuffle across blocks would need all scenes in memory or twice on disk. It is not needed: any sequence of scenes a few
times as long as C is already even over the cells. Common cells wait for rare ones, at most one block ahead, which
limits the memory. The blocks depend only on the candidates and their order, not on the number of workers.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from scenegen.arrays import Array
from scenegen.processes.pool import run_pieces
from scenegen.sampling.plan import Piece, Plan, Tally
from scenegen.sampling.request import Progress
from scenegen.sampling.streams import BLOCK_ORDER_STREAM
from scenegen.scenes.blocks import BLOCK, Block, join_blocks
from scenegen.search.effort import StoppedError

Cells = npt.NDArray[np.integer[Any]]


@dataclass(frozen=True, slots=True)
class Drawing:
    """Piece k of a plan: its candidates in range, the cell of each as a small integer. The requirement's margin, the
    last row of phi if there is one, is no longer needed then."""

    plan: Plan
    labels: int

    def __call__(self, k: int) -> Piece:
        made = self.plan.draw(k)
        block, cell = Block(made.rows, made.phi[: self.labels]), made.cell
        if len(cell) and cell.min() < 0:
            inside = np.flatnonzero(cell >= 0)
            block, cell = block.take(inside), cell[inside]
        small = np.min_scalar_type(-int(cell.max(initial=0)) - 1)  # cells often need a byte each, not eight
        return Piece(block.rows, block.phi, cell.astype(small), made.facts)


Cell = npt.NDArray[np.intp]

GOLDEN = (5.0**0.5 - 1.0) / 2.0  # its multiples are evenly spaced modulo 1, for any number of them


class BlockAssembler:
    """Assembles blocks. `done` scenes are in finished blocks, `candidates` in reached cells have been offered, and
    `strays` are cells that were hit although the plan considers them unreachable."""

    def __init__(
        self,
        reached: Sequence[int],
        wanted: int,
        seed: int,
        size: int = BLOCK,
        groups: Sequence[Sequence[int]] | None = None,
        weights: Sequence[int] | None = None,
    ) -> None:
        shift = np.random.default_rng(np.random.SeedSequence([seed, BLOCK_ORDER_STREAM])).random()
        cells = np.array(sorted(reached), dtype=np.intp)
        groups = [reached] if groups is None else groups
        if not len(cells):
            raise ValueError("no cell can be reached")
        self._cells = cells
        self._index = np.full(cells[-1] + 2, -1, dtype=np.intp)  # of each cell among the reached ones; -1 for others
        self._index[cells] = np.arange(len(cells))
        self._turn = np.empty(len(cells), dtype=np.intp)  # the place of each cell in the order of its group
        self._many = np.empty(len(cells), dtype=np.intp)  # how many cells its group has
        self._group = np.empty(len(cells), dtype=np.intp)
        often = np.ones(len(groups), dtype=np.intp) if weights is None else np.array(weights, dtype=np.intp)
        owners = np.arange(len(groups)).repeat(often)
        within = np.arange(len(owners)) - (often.cumsum() - often)[owners]
        order = _order(np.arange(len(groups)), shift)
        # the groups of a round of scenes, each as evenly as can be
        self._owners = owners[np.lexsort((order[owners], (within + 0.5) / often[owners]))]
        for number, group in enumerate(groups):
            mine = self._index[np.array(sorted(group), dtype=np.intp)]
            self._turn[mine], self._many[mine] = _order(cells[mine], shift), len(mine)
            self._group[mine] = number
        self._wanted, self._seed, self._size = wanted, seed, size
        self._waiting: list[tuple[Block, Cell]] = []  # with the index of each scene's cell
        self._count = np.zeros(len(cells), dtype=np.intp)  # of those that wait, by index of the cell
        self.done = self.candidates = 0
        self.strays: set[int] = set()

    @property
    def complete(self) -> bool:
        return self.done == self._wanted

    @property
    def waiting(self) -> int:
        """The number of scenes for unfinished blocks."""
        return int(self._count.sum())

    @property
    def count(self) -> int:
        """The number of scenes if the run ended now."""
        return self.done + self.waiting

    @property
    def scarcest(self) -> int | None:
        """The cell that lacks most scenes of its share; None if none does."""
        if self.complete:
            return None
        lacks = self._shares(self.done, self._wanted) - self._count
        return int(self._cells[int(lacks.argmax())])

    @property
    def shares(self) -> dict[int, int]:
        """How many of all scenes belong to each reached cell."""
        return dict(zip(self._cells.tolist(), self._shares(0, self._wanted).tolist(), strict=True))

    def offer(self, block: Block, cell: Cells) -> Iterator[Block]:
        """The blocks that m more candidates complete; `cell` (m,) is -1 for those out of range."""
        cell = cell.astype(np.intp, copy=False)
        index = self._index[np.minimum(cell, len(self._index) - 1)]
        known = index >= 0
        self.strays.update(np.bincount(cell[~known & (cell >= 0)]).nonzero()[0].tolist())
        self.candidates += int(known.sum())
        # In slices: scenes that are dropped because a cell is full could be used after a block is finished.
        for start in range(0, block.count, self._size):
            part = slice(start, start + self._size)
            self._keep(block.part(start, start + self._size), index[part], known[part])
            yield from self._finish_blocks()

    def rest(self) -> Block | None:
        """The scenes of unfinished blocks, in random order: for a run that has to end early."""
        if not self._waiting:
            return None
        block, index = self._together()
        self._waiting, self._count = [], np.zeros_like(self._count)
        return self._leave(block, np.arange(len(index)))

    def state(self) -> tuple[dict[str, object], Array]:
        """Everything that the request does not determine, to continue from later: JSON, and the scenes of unfinished
        blocks as (3N + L + 1, m), the number of the cell in the last row."""
        facts: dict[str, object] = {"done": self.done, "candidates": self.candidates, "strays": sorted(self.strays)}
        if not self._waiting:
            return facts, np.empty((0, 0))
        block, index = self._together()
        self._waiting = [(block, index)]
        return facts, np.concatenate([block.rows, block.phi, self._cells[index][None].astype(np.float64)])

    def restore(self, facts: dict[str, object], waiting: Array, coordinates: int) -> None:
        """Restores this state in a new assembler of the same request; `coordinates` is 3N."""
        done, candidates, strays = facts["done"], facts["candidates"], facts["strays"]
        assert isinstance(done, int) and isinstance(candidates, int) and isinstance(strays, list)
        self.done, self.candidates, self.strays = done, candidates, set(strays)
        if waiting.size:
            index = self._index[waiting[-1].astype(np.intp)]
            self._waiting = [(Block(waiting[:coordinates], waiting[coordinates:-1]), index)]
            self._count = np.bincount(index, minlength=len(self._cells))

    def _shares(self, start: int, stop: int) -> Cell:
        """How many of the scenes `start` up to `stop` belong to each cell."""
        size, shares = len(self._owners), list[Cell]()
        for end in (start, stop):
            turns = np.bincount(self._owners, _turns(end, np.arange(size), size)).astype(np.intp)
            shares.append(_turns(turns[self._group], self._turn, self._many))
        return shares[1] - shares[0]

    def _keep(self, block: Block, index: Cell, known: npt.NDArray[np.bool_]) -> None:
        horizon = min(self.done + 2 * self._size, self._wanted)
        room = self._shares(self.done, horizon) - self._count
        if len(self._cells) == 1 and known.all():
            count = min(block.count, int(room[0]))
            if count > 0:
                self._waiting.append((block.part(0, count), index[:count]))
                self._count += count
            return
        kept = np.flatnonzero(known)
        kept = kept[_rank(index[kept], len(self._cells)) < room[index[kept]]]
        if len(kept):
            self._waiting.append((block.take(kept), index[kept]))
            self._count += np.bincount(index[kept], minlength=len(self._cells))

    def _finish_blocks(self) -> Iterator[Block]:
        while not self.complete:
            shares = self._shares(self.done, min(self.done + self._size, self._wanted))
            if (self._count < shares).any():
                return
            block, index = self._together()
            if len(self._cells) == 1:
                size = int(shares[0])
                self._waiting = [(block.part(size, block.count), index[size:])] if size < block.count else []
                self._count = self._count - size
                self.done += size
                yield block.part(0, size)
                continue
            leaves = _rank(index, len(self._cells)) < shares[index]
            stays = np.flatnonzero(~leaves)
            self._waiting = [(block.take(stays), index[stays])] if len(stays) else []
            self._count = self._count - shares
            yield self._leave(block, np.flatnonzero(leaves))

    def _leave(self, block: Block, which: Cell) -> Block:
        if len(self._cells) == 1:
            self.done += len(which)
            return block
        seed = np.random.SeedSequence([self._seed, BLOCK_ORDER_STREAM, self.done])
        order = which[np.random.default_rng(seed).permutation(len(which))]
        self.done += len(order)
        return block.take(order)

    def _together(self) -> tuple[Block, Cell]:
        blocks, indices = zip(*self._waiting, strict=True)
        if len(blocks) == 1:
            return blocks[0], indices[0]
        first: Block = blocks[0]
        return join_blocks(blocks, len(first.rows), len(first.phi)), np.concatenate(indices)


def _order(cells: Cell, shift: float) -> Cell:
    """The place of each of these in their order."""
    turn = np.empty(len(cells), dtype=np.intp)
    turn[np.argsort((cells * GOLDEN + shift) % 1.0, kind="stable")] = np.arange(len(cells))
    return turn


def _turns(end: Any, turn: Cell, count: Any) -> Any:
    """How many of `end` turns are those of place `turn` among `count`."""
    return (end - turn + count - 1) // count


def _rank(index: Cell, count: int) -> Cell:
    """The index of each scene among the scenes of its cell, from 0."""
    # numpy sorts 16-bit integers ten times as fast as larger ones
    order = np.argsort(index.astype(np.int16) if count <= np.iinfo(np.int16).max else index, kind="stable")
    size = np.bincount(index, minlength=count)
    first = np.cumsum(size) - size
    rank = np.empty(len(index), dtype=np.intp)
    rank[order] = np.arange(len(index)) - first[index[order]]
    return rank


@dataclass(slots=True)
class RunProgress:
    """The progress of a run. `used` pieces have given the sums `facts`; the last `idle` of them gave no new scene.
    `cut` says how far the piece had come that the time limit cut short."""

    plan: Plan
    size: int = BLOCK
    used: int = 0
    idle: int = 0
    facts: Array = field(default_factory=lambda: np.empty(0))
    cut: str = ""
    assembler: BlockAssembler = field(init=False)

    def __post_init__(self) -> None:
        plan = self.plan
        self.assembler = BlockAssembler(
            plan.reached_cells, plan.scenes_wanted, plan.seed, self.size, plan.groups, plan.weights
        )

    def follow(self, pieces: Iterator[Any], spent: Callable[[], bool], progress: Progress | None) -> Iterator[Any]:
        """The pieces, one after the other, until the run ends or its time is `spent`; `take` gets each."""
        while not self.is_over:
            try:
                piece = next(pieces)
            except StoppedError as stopped:  # time was up in the midst of the piece
                self.cut = stopped.how_far
                return
            yield piece
            if progress is not None:
                progress(self.assembler.count, self.plan.scenes_wanted, self.assembler.candidates)
            if spent():
                return

    @property
    def is_over(self) -> bool:
        """Whether the run has come to its end by itself."""
        if self.assembler.complete:
            return self.used >= self.plan.fewest
        patience = self.plan.patience
        return patience is not None and self.idle >= patience

    def take(self, piece: Piece) -> Generator[Block, None, None]:
        """The blocks that one more piece completes."""
        found, facts = self.assembler.count, piece.facts
        yield from self.assembler.offer(piece, piece.cell)
        if len(facts) > len(self.facts):  # an empty piece may have fewer facts than others
            self.facts, facts = facts.copy(), self.facts
        self.facts[: len(facts)] += facts
        self.idle = self.idle + 1 if self.assembler.count == found else 0
        self.used += 1

    def tally(self) -> Tally:
        assembler = self.assembler
        strays, facts = tuple(sorted(assembler.strays)), tuple(map(float, self.facts))
        return Tally(
            assembler.done,
            assembler.count,
            self.used,
            assembler.candidates,
            strays,
            facts,
            assembler.scarcest,
            self.cut,
        )

    def state(self) -> tuple[dict[str, object], Array]:
        """Everything that the request does not determine: JSON, and the scenes of unfinished blocks."""
        facts, waiting = self.assembler.state()
        state = {"pieces": self.used, "idle": self.idle, "found": self.assembler.count}
        return {**state, "facts": self.facts.tolist(), "assembler": facts}, waiting

    def restore(self, state: Mapping[str, Any], waiting: Array, coordinates: int) -> None:
        self.used, self.idle = int(state["pieces"]), int(state["idle"])
        self.facts = np.array(state["facts"], dtype=np.float64)
        self.assembler.restore(state["assembler"], waiting, coordinates)


def run_blocks(
    plan: Plan,
    labels: int,
    *,
    workers: int = 1,
    spent: Callable[[], bool] = lambda: False,
    progress: Progress | None = None,
    size: int = BLOCK,
) -> Generator[Block, None, Tally]:
    """The scenes of a request in blocks of `size`; the generator's return value is the tally.

    `labels` is the number of the spec's labels. `spent` is called after each piece; if it returns True, the run ends
    with fewer scenes than requested. Raises what `run_pieces` raises.
    """
    run = RunProgress(plan, size)
    with closing(run_pieces(Drawing(plan, labels), itertools.count(), workers)) as pieces:
        for piece in run.follow(pieces, spent, progress):
            yield from run.take(piece)
    scarcest = run.assembler.scarcest
    rest = run.assembler.rest()
    if rest is not None:
        yield rest
    return replace(run.tally(), scarcest=scarcest)
