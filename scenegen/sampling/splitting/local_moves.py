"""Local moves: walks, shifts, turns, redraws and differences. See scenegen.sampling.splitting.moves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from scenegen.pose import EVERY, PLACE, X, Y
from scenegen.sampling.splitting.chain_state import Part
from scenegen.sampling.splitting.moves import Draw, Kind, Proposal

Array = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]
Rows = list[Array]


def _row(draw: Draw) -> Proposal:
    (row,) = draw.row_deck.deal()
    half = draw.capped(row, draw.factor())
    return Proposal((row,), (draw.rows[row] + draw.noise(half),), row=row)


def _object(draw: Draw) -> Proposal:
    return draw.walk(draw.pick(1)[0].rows)


def _pair(draw: Draw) -> Proposal:
    return draw.walk([row for part in draw.pick(2) for row in part.rows])


def _two(draw: Draw) -> Proposal:
    """Two rows of any objects, for scenes in which another atom becomes active."""
    return draw.walk(draw.row_deck.deal(2))


def _all(draw: Draw) -> Proposal:
    return draw.walk(range(draw.chain_state.dimension))


def _shift_all(draw: Draw) -> Proposal:
    return _shifted(draw, draw.chain_state.parts)


def _shift_some(draw: Draw) -> Proposal:
    return _shifted(draw, draw.pick(int(draw.rng.integers(2, len(draw.chain_state.parts) + 1))))


def _shift_run(draw: Draw) -> Proposal:
    """Objects that follow one another in the spec: if they stand in a row on the table, only the gaps at both ends
    change."""
    first, last = sorted(draw.rng.integers(len(draw.chain_state.parts), size=2).tolist())
    return _shifted(draw, draw.chain_state.parts[first : last + 1])


def _shifted(draw: Draw, parts: Sequence[Part]) -> Proposal:
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
    return Proposal(tuple(rows), tuple(values))


def _stretch(draw: Draw) -> Proposal:
    """All objects towards or away from one of them, along x or y: gaps grow or shrink in proportion.

    The map multiplies volumes by s^m for m rows stretched by s = e^u, and u and -u are equally likely: a proposal in
    range is accepted with probability min(1, s^m) (Green 1995).
    """
    axis = PLACE[int(draw.rng.integers(2))]
    (pivot,) = draw.pick(1)
    about = pivot.at[axis]
    rows = [row for part in draw.chain_state.parts if (row := part.at[axis]) is not None and row != about]
    if about is None or not rows:
        return Proposal((), ())
    u = draw.noise(min(1.0, draw.factor()))
    stretch = np.exp(u)
    middle = draw.rows[about]
    values = tuple(middle + stretch * (draw.rows[row] - middle) for row in rows)
    return Proposal(tuple(rows), values, np.log(draw.rng.random(draw.count)) < len(rows) * u)


def _redrawn(draw: Draw, rows: Sequence[int]) -> Proposal:
    """Rows redrawn uniformly within the box of the plan's chains. Chains outside this box stay, because the reverse
    move would be impossible."""
    low, high = draw.tuning.low, draw.tuning.high
    values: Rows = []
    allowed: Mask | None = None
    for row in rows:
        old = draw.rows[row]
        here = (old >= low[row]) & (old <= high[row])
        allowed = here if allowed is None else allowed & here
        value = draw.rng.random(draw.count)
        value *= high[row] - low[row]
        value += low[row]
        values.append(value)
    return Proposal(tuple(rows), tuple(values), allowed)


def _redraw_row(draw: Draw) -> Proposal:
    return _redrawn(draw, draw.row_deck.deal())


def _redraw_two(draw: Draw) -> Proposal:
    return _redrawn(draw, draw.row_deck.deal(2))


def _redraw_object(draw: Draw) -> Proposal:
    return _redrawn(draw, draw.pick(1)[0].rows)


def _redraw_axis(draw: Draw) -> Proposal:
    """One coordinate of all objects, which a disjunct along the other axis leaves free."""
    by_axis = [[row for part in draw.chain_state.parts if (row := part.at[axis]) is not None] for axis in EVERY]
    axes = [rows for rows in by_axis if rows]
    return _redrawn(draw, axes[int(draw.rng.integers(len(axes)))])


def _turn(draw: Draw) -> Proposal:
    """One object around another, by an angle 2 atan(t) with t symmetric about 0: their distance does not change."""
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


def _difference(draw: Draw) -> Proposal:
    """Some objects by the difference of two scenes of a frozen pool (ter Braak 2006, but with a fixed pool): steps
    along the shape of the target set, and from one of its modes to another."""
    parts = draw.chain_state.parts
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
    "redraw axis": _redraw_axis,
    "difference": _difference,
    "pair": _pair,
    "shift all": _shift_all,
    "shift some": _shift_some,
    "shift run": _shift_run,
    "turn": _turn,
    "stretch": _stretch,
}
SCALED = frozenset(
    {
        "row",
        "two rows",
        "object",
        "pair",
        "all",
        "shift all",
        "shift some",
        "shift run",
        "turn",
        "stretch",
        "difference",
    }
)
