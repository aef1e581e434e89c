"""How rare each value of phi is under the base distribution: P(phi >= t) and P(phi <= t) for every t at once.

Chains start as uniform scenes and are restricted level by level, up to the highest phi and, in a separate run, down to
the lowest; each level keeps about half (adaptive multilevel splitting, Cerou and Guyader 2007). The share that reaches
t from the level below it, times the shares of all levels before, estimates P(phi >= t). The requirement is satisfied
first, in the same way, so all probabilities are conditional on it.

The chains are divided into islands that never exchange chains (Whiteley, Lee and Heine 2016 discuss such particle
systems). Each island has its own estimate; the scatter of these gives a 95 % interval (see report.py), which
includes the effect of copies of one ancestor. Effort is counted in node visits, never in seconds. numpy only: torch is
not loaded.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from scenegen.arrays import Array
from scenegen.geometry import NUMPY
from scenegen.geometry.footprint import Circle
from scenegen.lang.formula.core import REQUIRE, Apply, Core, gate, part_of
from scenegen.lang.formula.interpret import phi as evaluate
from scenegen.lang.spec import CheckedSpec
from scenegen.sampling.cells import Cells
from scenegen.sampling.report import Estimate, ratio
from scenegen.sampling.splitting.chain_state import ChainState, ChainTape, make_chain_state
from scenegen.sampling.splitting.chains import Chains
from scenegen.sampling.splitting.levels import ChainPopulation, Region
from scenegen.sampling.splitting.tuning import Tuner, max_moves
from scenegen.sampling.streams import RARITY_STREAM
from scenegen.search.effort import NEVER, Stop, StoppedError

TAIL_ISLANDS = 16  # estimates whose scatter is the error bar
# share of the chains that makes a level; the same once levels are not counted any more
LEVEL_SHARE, CLIMB_SHARE = 0.5, 0.1
# how near to the end levels are counted, and searched: shares of the way from the median
NEAR_END, AT_END = 0.01, 0.001
# maximum number of counted levels, and of levels in the search for the end after them
MAX_COUNTED_LEVELS, MAX_SEARCH_LEVELS = 400, 30
# share of the effort after which levels are not counted any more, so that some is left for the search
COUNTED_EFFORT = 0.8
MOVES_PER_LEVEL = 2  # rounds of moves on a level: after one, copies have parted, but resemble each other
RULE_OF_THREE = 3.0  # scenes that may be missed at 95 % where none of a large number was
MIN_HITS = 8  # minimum number of scenes behind an estimate


@dataclass(frozen=True, slots=True)
class Tail:
    """One run: `sign` is 1 towards the highest phi, -1 towards the lowest.

    `levels` (K,) are each stage's lower limit of sign * phi, the first -inf; `values` are the chains' sign * phi, K
    arrays (islands, chains of an island) in rising order; `weights` (K, islands) are the probabilities of the stages by
    island. `end` is the furthest phi that was found; `whole` says that levels were counted until hardly any scenes were
    left, and did not end because the effort was used up.
    """

    sign: int
    levels: Array
    values: tuple[Array, ...]
    weights: Array
    end: float
    whole: bool

    def __call__(self, phi: float) -> Estimate | None:
        """log10 P(phi' >= phi) for a run upwards, log10 P(phi' <= phi) downwards; None if there are too few scenes."""
        place = self.sign * phi
        stage = int(np.searchsorted(self.levels, place, side="right")) - 1
        values = self.values[stage]
        hits = values.shape[1] - np.array([np.searchsorted(island, place, side="left") for island in values])
        if hits.sum() < MIN_HITS:
            return None
        if stage == 0 and hits.sum() == values.size and values.shape[1] > 1:
            # Of all that are not there, the share is at most 3 / n at 95 % (the rule of three). Copies tell nothing.
            return Estimate(0.0, -math.log10(1.0 - RULE_OF_THREE / max(2.0 * RULE_OF_THREE, len(np.unique(values)))))
        return ratio(self.weights[stage] * hits / values.shape[1], self.weights[0])

    def quantile(self, share: float) -> float:
        """The phi beyond which, in the direction of the run, about that share of the scenes lies."""
        first = np.sort(self.values[0].ravel())
        return self.sign * float(first[max(0, len(first) - max(1, round(share * len(first))))])


Run: TypeAlias = "Tail | MixedTail"  # one direction of a label's distribution


@dataclass(frozen=True, slots=True)
class PhiDistribution:
    """The distribution of a label's phi among the scenes that satisfy the requirement."""

    up: Run
    down: Run
    evaluations: int


@dataclass(frozen=True, slots=True)
class Rarity:
    """The runs of a spec: `reaches` by label, and how rare the requirement is (None: nothing is required)."""

    reaches: dict[str, PhiDistribution]
    requirement: Estimate | None
    evaluations: int


