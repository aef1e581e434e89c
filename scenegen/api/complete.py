"""Given scenes, completed one by one: what is not given is drawn, so that phi is in the range.

Candidates of many scenes are scored together, which costs far less than a run for each. Scenes that are not hit get
one: there bounds, growth and splitting help, and say where nothing can be found.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from scenegen.api.request import check_request
from scenegen.api.scenes import SceneSet, scenes_of
from scenegen.api.spec import LearnedModel, Spec
from scenegen.arrays import Array, as_numbers
from scenegen.errors import DataError, Diagnostic, RequestError
from scenegen.errors.files import COLUMN_NOT_A_NUMBER
from scenegen.errors.requests import (
    ALL_HELD,
    CANNOT_BE_HELD,
    NO_SCENES,
    NOT_COMPLETED,
    OUT_OF_PLACE,
    UNKNOWN_OBJECT,
    WRONG_VALUE,
)
from scenegen.pose import NAMES, PLACE, THETA, TWO_PI, X, Y, row_of
from scenegen.sampling.plan import verify
from scenegen.sampling.plans import SELECTIONS
from scenegen.sampling.prior import pull_back
from scenegen.sampling.problem import Problem, make_problem, refuse_turned_priors
from scenegen.sampling.request import SampleRequest
from scenegen.sampling.streams import COMPLETION_STREAM
from scenegen.scenes.arrange import check_held, doubts_of
from scenegen.search.effort import Budget

if TYPE_CHECKING:
    from scenegen.lang.spec import CheckedSpec

Draw = Callable[[Spec, SampleRequest], SceneSet]

ROUND_CANDIDATES = 65_536  # candidates that are scored together
MAX_COMPLETION_ROUNDS = 64


def many_given(fix: object) -> bool:
    """Whether these are poses of many scenes, and not of one."""
    if isinstance(fix, Mapping):
        return any(getattr(pose, "ndim", 0) == 2 for pose in fix.values())
    return isinstance(fix, SceneSet) or getattr(fix, "ndim", 0) == 3


def given_poses(spec: CheckedSpec, fix: Any) -> Array:
    """(n, N, 3) with NaN for what is free: of a set of scenes, an array, or arrays (n, 2) or (n, 3) by name. Raises
    RequestError."""
    wanted = f"a SceneSet, an array (n, {len(spec.objects)}, 3) with NaN for what is free, or arrays (n, 3) by name"
    wrong = RequestError(WRONG_VALUE(argument="fix", value=repr(fix)[:80], wanted=wanted))
    if isinstance(fix, SceneSet):
        fix = {name: fix.poses[:, k] for k, name in enumerate(fix.objects) if name in spec.objects}
    try:
        given = {name: as_numbers(pose) for name, pose in fix.items()} if isinstance(fix, Mapping) else as_numbers(fix)
    except (TypeError, ValueError):
        raise wrong from None
    if not isinstance(given, dict):
        if given.shape[1:] != (len(spec.objects), len(NAMES)):
            raise wrong
        return given
    sizes = {len(one) for one in given.values() if one.ndim == 2}
    if len(sizes) != 1 or any(one.ndim > 2 or one.shape[-1:] not in ((2,), (3,)) for one in given.values()):
        raise wrong
    found = np.full((sizes.pop(), len(spec.objects), len(NAMES)), np.nan)
    for name, one in given.items():
        if name not in spec.objects:
            raise RequestError(UNKNOWN_OBJECT(name=name, known=spec.objects))
        found[:, spec.objects.index(name), : one.shape[-1]] = one
    return found


def _check_parts(spec: CheckedSpec, given: Array, source: str) -> None:
    """Raises DataError for a place of which only half is given, a heading without a place, and what is not finite."""
    missing = np.isnan(given)
    wrong = np.isinf(given)
    wrong[..., PLACE] |= missing[..., PLACE] & ~missing.all(axis=-1, keepdims=True)
    if wrong.any():
        scene, thing, axis = np.argwhere(wrong)[0].tolist()
        facts = {"column": f"{spec.objects[thing]}.{NAMES[axis]}", "scene": scene + 1}
        raise DataError(COLUMN_NOT_A_NUMBER(path=source, own=True, **facts))


def complete(
    spec: Spec | LearnedModel, request: SampleRequest, fix: Any, draw: Draw, n: int | None = None, source: str = "`fix`"
) -> SceneSet:
    """A scene for each that is given by `fix`, in their order: see `given_poses`. `draw` draws those that are rare, `n`
    is how many there are, if the caller says it, and `source` where they are from. Within the range the scenes are
    spread as the request says, as far as what is given allows. Raises RequestError for a request that does not go with
    given scenes, and where one cannot be completed in time, unless `keep_partial`; DataError for half a pose."""
    began = time.monotonic()
    if not isinstance(spec, Spec):
        raise RequestError(OUT_OF_PLACE(argument="fix", rule="of many scenes is for specs", remedy="give a spec"))
    checked = spec.checked
    given = given_poses(checked, fix)
    _check_parts(checked, given, source)
    if not len(given):
        raise RequestError(NO_SCENES())
    for name, odd in (
        ("n", n not in (None, len(given))),
        *((option, bool(getattr(request, option))) for option in SELECTIONS),
        ("spread", request.spread == "even"),
        ("method", request.method not in ("auto", "rejection")),
    ):
        if odd:
            rule = "does not go with given scenes, of which each is completed once"
            raise RequestError(OUT_OF_PLACE(argument=name, rule=rule, remedy="leave it out"))
    request = check_request(spec, replace(request, n=len(given), fix={}))
    problem = make_problem(checked, request, Budget(request.timeout))
    held = _given_rows(problem, given)
    refuse_turned_priors(checked, ~np.isnan(held))
    found, hit, draws = _draw_candidates(problem, held, request, began)
    warnings = [*problem.warnings, *doubts_of(source, checked.objects, given, checked.workspace)]
    for number in np.flatnonzero(~hit):
        one = _complete_alone(
            spec, request, given[number], int(number), request.timeout - (time.monotonic() - began), draw
        )
        if isinstance(one, Diagnostic):
            if not request.keep_partial:
                raise RequestError(one)
            warnings.append(replace(one, severity="warning"))
            continue
        found[:, number], hit[number] = one, True
    rows = np.ascontiguousarray(found[:, hit])
    phi = problem.phi(rows)
    verify(problem, rows, phi)
    names = [name for k, name in enumerate(checked.objects) if not np.isnan(given[:, k, X]).all()]
    if not hit.any():
        raise RequestError(NO_SCENES())
    facts = {"draws": draws, "acceptance": float(hit.sum()) / draws, "held": names}
    return scenes_of(problem, {"method": "completed", **facts}, rows, phi, tuple(warnings))


def _given_rows(problem: Problem, given: Array) -> Array:
    """(R, n): the rows of the core that are given, headings in [0, 2 pi), and NaN for those that are free. Raises
    RequestError and DataError."""
    spec = problem.spec
    held = np.full((len(problem.lowest), len(given)), np.nan)
    for which, name in enumerate(spec.objects):
        for axis in range(len(NAMES)):
            values = given[:, which, axis]
            held[row_of(which, axis)] = np.remainder(values, TWO_PI) % TWO_PI if axis == THETA else values
        for axis in PLACE:
            row = row_of(which, axis)
            low, high = problem.lowest[row], problem.highest[row]
            out = np.flatnonzero((held[row] < low) | (held[row] > high))
            if len(out) and which not in spec.fixed:
                facts = {"x": given[out[0], which, X], "y": given[out[0], which, Y]}
                ends = (
                    f"[{problem.lowest[at]:g}, {problem.highest[at]:g}]" for at in (row_of(which, k) for k in PLACE)
                )
                raise RequestError(CANNOT_BE_HELD(name=name, workspace=" x ".join(ends), **facts))
        if which in spec.fixed and not np.isnan(given[:, which, X]).any():
            check_held(replace(spec, fixed={which: spec.fixed[which]}), held)
    still = problem.lowest == problem.highest
    held[still] = problem.lowest[still, None]
    if len(given) and not np.isnan(held).any():
        raise RequestError(ALL_HELD(consequence="nothing is left to sample"))
    return held


def _draw_candidates(
    problem: Problem, held: Array, request: SampleRequest, began: float
) -> tuple[Array, npt.NDArray[np.bool_], int]:
    """The rows of every scene, (R, n), of which there are some, and the number of candidates. These follow the base
    distribution where nothing is given: the first one that is in the range is exactly distributed."""
    count = held.shape[1]
    found, hit = np.full(held.shape, np.nan), np.zeros(count, dtype=bool)
    generator = np.random.default_rng(np.random.SeedSequence([request.seed, COMPLETION_STREAM]))
    cells = problem.cells
    possible = np.array(sorted(problem.possible))
    wanted = np.concatenate([generator.permutation(possible) for _ in range(0, count, len(possible))])[:count]
    draws = 0
    span = (problem.highest - problem.lowest)[:, None]
    _, base = pull_back(problem.spec, problem.lowest, problem.highest)
    for turn in range(MAX_COMPLETION_ROUNDS):
        waiting = np.flatnonzero(~hit)
        if not len(waiting) or time.monotonic() - began > request.timeout:
            break
        some = waiting[:ROUND_CANDIDATES]
        each = max(1, ROUND_CANDIDATES // len(some) >> max(0, 4 - turn))  # most scenes are hit soon
        draws += each * len(some)
        rows = problem.lowest[:, None] + span * generator.random((len(held), len(some) * each))
        given = np.repeat(held[:, some], each, axis=1)
        rows = base.poses(rows, given)
        cell = cells.find(problem.phi(rows)).reshape(len(some), each)
        strict = request.spread == "flat" and turn < MAX_COMPLETION_ROUNDS // 2
        fits = cell == wanted[some, None] if strict else cell >= 0
        new = fits.any(axis=1)
        first = fits.argmax(axis=1)
        found[:, some[new]] = rows[:, (np.arange(len(some)) * each + first)[new]]
        hit[some[new]] = True
    return found, hit, draws


def _complete_alone(
    spec: Spec, request: SampleRequest, given: Array, number: int, left: float, draw: Draw
) -> Array | Diagnostic:
    """The rows of one scene that was not hit, or why there are none."""
    checked = spec.checked
    fix = {
        name: tuple(float(value) for value in pose if not np.isnan(value))
        for which, (name, pose) in enumerate(zip(checked.objects, given, strict=True))
        if not np.isnan(pose[X]) and which not in checked.fixed
    }
    if left <= 0.0:
        return NOT_COMPLETED(scene=number + 1, reason="time is up")
    seed = int(np.random.SeedSequence([request.seed, COMPLETION_STREAM, number]).generate_state(1)[0])
    alone = replace(request, n=1, fix=fix, seed=seed, spread="base", method="auto", timeout=left, keep_partial=False)
    try:
        scenes = draw(spec, alone)
    except RequestError as error:
        return NOT_COMPLETED(scene=number + 1, reason=error.diagnostics[0].title)
    from scenegen.api.scene_arrays import rows_of

    return rows_of(checked, scenes)[:, 0]
