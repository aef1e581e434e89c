"""Nodes of a tape in batches: all that have one primitive and the same footprints, and only refer to earlier batches.

On small arrays a call of numpy costs far more than the arithmetic. Forty boxes that do not overlap are 780 gaps of one
kind: as one batch, their rule is called once, with the nodes as a further axis before that of the boxes. That is why
large tapes are not walked with `lang.fold`, which takes one node after another.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scenegen.bounds.effort import Effort, bounding
from scenegen.lang.core import Apply, Atom, Const, Coord, Junction, Node, children
from scenegen.primitives import PRIMITIVES, Interval

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.intp]
Bool = npt.NDArray[np.bool_]

FEWEST = 500  # nodes from which on batches are made; smaller tapes are walked node by node
WORTH = 4  # nodes that a batch must have on average: long chains of nodes gain nothing
ELEMENTS = 1 << 13  # nodes times boxes of one call: what a rule computes on the way stays in cache


@dataclass(frozen=True, slots=True)
class Batch:
    """Nodes of one kind at one depth, of which any may be computed before any other: their places `at` (m,) and those
    of their arguments, `args` (n, m)."""

    kind: Node
    at: Index
    args: Index

    def pieces(self, boxes: int, effort: Effort) -> Iterator[Batch]:
        """The batch in pieces that are worth a call each, for so many boxes; their work is counted."""
        size = max(1, ELEMENTS // max(1, boxes * max(1, len(self.args) // 8)))
        for begin in range(0, len(self.at), size):
            at = self.at[begin : begin + size]
            effort.spend(bounding(self.kind, len(at) * boxes))
            yield self if size >= len(self.at) else Batch(self.kind, at, self.args[:, begin : begin + size])

    def value(self, lo: Array, hi: Array) -> Interval:
        """The bounds of the nodes, (m, K), from the intervals of all, (T, K)."""
        match self.kind:
            case Apply(primitive, _, shapes):
                return PRIMITIVES[primitive].interval(*shapes, *self._parts(lo, hi))
            case Junction("min"):
                return Interval(lo[self.args].min(axis=0), hi[self.args].min(axis=0))
            case Junction():
                return Interval(lo[self.args].max(axis=0), hi[self.args].max(axis=0))
        return Interval(lo[self.args[0]], hi[self.args[0]])

    def revise(self, lo: Array, hi: Array) -> None:
        """Narrow the intervals of the arguments, in place, to what those of the nodes leave."""
        result = Interval(lo[self.at], hi[self.at])
        if isinstance(self.kind, Junction):
            self._narrow(*_junction(self.kind.kind, result, lo[self.args], hi[self.args]), lo, hi)
        elif isinstance(self.kind, Apply):
            rule = PRIMITIVES[self.kind.primitive].backward
            if rule is not None:
                parts = self._parts(lo, hi)
                narrower = rule(*self.kind.shapes, result, *parts)
                # most rules leave some arguments, such as headings, as they are
                kept = [k for k, (new, old) in enumerate(zip(narrower, parts, strict=True)) if new is not old]
                if kept:
                    low, high = (np.stack([narrower[k][end] for k in kept]) for end in (0, 1))
                    Batch(self.kind, self.at, self.args[kept])._narrow(low, high, lo, hi)

    def _parts(self, lo: Array, hi: Array) -> tuple[Interval, ...]:
        return tuple(Interval(lo[arg], hi[arg]) for arg in self.args)

    def _narrow(self, low: Array, high: Array, lo: Array, hi: Array) -> None:
        """Meet the intervals of the arguments with low and high, (n, m, K) each; several may be of one place."""
        flat = self.args.ravel()
        order = np.argsort(flat, kind="stable")
        place = flat[order]
        starts = np.flatnonzero(np.concatenate([[True], place[1:] != place[:-1]]))
        place = place[starts]
        low, high = low.reshape(len(flat), -1)[order], high.reshape(len(flat), -1)[order]
        lo[place] = np.fmax(lo[place], np.fmax.reduceat(low, starts, axis=0))
        hi[place] = np.fmin(hi[place], np.fmin.reduceat(high, starts, axis=0))


def _junction(kind: str, result: Interval, low: Array, high: Array) -> tuple[Array, Array]:
    """What is left of the parts, (n, m, K) each, of junctions (m, K); see backward.minimum."""
    shape = low.shape
    if kind == "min":
        can = low <= result.hi
        return np.broadcast_to(result.lo, shape), np.where(can.sum(axis=0) == can, result.hi, np.inf)
    can = high >= result.lo
    return np.where(can.sum(axis=0) == can, result.lo, -np.inf), np.broadcast_to(result.hi, shape)


@dataclass(frozen=True, slots=True)
class Batches:
    """A tape in the order of its batches; `places` and `values` (C,) are those of its constants, `coords` the places of
    the coordinates. Methods change intervals lo, hi (T, K) in place, and raise what `effort` raises."""

    places: Index
    values: Array
    coords: Index
    batches: tuple[Batch, ...]

    def bounds(self, lo: Array, hi: Array, effort: Effort, known: Bool | None = None) -> None:
        """The bounds of all nodes from those of the coordinates; what is `known` (T,) is met with the old interval."""
        lo[self.places] = hi[self.places] = self.values[:, None]
        for batch in self.batches:
            for piece in batch.pieces(lo.shape[1], effort):
                low, high = piece.value(lo, hi)
                if known is not None and known[piece.at].any():
                    met = known[piece.at][:, None]
                    low = np.where(met, np.fmax(low, lo[piece.at]), low)
                    high = np.where(met, np.fmin(high, hi[piece.at]), high)
                lo[piece.at], hi[piece.at] = low, high

    def meet_up(self, lo: Array, hi: Array, effort: Effort) -> None:
        """Meet every node's interval with the bounds of its arguments."""
        lo[self.places] = np.fmax(lo[self.places], self.values[:, None])
        hi[self.places] = np.fmin(hi[self.places], self.values[:, None])
        for batch in self.batches:
            for piece in batch.pieces(lo.shape[1], effort):
                low, high = piece.value(lo, hi)
                lo[piece.at] = np.fmax(lo[piece.at], low)
                hi[piece.at] = np.fmin(hi[piece.at], high)

    def meet_down(self, lo: Array, hi: Array, effort: Effort) -> None:
        """Meet every argument's interval with what the nodes that use it leave."""
        for batch in reversed(self.batches):
            for piece in batch.pieces(lo.shape[1], effort):
                piece.revise(lo, hi)


