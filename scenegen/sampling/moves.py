"""The moves of the splitting chains: proposals that are symmetric under the uniform base distribution.

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

SPREAD = 4.0  # step lengths are log-uniform from 1/4 to 4 times the tuned one
_TWO_PI = 2.0 * math.pi
_POSE = ("x", "y", "theta")


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
    """New values of some rows. `coin` (P,) tells for maps that are their own inverse which chains are to try them; two
    chains that were copies of each other may still be so afterwards. None for moves with random numbers of their own
    for each chain: those part copies. `row` is the one row that a single-row walk moved, -1 for others."""

    rows: tuple[int, ...]
    values: tuple[Array, ...]
    coin: Mask | None = None
    row: int = -1

    @property
    def parting(self) -> bool:
        return self.coin is None


@dataclass(frozen=True, slots=True)
class Draw:
    """What a kind of move is given: the rows now, the frozen pool that differences are taken from, the tuning."""

    frame: Frame
    rows: Rows
    pool: Rows
    tuning: Tuning
    scale: float
    rng: np.random.Generator

    @property
    def count(self) -> int:
        return len(self.rows[0])

    def factor(self) -> float:
        return self.scale * SPREAD ** self.rng.uniform(-1.0, 1.0)

    def noise(self, half_width: float) -> Array:
        """One step per chain, uniform and symmetric. Two of 32 bits from each random number: the length of the step is
        random, too, so that the grid of 2^32 values is never seen."""
        raw: npt.NDArray[np.uint64] = self.rng.bit_generator.random_raw(-(-self.count // 2))
        steps = raw.view(np.int32)[: self.count].astype(np.float64)
        steps += 0.5  # the integers reach from -2^31 to 2^31 - 1
        steps *= half_width / 2.0**31
        return steps

    def coin(self) -> Mask:
        count = self.count
        return np.unpackbits(np.frombuffer(self.rng.bytes(-(-count // 8)), dtype=np.uint8), count=count).view(np.bool_)

    def pick(self, many: int, least: int = 1) -> list[Part]:
        """`many` different parts."""
        parts = self.frame.parts
        chosen = self.rng.permutation(len(parts))[: max(least, many)]
        return [parts[index] for index in chosen]

    def walk(self, rows: Sequence[int]) -> Proposal:
        """Independent steps of the given rows."""
        factor = self.factor() / math.sqrt(len(rows))
        return Proposal(tuple(rows), tuple(self.rows[row] + self.noise(self._capped(row, factor)) for row in rows))

    def _capped(self, row: int, factor: float) -> float:
        return min(float(self.tuning.length[row]) * factor, 0.5 * float(self.frame.high[row] - self.frame.low[row]))

    def step(self, rows: Sequence[int], factor: float) -> float:
        """One step length for several rows that move alike: the geometric mean of their own."""
        mean = math.exp(sum(math.log(self.tuning.length[row]) for row in rows) / len(rows))
        room = min(float(self.frame.high[row] - self.frame.low[row]) for row in rows)
        return min(mean * factor, 0.5 * room)


Kind = Callable[[Draw], Proposal]


def _row(draw: Draw) -> Proposal:
    row = int(draw.rng.integers(draw.frame.dimension))
    half = draw._capped(row, draw.factor())
    return Proposal((row,), (draw.rows[row] + draw.noise(half),), row=row)


def _object(draw: Draw) -> Proposal:
    return draw.walk(draw.pick(1)[0].rows)


def _pair(draw: Draw) -> Proposal:
    return draw.walk([row for part in draw.pick(2) for row in part.rows])


def _two(draw: Draw) -> Proposal:
    """Two rows of any objects: one atom hands over to another."""
    chosen = draw.rng.permutation(draw.frame.dimension)[:2]
    return draw.walk([int(row) for row in chosen])


def _all(draw: Draw) -> Proposal:
    return draw.walk(range(draw.frame.dimension))


def _shift(draw: Draw) -> Proposal:
    """Several objects by the same step along x, y or both; half of the time all of them."""
    count = len(draw.frame.parts)
    many = count if draw.rng.random() < 0.5 else int(draw.rng.integers(2, count + 1))
    parts = draw.pick(many)
    axes = (("x",), ("y",), ("x", "y"))[int(draw.rng.integers(3))]
    factor = draw.factor()
    rows: list[int] = []
    values: Rows = []
    for axis in axes:
        mine = [row for part in parts if (row := getattr(part, axis)) is not None]
        if mine:
            step = draw.noise(draw.step(mine, factor))
            rows += mine
            values += [draw.rows[row] + step for row in mine]
    return Proposal(tuple(rows), tuple(values))


def _anew(draw: Draw, rows: Sequence[int]) -> Proposal:
    """Rows drawn anew where the plan's chains lived. Chains that have left those parts stay: they could not be met."""
    low, high = draw.tuning.low, draw.tuning.high
    values: Rows = []
    for row in rows:
        old = draw.rows[row]
        value = draw.rng.random(draw.count)
        value *= high[row] - low[row]
        value += low[row]
        values.append(np.where((old >= low[row]) & (old <= high[row]), value, np.nan))
    return Proposal(tuple(rows), tuple(values))


