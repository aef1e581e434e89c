"""The independent parts of a request: sets of objects that no clause connects.

The clauses of a request and of the spec's requirements form connected components (see `growth.graph`). Under the base
distribution objects are independent. So scenes of each component can be sampled separately and combined into scenes of
the whole, and the probability is the product. A part is a problem of its own: its labels keep the conjuncts that
contain its objects; all other objects are held at arbitrary poses.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from scenegen.arrays import Array
from scenegen.errors import Diagnostic, RequestError
from scenegen.lang.formula.core import REQUIRE, Core, Junction, Node, part_of
from scenegen.pose import keep_below_turn, rows_of, span_of
from scenegen.sampling.growth.graph import components, make_graph, objects_by_node
from scenegen.sampling.plan import Account, Piece, Plan, Tally, digest
from scenegen.sampling.problem import Problem, narrow_problem
from scenegen.sampling.rejection.sampler import SPARE_SCENES, Rejection
from scenegen.sampling.report import too_early
from scenegen.sampling.request import Range
from scenegen.sampling.streams import PARTS_STREAM
from scenegen.search.contract import push_down
from scenegen.search.effort import Budget, Effort, StoppedError, scoring_work

Objects = frozenset[int]

REQUIRED = "what is required"  # a label of parts like any other: its probability is a factor, too
SHARE_SCENES = 1024  # scenes for estimating how common a part is
COMMON_SHARE = 0.2  # parts are merged while at least this share of the contracted box is in range


@dataclass(frozen=True, slots=True, eq=False)
class SubProblem:
    """`problem` is the request for `objects` alone, indices of free objects in rising order."""

    objects: tuple[int, ...]
    problem: Problem


def independent_parts(problem: Problem, budget: Budget) -> tuple[SubProblem, ...]:
    """The parts of a request; common parts are merged and come last. Empty if fewer than two are rare. Raises
    RequestError if a part is proved to have no scene, or if time is up."""
    with np.errstate(all="ignore"):
        effort = Effort(lambda: budget.overdrawn)
        try:
            return _parts(problem, effort)
        except StoppedError:
            raise RequestError(too_early(problem, "no draws at all", problem.cells.count)) from None


def _parts(problem: Problem, effort: Effort) -> tuple[SubProblem, ...]:
    touches = objects_by_node(problem, effort)
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
    rare = [group for group in groups if shares[group] < COMMON_SHARE]
    common: list[Objects] = []
    together = 0.0
    for group in sorted(set(groups).difference(rare), key=lambda group: (-shares[group], min(group))):
        together *= shares[group]
        if together >= COMMON_SHARE:
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
) -> SubProblem:
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
    seed = np.random.SeedSequence([problem.request.seed, PARTS_STREAM, *sorted(group)]).generate_state(1, np.uint64)
    small = part_of(Core(tuple(nodes), mine, core.objects), tuple(mine))
    phi = {label: problem.request.phi.get(label, Range(0.0)) for label in mine}
    made = narrow_problem(problem, small, (lowest, highest), phi, int(seed[0] >> np.uint64(1)), effort)
    return SubProblem(tuple(sorted(group)), made)


def _share(one: SubProblem, effort: Effort) -> float:
    """About which share of the contracted box is in range; 0 if the range is cut into cells."""
    effort.check()
    problem = one.problem
    if problem.cells.count > 1:
        return 0.0
    graph = make_graph(problem, effort=effort)
    low, high = graph.low, graph.high
    rng = np.random.default_rng(np.random.SeedSequence([problem.request.seed, PARTS_STREAM]))
    rows = low + rng.random((len(low), SHARE_SCENES)) * (high - low)
    return float((problem.cells.find(problem.phi(rows)) == 0).mean())


# Independent parts of a request, each sampled by its own plan, and combined.
#
# Piece k combines piece k of every part's plan. The scenes of a piece come in random order and are independent of
# those of the other parts, so a combination is a scene of the whole request. Costs add up, where the probabilities of
# a joint draw would multiply.


# maximum work of a piece of rejection that must give as many scenes as the other parts' pieces
MAX_PIECE_WORK = 1 << 25


@dataclass(frozen=True, slots=True, eq=False)
class ProductPlan(Plan):
    """A plan for one request: the `plans` of its `parts`. The facts of a piece are those of the parts' pieces one after
    the other; `facts` has the number of each part, and missing ones are zeros."""

    parts: tuple[SubProblem, ...]
    plans: tuple[Plan, ...]
    facts: tuple[int, ...]

    method: ClassVar[str] = "paired"

    @property
    def plan_digest(self) -> str:
        objects = tuple(part.objects for part in self.parts)
        return digest("paired", objects, tuple(plan.plan_digest for plan in self.plans))

    @property
    def reached_cells(self) -> Sequence[int]:
        return self._spread.reached_cells

    @property
    def ruled_out(self) -> frozenset[int]:
        return self._spread.ruled_out

    @property
    def fewest(self) -> int:
        return max(plan.fewest for plan in self.plans)

    @property
    def patience(self) -> int | None:
        known = [plan.patience for plan in self.plans if plan.patience is not None]
        return max(known, default=None)

    @property
    def shared_by(self) -> int:
        return min(plan.shared_by for plan in self.plans)

    @property
    def scenes_per_piece(self) -> float:
        return min(plan.scenes_per_piece for plan in self.plans)

    @property
    def evaluations(self) -> float:
        return sum(plan.evaluations for plan in self.plans)

    @property
    def seconds(self) -> float:
        return sum(plan.seconds for plan in self.plans)

    @property
    def fact_count(self) -> int:
        return sum(self.facts)

    @property
    def _spread(self) -> Plan:
        """The plan of the part whose labels have cells; any plan if there are no cells."""
        return max(self.plans, key=lambda plan: plan.cells.count)

    def draw(self, k: int) -> Piece:
        """Piece k. Raises StoppedError if a part's deadline passes meanwhile."""
        made = [plan.draw(k) for plan in self.plans]
        rng = np.random.default_rng(np.random.SeedSequence([self.seed, PARTS_STREAM, k]))
        chosen = [rng.permutation(np.flatnonzero(one.cell >= 0)) for one in made]
        count = min(map(len, chosen))
        lowest, highest = self.problem.lowest, self.problem.highest
        rows = np.empty((len(lowest), count))
        mine: set[int] = set()
        for part, one, order in zip(self.parts, made, chosen, strict=True):
            for row in (row for thing in part.objects for row in rows_of(thing)):
                rows[row] = one.rows[row, order[:count]]
                mine.add(row)
        for row in sorted(set(range(len(lowest))) - mine):  # no clause reads them
            rows[row] = lowest[row] + rng.random(count) * (highest[row] - lowest[row])
        keep_below_turn(rows)
        with np.errstate(all="ignore"):  # as in the parts' own plans
            phi = self.problem.phi(rows)
        return Piece(rows, phi, self.cells.find(phi), self._together([one.facts for one in made]))

    def account(self, tally: Tally) -> Account:
        """What the scene file says about the run: each part's own account, and the probability of all of them."""
        accounts = [self._account(number, tally) for number in range(len(self.plans))]
        evaluations = sum(int(_number(one.info, "candidates", "draws")) for one in accounts)
        info: dict[str, object] = {
            "method": "paired",
            "seed": self.seed,
            "candidates": evaluations,
            "pieces": tally.pieces,
            "effective_share": min(_number(one.info, "effective_share", otherwise=1.0) for one in accounts),
            **_product([one.info for one in accounts]),
        }
        if REQUIRE in self.problem.core.labels:
            info["probability_of"] = "range and requirement"
        info["components"] = [
            {
                "objects": [self.problem.core.objects[thing] for thing in part.objects],
                **{name: value for name, value in one.info.items() if name != "seed"},
            }
            for part, one in zip(self.parts, accounts, strict=True)
        ]
        warnings: dict[Diagnostic, None] = {}
        for one in accounts:
            warnings |= dict.fromkeys(one.warnings)
        methods = ", ".join(one.tried for one in accounts)
        return Account(info, f"{len(accounts)} parts: {methods}", tuple(warnings))

    def _together(self, facts: Sequence[Array]) -> Array:
        return np.concatenate([np.pad(one, (0, size - len(one))) for one, size in zip(facts, self.facts, strict=True)])

    def _account(self, number: int, tally: Tally) -> Account:
        first = sum(self.facts[:number])
        facts = tally.facts[first : first + self.facts[number]]
        return self.plans[number].account(replace(tally, strays=(), facts=facts))


