"""phi over motions for chains, which ask less of it: whether a motion stays in a region, and its phi if it does.

Chains are cheaper to score than motions that are returned:

* bounds of steps hold by construction, so the requirement is scored without them;
* formulas of a state are computed at the moments that phi looks at: `finally f` needs f at one;
* what leaves the region by its limits or labels needs no requirement, and of a requirement that holds already, only
  gaps that can be negative are computed.

Labels have the values of `TraceScores`, to the bit, where a motion stays in the region. The requirement has at least
the sign. Motions are scored in full before they are returned.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from scenegen.lang.core import Const, Coord, Core, Everywhere, Junction, Moment, Until, Window, children, moved, part
from scenegen.lang.fold import fold
from scenegen.lang.headings import bare_rows
from scenegen.lang.interpret import Fewer, Numbers
from scenegen.lang.least_gap import Groups, find_groups, negative
from scenegen.lang.timed import Numpy, Signal, Timed, TimeNode, over_time
from scenegen.motions.bounds import without_step_bounds
from scenegen.motions.needed import Mask, moments_needed
from scenegen.motions.variables import within_a_turn
from scenegen.pose import THETA, along
from scenegen.primitives import NUMPY, Namespace
from scenegen.primitives.namespace import turning

Array = npt.NDArray[np.float64]
Moments = npt.NDArray[np.intp]

FEW, EACH = 2, 1  # gaps of a minimum, and for each pair of shapes: few states have one that can be negative


class _Signs(Fewer):
    """Minima of gaps have their values where they are negative; else they are merely not. `table` has the rows."""

    def __init__(
        self, namespace: Namespace, rows: Sequence[Any], groups: Groups, values: list[Any], table: Array
    ) -> None:
        super().__init__(namespace, rows, groups, values)
        self.table = table

    def junction(self, index: int, node: Junction, args: list[Any]) -> Any:
        group = self.groups.by_node.get(index)
        if group is None or index in self.groups.skipped:
            return super().junction(index, node, args)
        least = negative(group, self.table)
        for arg in group.rest:
            least = np.minimum(least, self.values[arg])
        return least


@dataclass(frozen=True, slots=True)
class _Part:
    """Some formulas of a state, `signals`, that are needed at the same `moments`. `steps`: they look at the moments
    before, too. `groups` are minima of gaps whose values are asked for, `signs` those of which only signs are."""

    core: Core
    signals: tuple[int, ...]
    moments: Moments
    steps: bool
    groups: Groups
    signs: Groups

    def values(self, poses: Array, signs: bool) -> list[Array]:
        """The values of the signals, (moments, B) each, of poses (N, 3, T + 1, B)."""
        moments, count = poses.shape[2:]
        some = poses if len(self.moments) == moments else poses[:, :, self.moments]
        if self.steps:
            before = poses[:, :, np.maximum(self.moments - 1, 0)]
            some = np.concatenate([some, before])
        table = some.reshape(-1, len(self.moments) * count)
        rows, values = list(table), list[Any]()
        namespace = turning(NUMPY, rows[along(THETA)])
        groups = self.signs if signs else self.groups
        algebra: Numbers = Numbers(namespace, rows)
        if signs:
            algebra = _Signs(namespace, rows, groups, values, table)
        elif groups.skipped:
            algebra = Fewer(namespace, rows, groups, values)
        fold(self.core.nodes, algebra, values=values)
        found = [values[self.core.labels[str(signal)]] for signal in self.signals]
        return [np.broadcast_to(one, table.shape[1]).reshape(-1, count) for one in found]


@dataclass(frozen=True, slots=True)
class _Stage:
    """Formulas over time of which some `nodes` are asked for, and the formulas of a state that these need."""

    timed: Timed
    nodes: tuple[int, ...]
    parts: tuple[_Part, ...]

    def values(self, poses: Array, signs: bool = False) -> list[Array]:
        """The values of the nodes at every moment, (B, T + 1) each; right where they are needed."""
        moments, count = poses.shape[2:]

        def everywhere(value: float) -> Array:
            return np.full((moments, count), value).T  # time is the last axis of formulas, and the first in memory

        signals = [everywhere(0.0)] * len(self.timed.state.labels)
        for part_ in self.parts:
            for signal, value in zip(part_.signals, part_.values(poses, signs), strict=True):
                if len(part_.moments) < moments:
                    whole = np.zeros((moments, count))
                    whole[part_.moments] = value
                    value = whole
                signals[signal] = value.T
        found = over_time(Numpy(), self.timed, signals, everywhere)
        return [found[node] for node in self.nodes]


@dataclass(frozen=True, slots=True)
class LeanScores:
    """Scores of a spec over time, in two stages."""

    labels: _Stage
    requirement: _Stage | None
    bare: bool  # whether a formula takes headings as numbers

    def of_labels(self, poses: Array) -> Array:
        """phi of every label, (N, 3, T + 1, B) -> (L, B)."""
        values = self.labels.values(self._ready(poses))
        return np.array([value[:, 0] for value in values]).reshape(len(values), poses.shape[-1])

    def of_requirement(self, poses: Array, signs: bool) -> Array:
        """The least margin of what is required, (N, 3, T + 1, B) -> (B,): where it is positive, some positive number;
        where only `signs` are asked for, where it is negative, some negative one."""
        if self.requirement is None:
            return np.full(poses.shape[-1], np.inf)
        least: Array = self.requirement.values(self._ready(poses), signs)[0].min(axis=1)
        return least

    def _ready(self, poses: Array) -> Array:
        return within_a_turn(poses.copy()) if self.bare else poses


def lean(timed: Timed) -> LeanScores:
    """The lean scores of a spec over time."""
    roots = tuple(timed.labels.values())
    labels = _stage(timed, roots, moments_needed(timed, labels=True, requirement=False))
    required: _Stage | None = None
    if timed.requirement is not None:
        less = without_step_bounds(timed)
        assert less.requirement is not None
        needed = moments_needed(less, labels=False, requirement=True)
        stage = _stage(less, (less.requirement,), needed)
        if any(one.core.nodes != (Const(math.inf),) for one in stage.parts):
            required = stage
    return LeanScores(labels, required, bool(bare_rows(timed.state)))


def _stage(timed: Timed, nodes: tuple[int, ...], needed: Sequence[Mask]) -> _Stage:
    by_moments: dict[bytes, list[int]] = {}
    for signal, mask in enumerate(needed):
        if mask.any():
            by_moments.setdefault(mask.tobytes(), []).append(signal)
    parts, count = [], len(timed.objects)
    for signals in by_moments.values():
        core = part(timed.state, tuple(map(str, signals)))
        roots = tuple(core.labels.values())
        steps = any(isinstance(node, Coord) and node.object >= count for node in core.nodes)
        usual, signs = find_groups(core, roots), find_groups(core, roots, FEW, EACH)
        parts.append(_Part(core, tuple(signals), np.flatnonzero(needed[signals[0]]), steps, usual, signs))
    kept, place = _below(timed, nodes)
    return _Stage(replace(timed, nodes=kept, labels={}, requirement=None), place, tuple(parts))


def _below(timed: Timed, roots: tuple[int, ...]) -> tuple[tuple[TimeNode, ...], tuple[int, ...]]:
    """The nodes over time that some nodes need, and the places of those among them."""
    needed = [False] * len(timed.nodes)
    for root in roots:
        needed[root] = True
    for index in range(len(timed.nodes) - 1, -1, -1):
        node = timed.nodes[index]
        if needed[index] and not isinstance(node, Signal):
            for child in children(node):
                needed[child] = True
    place: dict[int, int] = {}
    kept: list[TimeNode] = []
    for index, node in enumerate(timed.nodes):
        if needed[index]:
            place[index] = len(kept)
            if isinstance(node, Signal):
                kept.append(node)
                continue
            again = moved(node, place)
            assert isinstance(again, Junction | Window | Until | Moment | Everywhere)
            kept.append(again)
    return tuple(kept), tuple(place[root] for root in roots)