@dataclass(frozen=True, slots=True)
class RequirementUnmet:
    """No scene that satisfies the requirement was found; `best` is its largest margin."""

    best: float
    evaluations: int


def constant_phi(phi: float) -> PhiDistribution:
    """The result for a label whose phi is the same in all scenes."""
    weights = np.ones((1, TAIL_ISLANDS))
    tails = [
        Tail(sign, np.array([-np.inf]), (np.full((TAIL_ISLANDS, 1), sign * phi),), weights, phi, True)
        for sign in (1, -1)
    ]
    return PhiDistribution(tails[0], tails[1], 1)


def climb(
    state: ChainPopulation,
    move: Callable[[], object],
    weights: Array,
    sign: int,
    work: int,
    row: int = 0,
    stop: Stop = NEVER,
) -> tuple[Tail, int]:
    """Restrict the chains step by step towards one end of the phi of a row, with at most about `work` evaluations.
    `move` is one round of moves. Where `stop` or a move raises StoppedError, the run ends with what it has."""
    phi = margins(state, sign, row)
    levels, values, shares = [-np.inf], [_sort_islands(phi)], [weights]
    middle, end = float(np.median(phi)), float(phi.max())
    counting, searched, whole = True, 0, False
    while state.evaluations < work and searched < MAX_SEARCH_LEVELS:
        here = sign * (state.region.low if sign > 0 else state.region.high)[row]
        whole = whole or (counting and bool(end - here <= NEAR_END * (end - middle)))
        counting = (
            counting and not whole and len(levels) < MAX_COUNTED_LEVELS and state.evaluations < COUNTED_EFFORT * work
        )
        level = next_level(phi, here, LEVEL_SHARE if counting else CLIMB_SHARE)
        if level is None or end - level <= AT_END * (end - middle):
            whole = whole or counting
            break
        try:
            stop.check()
            kept = restrict(state, level, sign, row)
            for _ in range(MOVES_PER_LEVEL if counting else 1):
                move()
        except StoppedError:
            break
        phi = margins(state, sign, row)
        end = max(end, float(phi.max()))
        if counting:
            weights = weights * kept
            levels.append(level)
            values.append(_sort_islands(phi))
            shares.append(weights)
        else:
            searched += 1
    return Tail(sign, np.array(levels), tuple(values), np.array(shares), sign * end, whole), state.evaluations


def margins(state: ChainPopulation, sign: int, row: int = 0) -> Array:
    """sign * phi of a row, (P,); NaN counts as the lowest."""
    phi = sign * state.scores[row]
    return np.where(np.isnan(phi), -np.inf, phi)


def _sort_islands(phi: Array) -> Array:
    return np.sort(phi.reshape(TAIL_ISLANDS, -1), axis=1)


def next_level(phi: Array, here: float, kept: float) -> float | None:
    """The next level above `here`: the one that `kept` of the chains reach, or the lowest above; None at the top."""
    level = float(np.quantile(phi, 1.0 - kept, method="higher"))
    if level > here:
        return level
    above = phi[phi > here]
    return float(above.min()) if len(above) else None


def restrict(state: ChainPopulation, level: float, sign: int, row: int = 0) -> Array:
    """Restrict the chains to sign * phi >= level in a row; returns the share of each island that survived."""
    low, high = state.region.low.copy(), state.region.high.copy()
    (low if sign > 0 else high)[row] = sign * level
    region = Region(low, high)
    alive: Array = region.holds(state.scores).reshape(TAIL_ISLANDS, -1).mean(axis=1)
    state.narrow(region, TAIL_ISLANDS)
    return alive


MAX_TAIL_CHAINS, MIN_TAIL_CHAINS = 8192, 256  # chains of a run
MIN_LEVELS = 15  # levels that the effort of a run must cover if every level takes the maximum number of moves
# node visits of the runs together, and of meeting the requirement: some 8 s each, rarely spent
RARITY_VISITS = 5_000_000_000
# cost of a footprint with corners, in plain nodes; two of them in one node cost four times as much
RARITY_SHAPE_COST = 60
MOVES_PER_REQUIRED_LEVEL = 4  # the same for the requirement: all runs start from there
MAX_CHAIN_ROWS = 20  # with so many moving rows, chains that start at uniform scenes fail
MIN_AFFORDED_CHAINS = 100  # chains: if the effort does not allow so many, growth is used instead
MOVES_AFTER_REQUIREMENT = 4  # more rounds once the requirement is met, before its chains start the runs


