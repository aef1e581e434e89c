"""Pruned rejection: draw from a cover of the scenes in range, found by branch and prune, and keep what is in range.

Exact and independent: proposals are uniform over disjoint sets of known volume that contain every scene in range, so
accepted scenes follow the base distribution within each cell. The plan (which sets, and how many candidates from each)
is computed once from spec, request and seed; piece k depends only on the plan and k.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass, field
from functools import partial
from typing import ClassVar

import numpy as np

from scenegen.arrays import Array, Bool, Index
from scenegen.errors import RequestError
from scenegen.lang.formula.core import REQUIRE
from scenegen.sampling.plan import Account, Piece, Plan, Tally, digest
from scenegen.sampling.problem import SCENES_IN_CACHE, Problem, refuse_impossible
from scenegen.sampling.rejection.draw import (
    PIECE_WORK,
    PILOT_CANDIDATES,
    Stages,
    affordable,
    chunk_size,
    chunks,
    draw_kept,
    explore,
    make_stages,
    misses,
    scorable,
)
from scenegen.sampling.rejection.trial import (
    Rate,
    Trial,
    effort_of,
    make_cover,
    make_trial,
    nothing_found,
    own_covers,
    search_longer,
)
from scenegen.sampling.report import hits_info, too_early
from scenegen.sampling.streams import REJECTION_PLAN_STREAM, REJECTION_STREAM
from scenegen.search.contract import Bounds
from scenegen.search.effort import (
    CALL_SECONDS,
    DRAW_SECONDS,
    NEVER,
    SCORE_SECONDS,
    Budget,
    Stop,
    StoppedError,
    TooMuchError,
    work_per_scene,
)
from scenegen.search.prune import GOOD_ACCEPTANCE, Cover, GoodEnough, box_cover

# Cells that no candidate hit, looked at together: where phi jumps, most of the cells of a range have no scenes.
#
# Bounds seldom prove this, and a cover of each such cell takes as long as one of the whole range. Where all those
# covers would take long, one is made of each run of such cells first. Cells that its candidates hit are served from
# it; if they miss all cells, these get no covers of their own.


# work of covers of a cell each, about, above which a look at all of them together is worth it: 0.5 s
SIFTING_WORK = 3e7
MIN_RUN_CELLS = 2  # cells of a run
RUN_CHUNKS = 10  # drawn from the cover of a run
RUN_COVER_WORK = 5e6  # work of a cover of a run, about: many candidates are drawn in the time that a good one takes


@dataclass(frozen=True, slots=True, eq=False)
class CellGroup:
    """Cells that are taken from one cover; a candidate hits the rarest of them with the probability `rate`. `stages`
    are the cover's, if they were made."""

    cells: tuple[int, ...]
    cover: Cover
    rate: float
    stages: Stages | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Sieve:
    """What is known of cells that need no covers of their own: those that are served together, those proved empty, and
    those that no candidate hit."""

    served: tuple[CellGroup, ...] = ()
    empty: frozenset[int] = frozenset()
    barren: frozenset[int] = frozenset()
    tried: int = 0
    work: float = 0.0

    @property
    def settled_cells(self) -> frozenset[int]:
        return self.empty.union(self.barren, *(one.cells for one in self.served))


