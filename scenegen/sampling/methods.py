"""The sampling methods, one table for the command line, the Python API and `auto`; and from a request to its plan."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    from scenegen.lang.spec import CheckedSpec
    from scenegen.sampling.motions.schedule import Watch
    from scenegen.sampling.plan import Plan
    from scenegen.sampling.problem import Problem
    from scenegen.sampling.proposer import Proposer
    from scenegen.sampling.request import Range, SampleRequest
    from scenegen.search.effort import Budget


@dataclass(frozen=True, slots=True)
class Method:
    """`make` is "module:function". It makes a plan from a problem and a budget; if `proposes`, also from a proposer.
    Raises RequestError if there is no scene, or if time is up before there is a plan."""

    make: str
    good_for: str
    proposes: bool = False
    over_time: bool = False  # draws motions, too


METHODS: Mapping[str, Method] = {
    "auto": Method("scenegen.sampling.choice:choose", "takes the method below that needs least time", over_time=True),
    "rejection": Method("scenegen.sampling.rejection.sampler:make_plan", "most requests", over_time=True),
    "growth": Method("scenegen.sampling.growth.sampler:make_plan", "full tables"),
    "splitting": Method("scenegen.sampling.splitting.sampler:make_plan", "rare targets", over_time=True),
    "any": Method("scenegen.learn.any:make_plan", "a network that has learnt from other specs; approximate"),
    "model": Method("scenegen.learn.guided:make_plan", "a model file", proposes=True),
}


def methods_help() -> str:
    """The help of `--method`: `auto, rejection or splitting (a spec), model (a model file)`."""
    *most, last = [name for name, method in METHODS.items() if not method.proposes]
    proposing = [f"{name} (a model file)" for name, method in METHODS.items() if method.proposes]
    return ", ".join([f"{', '.join(most)} or {last} (a spec)", *proposing]) + "."


SELECTIONS: Mapping[str, str] = {
    "success": "scenegen.play.fit.predicted:select",
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
    """The plan of a problem, by the request's method or another one. Raises what the method raises."""
    from scenegen.sampling.problem import phi_varies

    entry = METHODS[method or problem.request.method]
    if not entry.proposes and not phi_varies(problem):  # all scenes have the same phi
        entry = METHODS["rejection"]
    plan: Plan = _load(entry.make)(*((problem, budget, proposer) if entry.proposes else (problem, budget)))
    return plan


def _select(plan: Plan, request: SampleRequest, budget: Budget) -> Plan:
    """The plan without the scenes that options leave out."""
    for option, function in SELECTIONS.items():
        if getattr(request, option) and plan.reached:
            plan = _load(function)(plan, budget)
    return plan


def _load(function: str) -> Callable[..., Any]:
    module, _, name = function.partition(":")
    made: Callable[..., Any] = getattr(importlib.import_module(module), name)
    return made
