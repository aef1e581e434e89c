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
from scenegen.sampling.chains import Chains
from scenegen.sampling.frame import Frame, Tape, choices, watched
from scenegen.sampling.moves import Tuning

Array = npt.NDArray[np.float64]

NEGLIGIBLE = 0.05  # correlation of the slowest statistic between one scene and the next of a chain
_LATE = 0.3  # the largest correlation when it shows which statistics are slow
_SLOW = 6  # how many of them count
_TRIES = 6  # moves of a kind by which it is judged
_WITHIN = 6  # differences watched within each way in which the formula is met
_PAIRS = 16  # pairs of objects whose difference is watched


class Statistics:
    """What must be forgotten: coordinates (headings as cosine and sine), signed and unsigned differences of pairs of
    objects along x and y, the margin of every atom, the value of every disjunct, and phi of every label; and the
    differences apart for each way in which the formula is met, since what is slow in one mode may be fast in others."""

    def __init__(self, frame: Frame, stop: Stop = NEVER) -> None:
        self._frame = frame
        self._atoms = Tape(frame, watched(frame.core), stop)
        self._choices = [(node.kind, Tape(frame, core, stop)) for node, core in choices(frame.core)]
        pairs = [(a, b) for a in range(len(frame.parts)) for b in range(a)]
        step = max(1, -(-len(pairs) // _PAIRS))
        self._pairs = [
            (first, second)
            for a, b in pairs[::step]
            for axis in ("x", "y")
            if (first := getattr(frame.parts[a], axis)) is not None
            and (second := getattr(frame.parts[b], axis)) is not None
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
    """How long chains remember: `moves` until no statistic is correlated with what it was at the `start` (S, P), and
    the largest correlation `left` then. `late` are copies of the chains when most had faded, and `faded` (S,) the
    correlations at that time: they show which statistics are the slow ones."""

    moves: int
    left: float
    start: Array
    late: Chains
    faded: Array


def forgetting(chains: Chains, statistics: Statistics, tuning: Tuning, most: int) -> Memory:
    """The mirrors once, then moves until the chains have forgotten where they were; they are moved by it.

    Stops at `most` moves: what is left is then not negligible.
    """
    start = statistics(chains)
    noise = 3.0 / np.sqrt(chains.count)  # the largest of some dozens of correlations that are 0
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
    # A fifth more brings what the noise may have hidden below the limit.
    return Memory(done + done // 5, max(0.0, left - noise), start, *late)


def helps(memory: Memory, statistics: Statistics, tuning: Tuning, kind: str) -> tuple[float, int]:
    """By how much a move of a kind lowers the correlations that fade last, and what trying it cost in evaluations."""
    chains = memory.late.some(memory.late.count)
    for _ in range(_TRIES):
        chains.move(kind, tuning)
    slow = np.argsort(-np.abs(memory.faded))[:_SLOW]
    before, after = memory.faded[slow], correlation(memory.start[slow], statistics(chains)[slow])
    return float((np.abs(before) * (np.abs(before) - np.abs(after))).sum()) / _TRIES, chains.evaluations


def design_effect(chains: Chains, values: Array) -> Array:
    """By how much the mean of each statistic (S, P) varies more than that of independent scenes, because survivors of
    one ancestor are alike: (S,), 1 where they are not. The largest over the remembered generations of ancestors."""
    worst = np.ones(len(values))
    for family in chains.families:
        sums = np.zeros((len(values), chains.count))
        for index, row in enumerate(values):
            sums[index] = np.bincount(family, weights=row, minlength=chains.count)
        same = ((sums * sums).sum(axis=1) - (values * values).sum(axis=1)) / chains.count
        worst = np.maximum(worst, 1.0 + same)
    return worst
