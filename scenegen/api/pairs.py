"""Pairs of a start and a goal from a spec."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from scenegen.api.motions import MotionSet
from scenegen.api.request import Phi, check_request, read_phi
from scenegen.api.scene_arrays import motion_header
from scenegen.api.spec import Spec, check_spec, refuse_choices
from scenegen.errors import Diagnostic, RequestError
from scenegen.errors.requests import OUT_OF_RANGE
from scenegen.pose import as_poses
from scenegen.sampling.request import Range, SampleRequest
from scenegen.scenes.motions import MotionFile, MotionRequestData, TimeData
from scenegen.validation import as_int

if TYPE_CHECKING:
    from scenegen.lang.spec import CheckedSpec

START, GOAL = "start.", "goal."  # before a label: its phi at that end


def pairs(
    spec: Spec,
    goal: Phi | None = None,
    start: Phi | None = None,
    n: int = 16,
    *,
    moved: int | None = None,
    seed: int = 0,
    workers: int | None = None,
    timeout: float = 60.0,
) -> MotionSet:
    """n pairs of a start and a goal, as motions of two moments: `poses` (n, 2, N, 3), the start first.

    `goal` and `start` are ranges of phi, as of `sample`. Left out, a goal satisfies every label, and a start is
    anything but a goal; both meet what the spec requires. Without `moved`, start and goal are independent of each
    other. `moved` is how many objects stand elsewhere: chosen uniformly, each at a new pose, where it usually is or uniform over the table,
    given that the start is in its range.

    `phi` holds `start.LABEL` and `goal.LABEL`; `facts` are `moved`, the number of objects whose place differs, and
    `distance`, the metres between their centres, summed. Every pair is scored once more before it is returned. The
    same arguments give the same pairs, whatever `workers`: how many processes draw scenes (None: one).

    Where the spec draws how many things there are, start and goal have as many, and numbers have their shares of the
    pairs; those that have none are left out, with a warning. Objects that are not there have NaN.

    Raises RequestError where there is no start or no goal, and where fewer than n pairs were found.
    """
    from scenegen.processes.pool import check_workers
    from scenegen.sampling.pairs import Pairs, PairStarts, draw_numbered, draw_pairs
    from scenegen.sampling.problem import make_problem
    from scenegen.search.effort import Budget

    check_spec(spec)
    drawn = spec.require_scenes()
    refuse_choices(spec, "a pair")
    if moved is not None and as_int("moved", moved) < 1:
        raise RequestError(OUT_OF_RANGE(argument="moved", value=moved, wanted="at least 1"))
    if workers is not None:
        check_workers(workers)
    ends = {name: Range(0.0) for name in spec.labels} if goal is None else read_phi(spec, goal)
    wanted = check_request(spec, SampleRequest(ends, n, seed=seed, workers=workers, timeout=timeout, strict=True))
    budget = Budget(wanted.timeout)
    begins = {} if start is None else read_phi(spec, start)

    def drawn_of(checked: CheckedSpec, wanted: SampleRequest) -> Pairs:
        targets = make_problem(checked, wanted, budget)
        first = make_problem(checked, replace(wanted, phi=begins), budget)
        return draw_pairs(targets, PairStarts(first, targets if start is None else None), moved, budget)

    sampler: dict[str, object] = {"kind": "pairs", "seed": seed, "moved": moved}
    warnings: tuple[Diagnostic, ...] = ()
    if spec.counts:
        numbered = draw_numbered(drawn, wanted, budget, drawn_of)
        found, warnings = numbered.pairs, numbered.warnings
        sampler |= {"goals_without_start": found.given_up, **numbered.info}
    else:
        found = drawn_of(drawn, wanted)
        sampler |= {"goals_without_start": found.given_up}
    if found.shortfall is not None:
        raise RequestError(found.shortfall)
    phi = {f"{START}{name}": values for name, values in zip(spec.labels, found.start_phi, strict=True)}
    phi |= {f"{GOAL}{name}": values for name, values in zip(spec.labels, found.goal_phi, strict=True)}
    facts = {"moved": found.moved.astype(np.float64), "distance": found.distance}
    poses = np.stack([as_poses(found.start), as_poses(found.goal)], axis=1)
    return MotionSet(poses, phi, facts, _header(spec, begins, ends, n, sampler), warnings)


def _header(
    spec: Spec, start: dict[str, Range], goal: dict[str, Range], n: int, sampler: dict[str, object]
) -> MotionFile:
    """The file without its pairs: one step of one second from start to goal."""
    phi = {f"{START}{name}": (one.low, one.high) for name, one in start.items()}
    phi |= {f"{GOAL}{name}": (one.low, one.high) for name, one in goal.items()}
    return motion_header(spec.require_scenes(), sampler, MotionRequestData(phi=phi, n=n), TimeData(steps=1))