@np.errstate(all="ignore")  # phi may overflow or be undefined somewhere: such scenes count as unreachable
def measure(
    core: Core,
    lowest: Array,
    highest: Array,
    labels: Sequence[str],
    seed: int = 0,
    work: int = RARITY_VISITS,
    stop: Stop = NEVER,
) -> Rarity | RequirementUnmet:
    """P(phi >= t) and P(phi <= t) of each of the labels, for poses uniform over the box lowest..highest (3N,),
    conditional on the core's requirement. The same arguments give the same numbers. `work` is the effort, in visits of
    nodes. Where `stop` raises StoppedError, runs end with what they have, and labels that were not begun are left out;
    it is raised again if there are none. Raises whatever else `stop` raises."""
    core = gate(core)
    base: _Base | None = None
    required: Estimate | None = None
    spent = 0
    gates = (REQUIRE,) if REQUIRE in core.labels else ()
    count = _chains([part_of(core, (label, *gates)) for label in labels], lowest, highest, work)
    if gates:
        base, best = _require(part_of(core, gates), lowest, highest, count, seed, work, stop)
        spent = base.evaluations
        if not base.weights.any():
            return RequirementUnmet(best, spent)
        required = ratio(base.weights, np.ones(TAIL_ISLANDS))
    reaches: dict[str, PhiDistribution] = {}
    for index, label in enumerate(labels):
        alone = part_of(core, (label,))
        if not make_chain_state(alone, lowest, highest).dimension:
            reaches[label] = constant_phi(float(evaluate(alone, list(lowest), NUMPY)[label]))
            continue
        one = part_of(core, (label, *gates))
        rng = np.random.Generator(np.random.SFC64(np.random.SeedSequence([seed, RARITY_STREAM, 1 + index])))
        try:
            start, weights = _begin(make_chain_state(one, lowest, highest), base, count, rng, stop)
        except StoppedError:
            if not reaches:
                raise
            break
        most = work // (2 * len(labels) * cost(one))
        up, down = (_climb(start.pick_chains(start.count), weights, sign, most, stop) for sign in (1, -1))
        reaches[label] = PhiDistribution(up[0], down[0], up[1] + down[1])
        spent += up[1] + down[1]
    return Rarity(reaches, required, spent)


def needs_growth(spec: CheckedSpec, labels: Sequence[str]) -> bool:
    """Whether growth (growth/rarity.py) serves better: for many objects, where some choose among surfaces, which chains
    hardly ever change, or if phi takes long to compute."""
    if spec.choices:
        return True
    core, (lowest, highest) = gate(spec.core), spec.box()
    gates = (REQUIRE,) if REQUIRE in core.labels else ()
    for label in labels:
        one = part_of(core, (label, *gates))
        dimension = make_chain_state(one, lowest, highest).dimension
        moves = MOVES_PER_LEVEL * max_moves(max(1, dimension)) * MIN_LEVELS
        if (
            dimension > MAX_CHAIN_ROWS
            or MIN_AFFORDED_CHAINS * 2 * len(labels) * cost(one) * moves > COUNTED_EFFORT * RARITY_VISITS
        ):
            return True
    return False


def cost(core: Core) -> int:
    """About the cost of phi of one scene, in visits of plain nodes."""
    shapes = [node.shapes for node in core.nodes if isinstance(node, Apply)]
    cornered = [sum(not isinstance(shape, Circle) for shape in pair) for pair in shapes]
    return len(core.nodes) + RARITY_SHAPE_COST * sum(many * many for many in cornered)


