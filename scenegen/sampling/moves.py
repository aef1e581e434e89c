"""What moves of the splitting chains are made of: proposals that are symmetric under the uniform base distribution.

A move draws its kind, objects and step length once for all chains (nothing of that depends on the chains' state, so
each chain stays a valid Metropolis chain) and its direction for every chain alone. Either the step and its reverse are
equally likely (walks, turns, differences) or the map is its own inverse and keeps volumes (swaps, mirrors), tossed by
a coin per chain so that chains in one mode part company. With a uniform target such a proposal is taken whenever it
lands in the wanted set (Metropolis et al. 1953; Tierney 1994 for the mixture of kinds).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scenegen.sampling.frame import Frame, Part

Array = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]
Rows = list[Array]

SPREAD = 2.0  # step lengths are log-uniform from half to twice the tuned one


@dataclass(frozen=True, slots=True)
class Tuning:
    """What the plan learns and freezes: how often each kind of move is made, how long its steps are.

    `weight` and `scale` are per kind; `length` (D,) is the step length of each row by itself, in metres or radians.
    `low`, `high` (D,) is the part of the box that the plan's chains lived in: where rows are drawn anew.
    `mirrors` are the kinds that are made once for every scene taken.
    """

    weight: Mapping[str, float]
    scale: Mapping[str, float]
    length: Array
    low: Array
    high: Array
    mirrors: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Proposal:
    """New values of some rows. `allowed` (P,) tells which chains are to try them (None: all). `parting` is for moves
    with random numbers of their own for each chain: chains that were copies of each other differ after one of these,
    and only after one of these. `row` is the one row that a single-row walk moved, -1 for others."""

    rows: tuple[int, ...]
    values: tuple[Array, ...]
    allowed: Mask | None = None
    parting: bool = True
    row: int = -1


class Deck:
    """The numbers 0 to n - 1 in random order, and again when they have run out: everyone's turn comes soon."""

    def __init__(self, size: int, rng: np.random.Generator) -> None:
        self._size, self._rng = size, rng
        self._left: list[int] = []

    def deal(self, many: int = 1) -> list[int]:
        """`many` different numbers (all there are, if that is fewer)."""
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
    """What a kind of move is given: the rows now, the frozen pool that differences are taken from, the tuning, and the
    decks that say which row and which object is next."""

    frame: Frame
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
        """One step per chain, uniform and symmetric. Two of 32 bits from each random number: the length of the step is
        random, too, so that the grid of 2^32 values is never seen."""
        raw: npt.NDArray[np.uint64] = self.rng.bit_generator.random_raw(-(-self.count // 2))
        steps = raw.view(np.int32)[: self.count].astype(np.float64)
        steps += 0.5  # the integers reach from -2^31 to 2^31 - 1
        steps *= half_width / 2.0**31
        return steps

    def coin(self) -> Mask:
        """Heads or tails for every chain."""
        count = self.count
        return np.unpackbits(np.frombuffer(self.rng.bytes(-(-count // 8)), dtype=np.uint8), count=count).view(np.bool_)

    def pick(self, many: int) -> list[Part]:
        """`many` different objects."""
        return [self.frame.parts[index] for index in self.part_deck.deal(many)]

    def walk(self, rows: Sequence[int]) -> Proposal:
        """Independent steps of the given rows."""
        factor = self.factor() / math.sqrt(len(rows))
        return Proposal(tuple(rows), tuple(self.rows[row] + self.noise(self.capped(row, factor)) for row in rows))

    def capped(self, row: int, factor: float) -> float:
        """The step length of a row times a factor, at most half of its box."""
        return min(float(self.tuning.length[row]) * factor, 0.5 * float(self.frame.high[row] - self.frame.low[row]))

    def step(self, rows: Sequence[int], factor: float) -> float:
        """One step length for several rows that move alike: the geometric mean of their own."""
        mean = math.exp(sum(math.log(self.tuning.length[row]) for row in rows) / len(rows))
        room = min(float(self.frame.high[row] - self.frame.low[row]) for row in rows)
        return min(mean * factor, 0.5 * room)


Kind = Callable[[Draw], Proposal]


def bring_home(frame: Frame, proposal: Proposal) -> tuple[tuple[Array, ...], Mask | None]:
    """The proposed values with headings wrapped into the circle, and which chains may take them: those that stay in the
    box and are allowed to (None: all)."""
    inside = proposal.allowed
    values: Rows = []
    for row, value in zip(proposal.rows, proposal.values, strict=True):
        low, high = frame.low[row], frame.high[row]
        if frame.circular[row]:
            turn = high - low
            value = value - turn * np.floor((value - low) / turn)
            value = np.where(value >= high, value - turn, value)
            values.append(value)
            continue
        here = (value >= low) & (value <= high)
        inside = here if inside is None else inside & here
        values.append(value)
    return tuple(values), inside
