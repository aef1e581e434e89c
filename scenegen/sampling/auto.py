"""Chooses the exact sampler for a request: the one that needs the fewest evaluations of phi.

Pruned rejection is tried first: its scenes are independent, and most requests take a fraction of a second. Where it
takes much work or misses a part of the range, `contest.py` looks at the other methods. Work is counted, never timed, so
the same request and seed always get the same method.
"""

from __future__ import annotations

from contextlib import ExitStack

from scenegen.sampling.at_once import FIRST, MANY, because, in_range, look, moving
from scenegen.sampling.plan import Plan
from scenegen.sampling.problem import Budget, Problem

FEW = 1000  # scenes up to which growth is done before another process has started


def choose(problem: Problem, budget: Budget) -> Plan:
    """The plan by the better method; its `why` says why. Raises RequestError if there is no scene, or if time is up
    before there is a plan."""
    with ExitStack() as stack:
        started = None
        if moving(problem) > MANY and problem.request.n > FEW:
            # Of so many objects growth will be asked, too: it can begin at once where there is a process for it.
            from scenegen.sampling.growth.plan import start_growth

            started = start_growth(problem, budget)
        if started is not None:
            stack.enter_context(started)
        found = look(problem, budget, FIRST)
        if found.plan is not None and found.enough:
            return because(found.plan, in_range(found.plan))
        # Loading growth and splitting takes longer than many requests for which rejection is enough.
        from scenegen.sampling.contest import contest

        return contest(problem, budget, found, started=started)
