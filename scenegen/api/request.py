"""Requests as people write them in Python, made into a `SampleRequest` and a plan."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from numbers import Real
from typing import TYPE_CHECKING, TypeAlias

from scenegen.api.spec import LearnedModel, Spec, refuse_choices, spec_of
from scenegen.errors import RequestError
from scenegen.errors.requests import (
    LABEL_NOT_NAMED,
    METHOD_WITHOUT_MODEL,
    RANGE_NOT_A_PAIR,
    RAW_SETTLED,
    RAW_WITH_FIXED,
    RAW_WITHOUT_MODEL,
    UNKNOWN_CHOICE,
    WRONG_VALUE,
)
from scenegen.errors.time import NOT_FOR_MOTIONS
from scenegen.needs import need
from scenegen.sampling.methods import METHODS
from scenegen.sampling.request import Range, SampleRequest
from scenegen.validation import as_int, as_list

if TYPE_CHECKING:
    from scenegen.lang.spec import CheckedSpec
    from scenegen.sampling.motions.schedule import Watch
    from scenegen.sampling.plan import Plan
    from scenegen.sampling.problem import Budget

Ends = tuple[float | None, float | None]
Phi: TypeAlias = Mapping[str, Ends | Range] | Ends | Range
"""Ranges of phi by label, or of the one label of a spec that has no other."""

Note = Callable[[str], None]

MOTION_METHODS = ("auto", "rejection", "splitting")


def read_phi(source: Spec | LearnedModel, phi: Phi | None) -> dict[str, Range]:
    """The ranges by label. Raises RequestError, also for a lone range where there are several labels."""
    labels = spec_of(source).labels
    if phi is None:
        return {}
    if isinstance(phi, Mapping):
        return {label: _range(label, ends) for label, ends in phi.items()}
    if len(labels) > 1:
        named = {"count": len(labels), "labels": tuple(labels), "first": labels[0]}
        raise RequestError(LABEL_NOT_NAMED(**named, phi=repr(phi)))
    return {label: _range(label, phi) for label in labels}


def _range(label: str, ends: object) -> Range:
    if isinstance(ends, Range):
        return ends
    pair = as_list(ends)
    if not isinstance(pair, list) or len(pair) != 2 or not all(end is None or isinstance(end, Real) for end in pair):
        raise RequestError(RANGE_NOT_A_PAIR(label=label, value=repr(ends)))
    low, high = pair
    return Range(None if low is None else float(low), None if high is None else float(high))


def check_request(source: Spec | LearnedModel, request: SampleRequest) -> SampleRequest:
    """The request with its method chosen for a model; what depends on the spec is checked by `make_problem`. Raises
    RequestError for values of the wrong kind, and for settings that do not go together."""
    over_time = spec_of(source).over_time is not None
    if over_time:
        _check_for_motions(spec_of(source), request)
    n, seed = as_int("n", request.n), as_int("seed", request.seed)
    fix, raw, timeout = request.fix, request.raw, request.timeout
    if not isinstance(fix, Mapping):
        wanted = 'poses by name: fix={"plate": (0.5, 0.5)}'
        raise RequestError(WRONG_VALUE(argument="fix", value=repr(fix), wanted=wanted))
    method = request.method if over_time else _method(request.method, source, raw)
    if not (isinstance(timeout, Real) and math.isfinite(timeout) and timeout > 0):
        shown = f"{timeout:g}" if isinstance(timeout, float | int) else repr(timeout)
        wanted = "a positive number of seconds"
        raise RequestError(WRONG_VALUE(argument="timeout", value=shown, wanted=wanted))
    if raw and fix:
        raise RequestError(RAW_WITH_FIXED())
    if raw and request.settle:
        raise RequestError(RAW_SETTLED())
    if request.settle:
        need("pybullet", "to settle scenes")
    return replace(request, n=n, seed=seed, method=method)


def _check_for_motions(spec: Spec, request: SampleRequest) -> None:
    refuse_choices(spec, "a motion")
    if request.raw:
        raise RequestError(NOT_FOR_MOTIONS(argument="raw"))
    if request.method not in MOTION_METHODS:
        raise RequestError(UNKNOWN_CHOICE(what="method", name=request.method, known=MOTION_METHODS))


def _method(method: str, source: Spec | LearnedModel, raw: bool) -> str:
    """One of METHODS, never auto for a model."""
    if method not in tuple(METHODS):
        raise RequestError(UNKNOWN_CHOICE(what="method", name=method, known=METHODS))
    if method == "auto" and isinstance(source, LearnedModel):
        method = "model"
    if METHODS[method].proposes and not isinstance(source, LearnedModel):
        raise RequestError(METHOD_WITHOUT_MODEL(method=method))
    if raw and not METHODS[method].proposes:
        raise RequestError(RAW_WITHOUT_MODEL())
    return method


def plan_of(
    source: Spec | LearnedModel,
    request: SampleRequest,
    budget: Budget,
    on_note: Note | None = None,
    *,
    watch: Watch | None = None,
) -> Plan:
    """The plan of a checked request; `on_note` gets what `auto` chose, `watch` is shown what comes near the motions of
    a spec over time. Raises RequestError where there is no scene, or time is up before there is a plan."""
    from scenegen.sampling.methods import make_plan
    from scenegen.sampling.problem import make_problem

    model = source if isinstance(source, LearnedModel) else None
    spec = spec_of(source)

    def make(checked: CheckedSpec, request: SampleRequest) -> Plan:
        proposer = None if model is None else model.proposer_of(checked, tuple(request.phi))
        return make_plan(make_problem(checked, request, budget), budget, proposer)

    def settled(plan: Plan) -> Plan:
        if not request.settle or not plan.reached:
            return plan
        from scenegen.worlds.physics.settling import Settling

        return Settling(plan.problem, plan, request.workers, budget, why=plan.why)

    if spec.over_time is not None:
        from scenegen.sampling.motions.sampler import plan_motions
        from scenegen.sampling.motions.scores import make_problem as make_motion_problem

        return settled(plan_motions(make_motion_problem(spec.declared, request, budget), budget, watch=watch))
    if spec.counts:
        from scenegen.sampling.families import plan_numbers

        plan: Plan = plan_numbers(spec.declared, request, budget, make, settled)
    else:
        plan = settled(make(spec.checked, request))
    if plan.why is not None and on_note is not None:
        on_note(f"{plan.method}: {plan.why}")
    return plan
