"""Pruned rejection: draw from a cover of the wanted scenes that branch and prune found, keep what lies in the range.

Exact and independent: proposals are uniform over disjoint sets of known volume that hold every wanted scene, so what is
kept follows the base distribution within each cell. The plan, what is drawn from and how much, is computed once from
spec, request and seed; piece k of it depends on nothing but the plan and k.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scenegen.bounds.proposal import BELOW_TURN
from scenegen.bounds.prune import Cover, prune
from scenegen.errors import RequestError
from scenegen.lang.interpret import evaluate
from scenegen.primitives import NUMPY
from scenegen.sampling.collect import Sampled
from scenegen.sampling.problem import PLAN, REJECTION, Budget, Problem, Progress, impossible
from scenegen.sampling.report import finish

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.intp]
Bool = npt.NDArray[np.bool_]

LIVE = 1 << 22  # numbers that are alive at a time while candidates are scored
CHUNK = 16_384  # candidates drawn and scored at a time, at most: intermediates then stay in cache
SMALLEST = 4096  # candidates of a piece, at least; fewer for specs of thousands of atoms
WORK = 1 << 26  # candidates times nodes that one look around may take
EXPLORE = 4  # chunks drawn from the common cover to see which cells it serves
SEARCH = 5  # chunks drawn from a cell's own cover before the cell counts as out of reach
LONG_SEARCH = 32 * 65_536  # candidates after which the search for further cells ends where exploring found none at all
OWN = 100_000  # candidates that could be drawn in the time that it takes to make a cover
SPARE = 1.2  # more than is needed on average, so that one piece is enough for few scenes
ENOUGH = 16  # hits that tell the rate of a cell well enough


@dataclass(frozen=True, slots=True)
class Source:
    """A cover and the cells whose scenes are taken from it, (C,) booleans; `candidates` are drawn for each piece."""

    cover: Cover
    cells: Bool
    candidates: int


@dataclass(frozen=True, slots=True)
class Tally:
    """Candidates looked at, and how many of them were kept."""

    candidates: int = 0
    hits: int = 0

    def __add__(self, other: Tally) -> Tally:
        return Tally(self.candidates + other.candidates, self.hits + other.hits)


@dataclass(frozen=True, slots=True)
class Piece:
    """Scenes of one piece in an order without pattern: rows (3N, m), phi (L, m); and the tally of every source."""

    rows: Array
    phi: Array
    tallies: tuple[Tally, ...]


@dataclass(frozen=True, slots=True)
class Plan:
    """What pieces are drawn from. The first source covers the whole range, the others one rare cell each.

    `reachable` are the cells that get scenes; where it is empty, none was hit yet. `ruled_out` are those proved empty.
    `explored` is the tally of the common cover while planning, `draws` all candidates of the plan. `cut` says that time
    was up before the plan was ready.
    """

    problem: Problem
    sources: tuple[Source, ...]
    reachable: frozenset[int]
    ruled_out: frozenset[int]
    explored: Tally
    draws: int
    cut: bool = False

    def piece(self, number: int) -> Piece:
        """Piece `number`, the same whoever computes it."""
        rng = np.random.default_rng(np.random.SeedSequence([self.problem.request.seed, REJECTION, number]))
        rows: list[Array] = []
        phi: list[Array] = []
        tallies = []
        room = np.empty((len(self.problem.lowest), CHUNK))  # the same memory for all chunks: fresh pages cost time
        for source in self.sources:
            hits = 0  # in the whole range for the common cover, in its cell for another
            for count in _chunks(self.problem, source.candidates):
                kept, values, cells = _draw(self.problem, source.cover, count, rng, room)
                mine = np.flatnonzero(source.cells[cells])
                if len(mine) < len(cells):
                    kept, values = kept.take(mine, axis=1), values.take(mine, axis=1)
                rows.append(kept)
                phi.append(values)
                hits += len(cells) if source is self.sources[0] else len(mine)
            tallies.append(Tally(source.candidates, hits))
        return Piece(np.concatenate(rows, axis=1), np.concatenate(phi, axis=1), tuple(tallies))


def rejection(problem: Problem, budget: Budget, progress: Progress | None = None) -> Sampled:
    """Scenes for a problem, or as many as the budget allows (`shortfall` then says why). Raises RequestError where it
    is proved that there are none."""
    plan = make_plan(problem, budget)
    collector = problem.collector(plan.reachable, plan.ruled_out)
    tallies = [Tally() for _ in plan.sources]
    number = draws = 0
    done = False
    # Without the whole plan it is not known who gets how many, and what time cuts short it must not change.
    while not plan.cut:
        piece = plan.piece(number)
        tallies = [one + more for one, more in zip(tallies, piece.tallies, strict=True)]
        collector.offer(piece.rows, piece.phi)
        number += 1
        draws = plan.draws + sum(tally.candidates for tally in tallies)
        if progress is not None:
            progress(collector.found, problem.request.n, draws)
        done = collector.complete and (draws >= LONG_SEARCH or not collector.undecided)
        if done or budget.spent:
            break
    draws = max(draws, plan.draws)
    info = {"method": "rejection", "seed": problem.request.seed, "draws": draws, **_facts(plan, tallies)}
    missed, phi = (problem.base(0).numpy()[:, :0], np.empty((len(problem.core.labels), 0)))
    if not done:
        missed, phi = _misses(plan)
    return finish(problem, collector, info, f"{draws:,} draws", missed, phi, done, early=plan.cut)


def make_plan(problem: Problem, budget: Budget) -> Plan:
    """The plan of a problem. Raises RequestError where there is provably no scene. Time can only cut it short."""
    cells = problem.cells
    seed = problem.request.seed
    cover = prune(problem.core, problem.lowest, problem.highest, problem.wanted(), (seed, PLAN), problem.tape)
    if not cover.parts:
        raise RequestError(impossible(problem))
    hits, tried = _explore(problem, cover, EXPLORE, np.random.default_rng(np.random.SeedSequence([seed, PLAN, 0])))
    explored = Tally(tried, int(hits.sum()))
    if cells.count == 1:
        reachable = frozenset({0}) if explored.hits else frozenset[int]()
        return _alone(problem, cover, reachable, frozenset(), explored, explored.candidates)
    possible = sorted(problem.possible)
    rate = hits / tried
    common = _served(rate, possible, problem.request.n / len(possible))
    ruled_out: set[int] = set()
    own: list[tuple[int, Cover, float]] = []
    draws = tried
    for cell in possible:
        if cell in common:
            continue
        if budget.spent:
            return _alone(problem, cover, frozenset(), frozenset(ruled_out), explored, draws, cut=True)
        wanted = problem.wanted(cell)
        mine = prune(problem.core, problem.lowest, problem.highest, wanted, (seed, PLAN, cell + 1), problem.tape)
        if not mine.parts:
            ruled_out.add(cell)
            continue
        rng = np.random.default_rng(np.random.SeedSequence([seed, PLAN, cell + 1]))
        counts, tried = _explore(problem, mine, SEARCH, rng, cell)
        draws += tried
        if counts[cell]:
            own.append((cell, mine, counts[cell] / tried))
    found = common.union(cell for cell, _, _ in own)
    if not found:
        return _alone(problem, cover, found, frozenset(ruled_out), explored, draws)
    sources = _balance(problem, cover, rate, common, own)
    return Plan(problem, sources, found, frozenset(ruled_out), explored, draws)


def _alone(
    problem: Problem,
    cover: Cover,
    reachable: frozenset[int],
    ruled_out: frozenset[int],
    explored: Tally,
    draws: int,
    cut: bool = False,
) -> Plan:
    """A plan that draws from the common cover alone."""
    rate = max(explored.hits, 1) / explored.candidates
    everywhere = np.ones(problem.cells.count, dtype=bool)
    source = Source(cover, everywhere, _size(problem, SPARE * problem.request.n / rate))
    return Plan(problem, (source,), reachable, ruled_out, explored, draws, cut)


def _served(rate: Array, possible: list[int], share: float) -> frozenset[int]:
    """The cells to take from the common cover: those for which that is cheaper, in candidates, than a cover each."""
    order = sorted(possible, key=lambda cell: -rate[cell])
    own = OWN + 2.0 * share
    best, cheapest = 0, own * len(order)
    for count in range(1, len(order) + 1):
        least = rate[order[count - 1]]
        if least <= 0.0:
            break
        cost = share / least + own * (len(order) - count)
        if cost < cheapest:
            best, cheapest = count, cost
    return frozenset(order[:best])


def _balance(
    problem: Problem, cover: Cover, rate: Array, common: frozenset[int], own: list[tuple[int, Cover, float]]
) -> tuple[Source, ...]:
    """How many candidates of each source a piece has, so that all cells are full at about the same time."""
    share = SPARE * problem.request.n / (len(common) + len(own))
    need = [share / min(rate[sorted(common)]) if common else 0.0, *(share / mine for _, _, mine in own)]
    size = _size(problem, sum(need))
    parts = [math.ceil(size * one / sum(need)) for one in need]
    served = np.zeros(problem.cells.count, dtype=bool)
    served[sorted(common)] = True
    sources = [Source(cover, served, parts[0])]
    for (cell, mine, _), candidates in zip(own, parts[1:], strict=True):
        only = np.zeros(problem.cells.count, dtype=bool)
        only[cell] = True
        sources.append(Source(mine, only, candidates))
    return tuple(sources)


def _size(problem: Problem, need: float) -> int:
    """Candidates of a piece: all that are needed if they are few, else a power of two up to a full piece."""
    bits = math.ceil(math.log2(max(need, 1.0)))
    least = _affordable(problem, SMALLEST)
    return int(min(max(least, 1 << min(bits, 62)), max(problem.piece_size, least)))


def _affordable(problem: Problem, count: int) -> int:
    """That many candidates, or fewer where scoring one takes thousands of operations."""
    return max(64, min(count, WORK // EXPLORE // len(problem.core.nodes)))


def _chunks(problem: Problem, count: int) -> list[int]:
    size = max(64, min(CHUNK, LIVE // len(problem.core.nodes), LIVE // len(problem.lowest)))
    whole, rest = divmod(count, size)
    return [size] * whole + ([rest] if rest else [])


def _explore(
    problem: Problem, cover: Cover, most: int, rng: np.random.Generator, cell: int | None = None
) -> tuple[Index, int]:
    """Hits of each cell, (C,), in a few chunks of candidates, and how many there were; with `cell`, as soon as that one
    is known well enough."""
    hits = np.zeros(problem.cells.count, dtype=np.intp)
    tried = 0
    for chunk in range(most):
        for count in _chunks(problem, _affordable(problem, 2048 if cell is not None and not chunk else CHUNK)):
            _, _, cells = _draw(problem, cover, count, rng)
            hits += np.bincount(cells, minlength=problem.cells.count)
            tried += count
        if cell is not None and hits[cell] >= ENOUGH:
            break
    return hits, tried


def _draw(
    problem: Problem, cover: Cover, count: int, rng: np.random.Generator, room: Array | None = None
) -> tuple[Array, Array, Index]:
    """What is kept of `count` candidates, in random order: rows (3N, m), phi (L, m), cells (m,). `room` is memory to
    draw them in, (3N, CHUNK)."""
    rows, phi, usable = _candidates(problem, cover, count, rng, room)
    for value, low, high in zip(phi, problem.cells.low, problem.cells.high, strict=True):
        if low > -math.inf:
            usable &= value >= low
        if high < math.inf:
            usable &= value <= high
    # Candidates come part by part: without shuffling, a piece that is cut off would lack the last parts.
    kept = rng.permutation(np.flatnonzero(usable))
    chosen = phi.take(kept, axis=1)
    return rows.take(kept, axis=1), chosen, problem.cells.find(chosen)


def _candidates(
    problem: Problem, cover: Cover, count: int, rng: np.random.Generator, room: Array | None = None
) -> tuple[Array, Array, Bool]:
    """Candidates (3N, B), their exact phi (L, B), and which are scenes of the part that they were drawn for, (B,)."""
    rows = np.empty((len(problem.lowest), count)) if room is None else room[:, :count]
    usable, spans = cover.draw(rows, rng)
    np.minimum(rows[2::3], BELOW_TURN, out=rows[2::3])
    values = evaluate(problem.core, list(rows), NUMPY)
    for part, span in zip(cover.parts, spans, strict=True):
        if part.apart:
            mine = part.owns(values, span)
            if mine is not None:
                usable[span] &= mine
    phi = np.empty((len(problem.core.labels), count))
    for label, node in enumerate(problem.core.labels.values()):
        phi[label] = values[node]
    return rows, phi, usable


def _misses(plan: Plan) -> tuple[Array, Array]:
    """Candidates out of the range, for the report: rows (3N, m) and phi (L, m)."""
    problem = plan.problem
    rng = np.random.default_rng(np.random.SeedSequence([problem.request.seed, PLAN, 0]))
    count = _chunks(problem, CHUNK)[0]
    rows, phi, usable = _candidates(problem, plan.sources[0].cover, count, rng)
    out = np.flatnonzero(usable & (problem.cells.find(phi) < 0))
    return rows[:, out], phi[:, out]


def _facts(plan: Plan, tallies: list[Tally]) -> dict[str, object]:
    """What goes into the scene file: the acceptance rate, and how probable the range is under the base draw.

    The probability is the covers' share of the box of poses times the share kept of what is drawn from it, with its
    standard error (both as log10); it is of a scene drawn uniformly over the box, `require` included in the range.
    """
    every = sum(tallies, Tally())
    whole = plan.explored + tallies[0]
    facts: dict[str, object] = {
        "acceptance": round(every.hits / max(1, every.candidates), 4),
        "covers": len(plan.sources),
        "parts": sum(len(source.cover.parts) for source in plan.sources),
    }
    if whole.hits:
        kept = whole.hits / whole.candidates
        log10 = math.log10(math.e)
        facts["log10_probability"] = round(plan.sources[0].cover.log_share * log10 + math.log10(kept), 6) + 0.0
        facts["log10_probability_error"] = round(log10 * math.sqrt((1.0 - kept) / whole.hits), 6)
    return facts
