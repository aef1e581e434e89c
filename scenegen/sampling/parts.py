"""The independent parts of a request: sets of objects that no clause connects.

The clauses of a request and of the spec's requirements form connected components (see `growth.graph`). Under the base
distribution objects are independent. So scenes of each component can be sampled separately and combined into scenes of
the whole, and the probability is the product. A part is a problem of its own: its labels keep the conjuncts that
contain its objects; all other objects are held at arbitrary poses.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scenegen.bounds.effort import Effort, StoppedError
from scenegen.bounds.requirements import push_down
from scenegen.errors import RequestError
from scenegen.lang.core import REQUIRE, Core, Junction, Node, part
from scenegen.pose import span_of
from scenegen.sampling.growth.graph import components, make_graph, touched
from scenegen.sampling.problem import PAIRED, Budget, Problem, narrowed
from scenegen.sampling.report import too_early
from scenegen.sampling.request import Range

Array = npt.NDArray[np.float64]
Objects = frozenset[int]

REQUIRED = "what is required"  # a label of parts like any other: its probability is a factor, too
LOOK = 1024  # scenes for estimating how common a part is
COMMON = 0.2  # parts are merged while at least this share of the contracted box is in range


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """`problem` is the request for `objects` alone, indices of free objects in rising order."""

    objects: tuple[int, ...]
    problem: Problem


def independent_parts(problem: Problem, budget: Budget) -> tuple[Part, ...]:
    """The parts of a request; common parts are merged and come last. Empty if fewer than two are rare. Raises
    RequestError if a part is proved to have no scene, or if time is up."""
    with np.errstate(all="ignore"):
        effort = Effort(lambda: budget.overdrawn)
        try:
            return _parts(problem, effort)
        except StoppedError:
            raise RequestError(too_early(problem, "no draws at all", problem.cells.count)) from None


def _parts(problem: Problem, effort: Effort) -> tuple[Part, ...]:
    touches = touched(problem, effort)
    labels = _demands(problem, touches)
    names = tuple(problem.core.labels)
    # a cell spans all labels with bounded ranges: their objects stay together
    spread = [Objects().union(*(touches[node] for node in labels[names[at]])) for at in problem.cells.bounded]
    if not all(spread):
        return ()
    groups = components([*touches.values(), Objects().union(*spread)])
    if len(groups) < 2:
        return ()
    parts = {group: _part(problem, group, touches, labels, effort) for group in groups}
    shares = {group: _share(one, effort) for group, one in parts.items()}
    rare = [group for group in groups if shares[group] < COMMON]
    common: list[Objects] = []
    together = 0.0
    for group in sorted(set(groups).difference(rare), key=lambda group: (-shares[group], min(group))):
        together *= shares[group]
        if together >= COMMON:
            common[-1] |= group
        else:
            common.append(group)
            together = shares[group]
    if len(rare) + len(common[1:]) < 2:  # merged common parts can be rare together
        return ()
    groups = (*sorted(rare, key=min), *common)
    return tuple(parts.get(group) or _part(problem, group, touches, labels, effort) for group in groups)


def _demands(problem: Problem, touches: Mapping[int, Objects]) -> dict[str, list[int]]:
    """The nodes at which the demands on each label arrive when pushed down, without those that are the same in every
    scene."""
    found: dict[str, list[int]] = {}
    for (name, node), low, high in zip(
        problem.core.labels.items(), problem.cells.low.tolist(), problem.cells.high.tolist(), strict=True
    ):
        asked = push_down(problem.core, {node: (low, high)})
        found[name] = [one for one in asked if touches[one]]
    return found


def _part(
    problem: Problem,
    group: Objects,
    touches: Mapping[int, Objects],
    labels: Mapping[str, Sequence[int]],
    effort: Effort,
) -> Part:
    """The problem of some components."""
    core, cells = problem.core, problem.cells
    nodes: list[Node] = list(core.nodes)
    mine: dict[str, int] = {}
    for at, (name, asked) in enumerate(labels.items()):
        here = tuple(node for node in asked if touches[node] <= group)
        if not here:
            continue
        label = REQUIRED if name == REQUIRE else name
        if math.isfinite(cells.low[at]) and math.isfinite(cells.high[at]):  # one of its nodes touches all its objects
            mine[label] = core.labels[name]
        elif len(here) == 1:
            mine[label] = here[0]
        else:  # a lower end reaches all parts of conjunctions, an upper end all those of disjunctions
            mine[label] = len(nodes)
            nodes.append(Junction("min" if math.isfinite(cells.low[at]) else "max", here))
    lowest, highest = problem.lowest, problem.highest.copy()
    for thing in range(len(core.objects)):
        if thing not in group:
            highest[span_of(thing)] = lowest[span_of(thing)]
    seed = np.random.SeedSequence([problem.request.seed, PAIRED, *sorted(group)]).generate_state(1, np.uint64)
    small = part(Core(tuple(nodes), mine, core.objects), tuple(mine))
    phi = {label: problem.request.phi.get(label, Range(0.0)) for label in mine}
    made = narrowed(problem, small, (lowest, highest), phi, int(seed[0] >> np.uint64(1)), effort)
    return Part(tuple(sorted(group)), made)


def _share(one: Part, effort: Effort) -> float:
    """About which share of the contracted box is in range; 0 if the range is cut into cells."""
    effort.check()
    problem = one.problem
    if problem.cells.count > 1:
        return 0.0
    graph = make_graph(problem, effort=effort)
    low, high = graph.low, graph.high
    rng = np.random.default_rng(np.random.SeedSequence([problem.request.seed, PAIRED]))
    rows = low + rng.random((len(low), LOOK)) * (high - low)
    return float((problem.cells.find(problem.phi(rows)) == 0).mean())
