"""Interval bounds of phi over boxes of poses."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from scenegen.bounds.batches import Batches, make_batches
from scenegen.bounds.effort import Effort, bounding
from scenegen.lang.core import Apply, Atom, Const, Coord, Core, Junction
from scenegen.lang.fold import Algebra, fold
from scenegen.lang.spec import CheckedSpec
from scenegen.primitives import PRIMITIVES, Interval
from scenegen.primitives import interval as iv

Array = npt.NDArray[np.float64]


def node_bounds(core: Core, lowest: Array, highest: Array, effort: Effort | None = None) -> list[Interval]:
    """Bounds of every node over boxes of poses.

    `lowest` and `highest` are (3N,) for one box or (3N, K) for K of them, in metres and radians. Each node gets arrays
    of shape () or (K,). The value of a node at any scene in a box lies within, rounding in float64 included; the bounds
    are exact where no coordinate occurs twice, and may be wide where one does. Raises what `effort` raises.
    """
    effort = Effort() if effort is None else effort
    lowest, highest = np.asarray(lowest, dtype=np.float64), np.asarray(highest, dtype=np.float64)
    batches = make_batches(core.nodes)
    if batches is not None:
        return _in_batches(core, batches, lowest, highest, effort)
    return fold(core.nodes, _Bounds(lowest, highest, effort))


class _Bounds(Algebra[Interval]):
    """Nodes as intervals over the boxes lowest..highest."""

    def __init__(self, lowest: Array, highest: Array, effort: Effort) -> None:
        self._lowest, self._highest, self._effort = lowest, highest, effort
        self._boxes = math.prod(lowest.shape[1:])

    def constant(self, index: int, node: Const) -> Interval:
        return iv.point(node.value)

    def coordinate(self, index: int, node: Coord) -> Interval:
        return Interval(self._lowest[node.row], self._highest[node.row])

    def apply(self, index: int, node: Apply, args: list[Interval]) -> Interval:
        self._effort.spend(bounding(node, self._boxes))
        return PRIMITIVES[node.primitive].interval(*node.shapes, *args)

    def atom(self, index: int, node: Atom, margin: Interval) -> Interval:
        self._effort.spend(bounding(node, self._boxes))
        return margin

    def junction(self, index: int, node: Junction, args: list[Interval]) -> Interval:
        self._effort.spend(bounding(node, self._boxes))
        return (iv.minimum if node.kind == "min" else iv.maximum)(*args)


def _in_batches(core: Core, batches: Batches, lowest: Array, highest: Array, effort: Effort) -> list[Interval]:
    """The same numbers, those of many nodes at a time."""
    shape = np.shape(lowest)[1:]
    columns = lowest.reshape(len(lowest), -1).shape[1]
    lo, hi = (np.empty((len(core.nodes), columns)) for _ in range(2))
    rows = [node.row for node in core.nodes if isinstance(node, Coord)]
    lo[batches.coords] = lowest.reshape(-1, columns)[rows]
    hi[batches.coords] = highest.reshape(-1, columns)[rows]
    batches.bounds(lo, hi, effort)
    return [Interval(low.reshape(shape), high.reshape(shape)) for low, high in zip(lo, hi, strict=True)]


def label_bounds(core: Core, lowest: Array, highest: Array, effort: Effort | None = None) -> tuple[Array, Array]:
    """Lowest and highest phi of each label over boxes of poses: two arrays of shape (L,) or (L, K)."""
    values = node_bounds(core, lowest, highest, effort)
    shape = np.shape(lowest)[1:]
    ends = [values[index] for index in core.labels.values()]
    return _stack([end.lo for end in ends], shape), _stack([end.hi for end in ends], shape)


def spec_bounds(spec: CheckedSpec) -> dict[str, tuple[float, float]]:
    """What phi of each label can be at most, anywhere in the workspace; the requirement is not looked at."""
    core = spec.core
    with np.errstate(over="ignore", invalid="ignore"):  # infinite bounds are an answer, not an accident
        lo, hi = label_bounds(core, *spec.box())
    return {name: (float(low), float(high)) for name, low, high in zip(core.labels, lo, hi, strict=True)}


def _stack(ends: Sequence[Array], shape: tuple[int, ...]) -> Array:
    return np.stack([np.broadcast_to(end, shape) for end in ends])
