"""How rare each value of phi is on a table of many objects: the same results as `rarity`, by growth instead of
splitting.

Chains that begin as uniform scenes fail if hardly any scene satisfies the requirement, or if one evaluation of phi
takes hundreds of clearances. Growth makes scenes of the base distribution and of any range of phi directly, each time
with an unbiased estimate of the probability. So a tail is a series of independent runs: each is restricted to a value
of phi that a few scenes of the previous run reach, and gives the distribution beyond it. If phi >= 0 is too far away
for that, a run is restricted to it directly. Effort is counted in visits of formula nodes, never in seconds.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from scenegen.arrays import Array
from scenegen.lang.formula.core import REQUIRE, Junction
from scenegen.lang.spec import CheckedSpec
from scenegen.sampling.cells import cut
from scenegen.sampling.growth.failure import GrowthFailed
from scenegen.sampling.growth.graph import flat_args
from scenegen.sampling.growth.model import GrowthModel, MoveTally, make_growth_model
from scenegen.sampling.growth.moves import MoveSettings, sweep
from scenegen.sampling.growth.population import Grown, PlacementFailed, Step, explore, grow, tuned_settings
from scenegen.sampling.growth.sampler import log_base
from scenegen.sampling.problem import Problem, make_problem
from scenegen.sampling.rarity import AT_END, MIN_HITS, NEAR_END, TAIL_ISLANDS, PhiDistribution, Rarity, Tail
from scenegen.sampling.report import Estimate, ratio
from scenegen.sampling.request import Range, SampleRequest
from scenegen.sampling.streams import GROWTH_RARITY_STREAM
from scenegen.search.contract import push_down
from scenegen.search.effort import Budget, StoppedError, TooMuchError

SETTLE_SWEEPS = 2  # sweeps over all objects after the last one is placed
EXPLORED_SCENES = 512  # scenes by which it is seen what a run needs


@dataclass(frozen=True, slots=True)
class Islands:
    """`log_share` (I,) is the natural logarithm of each island's estimate of the probability of the range, -inf where
    it died out; `phi` (I, L, P) are the labels of its scenes, NaN there. `work` counts visits of formula nodes."""

    log_share: Array
    phi: Array
    work: float


@dataclass(frozen=True, slots=True)
class NoRoom:
    """No scene was found: there was no room for some object, or (`stuck` is None) it took too much work."""

    model: GrowthModel
    stuck: PlacementFailed | None
    work: float


def grow_islands(
    problem: Problem, islands: int, each: int, seed: Sequence[int], most: float = math.inf, deadline: float = math.inf
) -> Islands | NoRoom:
    """`islands` independent populations of `each` scenes for a problem of one cell; equal seeds give equal numbers.

    What a run needs is found out by scenes of its own, so that the estimates are unbiased. `most` is how many visits of
    formula nodes it may take. Raises StoppedError after `deadline`, by the monotonic clock.
    """
    assert problem.cells.count == 1
    model, nodes = make_growth_model(problem, deadline=deadline), len(problem.core.nodes)
    model.most = most / nodes
    tally, steps = MoveTally(), list[Step]()
    try:
        for many in (EXPLORED_SCENES, 4 * EXPLORED_SCENES):
            number = np.arange(many)
            found, steps = explore(model, np.zeros_like(number), number % 4, _generator(seed, 0), tally)
            if isinstance(found, Grown):
                break
        if isinstance(found, PlacementFailed):
            return NoRoom(model, found, model.work * nodes)
        if not tally.steps:  # growing took no step: a few tell which lengths scenes take
            sweep(found.particles, MoveSettings({}), tally)
        settings = tuned_settings(tally)
        rng = _generator(seed, 1)
        number = np.arange(islands * each)
        grown = grow(model, np.zeros_like(number), number % islands, steps, settings, rng)
        if isinstance(grown, PlacementFailed):
            return NoRoom(model, grown, model.work * nodes)
        particles = grown.particles
        for _ in range(SETTLE_SWEEPS):
            sweep(particles, settings)
    except TooMuchError:
        return NoRoom(model, None, model.work * nodes)
    values = problem.phi(model.complete(particles.scenes.copy(), rng))
    phi = np.full((islands, len(values), each), np.nan)
    for island in range(islands):
        mine = np.flatnonzero(particles.island == island)
        phi[island, :, : len(mine)] = values[:, mine]
    return Islands((grown.log_share + log_base(model))[:, 0], phi, model.work * nodes)


def _generator(seed: Sequence[int], part: int) -> np.random.Generator:
    return np.random.Generator(np.random.SFC64(np.random.SeedSequence([*seed, part])))


ISLAND_SCENES = 64  # scenes of an island
LEVEL_SCENES = 16  # scenes that reach the next level
TAIL_EFFORT = 5e8  # visits of formula nodes by all tails together: about 5 s
FIRST_EFFORT = 4e9  # the same for the scenes with which all tails begin
MIN_RUNS = 2  # runs of a tail that are afforded, if they take no more than the scenes that it begins with
SATISFIED_EFFORT = 1e9  # visits of nodes for a run restricted to phi >= 0, where a tail's effort is too small for it
GAP_SHARE = 0.5  # share of a tail's effort after which a run is restricted to phi >= 0, if that was not reached
MAX_ALTERNATIVES = 64  # maximum alternatives of a disjunction to which growth can be restricted


def measure_by_growth(
    spec: CheckedSpec, labels: Sequence[str], seed: int = 0, *, up_only: bool = False, deadline: float = math.inf
) -> Rarity:
    """The results of `rarity.measure`; the same arguments give the same numbers. With `up_only`, the tails towards the
    lowest phi are left out. After `deadline`, by the monotonic clock, runs end with what they have.

    Raises RequestError if no scene satisfies the requirement, or if none was found, or if time is up before bounds are
    known, and StoppedError where the rest is not known by the deadline.
    """
    base = make_problem(spec, SampleRequest(n=1, seed=seed), Budget(deadline, started=0.0))
    with np.errstate(all="ignore"):  # phi may overflow or be undefined somewhere: such scenes count as unreachable
        first = grow_islands(base, TAIL_ISLANDS, ISLAND_SCENES, (seed, GROWTH_RARITY_STREAM), FIRST_EFFORT, deadline)
        if isinstance(first, NoRoom):
            raise GrowthFailed(first.model, first.stuck, first.work / len(base.core.nodes)).error(base)
        work = 0.0
        reaches: dict[str, PhiDistribution] = {}
        for index, label in enumerate(labels):
            runs = [
                _TailRuns(base, first, label, sign, (seed, GROWTH_RARITY_STREAM, 1 + index, 1 + sign), deadline)
                for sign in (1, -1)
            ]
            for run in runs[:1] if up_only else runs:
                waiting = len(labels) - index if up_only else 2 * (len(labels) - index) - (run.sign < 0)
                run.descend(max((TAIL_EFFORT - work) / waiting, MIN_RUNS * first.work / len(labels)))
                work += run.work
            spent = sum(run.work for run in runs) / len(base.core.nodes)
            reaches[label] = PhiDistribution(runs[0].tail(), runs[1].tail(), int(spent))
    required = _requirement(first) if REQUIRE in base.core.labels else None
    return Rarity(reaches, required, int((first.work + work) / len(base.core.nodes)))


def _requirement(first: Islands) -> Estimate:
    """Of the scenes that growth began with, however rare they are."""
    top = float(first.log_share.max())
    share = ratio(np.exp(first.log_share - top), np.ones(len(first.log_share)))
    assert share is not None  # one island has the share 1
    return replace(share, log10=share.log10 + top / math.log(10.0))


@dataclass(slots=True)
class _TailStage:
    level: float
    values: Array
    weights: Array


class _TailRuns:
    """The runs of one tail: towards the top of phi of a label (`sign` 1), or towards its bottom."""

    def __init__(
        self, base: Problem, first: Islands, label: str, sign: int, seed: tuple[int, ...], deadline: float
    ) -> None:
        self.base, self.label, self.sign, self.seed = base, label, sign, seed
        self.deadline = deadline
        self.place = tuple(base.core.labels).index(label)
        self.origin = float(first.log_share.max())
        self.work, self.runs = 0.0, 0
        self.stages = [self._stage(-np.inf, first)]
        values = self.stages[0].values
        self.end = float(values.max())
        self.middle = float(np.median(values[np.isfinite(values)])) if np.isfinite(self.end) else self.end
        self.whole = False
        self.held = False  # whether a run was restricted to phi >= 0

    def tail(self) -> Tail:
        levels = np.array([stage.level for stage in self.stages])
        values = tuple(stage.values for stage in self.stages)
        weights = np.array([stage.weights for stage in self.stages])
        return Tail(self.sign, levels, values, weights, self.sign * self.end, self.whole)

    def descend(self, effort: float) -> None:
        """Level by level towards the end, at a cost of about `effort` visits of nodes."""
        if not self._can_be_restricted():
            return
        far = self.sign > 0 and not self._has_scenes_beyond(0.0)  # phi >= 0 lies beyond what the last run met
        if far:
            self.middle = 0.0  # what counts as near to the top is then a share of what satisfies the label
        while self.work + self._cost_per_run() <= effort:
            last = self.stages[-1]
            level = self._next_level(last)
            if not far:
                scale = self.end - self.middle
                if level is None or self.end - level <= AT_END * scale or self.end - last.level <= NEAR_END * scale:
                    self.whole = True
                    return
                if not self._run_beyond(level, effort):
                    return
                continue
            quick = self.work + self._cost_per_run() <= GAP_SHARE * effort
            going = quick and level is not None and self._run_beyond(level, effort)
            if not going and (self.work > effort or not self._run_beyond(0.0, effort)):
                break
            far = not self._has_scenes_beyond(0.0)
        if far and not self.held:  # what satisfies a label is what people ask for: it is worth more than a tail
            self._run_beyond(0.0, 0.5 * (self.work + SATISFIED_EFFORT))

    def _has_scenes_beyond(self, phi: float) -> bool:
        """Whether the last run found enough scenes beyond a value of phi."""
        return int((self.stages[-1].values >= self.sign * phi).sum()) >= MIN_HITS

    def _cost_per_run(self) -> float:
        """What a run takes."""
        return self.work / self.runs if self.runs else 0.0

    def _next_level(self, stage: _TailStage) -> float | None:
        """The level that some scenes of a stage reach, or the next one where most of them share it; None where they
        have all reached the end."""
        values = np.sort(stage.values[np.isfinite(stage.values)])
        if not len(values):
            return None
        level = float(values[max(0, len(values) - LEVEL_SCENES)])
        if level > stage.level and 2 * np.count_nonzero(values == level) <= len(values):
            return level if level < values[-1] else None
        above = values[values > level]
        return float(above[0]) if len(above) else None

    def _run_beyond(self, level: float, effort: float) -> bool:
        """A run restricted to sign * phi >= level; False if it found nothing, if time is up, or if the tail took twice
        its effort."""
        if time.monotonic() > self.deadline:
            return False
        self.runs += 1
        self.held |= level == 0.0
        ends = Range(level, None) if self.sign > 0 else Range(None, -level)
        problem = _restrict(self.base, self.label, ends)
        try:
            most = 2.0 * effort - self.work
            found = grow_islands(problem, TAIL_ISLANDS, ISLAND_SCENES, (*self.seed, self.runs), most, self.deadline)
        except StoppedError:
            return False
        self.work += found.work
        if isinstance(found, NoRoom):
            return False
        self.stages.append(self._stage(level, found))
        self.end = max(self.end, float(self.stages[-1].values.max()))
        return True

    def _stage(self, level: float, found: Islands) -> _TailStage:
        values = self.sign * found.phi[:, self.place]
        values = np.sort(np.where(np.isnan(values), -np.inf, values), axis=1)
        return _TailStage(level, values, np.exp(found.log_share - self.origin))

    def _can_be_restricted(self) -> bool:
        """Whether growth can be restricted to one end of phi: not to one of hundreds of alternatives."""
        core = self.base.core
        ends = (0.0, np.inf) if self.sign > 0 else (-np.inf, 0.0)
        for node, wanted in push_down(core, {core.labels[self.label]: ends}).items():
            top = core.nodes[node]
            loose = isinstance(top, Junction) and (top.kind == "max") == (wanted[0] > -np.inf)
            if loose and len(flat_args(core, node)) > MAX_ALTERNATIVES:
                return False
        return True


def _restrict(base: Problem, label: str, ends: Range) -> Problem:
    """The base problem with a range for one label, and no proof that it is empty."""
    request = replace(base.request, phi={label: ends})
    cells = cut(request, tuple(base.core.labels))
    if REQUIRE in base.core.labels:
        cells.low[-1] = 0.0
    return replace(base, request=request, cells=cells, possible=frozenset({0}))
