"""Contraction: narrower boxes that hold the same solutions.

This is HC4 (Benhamou et al. 1999, "Revising hull and box consistency") on a tape whose nodes keep what they know.
Forward, every node's interval is met with the bounds of its children; backward, every child's with what its parent's
leaves it. Intervals on inner nodes are kept from sweep to sweep, so that what one atom says of a difference of two
coordinates reaches every other atom over the same objects.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from scenegen.bounds.batches import Batches
from scenegen.bounds.effort import Effort, bounding
from scenegen.bounds.tape import Tape
from scenegen.lang.core import Apply, Const, Coord, Junction, Node
from scenegen.primitives import PRIMITIVES, Interval
from scenegen.primitives import interval as iv
from scenegen.primitives.backward import maximum as back_maximum
from scenegen.primitives.backward import minimum as back_minimum

Array = npt.NDArray[np.float64]
Wanted = Mapping[int, tuple[float, float]]
"""Core node of a formula -> lowest and highest wanted value."""

ROUNDS = 4
LEAST = 0.02  # a sweep that takes less than this share off every box is the last
SLACK = 1e-9  # wanted ends are loosened by this, relative to the size of the numbers, for the tape rounds differently


def start(tape: Tape, wanted: Sequence[Wanted], lowest: Array, highest: Array) -> tuple[Array, Array]:
    """Intervals of all nodes, (T, K), for K boxes lowest..highest, (3N, K), each with its own wanted formula nodes."""
    lo, hi = np.full((len(tape.nodes), len(wanted)), -np.inf), np.full((len(tape.nodes), len(wanted)), np.inf)
    for row, node in tape.rows.items():
        lo[node], hi[node] = lowest[row], highest[row]
    scale = size_of(lowest, highest)
    for node in tape.loops:
        lo[node], hi[node] = -scale * SLACK, scale * SLACK
    for column, ends in enumerate(wanted):
        impose(tape, ends, lo[:, column], hi[:, column], scale)
    return lo, hi


def size_of(lowest: Array, highest: Array) -> float:
    """The size of the numbers that coordinates in a box are, at least 1."""
    return max(1.0, float(np.abs(lowest).max(initial=0.0)), float(np.abs(highest).max(initial=0.0)))


def impose(tape: Tape, wanted: Wanted, lo: Array, hi: Array, size: float) -> None:
    """Narrow the intervals of one box, (T,) each, in place, to what is wanted of formula nodes."""
    for node, (low, high) in wanted.items():
        at = tape.where[node]
        lo[at] = max(lo[at], low - SLACK * (size + abs(low)))
        hi[at] = min(hi[at], high + SLACK * (size + abs(high)))


def contract(
    nodes: Sequence[Node],
    lo: Array,
    hi: Array,
    rounds: int = ROUNDS,
    *,
    batches: Batches | None = None,
    effort: Effort | None = None,
) -> npt.NDArray[np.bool_]:
    """Narrow the intervals of T nodes over K boxes, (T, K) each, in place; returns which may hold a solution, (K,).

    No solution is lost: a scene that lies in a box and whose nodes lie in the intervals given lies in those left. With
    `batches`, those of `nodes`, many nodes are revised at a time: faster on large tapes, and narrower or wider by a
    little, for nodes of one batch do not see what the others have narrowed. Raises what `effort` raises.
    """
    effort = Effort() if effort is None else effort
    alive = np.ones(lo.shape[1], dtype=bool)
    leaves = [index for index, node in enumerate(nodes) if _is_leaf(nodes, node)]
    with np.errstate(all="ignore"):
        before = hi[leaves] - lo[leaves]
        for _ in range(rounds):
            if batches is None:
                _up(nodes, lo, hi, effort)
            else:
                batches.meet_up(lo, hi, effort)
            alive &= (lo <= hi).all(axis=0)
            if not alive.any():
                break
            if batches is None:
                _down(nodes, lo, hi, effort)
            else:
                batches.meet_down(lo, hi, effort)
            alive &= (lo <= hi).all(axis=0)
            after = hi[leaves] - lo[leaves]
            if not alive.any() or not (after < (1.0 - LEAST) * before)[:, alive].any():
                break
            before = after
    return alive


def forward(
    nodes: Sequence[Node],
    lo: Array,
    hi: Array,
    given: Sequence[int],
    *,
    batches: Batches | None = None,
    effort: Effort | None = None,
) -> tuple[Array, Array]:
    """Bounds of all nodes, (T, K), from the intervals of the `given` ones alone (and of all coordinates): the same
    with and without `batches`. Raises what `effort` raises."""
    effort = Effort() if effort is None else effort
    out_lo, out_hi = lo.copy(), hi.copy()
    known = np.zeros(len(nodes), dtype=bool)
    known[list(given)] = True
    if batches is not None:
        with np.errstate(all="ignore"):
            batches.bounds(out_lo, out_hi, effort, known)
        return out_lo, out_hi
    with np.errstate(all="ignore"):
        for index, node in enumerate(nodes):
            effort.spend(bounding(node, lo.shape[1]))
            value = _value(node, out_lo, out_hi)
            if value is None:
                continue
            out_lo[index], out_hi[index] = value
            if known[index]:
                np.fmax(out_lo[index], lo[index], out=out_lo[index])
                np.fmin(out_hi[index], hi[index], out=out_hi[index])
    return out_lo, out_hi


def _up(nodes: Sequence[Node], lo: Array, hi: Array, effort: Effort) -> None:
    """Meet every node's interval with the bounds of its children, one after another."""
    for index, node in enumerate(nodes):
        effort.spend(bounding(node, lo.shape[1]))
        value = _value(node, lo, hi)
        if value is not None:
            np.fmax(lo[index], value.lo, out=lo[index])
            np.fmin(hi[index], value.hi, out=hi[index])


