"""Many Metropolis chains side by side, one array per moving row, and how they are resampled."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from scenegen.arrays import Array, Bool, Index
from scenegen.pose import PLACE
from scenegen.sampling.cells import Cells
from scenegen.sampling.resampling import resample
from scenegen.sampling.splitting.chain_state import ChainState, ChainTape, choice_cores, watched_core
from scenegen.sampling.splitting.levels import Region
from scenegen.sampling.splitting.moves import MOVE_PROPOSALS, Deck, MoveInputs, MoveProposal, Tuning, bring_home
from scenegen.search.effort import NEVER, Stop

MAX_GENERATIONS = 12  # remembered generations of ancestors: the first chains, and later copies at growing intervals


@dataclass(slots=True)
class Chains:
    """P chains: `rows` D arrays (P,), `scores` the phi of L labels, (P,) each. `fresh` marks those that have moved on
    their own since they were last copied or taken. `pool` has the scenes for difference moves; it does not change while
    these moves use it."""

    chain_state: ChainState
    tape: ChainTape
    cells: Cells
    rng: np.random.Generator
    rows: list[Array]
    scores: list[Array]
    region: Region
    fresh: Bool
    pool: list[Array]
    decks: tuple[Deck, Deck]
    weight: Array | None = None
    evaluations: int = 0
    families: list[Index] = field(default_factory=list)

    @classmethod
    def start(
        cls, chain_state: ChainState, tape: ChainTape, cells: Cells, count: int, rng: np.random.Generator
    ) -> Chains:
        """Chains at the base distribution, allowed everywhere."""
        rows = chain_state.draw(count, rng)
        scores = tape(rows)
        anywhere = np.full(len(scores), -np.inf)
        region, fresh, decks = Region(anywhere, -anywhere), np.ones(count, dtype=bool), _decks(chain_state, rng)
        return cls(chain_state, tape, cells, rng, rows, scores, region, fresh, list(rows), decks, evaluations=count)

    @property
    def count(self) -> int:
        return len(self.rows[0])

    def pick_chains(self, count: int) -> Chains:
        """Independent copies of at most `count` of the chains, spread over all of them."""
        index = np.arange(0, self.count, max(1, self.count // count))[:count]
        return replace(
            self,
            rows=[row[index] for row in self.rows],
            scores=[value[index] for value in self.scores],
            fresh=self.fresh[index],
            decks=_decks(self.chain_state, self.rng),
            weight=None if self.weight is None else self.weight[index],
            evaluations=0,
            families=[],
        )

    def narrow(self, region: Region, islands: int = 1) -> float:
        """Restrict the chains to a region: survivors are resampled to the old number in proportion to the change of
        their weight. Returns the share that survived (0: none did, and the chains are unchanged).

        With several islands (blocks of equally many chains), each is refilled from its own survivors only (from all, if
        it has none), so that islands stay independent of each other.
        """
        alive = region.holds(self.scores)
        gain = alive.astype(np.float64)
        if region.weights is not None:
            gain[alive] *= region.weigh([value[alive] for value in self.scores], self.cells)
        if self.weight is not None:
            gain /= self.weight
        if not gain.sum() > 0.0:
            return 0.0
        share = float(alive.mean())
        each = gain.reshape(islands, -1)
        size = each.shape[1]
        blocks = [
            number * size + resample(own, size, self.rng) if own.any() else resample(gain, size, self.rng)
            for number, own in enumerate(each)
        ]
        self._copy(np.concatenate(blocks))
        self.region = region
        self.weight = None if region.weights is None else region.weigh(self.scores, self.cells)
        return share

    def _copy(self, index: Index) -> None:
        self.families.append(np.arange(self.count))
        if len(self.families) > MAX_GENERATIONS:
            self.families = self.families[::2]
        self.rows = [row[index] for row in self.rows]
        self.scores = [value[index] for value in self.scores]
        self.families = [family[index] for family in self.families]
        # The first copy still counts as unique; `index` is in order.
        first = np.ones(self.count, dtype=bool)
        first[1:] = index[1:] != index[:-1]
        self.fresh = self.fresh[index] & first
        self.pool = list(self.rows)

    def move(self, kind: str, tuning: Tuning) -> tuple[float, MoveProposal]:
        """One move of all chains. Returns the share of chains that took it, and what was proposed."""
        draw = MoveInputs(self.chain_state, *self.decks, self.rows, self.pool, tuning, tuning.scale[kind], self.rng)
        proposal = MOVE_PROPOSALS[kind](draw)
        if not proposal.rows:
            return 0.0, proposal
        values, taken = bring_home(self.chain_state, proposal)
        rows = list(self.rows)
        for row, value in zip(proposal.rows, values, strict=True):
            rows[row] = value
        scores = self.tape(rows)
        held = self.region.holds(scores)
        taken = held if taken is None else taken & held
        if self.weight is not None:
            weight = self.region.weigh(scores, self.cells)
            taken &= self.rng.random(self.count) * self.weight < weight
            self.weight = np.where(taken, weight, self.weight)
        for row in proposal.rows:
            self.rows[row] = np.where(taken, rows[row], self.rows[row])
        self.scores = [np.where(taken, new, old) for new, old in zip(scores, self.scores, strict=True)]
        if proposal.parting:
            self.fresh |= taken
        self.evaluations += self.count
        return float(np.count_nonzero(taken)) / self.count, proposal

    def run(self, moves: int, tuning: Tuning) -> float:
        """That many moves by the frozen tuning; returns the mean acceptance rate."""
        kinds = list(tuning.weight)
        weights = np.fromiter(tuning.weight.values(), dtype=np.float64)
        # Systematic resampling: in any run each kind gets its rounded share, and is never left out by chance.
        chosen = self.rng.permutation(resample(weights, moves, self.rng))
        return float(np.mean([self.move(kinds[kind], tuning)[0] for kind in chosen])) if moves else 0.0

    def reflect(self, tuning: Tuning) -> None:
        """Each of the tuning's mirrors once, in random order."""
        for index in self.rng.permutation(len(tuning.mirrors)):
            self.move(tuning.mirrors[index], tuning)

    def take(self) -> Index:
        """The chains to take a scene from now: those that have moved since they were last taken or copied."""
        index = np.flatnonzero(self.fresh)
        self.fresh = np.zeros(self.count, dtype=bool)
        return index


