"""The building blocks of the splitting chains' moves: proposals that are symmetric under the uniform base distribution.

A move draws its kind, objects and step length once for all chains (none of this depends on the chains' state, so each
chain stays a valid Metropolis chain) and its direction separately for each chain. Either the step and its reverse are
equally likely (walks, turns, differences), or the map is its own inverse and preserves volumes (swaps, mirrors) and is
applied with probability 1/2 per chain, so that chains in one mode separate. With a uniform target such a proposal is
accepted whenever it is in range (Metropolis et al. 1953; Tierney 1994 for the mixture of kinds).

Mirror images of the table and exchanges of objects lead directly from one mode of a symmetric spec to another, such as
from "a left of b" to "b left of a", where small steps would have to cross scenes out of range.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scenegen.arrays import Array, Bool
from scenegen.pose import EVERY, PLACE, TWO_PI, X, Y
from scenegen.sampling.splitting.chain_state import ChainObject, ChainState

Rows = list[Array]

STEP_SPREAD = 2.0  # step lengths are log-uniform from half to twice the tuned one


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
class MoveProposal:
    """New values of some rows. `allowed` (P,) marks the chains that try them (None: all). `parting` marks moves with
    separate random numbers for each chain: only these make copies of a chain differ. `row` is the one row that a
    single-row walk moved, -1 for others."""

    rows: tuple[int, ...]
    values: tuple[Array, ...]
    allowed: Bool | None = None
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
class MoveInputs:
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
        return self.scale * float(STEP_SPREAD ** self.rng.uniform(-1.0, 1.0))

    def noise(self, half_width: float) -> Array:
        """One step per chain, uniform and symmetric, two of 32 bits from each 64-bit random number. The step length is
        random as well, so the grid of 2^32 values has no effect."""
        raw: npt.NDArray[np.uint64] = self.rng.bit_generator.random_raw(-(-self.count // 2))
        steps = raw.view(np.int32)[: self.count].astype(np.float64)
        steps += 0.5  # integers from -2^31 to 2^31 - 1
        steps *= half_width / 2.0**31
        return steps

    def coin(self) -> Bool:
        """A random bit for every chain."""
        count = self.count
        return np.unpackbits(np.frombuffer(self.rng.bytes(-(-count // 8)), dtype=np.uint8), count=count).view(np.bool_)

    def pick(self, many: int) -> list[ChainObject]:
        """`many` different objects."""
        return [self.chain_state.parts[index] for index in self.part_deck.deal(many)]

    def walk(self, rows: Sequence[int]) -> MoveProposal:
        """Independent steps of the given rows."""
        factor = self.factor() / math.sqrt(len(rows))
        return MoveProposal(tuple(rows), tuple(self.rows[row] + self.noise(self.cap_step(row, factor)) for row in rows))

    def cap_step(self, row: int, factor: float) -> float:
        """The step length of a row times a factor, at most half of its box."""
        return min(
            float(self.tuning.length[row]) * factor, 0.5 * float(self.chain_state.high[row] - self.chain_state.low[row])
        )

    def step(self, rows: Sequence[int], factor: float) -> float:
        """One step length for several rows that move together: the geometric mean of theirs."""
        mean = math.exp(sum(math.log(self.tuning.length[row]) for row in rows) / len(rows))
        room = min(float(self.chain_state.high[row] - self.chain_state.low[row]) for row in rows)
        return min(mean * factor, 0.5 * room)


Kind = Callable[[MoveInputs], MoveProposal]


def bring_home(chain_state: ChainState, proposal: MoveProposal) -> tuple[tuple[Array, ...], Bool | None]:
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


def _row(draw: MoveInputs) -> MoveProposal:
    (row,) = draw.row_deck.deal()
    half = draw.cap_step(row, draw.factor())
    return MoveProposal((row,), (draw.rows[row] + draw.noise(half),), row=row)


def _shift_run(draw: MoveInputs) -> MoveProposal:
    """Objects that follow one another in the spec: if they stand in a row on the table, only the gaps at both ends
    change."""
    first, last = sorted(draw.rng.integers(len(draw.chain_state.parts), size=2).tolist())
    return _shift(draw, draw.chain_state.parts[first : last + 1])


def _shift(draw: MoveInputs, parts: Sequence[ChainObject]) -> MoveProposal:
    """Several objects by the same step along x, y or both."""
    axes = ((X,), (Y,), PLACE)[int(draw.rng.integers(3))]
    factor = draw.factor()
    rows: list[int] = []
    values: Rows = []
    for axis in axes:
        mine = [row for part in parts if (row := part.at[axis]) is not None]
        if mine:
            step = draw.noise(draw.step(mine, factor))
            rows += mine
            values += [draw.rows[row] + step for row in mine]
    return MoveProposal(tuple(rows), tuple(values))


def _stretch(draw: MoveInputs) -> MoveProposal:
    """All objects towards or away from one of them, along x or y: gaps grow or shrink in proportion.

    The map multiplies volumes by s^m for m rows stretched by s = e^u, and u and -u are equally likely: a proposal in
    range is accepted with probability min(1, s^m) (Green 1995).
    """
    axis = PLACE[int(draw.rng.integers(2))]
    (pivot,) = draw.pick(1)
    about = pivot.at[axis]
    rows = [row for part in draw.chain_state.parts if (row := part.at[axis]) is not None and row != about]
    if about is None or not rows:
        return MoveProposal((), ())
    u = draw.noise(min(1.0, draw.factor()))
    stretch = np.exp(u)
    middle = draw.rows[about]
    values = tuple(middle + stretch * (draw.rows[row] - middle) for row in rows)
    return MoveProposal(tuple(rows), values, np.log(draw.rng.random(draw.count)) < len(rows) * u)


def _redraw(draw: MoveInputs, rows: Sequence[int]) -> MoveProposal:
    """Rows redrawn uniformly within the box of the plan's chains. Chains outside this box stay, because the reverse
    move would be impossible."""
    low, high = draw.tuning.low, draw.tuning.high
    values: Rows = []
    allowed: Bool | None = None
    for row in rows:
        old = draw.rows[row]
        here = (old >= low[row]) & (old <= high[row])
        allowed = here if allowed is None else allowed & here
        value = draw.rng.random(draw.count)
        value *= high[row] - low[row]
        value += low[row]
        values.append(value)
    return MoveProposal(tuple(rows), tuple(values), allowed)


def _redraw_axis(draw: MoveInputs) -> MoveProposal:
    """One coordinate of all objects, which a disjunct along the other axis leaves free."""
    by_axis = [[row for part in draw.chain_state.parts if (row := part.at[axis]) is not None] for axis in EVERY]
    axes = [rows for rows in by_axis if rows]
    return _redraw(draw, axes[int(draw.rng.integers(len(axes)))])


def _turn(draw: MoveInputs) -> MoveProposal:
    """One object around another, by an angle 2 atan(t) with t symmetric about 0: their distance does not change."""
    moved, pivot = draw.pick(2)
    if moved.x is None or moved.y is None or pivot.x is None or pivot.y is None:
        return MoveProposal((), ())
    rows = draw.rows
    t = draw.noise(min(1.0, draw.factor()))
    square = t * t
    over = 1.0 / (1.0 + square)
    cos, sin = (1.0 - square) * over, 2.0 * t * over
    dx, dy = rows[moved.x] - rows[pivot.x], rows[moved.y] - rows[pivot.y]
    return MoveProposal((moved.x, moved.y), (rows[pivot.x] + cos * dx - sin * dy, rows[pivot.y] + sin * dx + cos * dy))


def _difference(draw: MoveInputs) -> MoveProposal:
    """Some objects by the difference of two scenes of a frozen pool (ter Braak 2006, but with a fixed pool): steps
    along the shape of the target set, and from one of its modes to another."""
    parts = draw.chain_state.parts
    many = len(parts) if draw.rng.random() < 0.5 else int(draw.rng.integers(1, len(parts) + 1))
    rows = [row for part in draw.pick(many) for row in part.rows]
    size = len(draw.pool[0])
    first, second = draw.rng.integers(size, size=(2, draw.count))
    factor = 1.0 if draw.rng.random() < 0.25 else draw.factor()
    return MoveProposal(
        tuple(rows), tuple(draw.rows[row] + factor * (draw.pool[row][first] - draw.pool[row][second]) for row in rows)
    )


STEP_PROPOSALS: Mapping[str, Kind] = {
    "row": _row,
    "two rows": lambda draw: draw.walk(draw.row_deck.deal(2)),  # for scenes in which another atom becomes active
    "object": lambda draw: draw.walk(draw.pick(1)[0].rows),
    "all": lambda draw: draw.walk(range(draw.chain_state.dimension)),
    "redraw row": lambda draw: _redraw(draw, draw.row_deck.deal()),
    "redraw two rows": lambda draw: _redraw(draw, draw.row_deck.deal(2)),
    "redraw object": lambda draw: _redraw(draw, draw.pick(1)[0].rows),
    "redraw axis": _redraw_axis,
    "difference": _difference,
    "pair": lambda draw: draw.walk([row for part in draw.pick(2) for row in part.rows]),
    "shift all": lambda draw: _shift(draw, draw.chain_state.parts),
    "shift some": lambda draw: _shift(draw, draw.pick(int(draw.rng.integers(2, len(draw.chain_state.parts) + 1)))),
    "shift run": _shift_run,
    "turn": _turn,
    "stretch": _stretch,
}
SCALED_KINDS = frozenset(kind for kind in STEP_PROPOSALS if not kind.startswith("redraw"))


def _flip(draw: MoveInputs) -> MoveProposal:
    """One object to the other side of another, along x, y or both."""
    moved, pivot = draw.pick(2)
    pairs = [(moved.x, pivot.x), (moved.y, pivot.y)]
    axis = int(draw.rng.integers(3))
    chosen = [pair for pair in (pairs if axis == 2 else pairs[axis : axis + 1]) if None not in pair]
    rows = draw.rows
    return MoveProposal(
        tuple(row for row, _ in chosen if row is not None),
        tuple(2.0 * rows[other] - rows[row] for row, other in chosen if row is not None and other is not None),
        draw.coin(),
        parting=False,
    )


def _exchangeable_rows(
    chain_state: ChainState, first: ChainObject, second: ChainObject, axes: Sequence[int]
) -> list[tuple[int, int]]:
    """The rows that two objects can exchange: those that move in both and have the same limits."""
    pairs = [(first.at[axis], second.at[axis]) for axis in axes]
    low, high = chain_state.low, chain_state.high
    return [(a, b) for a, b in pairs if a is not None and b is not None and low[a] == low[b] and high[a] == high[b]]


def _exchange(draw: MoveInputs, pairs: Sequence[tuple[ChainObject, ChainObject]]) -> MoveProposal:
    """The poses of each pair of objects exchanged: the whole pose, the position alone, or one coordinate."""
    axes = (EVERY, PLACE, (X,), (Y,))[int(draw.rng.integers(4))]
    rows: list[int] = []
    values: Rows = []
    for first, second in pairs:
        for a, b in _exchangeable_rows(draw.chain_state, first, second, axes):
            rows += [a, b]
            values += [draw.rows[b], draw.rows[a]]
    return MoveProposal(tuple(rows), tuple(values), draw.coin(), parting=False)


def _swap(draw: MoveInputs) -> MoveProposal:
    first, second = draw.pick(2)
    return _exchange(draw, [(first, second)])


def _reverse(draw: MoveInputs) -> MoveProposal:
    """The objects in reverse order of the spec."""
    parts = draw.chain_state.parts
    half = len(parts) // 2
    return _exchange(draw, list(zip(parts[:half], parts[::-1][:half], strict=True)))


def _symmetry(swapping: bool, along_x: bool, along_y: bool, exchange: bool) -> Kind:
    """All objects mirrored along the axes named, or with x and y exchanged first; `swapping` also exchanges the poses
    of two of them. Half of the time the headings are mirrored with the table.

    Exchanging x and y on a table that is not square stretches one and shrinks the other: volumes stay.
    """

    def move(draw: MoveInputs) -> MoveProposal:
        chain_state = draw.chain_state
        low, high = chain_state.low, chain_state.high
        new: dict[int, Array] = {}
        turning = draw.rng.random() < 0.5
        for part in chain_state.parts:
            for row in part.rows:
                new[row] = draw.rows[row]
            if exchange and part.x is not None and part.y is not None:
                x, y = part.x, part.y
                ratio = (high[x] - low[x]) / (high[y] - low[y])
                new[x], new[y] = low[x] + (new[y] - low[y]) * ratio, low[y] + (new[x] - low[x]) / ratio
            for row_, mirrored in ((part.x, along_x), (part.y, along_y)):
                if row_ is not None and mirrored:
                    new[row_] = high[row_] + low[row_] - new[row_]
            if turning and part.theta is not None and chain_state.circular[part.theta]:
                new[part.theta] = _mirror_heading(new[part.theta], along_x, along_y, exchange)
        if swapping:
            first, second = draw.pick(2)
            # An object without a moving x or y, or with other limits of its place, is mirrored in another way: with an
            # exchange the map would not be its own inverse.
            places = _exchangeable_rows(chain_state, first, second, PLACE)
            if _moving_axes(first) != _moving_axes(second) or len(places) < sum(_moving_axes(first)):
                return MoveProposal((), (), parting=False)
            for a, b in _exchangeable_rows(chain_state, first, second, EVERY):
                new[a], new[b] = new[b], new[a]
        moved = [(row, value) for row, value in new.items() if value is not draw.rows[row]]
        return MoveProposal(tuple(row for row, _ in moved), tuple(value for _, value in moved), draw.coin(), False)

    return move


def _moving_axes(part: ChainObject) -> tuple[bool, bool]:
    return part.x is not None, part.y is not None


def _mirror_heading(theta: Array, along_x: bool, along_y: bool, exchange: bool) -> Array:
    """The heading after the table has been mirrored: theta -> pi/2 - theta, then pi - theta, then -theta."""
    if exchange:
        theta = 0.5 * math.pi - theta
    if along_x:
        theta = math.pi - theta
    if along_y:
        theta = -theta
    return np.mod(theta, TWO_PI)


MIRROR_PROPOSALS: Mapping[str, Kind] = {
    "mirror x": _symmetry(False, True, False, False),
    "mirror y": _symmetry(False, False, True, False),
    "half turn": _symmetry(False, True, True, False),
    "exchange axes": _symmetry(False, False, False, True),
    "exchange axes, half turn": _symmetry(False, True, True, True),
    "flip": _flip,
    "swap": _swap,
    "reverse": _reverse,
    "swap, mirror x": _symmetry(True, True, False, False),
    "swap, mirror y": _symmetry(True, False, True, False),
    "swap, half turn": _symmetry(True, True, True, False),
    "swap, exchange axes": _symmetry(True, False, False, True),
    "swap, exchange axes, half turn": _symmetry(True, True, True, True),
}
HALF_TURNS = (frozenset({"half turn"}), frozenset({"mirror x", "mirror y"}))
# Compositions of other mirrors, each with its own random choice.
COMPOSED_MIRRORS: Mapping[str, tuple[frozenset[str], ...]] = {
    "half turn": HALF_TURNS[1:],
    "exchange axes, half turn": tuple(others | {"exchange axes"} for others in HALF_TURNS),
    "swap, mirror x": (frozenset({"swap", "mirror x"}),),
    "swap, mirror y": (frozenset({"swap", "mirror y"}),),
    "swap, half turn": tuple(others | {"swap"} for others in HALF_TURNS),
    "swap, exchange axes": (frozenset({"swap", "exchange axes"}),),
    "swap, exchange axes, half turn": (
        frozenset({"swap", "exchange axes, half turn"}),
        *(others | {"swap", "exchange axes"} for others in HALF_TURNS),
    ),
}


MOVE_PROPOSALS: Mapping[str, Kind] = {**STEP_PROPOSALS, **MIRROR_PROPOSALS}
# and all moves that are swaps or reversals of the order
COUPLED_KINDS = frozenset({"pair", "shift all", "shift some", "shift run", "turn", "stretch", "flip"})


def moves_for(chain_state: ChainState) -> tuple[str, ...]:
    """The kinds of moves that apply to a chain_state: those of two objects need two."""
    kinds = list(MOVE_PROPOSALS)
    if len(chain_state.parts) == 1:
        kinds = [kind for kind in kinds if kind not in COUPLED_KINDS and "swap" not in kind and kind != "reverse"]
    if chain_state.dimension == 1:
        kinds.remove("two rows")
        kinds.remove("redraw two rows")
    return tuple(kinds)
