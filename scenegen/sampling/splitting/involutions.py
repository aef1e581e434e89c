"""Moves that are their own inverse: mirror images of the table and exchanges of objects, each with probability 1/2 per
chain.

They lead directly from one mode of a symmetric spec to another, such as from "a left of b" to "b left of a", where
small steps would have to cross scenes out of range.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from scenegen.pose import EVERY, PLACE, TWO_PI, X, Y
from scenegen.sampling.splitting.chain_state import ChainState, Part
from scenegen.sampling.splitting.moves import Draw, Kind, Proposal

Array = npt.NDArray[np.float64]
Rows = list[Array]


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
        parting=False,
    )


def _alike(chain_state: ChainState, first: Part, second: Part, axes: Sequence[int]) -> list[tuple[int, int]]:
    """The rows that two objects can exchange: those that move in both and have the same limits."""
    pairs = [(first.at[axis], second.at[axis]) for axis in axes]
    low, high = chain_state.low, chain_state.high
    return [(a, b) for a, b in pairs if a is not None and b is not None and low[a] == low[b] and high[a] == high[b]]


def _exchange(draw: Draw, pairs: Sequence[tuple[Part, Part]]) -> Proposal:
    """The poses of each pair of objects exchanged: the whole pose, the position alone, or one coordinate."""
    axes = (EVERY, PLACE, (X,), (Y,))[int(draw.rng.integers(4))]
    rows: list[int] = []
    values: Rows = []
    for first, second in pairs:
        for a, b in _alike(draw.chain_state, first, second, axes):
            rows += [a, b]
            values += [draw.rows[b], draw.rows[a]]
    return Proposal(tuple(rows), tuple(values), draw.coin(), parting=False)


def _swap(draw: Draw) -> Proposal:
    first, second = draw.pick(2)
    return _exchange(draw, [(first, second)])


def _reverse(draw: Draw) -> Proposal:
    """The objects in reverse order of the spec."""
    parts = draw.chain_state.parts
    half = len(parts) // 2
    return _exchange(draw, list(zip(parts[:half], parts[::-1][:half], strict=True)))


def _symmetry(swapping: bool, along_x: bool, along_y: bool, exchange: bool) -> Kind:
    """All objects mirrored along the axes named, or with x and y exchanged first; `swapping` also exchanges the poses
    of two of them. Half of the time the headings are mirrored with the table.

    Exchanging x and y on a table that is not square stretches one and shrinks the other: volumes stay.
    """

    def move(draw: Draw) -> Proposal:
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
                new[part.theta] = _turned(new[part.theta], along_x, along_y, exchange)
        if swapping:
            first, second = draw.pick(2)
            # An object without a moving x or y, or with other limits of its place, is mirrored in another way: with an
            # exchange the map would not be its own inverse.
            places = _alike(chain_state, first, second, PLACE)
            if _places(first) != _places(second) or len(places) < sum(_places(first)):
                return Proposal((), (), parting=False)
            for a, b in _alike(chain_state, first, second, EVERY):
                new[a], new[b] = new[b], new[a]
        moved = [(row, value) for row, value in new.items() if value is not draw.rows[row]]
        return Proposal(tuple(row for row, _ in moved), tuple(value for _, value in moved), draw.coin(), False)

    return move


def _places(part: Part) -> tuple[bool, bool]:
    return part.x is not None, part.y is not None


def _turned(theta: Array, along_x: bool, along_y: bool, exchange: bool) -> Array:
    """The heading after the table has been mirrored: theta -> pi/2 - theta, then pi - theta, then -theta."""
    if exchange:
        theta = 0.5 * math.pi - theta
    if along_x:
        theta = math.pi - theta
    if along_y:
        theta = -theta
    return np.mod(theta, TWO_PI)


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
_TURN = (frozenset({"half turn"}), frozenset({"mirror x", "mirror y"}))
# Compositions of other mirrors, each with its own random choice.
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