def sift(problem: Problem, trial: Trial, cells: Sequence[int], budget: Budget, most: float, worth: float) -> Sieve:
    """Look at those of `cells` (rising) together that no candidate of the trial hit. A cell is served with others where
    it takes at most `worth` candidates for each scene that it is to get. Without choices of surfaces phi seldom jumps:
    nothing is looked at.

    Raises StoppedError if time is up, and TooMuchError if the work exceeds `most`.
    """
    missed = [cell for cell in cells if not trial.hits[cell]]
    if len(missed) * trial.work < SIFTING_WORK or not problem.chooses:
        return Sieve()
    served, empty, barren = list[CellGroup](), set[int](), set[int]()
    effort, tried = effort_of(budget, most), 0
    possible = sorted(problem.possible)
    waiting = _runs(missed, possible)
    while waiting:
        run = waiting.pop()
        if len(run) < MIN_RUN_CELLS:
            continue
        if budget.is_spent:
            raise StoppedError
        stream = (problem.request.seed, REJECTION_PLAN_STREAM, run[0] + 1, run[-1] + 1)
        cover = make_cover(problem, _demand_of_run(problem, run), stream, effort, GoodEnough(0.0, RUN_COVER_WORK))
        if not cover.parts:
            empty.update(run)
            continue
        rng = np.random.default_rng(np.random.SeedSequence(list(stream)))
        hits, count, stages = explore(problem, cover, RUN_CHUNKS, rng, effort)
        tried += count
        if not hits[run].any():
            barren.update(run)
            continue
        common = [cell for cell in run if hits[cell] * worth >= count]
        if common:
            served.append(CellGroup(tuple(common), cover, float(hits[common].min()) / count, stages))
            waiting += _runs([cell for cell in run if cell not in common], possible)
    return Sieve(tuple(served), frozenset(empty), frozenset(barren), tried, effort.used)


def _runs(missed: Sequence[int], possible: Sequence[int]) -> list[list[int]]:
    """Cells that follow one another among the possible ones, all rising."""
    place = {cell: number for number, cell in enumerate(possible)}
    runs: list[list[int]] = []
    for cell in missed:
        if runs and place[cell] == place[runs[-1][-1]] + 1:
            runs[-1].append(cell)
        else:
            runs.append([cell])
    return runs


def _demand_of_run(problem: Problem, run: Sequence[int]) -> dict[int, Bounds]:
    """A demand that the scenes of all these cells meet."""
    limits = [problem.cells.limits(cell) for cell in run]
    low, high = np.min([ends[0] for ends in limits], axis=0), np.max([ends[1] for ends in limits], axis=0)
    return problem.demand_between(low, high)


MAX_PIECE_FACTOR = 4  # times the usual size of a piece, at most, where each brings little
# that a request of such pieces has at least, and that each brings at most
MIN_LARGE_PIECES, LARGE_PIECE_NUMBERS = 32, 1 << 21
CANDIDATES_PER_PART = 512  # candidates of each part of a cover, from which on larger pieces are no faster
MIN_PIECE_CANDIDATES = 4096  # candidates of a piece, at least; fewer for specs of thousands of atoms
COVER_CANDIDATES = 100_000  # candidates that could be drawn in the time that it takes to make a cover
SPARE_SCENES = 1.2  # more than is needed on average, so that one piece is enough for few scenes
STAGED_PILOTS = 16  # times the candidates of a pilot that a source needs for stages to be worth it
# times the work that is left, and share of it spent, at which covers are given up
HOPELESS_WORK, HOPELESS_SHARE = 2.0, 0.2
SIFTING_SHARE = 0.25  # share of the work of all covers of a cell each that a look at these cells together may take
FIRST_LOOK_WORK, FIRST_LOOK_HITS = 6e7, 4  # work of a first trial, and how many of its candidates must be in each cell


