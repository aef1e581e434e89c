"""The sampling methods: one table for the command line, the Python API and `auto`."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from scenegen.sampling.plan import Plan
    from scenegen.sampling.problem import Budget, Problem
    from scenegen.sampling.proposer import Proposer


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
    "model": Method("scenegen.learn.guided:make_plan", "a model file", proposes=True),
}


def methods_help() -> str:
    """The help of `--method`: `auto, rejection or splitting (a spec), model (a model file)`."""
    *most, last = [name for name, method in METHODS.items() if not method.proposes]
    proposing = [f"{name} (a model file)" for name, method in METHODS.items() if method.proposes]
    return ", ".join([f"{', '.join(most)} or {last} (a spec)", *proposing]) + "."


def make_plan(problem: Problem, budget: Budget, proposer: Proposer | None = None, *, method: str | None = None) -> Plan:
    """The plan of a problem, by the request's method or another one. Raises what the method raises."""
    from scenegen.sampling.problem import moves

    entry = METHODS[method or problem.request.method]
    if not entry.proposes and not moves(problem):  # all scenes have the same phi
        entry = METHODS["rejection"]
    module, _, function = entry.make.partition(":")
    make = getattr(importlib.import_module(module), function)
    plan: Plan = make(problem, budget, proposer) if entry.proposes else make(problem, budget)
    return plan
