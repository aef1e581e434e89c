"""From a request to its plan, and at once to scenes."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Protocol

from scenegen.errors import RequestError
from scenegen.sampling.engine.run import SampledScenes, in_memory
from scenegen.sampling.methods import METHODS
from scenegen.sampling.request import EVEN_CANDIDATES
from scenegen.search.effort import Budget, Effort, StoppedError

if TYPE_CHECKING:
    from scenegen.lang.spec import CheckedSpec
    from scenegen.sampling.motions.schedule import Watch
    from scenegen.sampling.plan import Plan
    from scenegen.sampling.problem import Problem
    from scenegen.sampling.proposer import Proposer
    from scenegen.sampling.request import Progress, Range, SampleRequest

SELECTIONS: Mapping[str, str] = {
    "success": "scenegen.learn.success.predicted:select",
    "settle": "scenegen.worlds.physics.settling:select",
}
"""The options of a request that leave out scenes: what makes a plan of a plan (see `plan.Selection`) and a budget."""


class ProposerMaker(Protocol):
    """A trained model."""

    def proposer_of(self, checked: CheckedSpec, ranges: Mapping[str, Range]) -> Proposer:
        """What proposes scenes of a spec, asked for ranges of phi."""


def plan_for(
    spec: CheckedSpec,
    request: SampleRequest,
    budget: Budget,
    model: ProposerMaker | None = None,
    on_note: Callable[[str], None] | None = None,
    *,
    watch: Watch | None = None,
) -> Plan:
    """The plan of a request that has been checked against its spec, which may be over time or draw numbers of things.
    `model` proposes its scenes, if it is one for a model; `on_note` gets what `auto` chose, `watch` is shown what comes
    near the motions of a spec over time. Raises RequestError where there is no scene, or time is up before there is a
    plan."""
    if request.spread == "even":
        from scenegen.sampling.even import Even

        many = replace(request, n=EVEN_CANDIDATES * request.n, spread="flat")
        drawn = plan_for(spec, many, budget, on_note=on_note)
        asked = replace(drawn.problem.request, n=request.n, spread=request.spread)
        return Even(replace(drawn.problem, request=asked), drawn, budget, why=drawn.why)
    if spec.timed is not None:
        from scenegen.sampling.motions.sampler import plan_motions
        from scenegen.sampling.motions.scores import make_motion_problem

        return _select(plan_motions(make_motion_problem(spec, request, budget), budget, watch=watch), request, budget)
    from scenegen.sampling.problem import make_problem

    def make(checked: CheckedSpec, request: SampleRequest) -> Plan:
        proposer = None if model is None else model.proposer_of(checked, request.phi)
        return make_plan(make_problem(checked, request, budget), budget, proposer)

    if spec.counts:
        from scenegen.sampling.families import plan_numbers

        plan: Plan = plan_numbers(spec, request, budget, make, lambda plan: _select(plan, request, budget))
    else:
        plan = _select(make(spec, request), request, budget)
    if plan.why is not None and on_note is not None:
        on_note(f"{plan.method}: {plan.why}")
    return plan


def make_plan(problem: Problem, budget: Budget, proposer: Proposer | None = None, *, method: str | None = None) -> Plan:
    """The plan of a problem, by the request's method or another one. Raises RequestError where there is no scene, or
    time is up before there is a plan, and what else the method raises."""
    from scenegen.sampling.problem import phi_varies
    from scenegen.sampling.report import too_early

    entry = METHODS[method or problem.request.method]
    if not entry.proposes and not phi_varies(problem):  # all scenes have the same phi
        entry = METHODS["rejection"]
    try:
        if problem.spec.priors and not entry.proposes:
            from scenegen.sampling.prior import plan_placed

            return plan_placed(problem, lambda over: _load(entry.make)(over, budget), Effort(lambda: budget.overdrawn))
        plan: Plan = _load(entry.make)(*((problem, budget, proposer) if entry.proposes else (problem, budget)))
    except StoppedError as stopped:
        raise RequestError(too_early(problem, stopped.how_far or "no draws at all", len(problem.possible))) from None
    return plan


def _select(plan: Plan, request: SampleRequest, budget: Budget) -> Plan:
    """The plan without the scenes that options leave out."""
    for option, function in SELECTIONS.items():
        if getattr(request, option) and plan.reached_cells:
            plan = _load(function)(plan, budget)
    return plan


def _load(function: str) -> Callable[..., Any]:
    module, _, name = function.partition(":")
    made: Callable[..., Any] = getattr(importlib.import_module(module), name)
    return made


def draw(
    problem: Problem, budget: Budget | None = None, progress: Progress | None = None, *, method: str | None = None
) -> SampledScenes:
    """Exact scenes for a problem, by the request's method or another one; in this process, unless the request gives a
    number of workers. Raises RequestError if it is known that there are none."""
    budget = Budget(problem.request.timeout) if budget is None else budget
    here = replace(problem.request, workers=problem.request.workers or 1)
    return in_memory(make_plan(replace(problem, request=here), budget, method=method), budget, progress)
