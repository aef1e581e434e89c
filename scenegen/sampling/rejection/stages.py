"""What rejection scores first: cheap conditions that most candidates fail, so that few are scored in full.

phi of a conjunction is the least of its arguments, so a label is at least `low` if and only if each of them is; the
same holds for disjunctions and the upper end. These conditions are checked in stages, each on the candidates that met
those before. What is accepted does not depend on the stages, to the bit: they only save work.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scenegen.bounds.effort import per_scene
from scenegen.lang.core import Core, Junction, children
from scenegen.lang.interpret import evaluate
from scenegen.lang.least_gap import FEWEST, Groups, find_groups
from scenegen.pose import row_count
from scenegen.primitives import NUMPY
from scenegen.sampling.problem import Problem

Array = npt.NDArray[np.float64]
Bool = npt.NDArray[np.bool_]
Index = npt.NDArray[np.intp]
Check = Callable[[], None] | None

LATER = 0.5  # share of the candidates that a stage must leave out before another begins
FEW = 256  # candidates from which on all is scored at once: calls cost more than numbers
WORTH = 0.8  # share of the work of full scoring above which stages are not worth their calls
MOST = 100_000  # conditions times nodes: choosing among more would take longer than it saves
DRAW = 0.2  # work of a coordinate
BOUND, GAPS = 0.4, 36.0  # work of a minimum of gaps: of the bounds of each, and of the few that are computed


@dataclass(frozen=True, slots=True)
class Condition:
    """A formula node that must be at least `low`, or at most `high`; the other end is infinite."""

    node: int
    low: float
    high: float

    def holds(self, values: Sequence[Array]) -> Bool:
        """(B,), of the values of all nodes, (B,) each or () where they are the same for all."""
        value = values[self.node]
        return np.asarray(value >= self.low if self.low > -math.inf else value <= self.high)


@dataclass(frozen=True, slots=True, eq=False)
class Stage:
    """Conditions that are checked together, and the nodes that this needs."""

    conditions: tuple[Condition, ...]
    groups: Groups


@dataclass(frozen=True, slots=True, eq=False)
class Stages:
    """`full` is what scoring needs of those that meet all conditions; `work` is that of a candidate on average, with
    it."""

    stages: tuple[Stage, ...]
    full: Groups
    work: float

    def survivors(self, core: Core, rows: Array, usable: Bool, check: Check = None) -> tuple[Array, Index | None]:
        """The candidates (3N, m), of `rows` (3N, B), that are `usable` and meet the conditions, and which they are,
        (m,); conditions of a few candidates are left to scoring. Without stages: all candidates and None."""
        at: Index | None = None
        good = usable
        if usable.mean() <= LATER:
            at = np.flatnonzero(usable)
            rows, good = rows.take(at, axis=1), np.ones(len(at), dtype=bool)
        for stage in self.stages:
            if rows.shape[1] < FEW:
                break
            values = evaluate(core, list(rows), NUMPY, check, stage.groups)
            for condition in stage.conditions:
                good = good & condition.holds(values)
            passed = np.flatnonzero(good)
            rows, at = rows.take(passed, axis=1), passed if at is None else at[passed]
            good = np.ones(len(at), dtype=bool)
        return rows, at


def make_stages(problem: Problem, rows: Array, usable: Bool, needed: Collection[int]) -> Stages:
    """The stages that save most for candidates like `rows` (3N, B), of which some are `usable`, (B,). `needed` are the
    nodes that scoring needs."""
    core = problem.core
    full = find_groups(core, needed)
    costs = _Costs(core, full)
    unstaged = Stages((), full, costs.drawing + costs.whole)
    found = _conditions(problem)
    if len(found) * len(core.nodes) > MOST or not usable.any():
        return unstaged
    values = evaluate(core, list(rows[:, usable]), NUMPY, None, [one.node for one in found])
    alive = np.ones(int(usable.sum()), dtype=bool)
    holds = {one: np.broadcast_to(one.holds(values), alive.shape) for one in found}
    stages: list[list[Condition]] = []
    share, work, known = 1.0, 0.0, set[int]()
    while found and alive.any():
        prices = [costs.of((one.node,), known) / max(1e-9, 1.0 - holds[one][alive].mean()) for one in found]
        best = int(np.argmin(prices))
        if prices[best] >= costs.whole:
            break
        one = found.pop(best)
        if not known:
            stages.append([])
        stages[-1].append(one)
        work += share * costs.of((one.node,), known)
        known |= costs.needs((one.node,))
        alive &= holds[one]
        if alive.mean() <= LATER * share:
            share, known = float(alive.mean()), set()
    work += float(alive.mean()) * costs.whole
    if not stages or work > WORTH * costs.whole:
        return unstaged
    made = (Stage(tuple(some), find_groups(core, [one.node for one in some])) for some in stages)
    first = float(usable.mean())
    return Stages(tuple(made), full, costs.drawing + work * (first if first <= LATER else 1.0))


def _conditions(problem: Problem) -> list[Condition]:
    """What the labels' ranges ask of parts of them, each once."""
    core, found = problem.core, dict[Condition, None]()
    for label, top in enumerate(core.labels.values()):
        low, high = float(problem.cells.low[label]), float(problem.cells.high[label])
        if low > -math.inf:
            found |= dict.fromkeys(Condition(node, low, math.inf) for node in _arguments(core, top, "min"))
        if high < math.inf:
            found |= dict.fromkeys(Condition(node, -math.inf, high) for node in _arguments(core, top, "max"))
    return list(found)


def _arguments(core: Core, top: int, kind: str) -> list[int]:
    """Of a junction of a kind, and of such junctions within it, the arguments; long ones stay whole."""
    node = core.nodes[top]
    if not (isinstance(node, Junction) and node.kind == kind) or len(node.args) >= FEWEST:
        return [top]
    return [one for arg in node.args for one in _arguments(core, arg, kind)]


class _Costs:
    """The work of scoring parts of a core for a candidate; `whole` is that of all labels, `drawing` that of its
    coordinates."""

    def __init__(self, core: Core, full: Groups) -> None:
        self.core, self.groups = core, full.by_node
        self.drawing = DRAW * row_count(len(core.objects))
        self.whole = self.of(tuple(core.labels.values()), set())

    def needs(self, tops: Sequence[int]) -> set[int]:
        found, waiting = set[int](), list(tops)
        while waiting:
            index = waiting.pop()
            if index not in found:
                found.add(index)
                group = self.groups.get(index)
                waiting += children(self.core.nodes[index]) if group is None else group.rest
        return found

    def of(self, tops: Sequence[int], known: set[int]) -> float:
        """Of nodes and of what they need, but for what is known."""
        wanted = self.needs(tops) - known
        bounds = sum(BOUND * len(self.groups[index].less) + GAPS for index in wanted if index in self.groups)
        return bounds + per_scene(self.core.nodes[index] for index in wanted if index not in self.groups)[0]
