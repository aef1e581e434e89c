"""Pruned rejection: draw from a cover of the wanted scenes that branch and prune found, keep what lies in the range.

Exact and independent: proposals are uniform over disjoint sets of known volume that hold every wanted scene, so what is
kept follows the base distribution within each cell. The plan, what is drawn from and how much, is computed once from
spec, request and seed; piece k of it depends on nothing but the plan and k.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scenegen.bounds.effort import NEVER, Effort, Stop, StoppedError, TooMuchError, per_scene, scoring
from scenegen.bounds.proposal import BELOW_TURN
from scenegen.bounds.prune import Cover, box_cover, prune
from scenegen.errors import Diagnostic, RequestError
from scenegen.lang.core import REQUIRE
from scenegen.lang.interpret import evaluate
from scenegen.primitives import NUMPY
from scenegen.sampling.cells import Cells
from scenegen.sampling.digest import digest
from scenegen.sampling.pieces import MANY_PIECES, Account, Candidates, Tally
from scenegen.sampling.problem import PLAN, REJECTION, Budget, Problem, impossible
from scenegen.sampling.report import shortfall, too_early

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.intp]
Bool = npt.NDArray[np.bool_]

LIVE = 1 << 22  # numbers that are alive at a time while candidates are scored
CHUNK = 16_384  # candidates drawn and scored at a time, at most: intermediates then stay in cache
SMALLEST = 4096  # candidates of a piece, at least; fewer for specs of thousands of atoms
WORK = 1 << 26  # candidates times nodes that one look around may take
PIECE, PART = 1 << 24, 1 << 22  # work (see bounds.effort) of a piece and of a chunk: a third and a tenth of a second
MOST = 1.4e8  # work of a trial from which on another method is worth a try: more than any shipped spec takes, 2 to 3 s
EXPLORE = 4  # chunks drawn from the common cover to see which cells it serves
SEARCH = 5  # chunks drawn from a cell's own cover before the cell counts as out of reach
LONG_SEARCH = 32 * 65_536  # candidates after which the search for further cells ends where exploring found none at all
OWN = 100_000  # candidates that could be drawn in the time that it takes to make a cover
SPARE = 1.2  # more than is needed on average, so that one piece is enough for few scenes
LOOK, FEW, EASY = 6e7, 4, 1e8  # work of a first look; hits in each cell, and the work of the request, for it to suffice
ENOUGH = 16  # hits that tell the rate of a cell well enough


@dataclass(frozen=True, slots=True)
class Source:
    """A cover and the cells whose scenes are taken from it, (C,) booleans; `candidates` are drawn for each piece."""

    cover: Cover
    cells: Bool
    candidates: int


@dataclass(frozen=True, slots=True)
class Rate:
    """Candidates looked at, and how many of them were kept."""

    candidates: int = 0
    hits: int = 0


@dataclass(frozen=True, slots=True)
class Trial:
    """A cover of the whole range and what the first candidates from it say: `hits` (C,) of each cell, among `tried`.
    `work` is what it took, see scenegen.bounds.effort."""

    cover: Cover
    hits: Index
    tried: int
    work: float = 0.0

    @property
    def rate(self) -> Rate:
        return Rate(self.tried, int(self.hits.sum()))


@dataclass(frozen=True, slots=True)
class Plan:
    """What pieces are drawn from. The first source covers the whole range, the others one rare cell each.

    `reachable` are the cells that get scenes, `ruled_out` those proved empty. `explored` is what the common cover gave
    while planning, `draws` all candidates of the plan, `expected` those that the request will take beside them. `stop`
    can break pieces off, and is no part of what they depend on.
    """

    problem: Problem
    sources: tuple[Source, ...]
    reachable: frozenset[int]
    ruled_out: frozenset[int]
    explored: Rate
    draws: int
    expected: float
    stop: Stop = NEVER

    name = "rejection"
    fewest = 1
    patience = None

    @property
    def plan_digest(self) -> str:
        return digest("rejection", self.sources, self.reachable, self.ruled_out, self.explored, self.draws)

    @property
    def wanted(self) -> int:
        return self.problem.request.n

    @property
    def seed(self) -> int:
        return self.problem.request.seed

    @property
    def cells(self) -> Cells:
        return self.problem.cells

    @property
    def reached(self) -> tuple[int, ...]:
        return tuple(sorted(self.reachable))

    @property
    def shared_by(self) -> int:
        return MANY_PIECES

    @property
    def evaluations(self) -> float:
        return self.draws + self.expected

    def piece(self, k: int) -> Candidates:
        """Piece k, the same whoever computes it; its facts are the hits of each source: in the whole range for the
        common cover, in its cell for another. Raises StoppedError where time is up meanwhile."""
        rng = np.random.default_rng(np.random.SeedSequence([self.problem.request.seed, REJECTION, k]))
        rows: list[Array] = []
        phi: list[Array] = []
        found: list[Index] = []
        hits = np.zeros(len(self.sources))
        room = np.empty((len(self.problem.lowest), CHUNK))  # the same memory for all chunks: fresh pages cost time
        for which, source in enumerate(self.sources):
            for count in _chunks(self.problem, source.candidates):
                kept, values, cells = _draw(self.problem, source.cover, count, rng, room, self.stop.check)
                mine = np.flatnonzero(source.cells[cells])
                hits[which] += len(mine) if which else len(cells)
                if len(mine) < len(cells):
                    kept, values, cells = kept.take(mine, axis=1), values.take(mine, axis=1), cells[mine]
                rows.append(kept)
                phi.append(values)
                found.append(cells)
        if len(rows) == 1:
            return Candidates(rows[0], phi[0], found[0], hits)
        return Candidates(np.concatenate(rows, axis=1), np.concatenate(phi, axis=1), np.concatenate(found), hits)

    def account(self, tally: Tally) -> Account:
        """The acceptance rate, and how probable the range is under the base draw."""
        draws = self.draws + tally.pieces * sum(source.candidates for source in self.sources)
        hits = tally.facts or (0.0,) * len(self.sources)
        rates = [
            Rate(tally.pieces * source.candidates, int(count)) for source, count in zip(self.sources, hits, strict=True)
        ]
        info = {"method": "rejection", "seed": self.seed, "draws": draws, **_facts(self, rates)}
        return Account(info, f"{draws:,} draws")

    def misses(self) -> tuple[Array, Array]:
        return _misses(self.problem, self.sources[0].cover)


def make_plan(problem: Problem, budget: Budget, trial: Trial | None = None, most: float = math.inf) -> Plan:
    """The plan of a problem; `trial` is its trial, where that has been made. Time can only cut it short.

    `most` is the work that each cover may take, see scenegen.bounds.effort. Raises TooMuchError where that does not
    suffice; RequestError where there is provably no scene, and where time is up before it is known which cells get
    scenes: what time cuts short, it must not change.
    """
    trial = make_trial(problem, budget, most) if trial is None else trial
    if problem.cells.count == 1:
        return _alone(problem, trial, frozenset({0}), frozenset(), budget)
    possible = sorted(problem.possible)
    rate = trial.hits / trial.tried
    common = _served(rate, possible, problem.request.n / len(possible))
    ruled_out: set[int] = set()
    own: list[tuple[int, Cover, float]] = []
    draws = trial.tried
    seed = problem.request.seed
    for cell in possible:
        if cell in common:
            continue
        try:
            if budget.spent:
                raise StoppedError
            effort = _effort(budget, most)
            mine = _cover(problem, problem.wanted(cell), (seed, PLAN, cell + 1), effort)
            if not mine.parts:
                ruled_out.add(cell)
                continue
            rng = np.random.default_rng(np.random.SeedSequence([seed, PLAN, cell + 1]))
            counts, tried = _explore(problem, mine, SEARCH, rng, effort, cell)
        except StoppedError:
            undecided = len(possible) - len(common) - len(own) - len(ruled_out)
            raise RequestError(too_early(problem, f"{draws:,} draws", undecided)) from None
        draws += tried
        if counts[cell]:
            own.append((cell, mine, counts[cell] / tried))
    found = common.union(cell for cell, _, _ in own)
    if not found:
        if len(ruled_out) == len(possible):
            raise RequestError(impossible(problem, _effort(budget)))
        longer = search(problem, trial, lambda: budget.spent)
        if not longer.rate.hits:
            raise RequestError(hopeless(problem, longer))
        return _alone(problem, longer, frozenset(map(int, np.flatnonzero(longer.hits))), frozenset(ruled_out), budget)
    sources, expected = _balance(problem, trial.cover, rate, common, own)
    return Plan(problem, sources, found, frozenset(ruled_out), trial.rate, draws, expected, budget)


def _effort(budget: Budget, most: float = math.inf) -> Effort:
    """Work that is stopped where time has long been up."""
    return Effort(lambda: budget.overdrawn, most)


def _cover(problem: Problem, wanted: Mapping[int, tuple[float, float]], seed: tuple[int, ...], effort: Effort) -> Cover:
    return prune(problem.core, problem.lowest, problem.highest, wanted, seed, problem.tape, effort)


def make_trial(problem: Problem, budget: Budget, most: float = math.inf) -> Trial:
    """The cover of the whole range and a first look at what it gives.

    Raises RequestError where the cover proves that there is no scene, or time is up before there is one, and
    TooMuchError where the work comes to more than `most`: the same on any machine.
    """
    seed = problem.request.seed
    effort = _effort(budget, most)
    try:
        cover = _cover(problem, problem.wanted(), (seed, PLAN), effort)
        if not cover.parts:
            raise RequestError(impossible(problem, _effort(budget)))
        rng = np.random.default_rng(np.random.SeedSequence([seed, PLAN, 0]))
        hits, tried = _explore(problem, cover, EXPLORE, rng, effort)
    except StoppedError:
        raise RequestError(too_early(problem, "no draws at all", problem.cells.count)) from None
    return Trial(cover, hits, tried, effort.used)


def first_look(problem: Problem, budget: Budget) -> Plan | None:
    """Rejection from the box that contraction leaves of the range, if that serves every cell and takes little work;
    else None. Pruning would need fewer candidates, but it can take long to find out how. Raises RequestError where it
    turns out that there is no scene."""
    seed, effort = problem.request.seed, _effort(budget, LOOK)
    try:
        cover = box_cover(
            problem.core, problem.lowest, problem.highest, problem.wanted(), (seed, PLAN), problem.tape, effort
        )
        if not cover.parts:
            raise RequestError(impossible(problem, _effort(budget)))
        rng = np.random.default_rng(np.random.SeedSequence([seed, PLAN, 0, 2]))
        hits, tried = _explore(problem, cover, 1, rng, effort)
    except (StoppedError, TooMuchError):
        return None
    if hits[sorted(problem.possible)].min() < FEW:
        return None
    plan = _alone(problem, Trial(cover, hits, tried, effort.used), problem.possible, frozenset(), budget)
    return plan if plan.expected * per_scene(problem.core.nodes)[0] <= EASY else None


def search(problem: Problem, trial: Trial, stop: Callable[[], bool], most: float = math.inf) -> Trial:
    """A longer look, where the first found nothing: at least LONG_SEARCH candidates, and on until one is in the range,
    there are `most`, or `stop` says so."""
    rng = np.random.default_rng(np.random.SeedSequence([problem.request.seed, PLAN, 0, 1]))
    hits, tried = trial.hits.copy(), trial.tried
    effort = Effort(stop)
    while not stop() and (tried < LONG_SEARCH or (tried < most and not hits.any())):
        try:
            more, count = _explore(problem, trial.cover, EXPLORE, rng, effort)
        except StoppedError:
            break
        hits += more
        tried += count
    return Trial(trial.cover, hits, tried, trial.work)


def hopeless(problem: Problem, trial: Trial) -> Diagnostic:
    """What to say where no candidate was in the range."""
    return shortfall(problem, 0, f"{trial.tried:,} draws", *_misses(problem, trial.cover))


def _alone(problem: Problem, trial: Trial, reachable: frozenset[int], ruled_out: frozenset[int], stop: Stop) -> Plan:
    """A plan that draws from the common cover alone."""
    rarest = max(int(trial.hits[sorted(reachable)].min()), 1) / trial.tried
    need = SPARE * problem.request.n / (rarest * len(reachable))
    everywhere = np.ones(problem.cells.count, dtype=bool)
    source = Source(trial.cover, everywhere, _size(problem, need))
    return Plan(problem, (source,), reachable, ruled_out, trial.rate, trial.tried, need, stop)


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
) -> tuple[tuple[Source, ...], float]:
    """How many candidates of each source a piece has, so that all cells are full at about the same time; and how many
    the request will take."""
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
    return tuple(sources), float(sum(need))


def _size(problem: Problem, need: float) -> int:
    """Candidates of a piece: all that are needed if they are few, else a power of two up to a full piece."""
    bits = math.ceil(math.log2(max(need, 1.0)))
    least = _affordable(problem, SMALLEST)
    most = min(problem.piece_size, _within(problem, PIECE))
    return int(min(max(least, 1 << min(bits, 62)), max(most, least)))


def _within(problem: Problem, work: float) -> int:
    """How many candidates can be scored with so much work, at least 64."""
    return max(64, int(work / max(1.0, per_scene(problem.core.nodes)[0])))


def _affordable(problem: Problem, count: int) -> int:
    """That many candidates, or fewer where scoring one takes thousands of operations."""
    return max(64, min(count, WORK // EXPLORE // len(problem.core.nodes), _within(problem, PIECE)))


def _chunks(problem: Problem, count: int) -> list[int]:
    live = LIVE // max(len(problem.core.nodes), len(problem.lowest))
    size = max(64, min(CHUNK, live, _within(problem, PART)))
    whole, rest = divmod(count, size)
    return [size] * whole + ([rest] if rest else [])


def _explore(
    problem: Problem, cover: Cover, most: int, rng: np.random.Generator, effort: Effort, cell: int | None = None
) -> tuple[Index, int]:
    """Hits of each cell, (C,), in a few chunks of candidates, and how many there were; with `cell`, as soon as that one
    is known well enough. Raises what `effort` raises."""
    hits = np.zeros(problem.cells.count, dtype=np.intp)
    tried = 0
    for chunk in range(most):
        for count in _chunks(problem, _affordable(problem, 2048 if cell is not None and not chunk else CHUNK)):
            effort.spend(scoring(problem.core.nodes, count))
            _, _, cells = _draw(problem, cover, count, rng, check=effort.check)
            hits += np.bincount(cells, minlength=problem.cells.count)
            tried += count
        if cell is not None and hits[cell] >= ENOUGH:
            break
    return hits, tried


def _draw(
    problem: Problem,
    cover: Cover,
    count: int,
    rng: np.random.Generator,
    room: Array | None = None,
    check: Callable[[], None] | None = None,
) -> tuple[Array, Array, Index]:
    """What is kept of `count` candidates, in random order: rows (3N, m), phi (L, m), cells (m,). `room` is memory to
    draw them in, (3N, CHUNK); `check` may break off, see `evaluate`."""
    rows, phi, usable = _candidates(problem, cover, count, rng, room, check)
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
    problem: Problem,
    cover: Cover,
    count: int,
    rng: np.random.Generator,
    room: Array | None = None,
    check: Callable[[], None] | None = None,
) -> tuple[Array, Array, Bool]:
    """Candidates (3N, B), their exact phi (L, B), and which are scenes of the part that they were drawn for, (B,)."""
    rows = np.empty((len(problem.lowest), count)) if room is None else room[:, :count]
    usable, spans = cover.draw(rows, rng)
    np.minimum(rows[2::3], BELOW_TURN, out=rows[2::3])
    values = evaluate(problem.core, list(rows), NUMPY, check)
    for part, span in zip(cover.parts, spans, strict=True):
        if part.apart:
            mine = part.owns(values, span)
            if mine is not None:
                usable[span] &= mine
    phi = np.empty((len(problem.core.labels), count))
    for label, node in enumerate(problem.core.labels.values()):
        phi[label] = values[node]
    return rows, phi, usable


def _misses(problem: Problem, cover: Cover) -> tuple[Array, Array]:
    """Candidates out of the range, for the report: rows (3N, m) and phi (L, m)."""
    rng = np.random.default_rng(np.random.SeedSequence([problem.request.seed, PLAN, 0]))
    count = _chunks(problem, CHUNK)[0]
    rows, phi, usable = _candidates(problem, cover, count, rng)
    out = np.flatnonzero(usable & (problem.cells.find(phi) < 0))
    return rows[:, out], phi[:, out]


def _facts(plan: Plan, rates: Sequence[Rate]) -> dict[str, object]:
    """What goes into the scene file: the acceptance rate, and how probable the range is under the base draw.

    The probability is the covers' share of the box of poses times the share kept of what is drawn from it, with half
    of its 95 % interval (both as log10). Where the spec requires something, it is of meeting that and the range, by a
    scene drawn uniformly over the box.
    """
    drawn = sum(rate.candidates for rate in rates)
    kept_of_all = sum(rate.hits for rate in rates)
    facts: dict[str, object] = {
        "acceptance": round(kept_of_all / max(1, drawn), 4),
        "covers": len(plan.sources),
        "parts": sum(len(source.cover.parts) for source in plan.sources),
    }
    hits = plan.explored.hits + rates[0].hits
    if hits:
        kept = hits / (plan.explored.candidates + rates[0].candidates)
        log10 = math.log10(math.e)
        facts["log10_probability"] = round(plan.sources[0].cover.log_share * log10 + math.log10(kept), 6) + 0.0
        facts["log10_error"] = round(1.96 * log10 * math.sqrt((1.0 - kept) / hits), 6)
        if REQUIRE in plan.problem.core.labels:
            facts["probability_of"] = "range and requirement"
    return facts
