"""The building blocks of the splitting chains' moves: proposals that are symmetric under the uniform base distribution.

A move draws its kind, objects and step length once for all chains (none of this depends on the chains' state, so each
chain stays a valid Metropolis chain) and its direction separately for each chain. Either the step and its reverse are
equally likely (walks, turns, differences), or the map is its own inverse and preserves volumes (swaps, mirrors) and is
applied with probability 1/2 per chain, so that chains in one mode separate. With a uniform target such a proposal is
accepted whenever it is in range (Metropolis et al. 1953; Tierney 1994 for the mixture of kinds).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scenegen.sampling.splitting.chain_state import ChainState, Part

Array = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]
Rows = list[Array]

SPREAD = 2.0  # step lengths are log-uniform from half to twice the tuned one


@dataclass(frozen=True, slots=True)
class Tuning:
    """What the plan tunes and then freezes: how often each kind of move is made, and its step length.

    `weight` and `scale` are per kind; `length` (D,) is the step length of each row by itself, in metres or radians.
    `low`, `high` (D,) is the part of the box that the plan's chains visited, in which rows are redrawn. `mirrors` are
    the kinds that are applied once for every scene taken.
    """

    weight: Mapping[str, float]
    scale: Mapping[str, float]
    length: Array
    low: Array
    high: Array
    mirrors: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Proposal:
    """New values of some rows. `allowed` (P,) marks the chains that try them (None: all). `parting` marks moves with
    separate random numbers for each chain: only these make copies of a chain differ. `row` is the one row that a
    single-row walk moved, -1 for others."""

    rows: tuple[int, ...]
    values: tuple[Array, ...]
    allowed: Mask | None = None
    parting: bool = True
    row: int = -1


class Deck:
    """The numbers 0 to n - 1 in random order, again and again, so that each comes up regularly."""

    def __init__(self, size: int, rng: np.random.Generator) -> None:
        self._size, self._rng = size, rng
        self._left: list[int] = []

    def deal(self, many: int = 1) -> list[int]:
        """`many` different numbers (all of them, if there are fewer)."""
        hand: list[int] = []
        while len(hand) < min(many, self._size):
            if not self._left:
                self._left = self._rng.permutation(self._size).tolist()
            card = self._left.pop()
            if card not in hand:
                hand.append(card)
        return hand


@dataclass(frozen=True, slots=True)
class Draw:
    """The inputs of a move: the current rows, the frozen pool for differences, the tuning, and the decks that give the
    next row and the next object."""

    chain_state: ChainState
    row_deck: Deck
    part_deck: Deck
    rows: Rows
    pool: Rows
    tuning: Tuning
    scale: float
    rng: np.random.Generator

    @property
    def count(self) -> int:
        return len(self.rows[0])

    def factor(self) -> float:
        """A factor on all step lengths: the tuned one of the kind, spread log-uniformly."""
        return self.scale * float(SPREAD ** self.rng.uniform(-1.0, 1.0))

    def noise(self, half_width: float) -> Array:
        """One step per chain, uniform and symmetric, two of 32 bits from each 64-bit random number. The step length is
        random as well, so the grid of 2^32 values has no effect."""
        raw: npt.NDArray[np.uint64] = self.rng.bit_generator.random_raw(-(-self.count // 2))
        steps = raw.view(np.int32)[: self.count].astype(np.float64)
        steps += 0.5  # integers from -2^31 to 2^31 - 1
        steps *= half_width / 2.0**31
        return steps

    def coin(self) -> Mask:
        """A random bit for every chain."""
        count = self.count
        return np.unpackbits(np.frombuffer(self.rng.bytes(-(-count // 8)), dtype=np.uint8), count=count).view(np.bool_)

    def pick(self, many: int) -> list[Part]:
        """`many` different objects."""
        return [self.chain_state.parts[index] for index in self.part_deck.deal(many)]

    def walk(self, rows: Sequence[int]) -> Proposal:
        """Independent steps of the given rows."""
        factor = self.factor() / math.sqrt(len(rows))
        return Proposal(tuple(rows), tuple(self.rows[row] + self.noise(self.capped(row, factor)) for row in rows))

    def capped(self, row: int, factor: float) -> float:
        """The step length of a row times a factor, at most half of its box."""
        return min(
            float(self.tuning.length[row]) * factor, 0.5 * float(self.chain_state.high[row] - self.chain_state.low[row])
        )

    def step(self, rows: Sequence[int], factor: float) -> float:
        """One step length for several rows that move together: the geometric mean of theirs."""
        mean = math.exp(sum(math.log(self.tuning.length[row]) for row in rows) / len(rows))
        room = min(float(self.chain_state.high[row] - self.chain_state.low[row]) for row in rows)
        return min(mean * factor, 0.5 * room)


Kind = Callable[[Draw], Proposal]


def bring_home(chain_state: ChainState, proposal: Proposal) -> tuple[tuple[Array, ...], Mask | None]:
    """The proposed values with headings wrapped, and which chains may accept them: those that stay in the box and are
    in `allowed` (None: all)."""
    inside = proposal.allowed
    values: Rows = []
    for row, value in zip(proposal.rows, proposal.values, strict=True):
        low, high = chain_state.low[row], chain_state.high[row]
        if chain_state.circular[row]:
            turn = high - low
            value = value - turn * np.floor((value - low) / turn)
            value = np.where(value >= high, value - turn, value)
            values.append(value)
            continue
        here = (value >= low) & (value <= high)
        inside = here if inside is None else inside & here
        values.append(value)
    return tuple(values), inside