def _decks(chain_state: ChainState, rng: np.random.Generator) -> tuple[Deck, Deck]:
    return Deck(chain_state.dimension, rng), Deck(len(chain_state.parts), rng)


NEGLIGIBLE = 0.05  # correlation of the slowest statistic between one scene and the next of a chain
LATE_CORRELATION = 0.3  # the largest correlation when it shows which statistics are slow
SLOW_STATISTICS = 6  # how many of them count
KIND_TRIES = 6  # moves of a kind for judging it
MAX_DIFFERENCES_IN_WAY = 6  # differences tracked within each way of satisfying the formula
MAX_DIFFERENCE_PAIRS = 16  # pairs of objects whose difference is tracked


class Statistics:
    """The statistics that must decorrelate: coordinates (headings as cosine and sine), signed and unsigned differences
    of pairs of objects along x and y, the margin of every atom, the value of every disjunct, and phi of every label;
    also the differences separately for each way of satisfying the formula, because what is slow in one mode may be fast
    in others."""

    def __init__(self, chain_state: ChainState, stop: Stop = NEVER) -> None:
        self._chain_state = chain_state
        self._atoms = ChainTape(chain_state, watched_core(chain_state.core), stop)
        self._choices = [
            (node.kind, ChainTape(chain_state, core, stop)) for node, core in choice_cores(chain_state.core)
        ]
        pairs = [(a, b) for a in range(len(chain_state.parts)) for b in range(a)]
        step = max(1, -(-len(pairs) // MAX_DIFFERENCE_PAIRS))
        self._pairs = [
            (first, second)
            for a, b in pairs[::step]
            for axis in PLACE
            if (first := chain_state.parts[a].at[axis]) is not None
            and (second := chain_state.parts[b].at[axis]) is not None
        ]

    def __call__(self, chains: Chains) -> Array:
        """(S, P), standardised over the chains; statistics that are the same in all chains are left at 0."""
        rows = chains.rows
        values: list[Array] = []
        for row, circular in zip(rows, self._chain_state.circular, strict=True):
            values += [np.cos(row), np.sin(row)] if circular else [row]
        apart = [rows[first] - rows[second] for first, second in self._pairs]
        values += apart
        values += [np.abs(distance) for distance in apart]
        values += self._atoms(rows)
        few = [np.abs(distance) for distance in apart[:: max(1, len(apart) // MAX_DIFFERENCES_IN_WAY)]]
        for kind, tape in self._choices:
            ways = np.array(tape(rows))
            choice = ways.argmin(axis=0) if kind == "min" else ways.argmax(axis=0)
            for way in range(len(ways)):
                chosen = choice == way
                values.append(chosen.astype(np.float64))
                count = max(1, np.count_nonzero(chosen))
                values += [np.where(chosen, distance - distance[chosen].sum() / count, 0.0) for distance in few]
        values += chains.scores
        table = np.array(values)
        if not np.isfinite(table.sum()):
            table = np.nan_to_num(table)
        middle = table.mean(axis=1, keepdims=True)
        table -= middle
        spread = np.sqrt((table * table).mean(axis=1, keepdims=True))
        out: Array = table * np.where(spread > 1e-9 * (1.0 + np.abs(middle)), 1.0 / np.maximum(spread, 1e-300), 0.0)
        return out


def correlation(before: Array, after: Array) -> Array:
    """Correlation of each of S statistics over P chains, (S, P) twice -> (S,)."""
    out: Array = (before * after).mean(axis=1)
    return out


@dataclass(frozen=True, slots=True)
class CorrelationTime:
    """How long chains stay correlated: `moves` until no statistic is correlated with its value at the `start` (S, P),
    and the largest correlation `left` then. `late` are copies of the chains when most correlations had faded, and
    `faded` (S,) the correlations at that time: they show which statistics are slow."""

    moves: int
    left: float
    start: Array
    late: Chains
    faded: Array


def forgetting(chains: Chains, statistics: Statistics, tuning: Tuning, most: int) -> CorrelationTime:
    """Applies the mirrors once, then moves the chains until they are no longer correlated with their start.

    Stops at `most` moves; the correlation is then not negligible. It is an average over chains at their stationary
    distribution, not over the time of one chain: it also shows chains that never leave their mode, as a correlation
    that does not fade.
    """
    start = statistics(chains)
    noise = 3.0 / np.sqrt(chains.count)  # the largest of several dozen sample correlations whose true value is 0
    done, left = 0, 1.0
    late: tuple[Chains, Array] | None = None
    chains.reflect(tuning)
    while done < most:
        block = max(2, done // 8)
        chains.run(block, tuning)
        done += block
        now = correlation(start, statistics(chains))
        left = float(np.abs(now).max(initial=0.0))
        if late is None and (left < LATE_CORRELATION or done >= most):
            late = chains.pick_chains(chains.count), now
        if left < NEGLIGIBLE + noise:
            break
    assert late is not None
    # Noise may have hidden some correlation: a fifth more moves reduces it below the limit.
    return CorrelationTime(done + done // 5, max(0.0, left - noise), start, *late)


def helps(memory: CorrelationTime, statistics: Statistics, tuning: Tuning, kind: str) -> tuple[float, int]:
    """By how much a move of a kind lowers the slowest correlations, and the number of evaluations of this trial."""
    chains = memory.late.pick_chains(memory.late.count)
    for _ in range(KIND_TRIES):
        chains.move(kind, tuning)
    slow = np.argsort(-np.abs(memory.faded))[:SLOW_STATISTICS]
    before, after = memory.faded[slow], correlation(memory.start[slow], statistics(chains)[slow])
    return float((np.abs(before) * (np.abs(before) - np.abs(after))).sum()) / KIND_TRIES, chains.evaluations


def design_effect(chains: Chains, values: Array) -> Array:
    """The design effect: by which factor the variance of each statistic's mean, (S, P), exceeds that of independent
    scenes, because survivors of one ancestor are similar. (S,), 1 if they are not; the largest over the remembered
    generations of ancestors."""
    worst = np.ones(len(values))
    for family in chains.families:
        sums = np.zeros((len(values), chains.count))
        for index, row in enumerate(values):
            sums[index] = np.bincount(family, weights=row, minlength=chains.count)
        same = ((sums * sums).sum(axis=1) - (values * values).sum(axis=1)) / chains.count
        worst = np.maximum(worst, 1.0 + same)
    return worst