@dataclass(frozen=True, slots=True)
class CoverSource:
    """A cover and the cells whose scenes are taken from it, (C,) booleans; `candidates` are drawn for each piece, and
    scored in `stages`."""

    cover: Cover
    cells: Bool
    candidates: int
    stages: Stages | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Rejection(Plan):
    """The sources of the pieces. The first covers the whole range, the others one rare cell each.

    `reachable` are the cells that get scenes, `empty` those proved empty. `explored` is what the common cover gave
    while planning, `draws` all candidates of the plan, `expected` those that the request will need in addition. `stop`
    can interrupt pieces; it does not change their results.
    """

    sources: tuple[CoverSource, ...]
    reachable: frozenset[int]
    empty: frozenset[int]
    explored: Rate
    draws: int
    expected: float
    stop: Stop = NEVER

    method: ClassVar[str] = "rejection"

    @property
    def plan_digest(self) -> str:
        drawn = [(source.cover, source.cells, source.candidates) for source in self.sources]
        return digest("rejection", drawn, self.reachable, self.ruled_out, self.explored, self.draws)

    @property
    def reached_cells(self) -> tuple[int, ...]:
        return tuple(sorted(self.reachable))

    @property
    def ruled_out(self) -> frozenset[int]:
        return self.empty

    @property
    def candidates(self) -> int:
        """Of a piece."""
        return sum([source.candidates for source in self.sources])

    @property
    def fact_count(self) -> int:
        return len(self.sources)

    @property
    def scenes_per_piece(self) -> float:
        return SPARE_SCENES * self.scenes_wanted * self.candidates / max(self.expected, 1.0)

    @property
    def evaluations(self) -> float:
        return self.draws + self.expected

    @property
    def seconds(self) -> float:
        work, calls = work_of(self)
        moving = np.count_nonzero(self.problem.lowest < self.problem.highest)
        return self.expected * (SCORE_SECONDS * work + CALL_SECONDS * calls + DRAW_SECONDS * moving)

    def draw(self, k: int) -> Piece:
        """Piece k, the same in any process. Its facts are the hits of each source: in the whole range for the common
        cover, in its cell for the others. Raises StoppedError if time is up meanwhile."""
        rng = np.random.default_rng(np.random.SeedSequence([self.problem.request.seed, REJECTION_STREAM, k]))
        rows: list[Array] = []
        phi: list[Array] = []
        found: list[Index] = []
        hits = np.zeros(len(self.sources))
        # the same memory for all chunks: fresh pages cost time
        room = np.empty((len(self.problem.lowest), SCENES_IN_CACHE))
        for which, source in enumerate(self.sources):
            for count in chunks(source.candidates, chunk_size(self.problem, source.stages)):
                kept, values, cells = draw_kept(
                    self.problem, source.cover, count, rng, room, self.stop.check, source.stages
                )
                mine = np.flatnonzero(source.cells[cells])
                hits[which] += len(mine) if which else len(cells)
                if len(mine) < len(cells):
                    kept, values, cells = kept.take(mine, axis=1), values.take(mine, axis=1), cells[mine]
                rows.append(kept)
                phi.append(values)
                found.append(cells)
        if len(rows) == 1:
            return Piece(rows[0], phi[0], found[0], hits)
        return Piece(np.concatenate(rows, axis=1), np.concatenate(phi, axis=1), np.concatenate(found), hits)

    def account(self, tally: Tally) -> Account:
        """The acceptance rate, and how probable the range is under the base draw.

        The probability is the covers' share of the box of poses times the share of accepted candidates, with half of
        its 95 % interval (both as log10). If the spec requires something, it is the probability that a scene drawn
        uniformly over the box satisfies the requirement and is in range.
        """
        draws, first = self.draws + tally.pieces * self.candidates, self.sources[0]
        hits = tally.facts or (0.0,) * len(self.sources)
        info: dict[str, object] = {
            "method": "rejection",
            "seed": self.seed,
            "draws": draws,
            "acceptance": round(int(sum(hits)) / max(1, tally.pieces * self.candidates), 4),
            "covers": len(self.sources),
            "parts": sum([len(source.cover.parts) for source in self.sources]),
        }
        known = self.explored.hits + int(hits[0])
        if known:
            looked = self.explored.candidates + tally.pieces * first.candidates
            info |= hits_info(known, looked, first.cover.log_share + self.problem.log_excess)
            if REQUIRE in self.problem.core.labels:
                info["probability_of"] = "range and requirement"
        return Account(info, f"{draws:,} draws")

    def misses(self) -> tuple[Array, Array]:
        return misses(self.problem, self.sources[0].cover)