def _redraw_row(draw: Draw) -> Proposal:
    return _anew(draw, [int(draw.rng.integers(draw.frame.dimension))])


def _redraw_two(draw: Draw) -> Proposal:
    return _anew(draw, [int(row) for row in draw.rng.permutation(draw.frame.dimension)[:2]])


def _redraw_object(draw: Draw) -> Proposal:
    return _anew(draw, draw.pick(1)[0].rows)


def _turn(draw: Draw) -> Proposal:
    """One object around another, by an angle 2 atan(t) with t symmetric about 0: the distance between them stays."""
    moved, pivot = draw.pick(2)
    if moved.x is None or moved.y is None or pivot.x is None or pivot.y is None:
        return Proposal((), ())
    rows = draw.rows
    t = draw.noise(min(1.0, draw.factor()))
    square = t * t
    over = 1.0 / (1.0 + square)
    cos, sin = (1.0 - square) * over, 2.0 * t * over
    dx, dy = rows[moved.x] - rows[pivot.x], rows[moved.y] - rows[pivot.y]
    return Proposal((moved.x, moved.y), (rows[pivot.x] + cos * dx - sin * dy, rows[pivot.y] + sin * dx + cos * dy))


def _flip(draw: Draw) -> Proposal:
    """One object to the other side of another, along x, y or both."""
    moved, pivot = draw.pick(2)
    pairs = [(moved.x, pivot.x), (moved.y, pivot.y)]
    axis = int(draw.rng.integers(3))
    chosen = [pair for pair in (pairs if axis == 2 else pairs[axis : axis + 1]) if None not in pair]
    rows = draw.rows
    return Proposal(
        tuple(row for row, _ in chosen if row is not None),
        tuple(2.0 * rows[other] - rows[row] for row, other in chosen if row is not None and other is not None),
        draw.coin(),
    )


def _alike(frame: Frame, first: Part, second: Part, axes: Sequence[str]) -> list[tuple[int, int]]:
    """The rows that two objects can exchange: those that move in both, within the same limits."""
    pairs = [(getattr(first, axis), getattr(second, axis)) for axis in axes]
    low, high = frame.low, frame.high
    return [
        (a, b) for a, b in pairs if a is not None and b is not None and low[a] == low[b] and high[a] == high[b]
    ]


def _exchange(draw: Draw, pairs: Sequence[tuple[Part, Part]]) -> Proposal:
    """The poses of each pair of objects exchanged: all of it, the place alone, or one coordinate."""
    axes = (_POSE, ("x", "y"), ("x",), ("y",))[int(draw.rng.integers(4))]
    rows: list[int] = []
    values: Rows = []
    for first, second in pairs:
        for a, b in _alike(draw.frame, first, second, axes):
            rows += [a, b]
            values += [draw.rows[b], draw.rows[a]]
    return Proposal(tuple(rows), tuple(values), draw.coin())


def _swap(draw: Draw) -> Proposal:
    first, second = draw.pick(2)
    return _exchange(draw, [(first, second)])


def _reverse(draw: Draw) -> Proposal:
    """The objects in reverse order, as they stand in the spec."""
    parts = draw.frame.parts
    half = len(parts) // 2
    return _exchange(draw, list(zip(parts[:half], parts[::-1][:half], strict=True)))


