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
from scenegen.bounds.requirements import Ends
from scenegen.bounds.tape import Contracted, Tape
from scenegen.lang.core import Apply, Const, Coord, Junction, Node
from scenegen.lang.fold import Algebra, fold
from scenegen.primitives import PRIMITIVES, Interval
from scenegen.primitives import interval as iv
from scenegen.primitives.backward import maximum as back_maximum
from scenegen.primitives.backward import minimum as back_minimum

Array = npt.NDArray[np.float64]

ROUNDS = 4
LEAST = 0.02  # a sweep that takes less than this share off every box is the last
KEPT = 4  # contracted boxes of a tape that are kept
SLACK = 1e-9  # wanted ends are loosened by this, relative to the size of the numbers, for the tape rounds differently


def start(
    tape: Tape, wanted: Sequence[Mapping[int, Ends]], lowest: Array, highest: Array, *, slack: float = SLACK
) -> tuple[Array, Array]:
    """Intervals of all nodes, (T, K), for K boxes lowest..highest, (3N, K), each with its own wanted formula nodes.
    Contraction proves nothing with less `slack` than SLACK."""
    lo, hi = np.full((len(tape.nodes), len(wanted)), -np.inf), np.full((len(tape.nodes), len(wanted)), np.inf)
    for row, node in tape.rows.items():
        lo[node], hi[node] = lowest[row], highest[row]
    scale = size_of(lowest, highest)
    for node in tape.loops:
        lo[node], hi[node] = -scale * SLACK, scale * SLACK
    for column, ends in enumerate(wanted):
        impose(tape, ends, lo[:, column], hi[:, column], scale, slack)
    return lo, hi


def size_of(lowest: Array, highest: Array) -> float:
    """The size of the numbers that coordinates in a box are, at least 1."""
    return max(1.0, float(np.abs(lowest).max(initial=0.0)), float(np.abs(highest).max(initial=0.0)))


def impose(tape: Tape, wanted: Mapping[int, Ends], lo: Array, hi: Array, size: float, slack: float = SLACK) -> None:
    """Narrow the intervals of one box, (T,) each, in place, to what is wanted of formula nodes."""
    for node, (low, high) in wanted.items():
        at = tape.where[node]
        lo[at] = max(lo[at], low - slack * (size + abs(low)))
        hi[at] = min(hi[at], high + slack * (size + abs(high)))


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
                fold(nodes, _Forward(lo, hi, effort))
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


def contract_box(
    tape: Tape, lowest: Array, highest: Array, demand: Mapping[int, Ends], effort: Effort, rounds: int = ROUNDS
) -> Contracted:
    """One box lowest..highest, (3N,), with a demand, contracted. Raises what `effort` raises.

    The check of a request, pruning, and the look at rejection without it all begin with the same box. The tape keeps
    the latest ones, and the same work is counted for one that is at hand.
    """
    key = lowest.tobytes(), highest.tobytes(), tuple(sorted(demand.items())), rounds
    known = tape.contracted.get(key)
    if known is not None and effort.allows(known.work):
        effort.spend(known.work)
        return known
    used = effort.used
    lo, hi = start(tape, [demand], lowest[:, None], highest[:, None])
    alive = bool(contract(tape.nodes, lo, hi, rounds, batches=tape.batches, effort=effort)[0])
    made = tape.contracted[key] = Contracted(lo[:, 0], hi[:, 0], alive, effort.used - used)
    if len(tape.contracted) > KEPT:
        del tape.contracted[next(iter(tape.contracted))]
    return made


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
        fold(nodes, _Forward(out_lo, out_hi, effort, known))
    return out_lo, out_hi


class _Forward(Algebra[Interval]):
    """Nodes as the rows of lo and hi, (T, K), which are met with, or where not `known` (T,) replaced by, the bounds of
    their children, in place. Without `known`, all are met."""

    def __init__(self, lo: Array, hi: Array, effort: Effort, known: npt.NDArray[np.bool_] | None = None) -> None:
        self._lo, self._hi, self._effort, self._known = lo, hi, effort, known

    def constant(self, index: int, node: Const) -> Interval:
        return self._put(index, iv.point(node.value))

    def coordinate(self, index: int, node: Coord) -> Interval:
        return Interval(self._lo[index], self._hi[index])

    def apply(self, index: int, node: Apply, args: list[Interval]) -> Interval:
        self._effort.spend(bounding(node, self._lo.shape[1]))
        return self._put(index, PRIMITIVES[node.primitive].interval(*node.shapes, *args))

    def junction(self, index: int, node: Junction, args: list[Interval]) -> Interval:
        self._effort.spend(bounding(node, self._lo.shape[1]))
        # All rows at a time: conjunctions have hundreds of parts.
        columns = self._lo[list(node.args)], self._hi[list(node.args)]
        if node.kind == "min":
            return self._put(index, Interval(columns[0].min(axis=0), columns[1].min(axis=0)))
        return self._put(index, Interval(columns[0].max(axis=0), columns[1].max(axis=0)))

    def _put(self, index: int, value: Interval) -> Interval:
        mine = Interval(self._lo[index], self._hi[index])
        if self._known is None:
            np.fmax(mine.lo, value.lo, out=mine.lo)
            np.fmin(mine.hi, value.hi, out=mine.hi)
        elif self._known[index]:  # in this order, which tells where one is 0.0 and the other -0.0
            np.fmax(value.lo, mine.lo, out=mine.lo)
            np.fmin(value.hi, mine.hi, out=mine.hi)
        else:
            mine.lo[...], mine.hi[...] = value
        return mine


def _down(nodes: Sequence[Node], lo: Array, hi: Array, effort: Effort) -> None:
    """Meet every child's interval with what its parents leave, from the last node on: not a fold, for it goes from
    parents to children."""
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
