"""From a spec over time and a request to a problem for the samplers."""

from __future__ import annotations

import dataclasses

import numpy as np

from scenegen.bounds.effort import NEVER, Stop, StoppedError, asking
from scenegen.errors import Diagnostic, RequestError
from scenegen.errors.motions import NO_BOUND_ON_STEPS
from scenegen.errors.requests import NO_TIME_TO_CHECK
from scenegen.lang.spec import CheckedSpec
from scenegen.lang.timed import Timed
from scenegen.motions.bounds import phi_bounds, step_bounds
from scenegen.motions.cost import cost
from scenegen.motions.lean import lean
from scenegen.motions.problem import Array, MotionProblem
from scenegen.motions.scores import TraceScores
from scenegen.pose import PLACE, THETA, row_of, rows_of
from scenegen.sampling.fixed_objects import hold_fixed
from scenegen.sampling.request import SampleRequest, check_request


def make_problem(
    spec: CheckedSpec, request: SampleRequest, stop: Stop = NEVER
) -> tuple[MotionProblem, tuple[Diagnostic, ...]]:
    """The problem, and warnings about the request. Raises RequestError for a request that is wrong or out of the bounds
    of phi, for an object of which nothing says how far it moves in a step, and where time is up."""
    timed = spec.timed
    assert timed is not None
    effort = asking(stop)
    lowest, highest, fixed = hold_fixed(spec, request.fix)
    try:
        bounds = phi_bounds(timed, lowest, highest, effort)
    except StoppedError:
        raise RequestError(NO_TIME_TO_CHECK()) from None
    checked, warnings = check_request(dataclasses.replace(request, fix=fixed), bounds)
    radius, turn = _steps(timed, lowest, highest)
    for name in unbounded(timed, lowest, highest):
        raise RequestError(NO_BOUND_ON_STEPS(name=name))
    turn[np.isinf(turn)] = 0.0  # without a bound a heading is kept
    shape = (len(timed.objects), len(rows_of(0)))
    made = MotionProblem(
        names=timed.objects, labels=tuple(timed.labels), steps=timed.horizon.steps, lowest=lowest.reshape(shape),
        highest=highest.reshape(shape), radius=radius, turn=turn, score=TraceScores(timed), request=checked,
        moves=timed.moves, dt=timed.horizon.dt, cost=cost(spec),
        lean=lean(timed), log_excess=spec.workspace.log_excess(lowest, highest, len(timed.objects)),
    )  # fmt: skip
    return made, warnings


def unbounded(timed: Timed, lowest: Array, highest: Array) -> list[str]:
    """The objects of which nothing says how far they move in a step, in the box (3N,) of their poses."""
    radius, _ = _steps(timed, lowest, highest)
    return [name for name, far in zip(timed.objects, radius, strict=True) if np.isinf(far)]


def _steps(timed: Timed, lowest: Array, highest: Array) -> tuple[Array, Array]:
    """The largest displacement and turn of each object in a step, (N,) each: none of one that is held in place."""
    radius, turn = step_bounds(timed)
    for thing in range(len(timed.objects)):
        place = [row_of(thing, axis) for axis in PLACE]
        if (lowest[place] == highest[place]).all():
            radius[thing] = 0.0
            if lowest[row_of(thing, THETA)] == highest[row_of(thing, THETA)]:
                turn[thing] = 0.0
    return radius, turn