def make_plan(
    problem: Problem, budget: Budget, trial: Trial | None = None, most: float = math.inf, together: float = math.inf
) -> Rejection:
    """The plan of a problem; `trial` is its trial if there has been one. A time limit can only cut it short.

    `most` is the work that each cover may take, see scenegen.search.effort; `together` is that of all covers of a cell
    each: they are given up as soon as those that are made show that it cannot suffice. Raises TooMuchError if it does
    not; RequestError if there is provably no scene, and if time is up before it is known which cells get scenes,
    because a time limit must not change the scenes.
    """
    trial = make_trial(problem, budget, most) if trial is None else trial
    if problem.cells.count == 1:
        return _alone(problem, trial, frozenset({0}), frozenset(), budget)
    possible = sorted(problem.possible)
    each, _ = work_per_scene(problem.core.nodes)
    price = max(COVER_CANDIDATES, trial.work / each) if problem.chooses else COVER_CANDIDATES
    rates = trial.hits / trial.tried
    missed = [cell for cell in possible if not rates[cell]]
    hit = [cell for cell in np.argsort(rates, kind="stable").tolist() if rates[cell] and cell in problem.possible]
    shares = _Shares(rates, hit, problem.request.n / len(possible), price)
    own, empty, draws = list[CellGroup](), frozenset[int](), trial.tried
    if missed or shares.worth_another():
        own, empty, draws = _own_sources(problem, budget, trial, missed, shares, most, together)
    common = frozenset(hit[shares.best :])
    own = [one for one in own if one.cells[0] not in common] if own else own
    found = common.union(*[one.cells for one in own]) if own else common
    if not found:
        if len(empty) == len(possible):
            refuse_impossible(problem, effort_of(budget))
        longer = search_longer(problem, trial, budget)
        if not longer.hits.any():
            raise RequestError(nothing_found(problem, longer))
        return _alone(problem, longer, frozenset(map(int, np.flatnonzero(longer.hits))), empty, budget)
    sources, expected = _balance(problem, trial, common, own)
    return Rejection(problem, sources, found, empty, trial.rate, draws, expected, budget)


def _own_sources(
    problem: Problem, budget: Budget, trial: Trial, missed: Sequence[int], shares: _Shares, most: float, together: float
) -> tuple[list[CellGroup], frozenset[int], int]:
    """Sources of the cells that the trial missed, and of those that it hit so seldom that a cover of their own saves
    work, as `shares` notes; the cells that are proved empty, and all candidates. Raises what `make_plan` raises."""
    possible, hit, draws = problem.possible, shares.hit, trial.tried
    each, _ = work_per_scene(problem.core.nodes)
    try:
        worth = max(COVER_CANDIDATES, trial.work / each) * len(possible) / problem.request.n
        sieve = sift(problem, trial, missed, budget, min(most, SIFTING_SHARE * together), worth)
    except StoppedError:
        raise RequestError(too_early(problem, f"{draws:,} draws", len(possible) - len(hit))) from None
    together -= sieve.work
    draws += sieve.tried
    ruled_out, served = set(sieve.empty), list(sieve.served)
    must = [cell for cell in missed if cell not in sieve.settled_cells]
    rest = [*must, *hit]
    allowed = together
    own: list[CellGroup] = []
    with closing(own_covers(problem, rest, budget, lambda: min(most, together))) as covers:
        for done, cell in enumerate(rest):
            optional = done >= len(must)
            if optional and not shares.worth_another():
                break
            if not optional and _hopeless(allowed, together, done, len(must)):
                raise TooMuchError
            try:
                if budget.is_spent:
                    raise StoppedError
                mine = next(covers)
            except StoppedError:
                undecided = len(possible) - len(hit) - sum(len(one.cells) for one in served) - len(ruled_out)
                raise RequestError(too_early(problem, f"{draws:,} draws", max(1, undecided))) from None
            if mine.cover is None or mine.work > min(most, together):
                if optional:  # the common cover reaches the cell
                    break
                raise TooMuchError
            together -= mine.work
            draws += mine.tried
            if not mine.cover.parts:
                ruled_out.add(cell)
            elif mine.hits:
                own.append(CellGroup((cell,), mine.cover, mine.hits / mine.tried, mine.stages))
            if optional:
                shares.made.append(mine.hits / mine.tried)
    return served + sorted(own, key=lambda one: one.cells), frozenset(ruled_out), draws


