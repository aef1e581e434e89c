"""Pairs of a start and a goal from a spec."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from scenegen.api.motions import MotionSet
from scenegen.api.request import Phi, as_range, check_request, read_phi
from scenegen.api.scene_arrays import motion_header
from scenegen.api.spec import Spec, check_spec, refuse_choices
from scenegen.errors import Diagnostic, RequestError
from scenegen.errors.requests import OUT_OF_RANGE, WRONG_VALUE
from scenegen.pose import as_poses
from scenegen.sampling.grasps import FITS, pair_grasp
from scenegen.sampling.request import Ends, Range, SampleRequest, empty_range
from scenegen.scenes.motions import MotionRequestData, TimeData
from scenegen.validation import as_int

if TYPE_CHECKING:
    from scenegen.lang.spec import CheckedSpec

START, GOAL = "start.", "goal."  # before a label: its phi at that end
GRASP, YAW = "grasp.", "yaw."  # before a robot: the margin of its grasps; before a thing: the yaw of that of it


def pairs(
    spec: Spec,
    goal: Phi | None = None,
    start: Phi | None = None,
    n: int = 16,
    *,
    moved: int | None = None,
    grasp: str | Mapping[str, Ends | Range] | None = None,
    seed: int = 0,
    workers: int | None = None,
    timeout: float = 60.0,
) -> MotionSet:
    """n pairs of a start and a goal, as motions of two moments: `poses` (n, 2, N, 3), the start first.

    `goal` and `start` are ranges of phi, as of `sample`. Left out, a goal satisfies every label, and a start is
    anything but a goal; both meet what the spec requires. Without `moved`, start and goal are independent of each
    other. `moved` is how many objects stand elsewhere: chosen uniformly, each at a new pose, where it usually is or
    uniform over the table, given that the start is in its range.

    `grasp` names a robot of the spec, for pairs with one grasp of each thing that is moved, at a yaw in its own frame,
    that fits at the start and at the goal; `{"arm": (0.01, None)}` has a range of its margin, for which 0 and above is
    taken. phi then holds `grasp.ROBOT`, the margin in metres, of several things the least, and `facts` `yaw.NAME` in
    radians, NaN where a thing is not moved. Robots are not moved, and without `moved` all else is that can be.

    `phi` holds `start.LABEL` and `goal.LABEL`; `facts` are `moved`, the number of objects whose place differs, and
    `distance`, the metres between their centres, summed. Every pair is scored once more before it is returned. The
    same arguments give the same pairs, whatever `workers`: how many processes draw scenes (None: one).

    Where the spec draws how many things there are, start and goal have as many, and numbers have their shares of the
    pairs; those that have none are left out, with a warning. Objects that are not there have NaN.

    Raises RequestError where there is no start or no goal, where fewer than n pairs were found, and for a grasp by what
    is no robot, or of nothing.
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
    hold = None if grasp is None else read_grasp(grasp)
    begins = {} if start is None else read_phi(spec, start)

    def drawn_of(checked: CheckedSpec, wanted: SampleRequest) -> Pairs:
        targets = make_problem(checked, wanted, budget)
        first = make_problem(checked, replace(wanted, phi=begins), budget)
        by = None if hold is None else pair_grasp(checked, *hold)
        return draw_pairs(targets, PairStarts(first, targets if start is None else None, by), moved, budget)

    sampler: dict[str, object] = {"kind": "pairs", "seed": seed, "moved": moved}
    sampler |= {} if hold is None else {"grasp": hold[0]}
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
    ranges = {f"{START}{name}": one for name, one in begins.items()} | {
        f"{GOAL}{name}": one for name, one in ends.items()
    }
    if hold is not None and found.grasps is not None:
        phi[f"{GRASP}{hold[0]}"], ranges[f"{GRASP}{hold[0]}"] = found.grasps[0], hold[1]
        yaws = zip(drawn.objects, drawn.shapes, found.grasps[1:], strict=True)
        facts |= {
            f"{YAW}{name}": yaw for k, (name, shape, yaw) in enumerate(yaws) if not shape.arm and k not in drawn.fixed
        }
    poses = np.stack([as_poses(found.start), as_poses(found.goal)], axis=1)
    asked = MotionRequestData(phi={name: (one.low, one.high) for name, one in ranges.items()}, n=n)
    return MotionSet(poses, phi, facts, motion_header(drawn, sampler, asked, TimeData(steps=1)), warnings)


def read_grasp(grasp: str | Mapping[str, Ends | Range]) -> tuple[str, Range]:
    """The robot, and the range of the margin. Raises RequestError."""
    if isinstance(grasp, str):
        return grasp, FITS
    if not isinstance(grasp, Mapping) or len(grasp) != 1:
        wanted = 'the name of a robot, or that with a range: {"arm": (0.01, None)}'
        raise RequestError(WRONG_VALUE(argument="grasp", value=repr(grasp), wanted=wanted))
    ((robot, ends),) = grasp.items()
    found = as_range(robot, ends)
    if wrong := empty_range(found):
        raise RequestError(wrong)
    return robot, found