def make_batches(nodes: Sequence[Node], fewest: int = FEWEST, worth: float = WORTH) -> Batches | None:
    """The batches of a tape; None for fewer nodes than `fewest`, or fewer than `worth` in a batch on average."""
    if len(nodes) < fewest:
        return None
    depth = [0] * len(nodes)
    members: dict[tuple[int, Hashable], list[int]] = {}
    constants: list[int] = []
    coords: list[int] = []
    for index, node in enumerate(nodes):
        match node:
            case Const():
                constants.append(index)
                continue
            case Coord():
                coords.append(index)
                continue
            case Apply(primitive, args, shapes):
                key: Hashable = (primitive, len(args), shapes)
            case Junction(kind, args):
                key = (kind, len(args))
            case Atom():
                key = "atom"
        depth[index] = 1 + max(depth[arg] for arg in children(node))
        members.setdefault((depth[index], key), []).append(index)
    if len(members) * worth > len(nodes):
        return None
    batches = tuple(
        Batch(nodes[found[0]], _index(found), np.array([children(nodes[one]) for one in found], dtype=np.intp).T)
        for (_, _), found in sorted(members.items(), key=lambda item: (item[0][0], item[1][0]))
    )
    values = np.array([node.value for node in nodes if isinstance(node, Const)], dtype=np.float64)
    return Batches(_index(constants), values, _index(coords), batches)


def _index(values: Sequence[int]) -> Index:
    return np.array(values, dtype=np.intp)