def _down(nodes: Sequence[Node], lo: Array, hi: Array, effort: Effort) -> None:
    """Meet every child's interval with what its parents leave, from the last node on."""
    for index in range(len(nodes) - 1, -1, -1):
        node = nodes[index]
        if isinstance(node, Apply | Junction):
            effort.spend(bounding(node, lo.shape[1]))
            _revise(node, Interval(lo[index], hi[index]), lo, hi)


def _is_leaf(nodes: Sequence[Node], node: Node) -> bool:
    """Coordinates, and differences of two of them: whose intervals are worth narrowing."""
    if isinstance(node, Apply):
        return node.primitive == "sub" and all(isinstance(nodes[arg], Coord) for arg in node.args)
    return isinstance(node, Coord)


def _value(node: Node, lo: Array, hi: Array) -> Interval | None:
    match node:
        case Const(value):
            return iv.point(value)
        case Apply(primitive, args, shapes):
            return PRIMITIVES[primitive].interval(*shapes, *(Interval(lo[arg], hi[arg]) for arg in args))
        case Junction(kind, args):
            columns = lo[list(args)], hi[list(args)]
            if kind == "min":
                return Interval(columns[0].min(axis=0), columns[1].min(axis=0))
            return Interval(columns[0].max(axis=0), columns[1].max(axis=0))
    return None


def _revise(node: Apply | Junction, result: Interval, lo: Array, hi: Array) -> None:
    parts = tuple(Interval(lo[arg], hi[arg]) for arg in node.args)
    if isinstance(node, Junction):
        narrower = (back_minimum if node.kind == "min" else back_maximum)(result, *parts)
    else:
        rule = PRIMITIVES[node.primitive].backward
        if rule is None:
            return
        narrower = rule(*node.shapes, result, *parts)
    for arg, part in zip(node.args, narrower, strict=True):
        np.fmax(lo[arg], part.lo, out=lo[arg])
        np.fmin(hi[arg], part.hi, out=hi[arg])