def pair(problem: Problem, parts: Sequence[SubProblem], plans: Sequence[Plan]) -> ProductPlan:
    """The plan that combines the parts' plans. Pieces of rejection can have any size; they are cut to give about as
    many scenes as the pieces of the others."""
    fixed = [count for plan in plans if (count := plan.scenes_per_piece) and not isinstance(plan, Rejection)]
    enough = SPARE_SCENES * problem.request.n / max(plan.fewest for plan in plans)
    target = min(enough, *(fixed or [plan.scenes_per_piece for plan in plans]))
    some = target + 3.0 * math.sqrt(target) + 8.0
    sized = tuple(_with_size(plan, some) if isinstance(plan, Rejection) else plan for plan in plans)
    return ProductPlan(problem, tuple(parts), sized, tuple(plan.fact_count for plan in sized))


def _with_size(plan: Rejection, scenes: float) -> Rejection:
    """The plan with pieces of about so many scenes, or as many as the maximum work of a piece allows."""
    most = MAX_PIECE_WORK / scoring_work(plan.problem.core.nodes, plan.candidates)
    factor = min(max(1.0, most), scenes / plan.scenes_per_piece)
    sources = [replace(one, candidates=math.ceil(factor * one.candidates)) for one in plan.sources]
    return replace(plan, sources=tuple(sources))


def _product(parts: Sequence[Mapping[str, object]]) -> dict[str, object]:
    """log10 of the product of the parts' probabilities, and its error: independent errors add up in squares."""
    total = sum(_number(info, "log10_probability", otherwise=math.nan) for info in parts)
    error = math.hypot(*(_number(info, "log10_error", otherwise=math.nan) for info in parts))
    return {
        "log10_probability": None if math.isnan(total) else round(total, 5) + 0.0,
        "log10_error": None if math.isnan(error) else round(error, 5),
    }


def _number(info: Mapping[str, object], *names: str, otherwise: float = 0.0) -> float:
    """The first of these facts that is present and not None."""
    for name in names:
        value = info.get(name)
        if isinstance(value, int | float):
            return value
    return otherwise
