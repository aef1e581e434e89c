"""Requests as people write them in Python, made into a `SampleRequest`."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from dataclasses import replace
from numbers import Real
from typing import TYPE_CHECKING, TypeAlias

from scenegen.api.spec import LearnedModel, Spec, check_spec, refuse_choices, spec_of
from scenegen.errors import RequestError
from scenegen.errors.requests import (
    CONFLICTING_ARGUMENTS,
    LABEL_NOT_NAMED,
    MISSING_ARGUMENT,
    NOT_FOR_MOTIONS,
    OUT_OF_PLACE,
    OUT_OF_RANGE,
    RANGE_NOT_A_PAIR,
    UNKNOWN_CHOICE,
    WITHOUT_MODEL,
)
from scenegen.needs import need
from scenegen.processes.pool import check_workers
from scenegen.sampling.methods import METHODS
from scenegen.sampling.request import MAX_EVEN, Ends, Range, SampleRequest
from scenegen.validation import as_list

if TYPE_CHECKING:
    from scenegen.search.effort import Budget

Phi: TypeAlias = Mapping[str, Ends | Range] | Ends | Range
"""Ranges of phi by label, or of the one label of a spec that has no other."""

Note = Callable[[str], None]


def read_phi(source: Spec | LearnedModel, phi: Phi | None) -> dict[str, Range]:
    """The ranges by label. Raises RequestError, also for a lone range where there are several labels."""
    labels = spec_of(source).labels
    if phi is None:
        return {}
    if isinstance(phi, Mapping):
        return {label: as_range(label, ends) for label, ends in phi.items()}
    if len(labels) > 1:
        named = {"count": len(labels), "labels": tuple(labels), "first": labels[0]}
        raise RequestError(LABEL_NOT_NAMED(**named, phi=repr(phi)))
    return {label: as_range(label, phi) for label in labels}


def as_range(label: str, ends: object) -> Range:
    """A range of phi from (lowest, highest), None for an open end. Raises RequestError."""
    if isinstance(ends, Range):
        return ends
    pair = as_list(ends)
    if not isinstance(pair, list) or len(pair) != 2 or not all(end is None or isinstance(end, Real) for end in pair):
        raise RequestError(RANGE_NOT_A_PAIR(label=label, value=repr(ends)))
    low, high = pair
    return Range(None if low is None else float(low), None if high is None else float(high))


def any_model(source: Spec | LearnedModel, budget: Budget | None = None) -> LearnedModel:
    """The model of any spec, for this one; a model is itself. Raises RequestError for a spec that it does not take, and
    where the time of `budget` is over before it is there."""
    if isinstance(source, LearnedModel):
        return source
    check_spec(source)
    _ = source.checked  # what is refused is refused before torch is loaded
    need("torch", "to draw from a model")
    # by its name, as the table has it: nothing here knows a model
    made: LearnedModel = importlib.import_module(METHODS["any"].make.partition(":")[0]).AnyModel(source, budget)
    return made


def check_request(source: Spec | LearnedModel, request: SampleRequest) -> SampleRequest:
    """The request held against what it samples from, a spec, a spec over time or a model: with the method of `auto` for
    a model. Raises RequestError for options that mean nothing there, and for options that do not go together. What
    depends on the bounds of phi is checked by `make_problem`."""
    spec = spec_of(source)
    learned = isinstance(source, LearnedModel)
    known: tuple[str, ...] = tuple(METHODS)
    if spec.over_time is not None:
        refuse_choices(spec, "a motion")
        argument = request.misplaced_option("motions", "files", "sets")
        if argument is not None:
            raise RequestError(NOT_FOR_MOTIONS(argument=argument))
        known = tuple(name for name, method in METHODS.items() if method.over_time)
    method = "model" if learned and request.method in ("auto", "any") else request.method
    if method not in known:
        raise RequestError(UNKNOWN_CHOICE(what="method", name=method, known=known))
    proposes = METHODS[method].proposes
    if proposes and not learned:
        raise RequestError(WITHOUT_MODEL(argument="method", rule=f"`{method}` needs a trained model"))
    if request.raw and not proposes:
        raise RequestError(WITHOUT_MODEL(argument="raw", rule="is a model's own output"))
    if request.spread == "even":
        _check_even(spec, request, learned)
    if request.workers is not None:
        check_workers(request.workers)
    if request.raw and request.fix:
        raise RequestError(
            CONFLICTING_ARGUMENTS(one="raw", other="fix", reason="a model does not know of objects that are held")
        )
    if request.raw and request.settle:
        raise RequestError(
            CONFLICTING_ARGUMENTS(one="raw", other="settle", reason="raw scenes are all of a model's output")
        )
    if request.settle:
        need("pybullet", "to settle scenes")
    if request.success is not None or request.under is not None:
        _check_success(spec, request)
    return request if method == request.method else replace(request, method=method)


def _check_even(spec: Spec, request: SampleRequest, learned: bool) -> None:
    """Raises RequestError where `even` has no place, and for more scenes than it can choose."""
    if learned or spec.over_time is not None:
        rule = "`even` chooses among exact scenes, and " + ("a model's are not" if learned else "these are motions")
        raise RequestError(OUT_OF_PLACE(argument="spread", rule=rule, remedy="ask for `flat` or `base`"))
    if request.n > MAX_EVEN:
        wanted = f"at most {MAX_EVEN:,} where scenes are chosen to be far from each other"
        raise RequestError(OUT_OF_RANGE(argument="n", value=f"{request.n:,}", wanted=wanted))


def _check_success(spec: Spec, request: SampleRequest) -> None:
    """Raises RequestError where one of range and fit is missing, and where they have no place."""
    if request.under is None:
        raise RequestError(
            MISSING_ARGUMENT(argument="under", question="name the file of `scenegen fit` that predicts it")
        )
    if request.success is None:
        raise RequestError(MISSING_ARGUMENT(argument="success", question="say how often the policy should succeed"))
    if request.raw:
        reason = "raw scenes are all of a model's output"
        raise RequestError(CONFLICTING_ARGUMENTS(one="raw", other="success", reason=reason))
    _ = spec.checked  # fits are of specs that draw no numbers of things