def _hopeless(allowed: float, left: float, done: int, count: int) -> bool:
    """Whether covers of `done` of `count` cells took so much of the work allowed that all will take far more."""
    if not done or math.isinf(allowed):
        return False
    spent = allowed - left
    return spent >= HOPELESS_SHARE * allowed and spent / done * (count - done) > HOPELESS_WORK * left


def first_look(problem: Problem, budget: Budget) -> Rejection | None:
    """Rejection from the contracted box, if candidates of little work reach every cell; else None. Pruning would need
    fewer candidates, but can take long itself. Raises RequestError if it turns out that there is no scene."""
    seed, effort = problem.request.seed, effort_of(budget, FIRST_LOOK_WORK)
    try:
        box, stream = (problem.lowest, problem.highest), (seed, REJECTION_PLAN_STREAM)
        cover = box_cover(problem.core, *box, problem.demand(), stream, problem.tape, effort, problem.stands)
        if not cover.parts:
            refuse_impossible(problem, effort_of(budget))
        rng = np.random.default_rng(np.random.SeedSequence([seed, REJECTION_PLAN_STREAM, 0, 2]))
        hits, tried, stages = explore(problem, cover, 1, rng, effort)
    except (StoppedError, TooMuchError):
        return None
    if hits[sorted(problem.possible)].min() < FIRST_LOOK_HITS:
        return None
    trial = Trial(cover, hits, tried, effort.used, stages)
    return _alone(problem, trial, problem.possible, frozenset(), budget)


def work_of(plan: Rejection) -> tuple[float, float]:
    """The work of a candidate, and of its part of the calls; see scenegen.search.effort. Most candidates may fail in
    the first stage, but some of every chunk are scored in full."""
    common = plan.sources[0]
    stages = make_stages(plan.problem, common.cover) if common.stages is None else common.stages
    _, calls = work_per_scene(plan.problem.core.nodes)
    return stages.work, calls / chunk_size(plan.problem, stages)


def _alone(
    problem: Problem, trial: Trial, reachable: frozenset[int], ruled_out: frozenset[int], stop: Stop
) -> Rejection:
    """A plan that draws from the common cover alone."""
    rarest = max(int(trial.hits[sorted(reachable)].min()), 1) / trial.tried
    need = SPARE_SCENES * problem.request.n / (rarest * len(reachable))
    everywhere = np.ones(problem.cells.count, dtype=bool)
    stages = _worth_stages(problem, trial.cover, need, trial.stages)
    size = _size(problem, need, len(trial.cover.parts), [stages])
    source = CoverSource(trial.cover, everywhere, size, stages)
    return Rejection(problem, (source,), reachable, ruled_out, trial.rate, trial.tried, need, stop)