def _chains(cores: Sequence[Core], lowest: Array, highest: Array, effort: int) -> int:
    """How many chains the effort allows for these cores, a multiple of the islands."""
    fewest = MAX_TAIL_CHAINS
    for core in cores:
        moves = MOVES_PER_LEVEL * max_moves(max(1, make_chain_state(core, lowest, highest).dimension)) * MIN_LEVELS
        fewest = min(fewest, int(COUNTED_EFFORT * effort) // (2 * len(cores) * cost(core) * moves))
    return max(fewest, MIN_TAIL_CHAINS) // TAIL_ISLANDS * TAIL_ISLANDS


@dataclass(frozen=True, slots=True)
class _Base:
    """Chains that satisfy the requirement: `rows` by their index in (3N, B) storage, and the islands' weights."""

    rows: dict[int, Array]
    weights: Array
    evaluations: int


def _require(
    core: Core, lowest: Array, highest: Array, count: int, seed: int, effort: int, stop: Stop
) -> tuple[_Base, float]:
    """Chains at the base distribution conditioned on the requirement; weights 0 if it could not be satisfied."""
    chain_state = make_chain_state(core, lowest, highest)
    if not chain_state.dimension:
        least = float(evaluate(core, list(lowest), NUMPY)[REQUIRE])
        return _Base({}, np.full(TAIL_ISLANDS, float(least >= 0.0)), 1), least
    rng = np.random.Generator(np.random.SFC64(np.random.SeedSequence([seed, RARITY_STREAM, 0])))
    state, weights = _begin(chain_state, None, count, rng, stop)
    tuner = Tuner(state)
    work = effort // cost(core)
    met = False
    while not met and state.evaluations < work:
        level = next_level(margins(state, 1), state.region.low[0], LEVEL_SHARE)
        if level is None:
            break
        met = level >= 0.0
        weights = weights * restrict(state, min(level, 0.0), 1)
        for _ in range(MOVES_PER_REQUIRED_LEVEL):
            tuner.adapt()
    for _ in range(MOVES_AFTER_REQUIREMENT if met else 0):
        tuner.adapt()
    best = float(margins(state, 1).max())
    rows = dict(zip(chain_state.rows, state.rows, strict=True))
    return _Base(rows, weights if met else np.zeros(TAIL_ISLANDS), state.evaluations), best


def _begin(
    chain_state: ChainState, base: _Base | None, count: int, rng: np.random.Generator, stop: Stop
) -> tuple[Chains, Array]:
    """`count` chains of a chain_state at the base distribution, and the weights of their islands."""
    cells = Cells(tuple(chain_state.core.labels), (), (), np.empty(0), np.empty(0))
    state = Chains.start(chain_state, ChainTape(chain_state, stop=stop), cells, count, rng)
    if base is None:
        return state, np.ones(TAIL_ISLANDS)
    state.rows = [base.rows.get(row, fresh) for row, fresh in zip(chain_state.rows, state.rows, strict=True)]
    state.pool = list(state.rows)
    state.scores = state.tape(state.rows)
    state.region = Region(np.array([-np.inf, 0.0]), np.full(2, np.inf))
    return state, base.weights


def _climb(state: Chains, weights: Array, sign: int, work: int, stop: Stop) -> tuple[Tail, int]:
    return climb(state, Tuner(state).adapt, weights, sign, work, stop=stop)


CERTAIN = Estimate(0.0, 0.0)


@dataclass(frozen=True, slots=True)
class MixedTail:
    """Tails of the same direction, which are met as often as `weights` say; it has what `Tail` has."""

    tails: tuple[Run, ...]
    weights: tuple[int, ...]

    @property
    def sign(self) -> int:
        return self.tails[0].sign

    @property
    def levels(self) -> Array:
        """Those of all tails."""
        found = np.unique(np.concatenate([tail.levels[1:] for tail in self.tails]))
        return np.concatenate([[-np.inf], found])

    @property
    def end(self) -> float:
        return self.sign * max(self.sign * tail.end for tail in self.tails)

    @property
    def whole(self) -> bool:
        return all(tail.whole for tail in self.tails)

    def __call__(self, phi: float) -> Estimate | None:
        """As of `Tail`; a tail that has too few scenes there counts as having none."""
        return mean_estimate([tail(phi) for tail in self.tails], self.weights)

    def quantile(self, share: float) -> float:
        """As of `Tail`."""
        pairs = zip(self.tails, self.weights, strict=True)
        each = [(tail.values[0].ravel(), weight) for tail, weight in pairs if isinstance(tail, Tail)]
        values, whole = np.concatenate([one for one, _ in each]), sum(weight for _, weight in each)
        weights = np.concatenate([np.full(len(one), 1.0 / len(one) / whole * weight) for one, weight in each])
        order = np.argsort(-values, kind="stable")
        beyond = np.cumsum(weights[order])
        place = min(int(np.searchsorted(beyond, share * (1.0 - 1e-12))), len(values) - 1)
        return self.sign * float(values[order[place]])


def mean_estimate(estimates: Sequence[Estimate | None], weights: Sequence[int]) -> Estimate | None:
    """The mean of probabilities by their weights; None counts as 0, and is what there is where all are None."""
    pairs = zip(estimates, weights, strict=True)
    known = [(weight * 10.0**one.log10, one.error) for one, weight in pairs if one is not None]
    total = sum(value for value, _ in known)
    if not total > 0.0:
        return None
    error = math.sqrt(sum((value * error) ** 2 for value, error in known)) / total
    return Estimate(math.log10(total / sum(weights)), error)


def mix_rarities(found: Sequence[Rarity], weights: Sequence[int]) -> Rarity:
    """The distribution over members as often as `weights` say, each among its own scenes that meet the requirement."""
    reaches = {}
    for label in found[0].reaches:
        each = [one.reaches[label] for one in found]
        tails = [one.up for one in each], [one.down for one in each]
        up, down = (MixedTail(tuple(some), tuple(weights)) for some in tails)
        reaches[label] = PhiDistribution(up, down, sum(one.evaluations for one in each))
    required = [one.requirement for one in found]
    requirement = None if not any(required) else mean_estimate([one or CERTAIN for one in required], weights)
    return Rarity(reaches, requirement, sum(one.evaluations for one in found))
