"""From a problem to its plan, by a method of the table `METHODS` (sampling/request.py)."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

from scenegen.sampling.request import METHODS

if TYPE_CHECKING:
    from scenegen.sampling.plan import Plan
    from scenegen.sampling.problem import Budget, Problem
    from scenegen.sampling.proposer import Proposer


def make_plan(problem: Problem, budget: Budget, proposer: Proposer | None = None, *, method: str | None = None) -> Plan:
    """The plan of a problem, by the request's method or another one. Raises what the method raises."""
    from scenegen.sampling.problem import phi_varies

    entry = METHODS[method or problem.request.method]
    if not entry.proposes and not phi_varies(problem):  # all scenes have the same phi
        entry = METHODS["rejection"]
    module, _, function = entry.make.partition(":")
    make = getattr(importlib.import_module(module), function)
    plan: Plan = make(problem, budget, proposer) if entry.proposes else make(problem, budget)
    return plan
