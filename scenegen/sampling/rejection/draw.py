"""Candidates from a cover, scored and sorted into cells, some at a time."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass

import numpy as np

from scenegen.arrays import Array, Bool, Index
from scenegen.geometry import NUMPY
from scenegen.lang.formula.core import Core, Junction, Node, children
from scenegen.lang.formula.interpret import FEWEST_GAPS, GapMinima, evaluate, find_groups
from scenegen.pose import keep_below_turn, row_count
from scenegen.sampling.problem import LIVE_NUMBERS, SCENES_IN_CACHE, Problem
from scenegen.sampling.streams import REJECTION_PLAN_STREAM
from scenegen.search.effort import Effort, dear_nodes, work_per_scene
from scenegen.search.prune import Cover

# What rejection scores first: cheap conditions that most candidates fail, so that few are scored in full.
#
# phi of a conjunction is the least of its arguments, so a label is at least `low` if and only if each of them is; the
# same holds for disjunctions and the upper end. These conditions are checked in stages, each on the candidates that
# met those before. What is accepted does not depend on the stages, to the bit: they only save work.


Check = Callable[[], None] | None

STAGE_SURVIVORS = 0.5  # share of the candidates that a stage must leave out before another begins
MIN_STAGED = 256  # candidates from which on all is scored at once: calls cost more than numbers
STAGED_SHARE = 0.8  # share of the work of full scoring above which stages are not worth their calls
MAX_STAGE_CHOICES = 100_000  # conditions times nodes: choosing among more would take longer than it saves
DRAW_WORK = 0.2  # work of a coordinate
BOUND_WORK, GAPS_WORK = 0.4, 36.0  # work of a minimum of gaps: of the bounds of each, and of the few that are computed


@dataclass(frozen=True, slots=True)
class Condition:
    """A formula node that must be at least `low`, or at most `high`; the other end is infinite."""

    node: int
    low: float
    high: float

    def holds(self, values: Sequence[Array]) -> Bool:
        """(B,), of the values of all nodes, (B,) each or () where they are the same for all."""
        value = values[self.node]
        return np.asarray(value >= self.low if self.low > -math.inf else value <= self.high)


@dataclass(frozen=True, slots=True, eq=False)
class FilterStage:
    """Conditions that are checked together, and the nodes that this needs."""

    conditions: tuple[Condition, ...]
    groups: GapMinima


@dataclass(frozen=True, slots=True, eq=False)
class Stages:
    """`full` is what scoring needs of those that meet all conditions; `work` is that of a candidate on average, with
    it."""

    stages: tuple[FilterStage, ...]
    full: GapMinima
    work: float

    def survivors(self, core: Core, rows: Array, usable: Bool, check: Check = None) -> tuple[Array, Index | None]:
        """The candidates (3N, m), of `rows` (3N, B), that are `usable` and meet the conditions, and which they are,
        (m,); conditions of a few candidates are left to scoring. Without stages: all candidates and None."""
        at: Index | None = None
        good = usable
        if usable.mean() <= STAGE_SURVIVORS:
            at = np.flatnonzero(usable)
            rows, good = rows.take(at, axis=1), np.ones(len(at), dtype=bool)
        for stage in self.stages:
            if rows.shape[1] < MIN_STAGED:
                break
            values = evaluate(core, list(rows), NUMPY, check, stage.groups)
            for condition in stage.conditions:
                good = good & condition.holds(values)
            passed = np.flatnonzero(good)
            rows, at = rows.take(passed, axis=1), passed if at is None else at[passed]
            good = np.ones(len(at), dtype=bool)
        return rows, at


def choose_stages(problem: Problem, rows: Array, usable: Bool, needed: Collection[int]) -> Stages:
    """The stages that save most for candidates like `rows` (3N, B), of which some are `usable`, (B,). `needed` are the
    nodes that scoring needs."""
    core = problem.core
    full, drawing, tops = (
        find_groups(core, needed),
        DRAW_WORK * row_count(len(core.objects)),
        tuple(core.labels.values()),
    )
    whole, _ = _work(core, full, tops, set())
    found = _conditions(problem)
    alone = len(tops) == 1 and {one.node for one in found} <= {*tops}  # it costs as much as all of the scoring
    if alone or len(found) * len(core.nodes) > MAX_STAGE_CHOICES or not usable.any():
        return Stages((), full, drawing + whole)
    values = evaluate(core, list(rows[:, usable]), NUMPY, None, [one.node for one in found])
    alive = np.ones(int(usable.sum()), dtype=bool)
    holds = {one: np.broadcast_to(one.holds(values), alive.shape) for one in found}
    stages: list[list[Condition]] = []
    share, work, known = 1.0, 0.0, set[int]()
    while found and alive.any():
        prices = [_work(core, full, (one.node,), known)[0] / max(1e-9, 1.0 - holds[one][alive].mean()) for one in found]
        best = int(np.argmin(prices))
        if prices[best] >= whole:
            break
        one = found.pop(best)
        if not known:
            stages.append([])
        stages[-1].append(one)
        more, needs = _work(core, full, (one.node,), known)
        work += share * more
        known |= needs
        alive &= holds[one]
        if alive.mean() <= STAGE_SURVIVORS * share:
            share, known = float(alive.mean()), set()
    work += float(alive.mean()) * whole
    if not stages or work > STAGED_SHARE * whole:
        return Stages((), full, drawing + whole)
    made = (FilterStage(tuple(some), find_groups(core, [one.node for one in some])) for some in stages)
    first = float(usable.mean())
    return Stages(tuple(made), full, drawing + work * (first if first <= STAGE_SURVIVORS else 1.0))


def _conditions(problem: Problem) -> list[Condition]:
    """What the labels' ranges ask of parts of them, each once: of a junction, and of such junctions within it, the
    arguments; long ones stay whole."""
    core, cells, found = problem.core, problem.cells, dict[Condition, None]()
    for label, top in enumerate(core.labels.values()):
        low, high = float(cells.low[label]), float(cells.high[label])
        for kind, ends in (("min", (low, math.inf)), ("max", (-math.inf, high))):
            waiting = [top] if ends != (-math.inf, math.inf) else []
            while waiting:
                index = waiting.pop()
                node = core.nodes[index]
                if isinstance(node, Junction) and node.kind == kind and len(node.args) < FEWEST_GAPS:
                    waiting += reversed(node.args)
                else:
                    found[Condition(index, *ends)] = None
    return list(found)


def _work(core: Core, full: GapMinima, tops: Sequence[int], known: Collection[int]) -> tuple[float, set[int]]:
    """The work of scoring nodes and what they need for a candidate, but for what is known; and all that they need."""
    needs, waiting, groups = set[int](), list(tops), full.by_node
    while waiting:
        index = waiting.pop()
        if index not in needs:
            needs.add(index)
            waiting += groups[index].others if index in groups else children(core.nodes[index])
    wanted, bounds, rest = needs.difference(known), 0.0, list[Node]()
    for index in wanted:
        if index in groups:
            bounds += BOUND_WORK * len(groups[index].atoms) + GAPS_WORK
        else:
            rest.append(core.nodes[index])
    return bounds + work_per_scene(rest)[0], needs


EXPLORE_VISITS = 1 << 26  # candidates times nodes of one exploration
# work (see search.effort) of a piece and of a chunk: a third and a tenth of a second
PIECE_WORK, CHUNK_WORK = 1 << 24, 1 << 22
EXPLORE_CHUNKS = 4  # chunks drawn from the common cover to see which cells they hit
PILOT_CANDIDATES = 512  # candidates that show which conditions are best checked first
ENOUGH_HITS = 16  # hits after which a cell's rate is known well enough


def scorable(problem: Problem, work: float, stages: Stages | None = None) -> tuple[int, int]:
    """How many candidates can be scored with so much work, at least 64, and of how many nodes there are values at a
    time. What robots and cameras need takes so long that it matters how many candidates get there, which stages tell;
    all else is counted in full."""
    nodes = problem.core.nodes
    each, values = work_per_scene(nodes)[0], len(nodes)
    if stages is not None and dear_nodes(nodes):
        each = stages.work
        values -= min(one.absent for one in (stages.full, *(stage.groups for stage in stages.stages)))
    return max(64, int(work / max(1.0, each))), values


def affordable(problem: Problem, count: int, stages: Stages | None = None) -> int:
    """That many candidates, or fewer if scoring one takes thousands of operations."""
    scored, values = scorable(problem, PIECE_WORK, stages)
    return max(64, min(count, EXPLORE_VISITS // EXPLORE_CHUNKS // values, scored))


def chunk_size(problem: Problem, stages: Stages | None = None) -> int:
    """How many candidates are drawn and scored at a time; a piece at once where few get through the stages."""
    few = stages is not None and dear_nodes(problem.core.nodes)
    scored, values = scorable(problem, PIECE_WORK if few else CHUNK_WORK, stages)
    return max(64, min(SCENES_IN_CACHE, LIVE_NUMBERS // max(values, len(problem.lowest)), scored))


def chunks(count: int, size: int) -> list[int]:
    """`count` candidates in chunks of a size."""
    whole, rest = divmod(count, size)
    return [size] * whole + ([rest] if rest else [])


def explore(
    problem: Problem,
    cover: Cover,
    most: int,
    rng: np.random.Generator,
    effort: Effort,
    cell: int | None = None,
    stages: Stages | None = None,
) -> tuple[Index, int, Stages | None]:
    """Hits of each cell, (C,), in a few chunks of candidates, how many there were, and the cover's stages, if they were
    given or worth making; with `cell`, as soon as that one is known well enough. Raises what `effort` raises."""
    hits = np.zeros(problem.cells.count, dtype=np.intp)
    if stages is None and dear_nodes(problem.core.nodes):
        stages = make_stages(problem, cover)
    tried, size = 0, chunk_size(problem, stages)
    for chunk in range(most):
        some = 2048 if cell is not None and not chunk else SCENES_IN_CACHE
        for count in chunks(affordable(problem, some, stages), size):
            if stages is None and tried:
                stages = make_stages(problem, cover)
            each, calls = work_per_scene(problem.core.nodes)
            effort.spend(calls + count * (each if stages is None else min(each, stages.work)))
            _, _, cells = draw_kept(problem, cover, count, rng, check=effort.check, stages=stages)
            hits += np.bincount(cells, minlength=problem.cells.count)
            tried += count
        if cell is not None and hits[cell] >= ENOUGH_HITS:
            break
    return hits, tried, stages


def draw_kept(
    problem: Problem,
    cover: Cover,
    count: int,
    rng: np.random.Generator,
    room: Array | None = None,
    check: Callable[[], None] | None = None,
    stages: Stages | None = None,
) -> tuple[Array, Array, Index]:
    """The accepted ones of `count` candidates, in random order: rows (3N, m), phi (L, m), cells (m,). `room` is a
    buffer for the draws, (3N, SCENES_IN_CACHE); `check` may interrupt, see `evaluate`; `stages` save work."""
    rows, spans, usable = _draw(problem, cover, count, rng, room)
    if stages is not None:
        rows, at = stages.survivors(problem.core, rows, usable, check)
        if at is not None:
            spans = [slice(*np.searchsorted(at, (span.start, span.stop))) for span in spans]
            usable = np.ones(len(at), dtype=bool)
    phi = _score(problem, cover, rows, spans, usable, check, None if stages is None else stages.full)
    for value, low, high in zip(phi, problem.cells.low, problem.cells.high, strict=True):
        if low > -math.inf:
            usable &= (value >= low) & (value <= high)
        elif high < math.inf:
            usable &= value <= high
    # Candidates come part by part: without shuffling, a piece that is cut off would lack the last parts.
    kept = rng.permutation(np.flatnonzero(usable))
    chosen = phi.take(kept, axis=1)
    return rows.take(kept, axis=1), chosen, problem.cells.find(chosen)


def candidates(problem: Problem, cover: Cover, count: int, rng: np.random.Generator) -> tuple[Array, Array, Bool]:
    """Candidates (3N, B), their exact phi (L, B), and which are scenes of the part that they were drawn for, (B,)."""
    rows, spans, usable = _draw(problem, cover, count, rng)
    return rows, _score(problem, cover, rows, spans, usable), usable


def _draw(
    problem: Problem, cover: Cover, count: int, rng: np.random.Generator, room: Array | None = None
) -> tuple[Array, Sequence[slice], Bool]:
    """Candidates (3N, B), which of them belong to each part, and which are scenes of its box, (B,)."""
    rows = np.empty((len(problem.lowest), count)) if room is None else room[:, :count]
    usable, spans = cover.draw(rows, rng)
    keep_below_turn(rows)
    return rows, spans, usable


def _score(
    problem: Problem,
    cover: Cover,
    rows: Array,
    spans: Sequence[slice],
    usable: Bool,
    check: Callable[[], None] | None = None,
    full: GapMinima | None = None,
) -> Array:
    """phi (L, B); and `usable` loses those that are not scenes of their part."""
    labels = problem.core.labels.values()
    values = evaluate(problem.core, list(rows), NUMPY, check, _needed_nodes(problem, cover) if full is None else full)
    for part, span in zip(cover.parts, spans, strict=True):
        if part.apart:
            mine = part.owns(values, span)
            if mine is not None:
                usable[span] &= mine
    phi = np.empty((len(labels), rows.shape[1]))
    for label, node in enumerate(labels):
        phi[label] = values[node]
    return phi


def _needed_nodes(problem: Problem, cover: Cover) -> set[int]:
    """The nodes whose values scoring reads."""
    needed = {*problem.core.labels.values()}
    for part in cover.parts:
        needed.update([node for node, _, _ in part.apart] if part.apart else ())
    return needed


def make_stages(problem: Problem, cover: Cover) -> Stages:
    """What is scored first of candidates from a cover."""
    rng = np.random.default_rng(np.random.SeedSequence([problem.request.seed, REJECTION_PLAN_STREAM, 0, 3]))
    rows, _, usable = _draw(problem, cover, affordable(problem, PILOT_CANDIDATES), rng)
    return choose_stages(problem, rows, usable, _needed_nodes(problem, cover))


def misses(problem: Problem, cover: Cover) -> tuple[Array, Array]:
    """Candidates out of the range, for the report: rows (3N, m) and phi (L, m)."""
    rng = np.random.default_rng(np.random.SeedSequence([problem.request.seed, REJECTION_PLAN_STREAM, 0]))
    rows, phi, usable = candidates(problem, cover, chunk_size(problem), rng)
    out = np.flatnonzero(usable & (problem.cells.find(phi) < 0))
    return rows[:, out], phi[:, out]
