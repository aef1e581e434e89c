"""Requests as people write them in Python, made into a `SampleRequest` and a plan."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from numbers import Real
from typing import TYPE_CHECKING, TypeAlias, cast

from scenegen.api.spec import LearnedModel, Spec, spec_of
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
from scenegen.needs import need
from scenegen.processes.pool import check_workers
from scenegen.sampling.methods import METHODS
from scenegen.sampling.request import Range, SampleRequest, Spread
from scenegen.scenes.data import RequestData
from scenegen.validation import as_int, as_list

if TYPE_CHECKING:
    from scenegen.lang.spec import CheckedSpec
    from scenegen.sampling.plan import Plan
    from scenegen.sampling.problem import Budget

Ends = tuple[float | None, float | None]
Phi: TypeAlias = Mapping[str, Ends | Range] | Ends | Range
"""Ranges of phi by label, or of the one label of a spec that has no other."""

Note = Callable[[str], None]


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
    spec_of(source)
    n, seed = as_int("n", request.n), as_int("seed", request.seed)
    fix, raw, timeout = request.fix, request.raw, request.timeout
    if not isinstance(fix, Mapping):
        wanted = 'poses by name: fix={"plate": (0.5, 0.5)}'
        raise RequestError(WRONG_VALUE(argument="fix", value=repr(fix), wanted=wanted))
    method = _method(request.method, source, raw)
    if not (isinstance(timeout, Real) and math.isfinite(timeout) and timeout > 0):
        shown = f"{timeout:g}" if isinstance(timeout, float | int) else repr(timeout)
        wanted = "a positive number of seconds"
        raise RequestError(WRONG_VALUE(argument="timeout", value=shown, wanted=wanted))
    if request.workers is not None:
        check_workers(request.workers)
    if raw and fix:
        raise RequestError(RAW_WITH_FIXED())
    if raw and request.settle:
        raise RequestError(RAW_SETTLED())
    if request.settle:
        need("pybullet", "to settle scenes")
    return replace(request, n=n, seed=seed, method=method)


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


def plan_of(source: Spec | LearnedModel, request: SampleRequest, budget: Budget, on_note: Note | None = None) -> Plan:
    """The plan of a checked request; `on_note` gets what `auto` chose. Raises RequestError where there is no scene, or
    time is up before there is a plan."""
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

    if spec.counts:
        from scenegen.sampling.families import plan_numbers

        plan: Plan = plan_numbers(spec.declared, request, budget, make, settled)
    else:
        plan = settled(make(spec.checked, request))
    if plan.why is not None and on_note is not None:
        on_note(f"{plan.method}: {plan.why}")
    return plan


def request_data(request: SampleRequest) -> RequestData:
    """The request as scene files tell it."""
    phi = {label: (one.low, one.high) for label, one in request.phi.items()}
    return RequestData(phi=phi, n=request.n, spread=cast(Spread, request.spread))
