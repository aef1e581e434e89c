"""Contraction: narrower boxes that hold the same solutions.

This is HC4 (Benhamou et al. 1999, "Revising hull and box consistency") on a tape whose nodes keep what they know.
Forward, every node's interval is met with the bounds of its children; backward, every child's with what its parent's
leaves it. Intervals on inner nodes are kept from sweep to sweep, so that what one atom says of a difference of two
coordinates reaches every other atom over the same objects.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import numpy.typing as npt

from scenegen.arrays import Array
from scenegen.geometry import Interval
from scenegen.lang.formula.core import Apply, Coord, Core, Junction, Node
from scenegen.lang.spec import CheckedSpec
from scenegen.search.effort import Effort
from scenegen.search.tape import BatchedTape, Contracted, Tape, make_batches, one_by_one

# What is wanted of a formula, pushed down to its parts, and split into alternatives that exclude one another.
#
# A conjunction lies at or above l if all its parts do; it lies at or below u if *some* part does, and the first one
# that does names an alternative. The alternatives of a node are disjoint and leave nothing out, so scenes drawn for
# each, in proportion to their volumes, are scenes drawn for the whole. Disjunctions are the mirror image.


Bounds = tuple[float, float]
"""Lowest and highest value, infinite where there is no limit."""

EVERYTHING: Bounds = (-math.inf, math.inf)


def intersect(a: Bounds, b: Bounds) -> Bounds:
    return max(a[0], b[0]), min(a[1], b[1])


def label_demand(core: Core, low: Array, high: Array) -> dict[int, Bounds]:
    """That phi of every label lies in low..high, (L,) each, as a demand on formula nodes."""
    demand: dict[int, Bounds] = {}
    for node, least, most in zip(core.labels.values(), map(float, low), map(float, high), strict=True):
        demand[node] = intersect(demand.get(node, EVERYTHING), (least, most))
    return demand


def push_down(core: Core, wanted: Mapping[int, Bounds]) -> dict[int, Bounds]:
    """The same demand with every end that all parts of a junction must meet handed to the parts.

    What stays on a junction is what one of its parts must meet: an upper end of a conjunction, a lower end of a
    disjunction. Nodes without a demand are left out.
    """
    out = dict(wanted)
    for index in sorted(out, reverse=True):
        _push(core, out, index)
    return {index: out[index] for index in sorted(out) if out[index] != EVERYTHING}


def _push(core: Core, out: dict[int, Bounds], top: int) -> None:
    """Hand the ends at `top` down as far as they go."""
    stack = [top]
    while stack:
        index = stack.pop()
        node = core.nodes[index]
        if not isinstance(node, Junction):
            continue
        low, high = out[index]
        if node.kind == "min":
            passed, kept = (low, math.inf), (-math.inf, high)
        else:
            passed, kept = (-math.inf, high), (low, math.inf)
        out[index] = kept
        if passed == EVERYTHING:
            continue
        for arg in node.args:
            before = out.get(arg, EVERYTHING)
            after = intersect(before, passed)
            if after != before:
                out[arg] = after
                stack.append(arg)


def alternatives(
    core: Core, wanted: Mapping[int, Bounds], index: int
) -> Iterator[tuple[dict[int, Bounds], dict[int, Bounds]]]:
    """The demand split at junction `index`, which must hold one: one entry per part that can be the first to meet it.

    Each entry is the whole demand of that alternative, pushed down, and what sets it apart: ends of formula nodes that
    hold for its scenes and for no other alternative's. Strict ends are the next number of float64, so that they say
    exactly what they mean about computed values.
    """
    node = core.nodes[index]
    assert isinstance(node, Junction)
    low, high = wanted[index]
    below = node.kind == "min"
    meets: Bounds = (-math.inf, high) if below else (low, math.inf)
    fails: Bounds = (
        (float(np.nextafter(high, math.inf)), math.inf) if below else (-math.inf, float(np.nextafter(low, -math.inf)))
    )
    rest = {key: ends for key, ends in wanted.items() if key != index}
    for position, arg in enumerate(node.args):
        apart = dict.fromkeys(node.args[:position], fails)
        # A part that occurs twice cannot be the first to meet the demand at its second place.
        if arg in apart:
            continue
        apart[arg] = meets
        demand = dict(rest)
        for key, ends in apart.items():
            demand[key] = intersect(demand.get(key, EVERYTHING), ends)
        if all(low <= high for low, high in demand.values()):
            yield push_down(core, demand), apart


SWEEPS = 4
MIN_SWEEP_GAIN = 0.02  # a sweep that takes less than this share off every box is the last
MAX_CACHED_BOXES = 4  # contracted boxes of a tape that are kept
CONTRACT_SLACK = (
    1e-9  # wanted ends are loosened by this, relative to the size of the numbers, for the tape rounds differently
)


def start(
    tape: Tape, wanted: Sequence[Mapping[int, Bounds]], lowest: Array, highest: Array, *, slack: float = CONTRACT_SLACK
) -> tuple[Array, Array]:
    """Intervals of all nodes, (T, K), for K boxes lowest..highest, (3N, K), each with its own wanted formula nodes.
    Contraction proves nothing with less `slack` than SLACK."""
    lo, hi = np.full((len(tape.nodes), len(wanted)), -np.inf), np.full((len(tape.nodes), len(wanted)), np.inf)
    for row, node in tape.rows.items():
        lo[node], hi[node] = lowest[row], highest[row]
    scale = size_of(lowest, highest)
    for node in tape.loops:
        lo[node], hi[node] = -scale * CONTRACT_SLACK, scale * CONTRACT_SLACK
    for column, ends in enumerate(wanted):
        impose(tape, ends, lo[:, column], hi[:, column], scale, slack)
    return lo, hi


def size_of(lowest: Array, highest: Array) -> float:
    """The size of the numbers that coordinates in a box are, at least 1."""
    return max(1.0, float(np.abs(lowest).max(initial=0.0)), float(np.abs(highest).max(initial=0.0)))


def impose(
    tape: Tape, wanted: Mapping[int, Bounds], lo: Array, hi: Array, size: float, slack: float = CONTRACT_SLACK
) -> None:
    """Narrow the intervals of one box, (T,) each, in place, to what is wanted of formula nodes."""
    for node, (low, high) in wanted.items():
        at = tape.where[node]
        lo[at] = max(lo[at], low - slack * (size + abs(low)))
        hi[at] = min(hi[at], high + slack * (size + abs(high)))


def contract(
    nodes: Sequence[Node],
    lo: Array,
    hi: Array,
    rounds: int = SWEEPS,
    *,
    batches: BatchedTape | None = None,
    effort: Effort | None = None,
) -> npt.NDArray[np.bool_]:
    """Narrow the intervals of T nodes over K boxes, (T, K) each, in place; returns which may hold a solution, (K,).

    No solution is lost: a scene that lies in a box and whose nodes lie in the intervals given lies in those left. With
    `batches`, those of `nodes`, many nodes may be revised at a time: faster on large tapes, and narrower or wider by a
    little, for nodes of one batch do not see what the others have narrowed. Raises what `effort` raises.
    """
    effort = Effort() if effort is None else effort
    batches = one_by_one(nodes) if batches is None else batches
    alive = np.ones(lo.shape[1], dtype=bool)
    leaves = [index for index, node in enumerate(nodes) if _is_leaf(nodes, node)]
    with np.errstate(all="ignore"):
        before = hi[leaves] - lo[leaves]
        for _ in range(rounds):
            batches.meet_up(lo, hi, effort)
            alive &= (lo <= hi).all(axis=0)
            if not alive.any():
                break
            batches.meet_down(lo, hi, effort)
            alive &= (lo <= hi).all(axis=0)
            after = hi[leaves] - lo[leaves]
            if not alive.any() or not (after < (1.0 - MIN_SWEEP_GAIN) * before)[:, alive].any():
                break
            before = after
    return alive


def contract_box(
    tape: Tape, lowest: Array, highest: Array, demand: Mapping[int, Bounds], effort: Effort, rounds: int = SWEEPS
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
    if len(tape.contracted) > MAX_CACHED_BOXES:
        del tape.contracted[next(iter(tape.contracted))]
    return made


def forward(
    nodes: Sequence[Node],
    lo: Array,
    hi: Array,
    given: Sequence[int],
    *,
    batches: BatchedTape | None = None,
    effort: Effort | None = None,
) -> tuple[Array, Array]:
    """Bounds of all nodes, (T, K), from the intervals of the `given` ones alone (and of all coordinates): the same
    with and without `batches`. Raises what `effort` raises."""
    effort = Effort() if effort is None else effort
    out_lo, out_hi = lo.copy(), hi.copy()
    known = np.zeros(len(nodes), dtype=bool)
    known[list(given)] = True
    with np.errstate(all="ignore"):
        (one_by_one(nodes) if batches is None else batches).bounds(out_lo, out_hi, effort, known)
    return out_lo, out_hi


def _is_leaf(nodes: Sequence[Node], node: Node) -> bool:
    """Coordinates, and differences of two of them: whose intervals are worth narrowing."""
    if isinstance(node, Apply):
        return node.primitive == "sub" and all(isinstance(nodes[arg], Coord) for arg in node.args)
    return isinstance(node, Coord)


def node_bounds(
    core: Core, lowest: Array, highest: Array, effort: Effort | None = None, batches: BatchedTape | None = None
) -> list[Interval]:
    """Bounds of every node over boxes of poses.

    `lowest` and `highest` are (3N,) for one box or (3N, K) for K of them, in metres and radians. Each node gets arrays
    of shape () or (K,). The value of a node at any scene in a box lies within, rounding in float64 included; the bounds
    are exact where no coordinate occurs twice, and may be wide where one does. `batches`: the core's, if they are at
    hand. Raises what `effort` raises.
    """
    batches = make_batches(core.nodes) if batches is None else batches
    lowest, highest = np.asarray(lowest, dtype=np.float64), np.asarray(highest, dtype=np.float64)
    shape, rows = lowest.shape[1:], [node.row for node in core.nodes if isinstance(node, Coord)]
    lowest, highest = (ends.reshape(len(ends), -1) for ends in (lowest, highest))
    lo, hi = (np.empty((len(core.nodes), lowest.shape[1])) for _ in range(2))
    lo[batches.coords], hi[batches.coords] = lowest[rows], highest[rows]
    batches.bounds(lo, hi, Effort() if effort is None else effort)
    return [Interval(low.reshape(shape), high.reshape(shape)) for low, high in zip(lo, hi, strict=True)]


def label_bounds(
    core: Core, lowest: Array, highest: Array, effort: Effort | None = None, batches: BatchedTape | None = None
) -> tuple[Array, Array]:
    """Lowest and highest phi of each label over boxes of poses: two arrays of shape (L,) or (L, K)."""
    values = node_bounds(core, lowest, highest, effort, batches)
    ends = [values[index] for index in core.labels.values()]
    return np.stack([end.lo for end in ends]), np.stack([end.hi for end in ends])


def spec_bounds(spec: CheckedSpec) -> dict[str, tuple[float, float]]:
    """What phi of each label can be at most, anywhere in the workspace; the requirement is not looked at."""
    core, known = spec.core, spec.phi_bounds
    if not known:
        with np.errstate(over="ignore", invalid="ignore"):  # infinite bounds are an answer, not an accident
            lo, hi = label_bounds(core, *spec.box())
        known.update((name, (float(low), float(high))) for name, low, high in zip(core.labels, lo, hi, strict=True))
    return known