def _symmetry(swapping: bool, along_x: bool, along_y: bool, exchange: bool) -> Kind:
    """All objects mirrored along the axes named, or with x and y exchanged first; `swapping` also exchanges the poses
    of two of them. Half of the time the headings are mirrored with the table.

    Exchanging x and y on a table that is not square stretches one and shrinks the other: volumes stay.
    """

    def move(draw: Draw) -> Proposal:
        frame = draw.frame
        low, high = frame.low, frame.high
        new: dict[int, Array] = {}
        turning = draw.rng.random() < 0.5
        for part in frame.parts:
            for row in part.rows:
                new[row] = draw.rows[row]
            if exchange and part.x is not None and part.y is not None:
                x, y = part.x, part.y
                ratio = (high[x] - low[x]) / (high[y] - low[y])
                new[x], new[y] = low[x] + (new[y] - low[y]) * ratio, low[y] + (new[x] - low[x]) / ratio
            for row_, mirrored in ((part.x, along_x), (part.y, along_y)):
                if row_ is not None and mirrored:
                    new[row_] = high[row_] + low[row_] - new[row_]
            if turning and part.theta is not None and frame.circular[part.theta]:
                new[part.theta] = _turned(new[part.theta], along_x, along_y, exchange)
        if swapping:
            first, second = draw.pick(2)
            for a, b in _alike(frame, first, second, _POSE):
                new[a], new[b] = new[b], new[a]
        moved = [(row, value) for row, value in new.items() if value is not draw.rows[row]]
        return Proposal(tuple(row for row, _ in moved), tuple(value for _, value in moved), draw.coin())

    return move


def _turned(theta: Array, along_x: bool, along_y: bool, exchange: bool) -> Array:
    """The heading after the table has been mirrored: theta -> pi/2 - theta, then pi - theta, then -theta."""
    if exchange:
        theta = 0.5 * math.pi - theta
    if along_x:
        theta = math.pi - theta
    if along_y:
        theta = -theta
    return np.mod(theta, _TWO_PI)


def _difference(draw: Draw) -> Proposal:
    """Some objects by the difference of two scenes of a frozen pool (ter Braak 2006, with a pool that does not move):
    steps along the shape of the wanted set, and from one of its modes to another."""
    parts = draw.frame.parts
    many = len(parts) if draw.rng.random() < 0.5 else int(draw.rng.integers(1, len(parts) + 1))
    rows = [row for part in draw.pick(many) for row in part.rows]
    size = len(draw.pool[0])
    first, second = draw.rng.integers(size, size=(2, draw.count))
    factor = 1.0 if draw.rng.random() < 0.25 else draw.factor()
    return Proposal(
        tuple(rows),
        tuple(draw.rows[row] + factor * (draw.pool[row][first] - draw.pool[row][second]) for row in rows),
    )


STEPS: Mapping[str, Kind] = {
    "row": _row,
    "two rows": _two,
    "object": _object,
    "all": _all,
    "redraw row": _redraw_row,
    "redraw two rows": _redraw_two,
    "redraw object": _redraw_object,
    "difference": _difference,
    "pair": _pair,
    "shift": _shift,
    "turn": _turn,
}
MIRRORS: Mapping[str, Kind] = {
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
KINDS: Mapping[str, Kind] = {**STEPS, **MIRRORS}
SCALED = frozenset({"row", "two rows", "object", "pair", "all", "shift", "turn", "difference"})

_TURN = (frozenset({"half turn"}), frozenset({"mirror x", "mirror y"}))
# Mirrors that others make up, each with a coin of its own.
COMPOSED: Mapping[str, tuple[frozenset[str], ...]] = {
    "half turn": _TURN[1:],
    "exchange axes, half turn": tuple(others | {"exchange axes"} for others in _TURN),
    "swap, mirror x": (frozenset({"swap", "mirror x"}),),
    "swap, mirror y": (frozenset({"swap", "mirror y"}),),
    "swap, half turn": tuple(others | {"swap"} for others in _TURN),
    "swap, exchange axes": (frozenset({"swap", "exchange axes"}),),
    "swap, exchange axes, half turn": (
        frozenset({"swap", "exchange axes, half turn"}),
        *(others | {"swap", "exchange axes"} for others in _TURN),
    ),
}
_COUPLED = frozenset({"pair", "shift", "turn", "flip"})  # and all that speaks of a swap or the order


def kinds_for(frame: Frame) -> tuple[str, ...]:
    """The kinds of moves that mean something for a frame: those of two objects need two."""
    kinds = list(KINDS)
    if len(frame.parts) == 1:
        kinds = [kind for kind in kinds if kind not in _COUPLED and "swap" not in kind and kind != "reverse"]
    if frame.dimension == 1:
        kinds.remove("two rows")
        kinds.remove("redraw two rows")
    return tuple(kinds)


def bring_home(frame: Frame, proposal: Proposal) -> tuple[tuple[Array, ...], Mask | None]:
    """The proposed values with headings wrapped into the circle, and which chains may take them: those that stay in the
    box and whose coin says so (None: all)."""
    inside = proposal.coin
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
