"""How fast chains forget: correlation of statistics over an ensemble of chains, and among survivors of one ancestor.

With many chains at their stationary distribution, the correlation between a statistic now and t moves later is an
average over chains, not over the time of one chain: it also shows chains that never leave their mode, as a correlation
that does not fade.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scenegen.bounds.effort import NEVER, Stop
from scenegen.pose import PLACE
from scenegen.sampling.splitting.chain_state import ChainState, Tape, choices, watched
from scenegen.sampling.splitting.chains import Chains
from scenegen.sampling.splitting.moves import Tuning

Array = npt.NDArray[np.float64]

NEGLIGIBLE = 0.05  # correlation of the slowest statistic between one scene and the next of a chain
_LATE = 0.3  # the largest correlation when it shows which statistics are slow
_SLOW = 6  # how many of them count
_TRIES = 6  # moves of a kind for judging it
_WITHIN = 6  # differences tracked within each way of satisfying the formula
_PAIRS = 16  # pairs of objects whose difference is tracked


class Statistics:
    """The statistics that must decorrelate: coordinates (headings as cosine and sine), signed and unsigned differences
    of pairs of objects along x and y, the margin of every atom, the value of every disjunct, and phi of every label;
    also the differences separately for each way of satisfying the formula, because what is slow in one mode may be fast
    in others."""

    def __init__(self, chain_state: ChainState, stop: Stop = NEVER) -> None:
        self._frame = chain_state
        self._atoms = Tape(chain_state, watched(chain_state.core), stop)
        self._choices = [(node.kind, Tape(chain_state, core, stop)) for node, core in choices(chain_state.core)]
        pairs = [(a, b) for a in range(len(chain_state.parts)) for b in range(a)]
        step = max(1, -(-len(pairs) // _PAIRS))
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
        for row, circular in zip(rows, self._frame.circular, strict=True):
            values += [np.cos(row), np.sin(row)] if circular else [row]
        apart = [rows[first] - rows[second] for first, second in self._pairs]
        values += apart
        values += [np.abs(distance) for distance in apart]
        values += self._atoms(rows)
        few = [np.abs(distance) for distance in apart[:: max(1, len(apart) // _WITHIN)]]
        for kind, tape in self._choices:
            ways = np.array(tape(rows))
            choice = ways.argmin(axis=0) if kind == "min" else ways.argmax(axis=0)
            for way in range(len(ways)):
                chosen = choice == way
                values.append(chosen.astype(np.float64))
                count = max(1, np.count_nonzero(chosen))
                values += [np.where(chosen, distance - distance[chosen].sum() / count, 0.0) for distance in few]
        values += chains.phi
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
class Memory:
    """How long chains stay correlated: `moves` until no statistic is correlated with its value at the `start` (S, P),
    and the largest correlation `left` then. `late` are copies of the chains when most correlations had faded, and
    `faded` (S,) the correlations at that time: they show which statistics are slow."""

    moves: int
    left: float
    start: Array
    late: Chains
    faded: Array


def forgetting(chains: Chains, statistics: Statistics, tuning: Tuning, most: int) -> Memory:
    """Applies the mirrors once, then moves the chains until they are no longer correlated with their start.

    Stops at `most` moves; the correlation is then not negligible.
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
        if late is None and (left < _LATE or done >= most):
            late = chains.some(chains.count), now
        if left < NEGLIGIBLE + noise:
            break
    assert late is not None
    # Noise may have hidden some correlation: a fifth more moves reduces it below the limit.
    return Memory(done + done // 5, max(0.0, left - noise), start, *late)


def helps(memory: Memory, statistics: Statistics, tuning: Tuning, kind: str) -> tuple[float, int]:
    """By how much a move of a kind lowers the slowest correlations, and the number of evaluations of this trial."""
    chains = memory.late.some(memory.late.count)
    for _ in range(_TRIES):
        chains.move(kind, tuning)
    slow = np.argsort(-np.abs(memory.faded))[:_SLOW]
    before, after = memory.faded[slow], correlation(memory.start[slow], statistics(chains)[slow])
    return float((np.abs(before) * (np.abs(before) - np.abs(after))).sum()) / _TRIES, chains.evaluations


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