@dataclass(slots=True)
class _Shares:
    """Which cells are taken from the common cover, whose candidates hit them at `rates` (C,), and which from covers of
    their own. Each is to get `share` scenes; a cover takes as much work as `price` candidates. `hit` are the cells that
    the common cover hits, rarest first; `made` are the rates at which covers of the first of these are hit."""

    rates: Array
    hit: Sequence[int]
    share: float
    price: float
    made: list[float] = field(default_factory=list)

    def _cost(self, count: int, hoped: float = 0.0) -> float:
        """Candidates, if so many of the rarest get covers of their own; those yet to be made are hit as `hoped`."""
        cost = self.share / float(self.rates[self.hit[count]]) if count < len(self.hit) else 0.0
        known = self.made[:count]
        more = count - len(known)
        cost += sum([self.share / rate if rate else math.inf for rate in known]) if known else 0.0
        return cost + more * (self.price + self.share / hoped) if more else cost

    @property
    def best(self) -> int:
        """How many of the rarest cells are cheaper to serve from the covers that have been made."""
        return min(range(len(self.made) + 1), key=self._cost)

    def worth_another(self) -> bool:
        """Whether it is likely that further covers save more than they cost: if they are about as good as those made,
        or as `prune` wants them."""
        done = len(self.made)
        hoped = done / sum(1.0 / rate if rate else math.inf for rate in self.made) if done else GOOD_ACCEPTANCE
        if not hoped:
            return False
        ahead = [self._cost(count, hoped) for count in range(done + 1, len(self.hit) + 1)]
        return min(ahead, default=math.inf) < self._cost(self.best)


def _balance(
    problem: Problem, trial: Trial, common: frozenset[int], own: list[CellGroup]
) -> tuple[tuple[CoverSource, ...], float]:
    """How many candidates of each source a piece has, so that all cells are full at about the same time; and how many
    the request will need."""
    rate = trial.hits / trial.tried
    cells, parts = len(common), len(trial.cover.parts) if common else 0
    for one in own:
        cells, parts = cells + len(one.cells), parts + len(one.cover.parts)
    share = SPARE_SCENES * problem.request.n / cells
    need = [share / rate[sorted(common)].min() if common else 0.0]
    need += [share / one.rate for one in own]
    stages = [_worth_stages(problem, trial.cover, need[0], trial.stages)]
    stages += [_worth_stages(problem, one.cover, all_, one.stages) for one, all_ in zip(own, need[1:], strict=True)]
    size = _size(problem, sum(need), parts, stages)
    each = [math.ceil(size * one / sum(need)) for one in need]
    served = np.zeros(problem.cells.count, dtype=bool)
    served[sorted(common)] = True
    sources = [CoverSource(trial.cover, served, each[0], stages[0])]
    for one, candidates, mine in zip(own, each[1:], stages[1:], strict=True):
        only = np.zeros(problem.cells.count, dtype=bool)
        only[list(one.cells)] = True
        sources.append(CoverSource(one.cover, only, candidates, mine))
    return tuple(sources), float(sum(need))


def _worth_stages(problem: Problem, cover: Cover, need: float, stages: Stages | None) -> Stages | None:
    """A cover's stages: `stages` where they have been made. `need` is how many candidates the request takes in all: for
    a few, to make stages costs more than they save."""
    if stages is None and need >= STAGED_PILOTS * PILOT_CANDIDATES:
        return make_stages(problem, cover)
    return stages


def _size(problem: Problem, need: float, parts: int, stages: Sequence[Stages | None] = (None,)) -> int:
    """Candidates of a piece, from covers of so many parts, scored in these stages: all that are needed if they are few,
    else a power of two up to a full piece; more if there are many pieces, of which each brings few scenes or takes few
    from each part."""
    bits = math.ceil(math.log2(max(need, 1.0)))
    least = min(map(partial(affordable, problem, MIN_PIECE_CANDIDATES), stages))
    scored, _ = min(map(partial(scorable, problem, PIECE_WORK), stages))
    most = min(problem.piece_size, scored)
    size = int(min(max(least, 1 << min(bits, 62)), max(most, least)))
    kept, numbers = SPARE_SCENES * problem.request.n / need, len(problem.lowest) + len(problem.core.labels)
    largest = min(
        MAX_PIECE_FACTOR * problem.piece_size,
        scored,
        need / MIN_LARGE_PIECES,
        LARGE_PIECE_NUMBERS / (kept * numbers),
    )
    while 2 * size <= largest and (kept < 1.0 / MAX_PIECE_FACTOR or size < CANDIDATES_PER_PART * parts):
        size *= 2
    return size
