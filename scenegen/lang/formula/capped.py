"""The least of a constant and of clearances of a hand's boxes, of which those alone are computed that can be less.

At each of a dozen yaws a hand over a thing has the room between its fingers, and so many clearances from each other
thing, which are more than that where it stands far away. How far the centres are apart tells so for all of them at
once: a clearance is at least that less both outer radii. Where it is near, boxes of one size are computed together.
The least is the same number, bit for bit.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from scenegen.geometry import NUMPY, PRIMITIVES, Namespace
from scenegen.geometry.clearance import placed_gaps
from scenegen.geometry.footprint import Box, Circle, PlacedBox, measures
from scenegen.geometry.namespace import turning
from scenegen.lang.formula.core import Apply, Const, Node, children

ROUNDING_SHARE = 1e-12  # of lengths; far more than all steps of a clearance together are off by

Floats = npt.NDArray[np.float64]
Pose = tuple[int, ...]
"""The nodes of x, y and heading of two things."""
Like = tuple[Pose, Box, Circle | Box]
"""What clearances that are computed together are of: the poses, the size of the boxes, and the other shape."""


@dataclass(frozen=True, slots=True)
class CappedMinimum:
    """The least of `others`, nodes of which one is the constant `cap`, and of clearances, each no less than a floor:
    by their likes, which ones of these, and the floors (k, 1)."""

    cap: float
    others: tuple[int, ...]
    parts: Mapping[Like, tuple[tuple[int, ...], Floats]]


@dataclass(frozen=True, slots=True)
class CappedMinima:
    """The minima of a tape, by node; the `boxes` of all clearances, by their likes; how `far` centres are apart where
    none counts; and the nodes whose values nobody needs then."""

    by_node: Mapping[int, CappedMinimum]
    boxes: Mapping[Like, tuple[PlacedBox, ...]]
    far: Mapping[Pose, float]
    skipped: frozenset[int]


NO_CAPPED = CappedMinima({}, {}, {}, frozenset())


def find_capped(nodes: Sequence[Node], needed: Collection[int]) -> CappedMinima:
    """The capped minima of a tape where the values of the nodes `needed` will be read, and no others."""
    if not any(isinstance(node, Apply) and node.shapes and isinstance(node.shapes[0], PlacedBox) for node in nodes):
        return NO_CAPPED
    uses = [0] * len(nodes)
    for index in (*needed, *(child for node in nodes for child in children(node))):
        uses[index] += 1
    found: dict[int, CappedMinimum] = {}
    boxes: dict[Like, list[PlacedBox]] = {}
    far: dict[Pose, float] = {}
    skipped = set[int]()
    for index, node in enumerate(nodes):
        if not isinstance(node, Apply) or node.primitive != "min":
            continue
        cap = min((one.value for arg in node.args if isinstance(one := nodes[arg], Const)), default=-1.0)
        below = {arg: part for arg in node.args if (part := _gap_below(nodes, arg, uses)) is not None}
        if cap < 0.0 or not below:
            continue
        parts: dict[Like, tuple[list[int], list[float]]] = {}
        for arg, (like, box, floor) in below.items():
            places, floors = parts.setdefault(like, ([], []))
            places.append(len(boxes.setdefault(like, [])))
            floors.append(floor)
            boxes[like].append(box)
            far[like[0]] = max(far.get(like[0], 0.0), cap + measures(box).outer + measures(like[2]).outer)
            skipped |= {arg, children(nodes[arg])[0]}
        kept = {like: (tuple(places), np.array(floors)[:, None]) for like, (places, floors) in parts.items()}
        found[index] = CappedMinimum(cap, tuple(arg for arg in node.args if arg not in below), kept)
    return CappedMinima(found, {like: tuple(some) for like, some in boxes.items()}, far, frozenset(skipped))


def _gap_below(nodes: Sequence[Node], index: int, uses: Sequence[int]) -> tuple[Like, PlacedBox, float] | None:
    """Of max(gap, constant) that nothing else needs: what the clearance is of, and the constant."""
    node = nodes[index]
    if not isinstance(node, Apply) or node.primitive != "max" or uses[index] > 1 or len(node.args) != 2:
        return None
    gap, floor = (nodes[arg] for arg in node.args)
    if not isinstance(gap, Apply) or gap.primitive != "gap" or uses[node.args[0]] > 1 or not isinstance(floor, Const):
        return None
    box, other = gap.shapes
    if not isinstance(box, PlacedBox) or not isinstance(other, Circle | Box):
        return None
    return (gap.args, box.box, other), box, floor.value


@dataclass(frozen=True, slots=True)
class _Near:
    """Where two things are near enough, of arrays of a shape; the six numbers of their poses there; and a namespace
    that knows their headings."""

    shape: tuple[int, ...]
    at: tuple[Any, ...]
    numbers: tuple[Floats, ...]
    namespace: Namespace


class CappedNumbers:
    """The capped minima of one run over arrays of numpy; `values` gives those of nodes."""

    def __init__(self, minima: CappedMinima, values: Callable[[int], Any]) -> None:
        self._minima, self._values = minima, values
        self._near: dict[Pose, _Near] = {}
        self._gaps: dict[Like, Floats] = {}

    def minimum(self, one: CappedMinimum) -> Any:
        """The value of the minimum's node."""
        least = PRIMITIVES["min"].evaluate(NUMPY, *map(self._values, one.others))
        for like, (places, floors) in one.parts.items():
            near = self._near.get(like[0]) or self._find_near(like[0])
            gaps = self._gaps.get(like)
            if gaps is None:
                gaps = placed_gaps(near.namespace, self._minima.boxes[like], like[2], *near.numbers)
                self._gaps[like] = gaps
            some = np.full(near.shape, one.cap)
            some[near.at] = np.maximum(gaps[list(places)], floors).min(axis=0)
            least = np.minimum(least, some)
        return least

    def _find_near(self, pose: Pose) -> _Near:
        numbers = np.broadcast_arrays(*(np.atleast_1d(self._values(node)) for node in pose))
        dx, dy = numbers[3] - numbers[0], numbers[4] - numbers[1]
        limit = self._minima.far[pose] * (1.0 + ROUNDING_SHARE) + ROUNDING_SHARE
        at = np.nonzero(~(dx * dx + dy * dy > limit * limit))
        some = tuple([one[at] for one in numbers])
        near = _Near(numbers[0].shape, at, some, turning(NUMPY, (some[2], some[5])))
        self._near[pose] = near
        return near
