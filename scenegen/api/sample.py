"""Sampling: a spec or a model and a range of phi in, verified scenes out.

`sample`, `sample_to` (stream.py) and `sample_motions` (motions.py) have a parameter for each option of `SampleRequest`
that means something for them, by the same name and with the same default: tests/api/test_request.py says where one is
missing.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, cast

import numpy.typing as npt

from scenegen.api.request import Note, Phi, any_model, check_request, read_phi
from scenegen.api.scenes import SceneSet, scenes_of
from scenegen.api.spec import LearnedModel, Spec, model_of, spec_of
from scenegen.arrays import Array
from scenegen.errors import Diagnostic, RequestError
from scenegen.errors.files import ONLY_FOR_SETS
from scenegen.errors.requests import TOO_MANY
from scenegen.pose import row_count
from scenegen.sampling.request import DEFAULT_SCENES, MAX_SCENES, Ends, FixedPose, Progress, Range, SampleRequest

if TYPE_CHECKING:
    from scenegen.sampling.engine.run import SampledScenes
    from scenegen.sampling.motions.schedule import Watch
    from scenegen.sampling.plan import Plan
    from scenegen.scenes.motions import AnyFile
    from scenegen.search.effort import Budget


IN_MEMORY = 1 << 25  # numbers of a scene set at most: 3 a scene and object, 1 a scene and label; 268 MB


def sample(
    source: Spec | LearnedModel,
    phi: Phi | None = None,
    n: int | None = None,
    *,
    seed: int = 0,
    method: str = "auto",
    spread: str = "flat",
    timeout: float = 60.0,
    raw: bool = False,
    keep_partial: bool = False,
    fix: Mapping[str, FixedPose | tuple[float, ...] | npt.ArrayLike] | SceneSet | npt.ArrayLike | None = None,
    settle: bool = False,
    success: Range | Ends | None = None,
    under: str | Path | None = None,
    workers: int | None = None,
    progress: Progress | None = None,
    on_note: Note | None = None,
) -> SceneSet:
    """n scenes (16 if left out) whose phi lies in the wanted range of every label, re-scored by the exact spec.

    `phi` maps labels to (lowest, highest), None for an open end; labels that are not mentioned are free, and of a
    spec's only label the range itself will do. With two ends the range is cut into cells that get equal shares of the
    scenes; `spread="base"` switches that off, and `spread="even"` chooses these scenes far from each other, among 16
    times as many. From a Spec the scenes are drawn by pruned rejection (`rejection`:
    independent, and exactly distributed within a cell), by sequential Monte Carlo over objects (`growth`: for crowded
    tables) or by multilevel splitting (`splitting`: Markov chains that reach rare ranges, exact in the limit of long
    chains); `auto` takes what needs the least time by its estimate and tells `on_note`, and the header, what it took
    and why. From a Model they are its proposals, moved onto their target: approximately distributed. `raw` returns a
    model's own output instead, neither moved nor filtered. `fix` holds objects where they are, (x, y) or (x, y, theta)
    by name, so that the others complete a given scene. Of many scenes, as arrays (n, 2) or (n, 3) by name, an array
    (n, N, 3) with NaN for what is free, or a SceneSet, each is completed once, in their order, at a small part of the
    cost of n calls; `n` is then their number, or left out. `settle` drops every scene in PyBullet for one simulated
    second and returns those in which no object moves more than 1 cm or turns more than 5 degrees. `success`, a pair of
    rates, returns those at which a policy is predicted to succeed so often, by the fit in the file `under`.

    `workers` is the number of processes; left out, small requests stay in this one, others use all cores. The same
    arguments give the same scenes, whatever `workers`; `timeout` (seconds) can only cut a run short. Raises
    RequestError for a request that is wrong or out of reach, where fewer than n scenes were found in time, unless
    `keep_partial`, and for more scenes than go into memory: see `sample_to`.
    """
    from scenegen.api.complete import complete, many_given

    many = many_given(fix)
    alone = cast("Mapping[str, FixedPose | tuple[float, ...]]", {} if fix is None or many else fix)
    request = SampleRequest(
        read_phi(source, phi), DEFAULT_SCENES if n is None else n, seed=seed, method=method, spread=spread, fix=alone,
        settle=settle, success=success, under=under, raw=raw, timeout=timeout, workers=workers,
        keep_partial=keep_partial,
    )  # fmt: skip
    if many:
        return complete(source, request, fix, draw_scenes, n)
    return draw_scenes(source, request, progress=progress, on_note=on_note)


def draw_scenes(
    source: Spec | LearnedModel,
    request: SampleRequest,
    *,
    progress: Progress | None = None,
    on_note: Note | None = None,
) -> SceneSet:
    """The scenes of a request, in memory. Raises what `sample` raises."""
    from scenegen.search.effort import Budget

    _ = spec_of(source).require_scenes()
    budget = Budget(request.timeout)
    source = any_model(source, budget) if request.method == "any" else source
    request = check_request(source, request)
    _check_size(source, request.n)
    plan, drawn, warnings = run_in_memory(source, request, budget, progress=progress, on_note=on_note)
    if isinstance(source, LearnedModel) and request.method == "model":
        warnings = (*warnings, *source.advice(request, drawn.rows))
    return scenes_of(plan.problem, drawn.info, drawn.rows, drawn.phi, warnings)


def run_in_memory(
    source: Spec | LearnedModel,
    request: SampleRequest,
    budget: Budget | None = None,
    *,
    progress: Progress | None = None,
    on_note: Note | None = None,
    watch: Watch | None = None,
) -> tuple[Plan, SampledScenes, tuple[Diagnostic, ...]]:
    """A checked request's plan, the scenes or motions that it gives, and warnings. Raises RequestError where there are
    too few of them, unless the request keeps partial results."""
    from scenegen.sampling.engine.run import in_memory
    from scenegen.sampling.plans import plan_for
    from scenegen.search.effort import Budget

    budget = budget or Budget(request.timeout)
    plan = plan_for(spec_of(source).definition, request, budget, model_of(source), on_note, watch=watch)
    drawn = in_memory(plan, budget, progress)
    if drawn.shortfall is None:
        return plan, drawn, drawn.warnings
    if not (request.keep_partial and drawn.count):
        raise RequestError(drawn.shortfall)
    return plan, drawn, (*drawn.warnings, partial(drawn.shortfall))


def _check_size(source: Spec | LearnedModel, n: int) -> None:
    """Refuse more scenes than go into memory. Raises RequestError."""
    spec = spec_of(source).require_scenes()
    most = IN_MEMORY // (row_count(len(spec.objects)) + len(spec.labels))
    if most < n <= MAX_SCENES:  # of even more it is said that nobody can sample them
        raise RequestError(TOO_MANY(n=n, objects=len(spec.objects), most=most))


def partial(shortfall: Diagnostic) -> Diagnostic:
    """The warning that goes with fewer scenes than wanted."""
    return dataclasses.replace(shortfall.but(kept="these are kept"), severity="warning")


@dataclass(frozen=True, slots=True)
class PhiSummary:
    """phi of one label over the scenes of a file."""

    lowest: float
    mean: float
    highest: float


@dataclass(frozen=True, slots=True)
class Written:
    """A file or set: where it is, how many scenes or motions it holds, its header, and what phi is in it, by label."""

    path: Path | str
    count: int
    header: AnyFile
    phi: Mapping[str, PhiSummary]
    warnings: tuple[Diagnostic, ...] = field(default=(), compare=False)

    def __len__(self) -> int:
        return self.count


def summarize_phi(phi: Mapping[str, Array]) -> dict[str, PhiSummary]:
    """What phi, by label, is in a set of at least one scene, or motion."""
    return {label: PhiSummary(float(v.min()), float(v.mean()), float(v.max())) for label, v in phi.items()}


def refuse_set_options(request: SampleRequest) -> None:
    """Raises RequestError for options that only sets have."""
    argument = request.misplaced_option("scenes", "motions", "files")
    if argument is not None:
        raise RequestError(ONLY_FOR_SETS(argument=argument))


def glimpse(
    spec: Spec,
    phi: Phi | None = None,
    n: int = 4,
    *,
    seed: int = 0,
    fix: Mapping[str, FixedPose | tuple[float, ...]] | None = None,
    timeout: float = 5.0,
) -> SceneSet:
    """At most n scenes in the wanted ranges, the arguments as `scenegen.sample` takes them; none where nothing is found
    soon. They are in range, but not distributed in any particular way, and not those that `sample` returns. Raises
    RequestError for a request that is wrong or proved to be impossible."""
    from scenegen.sampling.growth.sampler import GLIMPSE_ROUNDS
    from scenegen.sampling.growth.sampler import glimpse as grown
    from scenegen.sampling.problem import make_problem
    from scenegen.search.effort import Budget

    wanted = {} if fix is None else fix
    request = SampleRequest(read_phi(spec, phi), n, seed=seed, method="growth", fix=wanted, timeout=timeout)
    budget = Budget(timeout)
    problem = make_problem(spec.checked, check_request(spec, request), budget, rounds=GLIMPSE_ROUNDS, most=n)
    if problem.spec.priors:
        from scenegen.sampling.prior import over_uniform
        from scenegen.search.effort import Effort

        over, base = over_uniform(problem, Effort(lambda: budget.overdrawn))
        rows = base.poses(grown(over, budget, n))
        rows = rows[:, problem.cells.find(problem.phi(rows)) >= 0]
    else:
        rows = grown(problem, budget, n)
    return scenes_of(problem, {"method": "glimpse", "seed": seed}, rows, problem.phi(rows))
