"""Scenes from any proposer, refined onto their targets and verified.

A proposer, in practice a trained model, gets target values of phi and returns scenes, good or bad. They are moved
onto the target, mixed by random moves within their range, and scored exactly; those in the range and the
workspace are candidates. So the distribution within a cell is the proposer's after these moves: approximate, as the
documentation says.

torch is loaded when a plan is made, and when one of a trained model is read back in another process.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from scenegen.arrays import Array, Index
from scenegen.errors import RequestError
from scenegen.processes.pool import one_thread
from scenegen.sampling.cells import Cells
from scenegen.sampling.plan import Account, Piece, Plan, Tally, digest
from scenegen.sampling.problem import PIECE_NUMBERS, Problem
from scenegen.sampling.proposer import Proposer
from scenegen.sampling.report import shortfall, too_early
from scenegen.sampling.streams import MODEL_PIECES_STREAM, MODEL_PILOT_STREAM
from scenegen.search.effort import NEVER, Budget, Stop, StoppedError

if TYPE_CHECKING:
    from torch import Tensor

    from scenegen.learn.robustness import Robustness


# Target values of phi.


MIN_REGION_SCENES = 16  # scenes of a range that tell how phi is distributed there
MAX_SCORED_NUMBERS = (
    1 << 22
)  # nodes of the formula, of all scenes that are scored together: their values may all be in memory
REQUIRED_MARGIN = 1e-4  # of what is required, where its margin is not known: a tenth of a millimetre


@dataclass(frozen=True, slots=True, eq=False)
class Targets:
    """Combinations of target values of phi that occur in scenes.

    Drawn from `phi` (L, P) of scenes as they occur in the range, or else of a pilot sample of the base distribution, so
    that labels which are free, or depend on each other, get compatible values; if none of them is in a cell, uniform in
    the cell. `members` are these scenes in order of their cells, which begin at `borders`.
    """

    cells: Cells
    phi: Array
    members: Index
    borders: Index

    def draw(self, cells: Index, rng: np.random.Generator) -> Array:
        """A target phi for each of B cells, (B,) -> (L, B)."""
        out = np.empty((self.phi.shape[0], len(cells)))
        for cell in map(int, np.unique(cells)):
            mine = np.flatnonzero(cells == cell)
            members = self.members[self.borders[cell] : self.borders[cell + 1]]
            if len(members):
                out[:, mine] = self.phi[:, rng.choice(members, len(mine))]
            else:
                out[:, mine] = self._guess(cell, len(mine), rng)
        return out

    def _guess(self, cell: int, count: int, rng: np.random.Generator) -> Array:
        """Uniform within a cell; labels with an open end take a value of the pilot, clipped to the cell."""
        low, high = self.cells.limits(cell)
        guess: Array = self.phi[:, rng.integers(self.phi.shape[1], size=count)]
        closed = np.isfinite(low) & np.isfinite(high)
        guess = np.clip(guess, low[:, None], high[:, None])
        width = np.where(closed, high - low, 0.0)[:, None]
        return np.where(closed[:, None], low[:, None] + width * rng.random(guess.shape), guess)


def make_targets(problem: Problem, regions: Sequence[Array] = (), stop: Stop = NEVER) -> Targets:
    """The targets of a problem. `regions` are what is known of how phi is distributed, see `occurring`. Raises what
    `stop` raises."""
    cells, labels = problem.cells, len(problem.spec.labels)
    best = occurring(regions, cells.low[:labels], cells.high[:labels])
    if best.shape[1] >= MIN_REGION_SCENES:
        required = np.full((len(cells.labels) - labels, best.shape[1]), REQUIRED_MARGIN)
        return _sort_by_cell(cells, np.concatenate([best, required]))
    rng = np.random.default_rng(np.random.SeedSequence([problem.request.seed, MODEL_PILOT_STREAM]))
    lowest, highest = problem.lowest[:, None], problem.highest[:, None]
    count = min(problem.piece_size, max(1024, PIECE_NUMBERS // len(problem.core.labels)))
    with np.errstate(all="ignore"):  # phi may overflow or be undefined somewhere: such scenes are no targets
        rows = lowest + (highest - lowest) * rng.random((len(lowest), count))
        parts = []
        for start in range(0, count, size := _at_a_time(problem, count)):
            stop.check()
            parts.append(problem.phi(rows[:, start : start + size]))
    return _sort_by_cell(cells, np.concatenate(parts, axis=1))


def _at_a_time(problem: Problem, most: int) -> int:
    """How many scenes are scored together, at most."""
    return max(64, min(most, MAX_SCORED_NUMBERS // len(problem.core.nodes)))


def occurring(regions: Sequence[Array], low: Array, high: Array) -> Array:
    """phi (L, m) of scenes as they occur with phi from `low` to `high`, (L,) each. Each of the regions is (L, 2 + m),
    the lowest and the highest phi of a part of all scenes, and the phi of m scenes as they occur there. Of those that
    hold the whole range, the one with most scenes in it is taken; m is 0 where none does."""
    best = np.empty((len(low), 0))
    for one in regions if all(len(each) == len(low) for each in regions) else ():
        if (one[:, 0] <= low).all() and (one[:, 1] >= high).all():
            phi = one[:, 2:]
            inside = phi[:, ((phi >= low[:, None]) & (phi <= high[:, None])).all(axis=0)]
            best = inside if inside.shape[1] > best.shape[1] else best
    return best


def _sort_by_cell(cells: Cells, phi: Array) -> Targets:
    found = cells.find(phi)
    order = np.argsort(found, kind="stable")
    borders = np.searchsorted(found[order], np.arange(cells.count + 1))
    return Targets(cells, phi, order, borders)


# Plans that draw from a proposer.


SMALLEST, LARGEST = 256, 16_384  # candidates of a piece
REFINED_AT_ONCE = 4096  # candidates refined at a time
FIRST, MORE = 8, 4  # candidates per cell in the plan's first round; factor from one round to the next
MAX_CELL_TRIES = 2048  # candidates without success after which a cell counts as unreachable
LOOKED_AT = 512  # minimum number of cells that the plan tries if fewer scenes than cells are requested
SURPLUS = 1.2  # more than is needed on average, so that one piece is enough for few scenes
REFINING = 60  # evaluations of phi per refined candidate, about
MAX_BARREN_PIECES = 64  # a run ends after so many pieces in a row without a new scene
PHI_SLACK = 1e-9  # beyond this distance from the range, torch's phi suffices to reject a scene
GOLDEN = (5.0**0.5 - 1.0) / 2.0


@dataclass(frozen=True, slots=True, eq=False)
class ProposerPlan(Plan):
    """A proposer's scenes, refined. A piece has `counts` candidates for the cells `reachable`; `rate` is the share of
    candidates in range. Making the plan took `candidates`, of which `moved` were refined. The facts of a piece are the
    numbers of its candidates and of those that were refined. `stop` can interrupt a piece; it does not change the
    result."""

    proposer: Proposer
    targets: Targets
    reachable: tuple[int, ...]
    counts: tuple[int, ...]
    rate: float
    candidates: int
    moved: int
    stop: Stop = NEVER

    method: ClassVar[str] = "model"
    patience: ClassVar[int] = MAX_BARREN_PIECES

    @property
    def plan_digest(self) -> str:
        return digest("model", self.proposer.digest, self.reachable, self.counts)

    @property
    def reached_cells(self) -> tuple[int, ...]:
        return self.reachable

    @property
    def fact_count(self) -> int:
        return 2

    @property
    def scenes_per_piece(self) -> float:
        return self.rate * sum(self.counts)

    @property
    def evaluations(self) -> float:
        return REFINING * (self.candidates + SURPLUS * self.scenes_wanted / max(self.rate, 1e-9))

    def draw(self, k: int) -> Piece:
        rows, phi, moved = self._candidates(k)
        return Piece(rows, phi, self.cells.find(phi), np.array([float(rows.shape[1]), float(moved)]))

    def account(self, tally: Tally) -> Account:
        """What the scene file says about the run."""
        made, moved = tally.facts or (0.0, 0.0)
        candidates = self.candidates + int(made)
        info = {
            "method": "model",
            "model": self.proposer.name,
            "seed": self.seed,
            "raw": False,
            "candidates": candidates,
            "refined": self.moved + int(moved),
            **self.proposer.info,
        }
        return Account(info, _candidates_text(candidates, self.proposer))

    def misses(self) -> tuple[Array, Array]:
        try:
            rows, phi, _ = self._candidates(0)
        except StoppedError:  # time is up: nothing is known of why
            return Plan.misses(self)
        out = np.flatnonzero(self.cells.find(phi) < 0)
        return rows[:, out], phi[:, out]

    def _candidates(self, k: int) -> tuple[Array, Array, int]:
        seed = (self.seed, MODEL_PIECES_STREAM, 1, k)
        order = np.random.default_rng(np.random.SeedSequence(seed)).permutation(sum(self.counts))
        cells = np.repeat(np.array(self.reached_cells, dtype=np.intp), self.counts)[order]
        return refine_scenes(self.problem, self.targets, self.proposer, cells, seed, self.stop)


@dataclass(frozen=True, slots=True, eq=False)
class RawOutput(Plan):
    """A proposer's own scenes, `size` in a piece, neither refined nor filtered, with targets spread like the request
    (`--raw`)."""

    proposer: Proposer
    targets: Targets
    size: int
    stop: Stop = NEVER

    method: ClassVar[str] = "model"
    reached_cells: ClassVar[tuple[int, ...]] = (0,)
    is_verified: ClassVar[bool] = False

    @property
    def plan_digest(self) -> str:
        return digest("raw", self.proposer.digest, self.size)

    @property
    def fact_count(self) -> int:
        return 0

    @property
    def scenes_per_piece(self) -> float:
        return self.size

    @property
    def evaluations(self) -> float:
        return self.scenes_wanted

    def draw(self, k: int) -> Piece:
        self.stop.check()
        seed = (self.seed, MODEL_PIECES_STREAM, 2, k)
        rng = np.random.default_rng(np.random.SeedSequence(seed))
        possible = np.array(sorted(self.problem.possible), dtype=np.intp)
        target = self.targets.draw(np.resize(rng.permutation(possible), self.size), rng)
        with one_thread():
            rows = propose_scenes(self.proposer, target, seed, self.stop).numpy()
        with np.errstate(all="ignore"):
            phi = self.problem.phi(rows)
        return Piece(rows, phi, np.zeros(self.size, dtype=np.intp), np.empty(0))

    def account(self, tally: Tally) -> Account:
        """What the scene file says about the run."""
        info = {
            "method": "model",
            "model": self.proposer.name,
            "seed": self.seed,
            "raw": True,
            "candidates": self.scenes_wanted,
        }
        return Account({**info, **self.proposer.info}, _candidates_text(tally.candidates, self.proposer))


def make_plan(problem: Problem, budget: Budget, proposer: Proposer) -> Plan:
    """The plan of a problem by a proposer; with `raw`, of its raw output. Raises RequestError if none of its scenes is
    in range, or if time is up before it is known which cells get scenes."""
    rows, phi = np.empty((len(problem.lowest), 0)), np.empty((len(problem.core.labels), 0))
    try:
        targets = make_targets(problem, proposer.regions, budget)
    except StoppedError:
        raise RequestError(shortfall(problem, 0, _candidates_text(0, proposer), rows, phi)) from None
    if problem.request.raw:
        size = min(problem.request.n, LARGEST, problem.piece_size)
        return RawOutput(problem, proposer, targets, size, budget)
    seed, n, count = problem.request.seed, problem.request.n, problem.cells.count
    order = sorted(problem.possible, key=lambda cell: (cell * GOLDEN) % 1.0)[: max(n, LOOKED_AT)]
    tries, served = np.zeros(count, dtype=np.intp), np.zeros(count, dtype=np.intp)
    met = np.zeros(count, dtype=bool)
    each, moved, number = max(FIRST, -(-SMALLEST // len(order))), 0, 0
    while waiting := [cell for cell in order if not met[cell] and tries[cell] < MAX_CELL_TRIES]:
        for start in range(0, len(waiting), max(1, LARGEST // each)):
            some = np.array(waiting[start : start + max(1, LARGEST // each)], dtype=np.intp)
            cells = np.repeat(some, np.minimum(each, MAX_CELL_TRIES - tries[some]))
            try:
                if budget.is_spent:
                    raise StoppedError
                rows, phi, shifted = refine_scenes(
                    problem, targets, proposer, cells, (seed, MODEL_PIECES_STREAM, 0, number), budget
                )
            except StoppedError:
                tried = _candidates_text(int(tries.sum()), proposer)
                if met.any():
                    raise RequestError(too_early(problem, tried, len(waiting))) from None
                raise RequestError(shortfall(problem, 0, tried, rows, phi)) from None
            found = problem.cells.find(phi)
            tries += np.bincount(cells, minlength=count)
            served += np.bincount(cells[found == cells], minlength=count)
            met[found[found >= 0]] = True
            rows, phi = rows[:, found < 0], phi[:, found < 0]
            moved, number = moved + shifted, number + 1
        each *= MORE
    reached = tuple(map(int, np.flatnonzero(met)))
    candidates = int(tries.sum())
    if not reached:
        raise RequestError(shortfall(problem, 0, _candidates_text(candidates, proposer), rows, phi))
    at = list(reached)
    rate = (served[at] + 0.5) / (tries[at] + 1.0)
    counts = _share_out(SURPLUS * max(1.0, n / len(at)) / rate, min(LARGEST, problem.piece_size))
    usual = float((rate * counts).sum() / sum(counts))
    return ProposerPlan(problem, proposer, targets, reached, counts, usual, candidates, moved, budget)


def _share_out(need: Array, most: int) -> tuple[int, ...]:
    """How many candidates of a piece go to each cell, given how many each needs in total."""
    size = max(min(SMALLEST, most), need.sum() / math.ceil(need.sum() / most))
    return tuple(math.ceil(size * one / need.sum()) for one in need)


def _candidates_text(candidates: int, proposer: Proposer) -> str:
    return f"{candidates:,} candidates of the {proposer.name}"


def propose_scenes(proposer: Proposer, target: Array, seed: Sequence[int], stop: Stop) -> Tensor:
    """Scenes (3N, B) float64 for targets (L, B). Raises what `stop` raises."""
    import torch

    state = np.random.SeedSequence([*seed, 1]).generate_state(1, np.uint64)
    generator = torch.Generator().manual_seed(int(state[0] >> np.uint64(1)))
    scenes: Tensor = proposer(torch.from_numpy(target), generator, stop)
    return scenes.to(torch.float64)


def refine_scenes(
    problem: Problem, targets: Targets, proposer: Proposer, cells: Index, seed: Sequence[int], stop: Stop = NEVER
) -> tuple[Array, Array, int]:
    """Proposed and refined scenes for B cells, (3N, B), with their exact phi (L, B), and how many of them refinement
    moved. Scenes outside the workspace have phi NaN. Raises what `stop` raises."""
    import torch

    from scenegen.learn.refine import refine
    from scenegen.learn.robustness import Robustness

    robustness, workspace = Robustness(problem.core), problem.spec.workspace
    still = np.flatnonzero(problem.lowest == problem.highest)
    held = (torch.from_numpy(still), torch.from_numpy(problem.lowest[still])) if len(still) else None
    rng = np.random.default_rng(np.random.SeedSequence([*seed, 2]))
    limits = {cell: problem.cells.limits(cell) for cell in map(int, np.unique(cells))}
    rows, phi = np.empty((len(problem.lowest), len(cells))), np.empty((len(problem.core.labels), len(cells)))
    labels, box = len(problem.spec.labels), (problem.lowest, problem.highest)
    moved = 0
    with one_thread(), np.errstate(all="ignore"):
        for start in range(0, len(cells), size := _at_a_time(problem, REFINED_AT_ONCE)):
            stop.check()
            part = slice(start, start + size)
            target = targets.draw(cells[part], rng)
            ends = (np.stack(side, axis=1) for side in zip(*[limits[int(cell)] for cell in cells[part]], strict=True))
            low, high = map(torch.from_numpy, ends)
            made = propose_scenes(proposer, target, (*seed, start), stop)
            better = refine(robustness, workspace, made, torch.from_numpy(target), low, high, held, stop)
            moved += int((better != made).any(dim=0).sum())
            state = np.random.SeedSequence([*seed, start, 3]).generate_state(1, np.uint64)
            ends_of_labels = low[:labels], high[:labels]
            better = proposer.mix(better, ends_of_labels, box, int(state[0] >> np.uint64(1)), stop)
            rows[:, part] = better.numpy()
            phi[:, part] = np.where(workspace.contains(rows[:, part]), score(problem, robustness, better), np.nan)
    return rows, phi, moved


def score(problem: Problem, robustness: Robustness, rows: Tensor) -> Array:
    """Exact phi of float64 rows, (3N, B) -> (L, B); most are expected to be far out of the range.

    torch scores them all. numpy scores those near the range again, because its square root, unlike torch's, is rounded
    correctly in batches of any size. So `scenegen eval` later computes the same bits.
    """
    import torch

    with torch.no_grad():
        phi = np.array(robustness.rows(rows, check=False).numpy())
    low, high = problem.cells.low[:, None] - PHI_SLACK, problem.cells.high[:, None] + PHI_SLACK
    near = np.flatnonzero(((phi >= low) & (phi <= high)).all(axis=0))
    if len(near):
        phi[:, near] = problem.phi(rows.numpy()[:, near])
    return phi
