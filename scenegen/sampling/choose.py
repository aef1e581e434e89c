"""Chooses the exact sampler for a request: the one that needs least time.

Pruned rejection is tried first: its scenes are independent, and most requests take a fraction of a second. Where it
takes much work or misses a part of the range, `contest` looks at the other methods. Work is counted, never timed:
its kinds have prices in seconds, which are constants. So the same request and seed always get the same method.
"""

from __future__ import annotations

from contextlib import ExitStack, suppress
from functools import partial
from typing import TYPE_CHECKING

from scenegen.errors import RequestError
from scenegen.sampling.plan import Plan
from scenegen.sampling.problem import Budget, Problem
from scenegen.sampling.rejection.outcome import FIRST, MANY, cheap_enough, moving, try_rejection

if TYPE_CHECKING:
    from scenegen.processes.ahead import BackgroundTask
    from scenegen.sampling.contest import MethodChoice, Seen
    from scenegen.sampling.growth.population import StartedGrowth
    from scenegen.sampling.parts import SubProblem

FEW = 1000  # scenes up to which growth is done before another process has started


def choose(problem: Problem, budget: Budget, *, whole: bool = False) -> Plan:
    """The plan by the better method; its `why` says why. `whole`: the request is not to be split into independent
    parts. Raises RequestError if there is no scene, or if time is up before there is a plan."""
    with ExitStack() as stack:
        started: StartedGrowth | None = None
        parts: tuple[SubProblem, ...] | None = () if whole else None
        seen: BackgroundTask[tuple[SubProblem, ...], list[Seen]] | None = None
        contest: MethodChoice | None = None

        def further() -> float:
            """Pruning takes more work than it was given."""
            nonlocal contest
            contest = rivals().with_box()
            return contest.affordable

        def rivals() -> MethodChoice:
            # Loading growth and splitting takes longer than many requests for which rejection is enough.
            from scenegen.sampling.contest import MethodChoice

            return MethodChoice(problem, budget, partial(choose, whole=True), started, parts, seen)

        def start() -> None:
            """Another process begins with what is likely to be asked for next: the parts, or else growth. Two would
            slow this one down."""
            nonlocal started, parts, seen
            from scenegen.sampling.growth.population import start_growth
            from scenegen.sampling.parts import independent_parts

            started = start_growth(problem, budget)
            if started is None:
                return
            if parts is None:
                with suppress(RequestError):  # pruning comes to the same, and has its say first
                    parts = independent_parts(problem, budget)
            if not parts:
                stack.enter_context(started).begin_first()
                return
            from scenegen.processes.ahead import BackgroundTask
            from scenegen.sampling.contest import PartsTrial

            seen = stack.enter_context(BackgroundTask(PartsTrial(budget), parts, budget.reserve))

        worth, many = problem.request.n > FEW, moving(problem) > MANY
        if worth and many:
            start()
        found = try_rejection(problem, budget, FIRST, start if worth and not many else None, further)
        return cheap_enough(found) or (contest or rivals()).best(found)
