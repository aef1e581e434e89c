"""Sampling: a spec or a model and a range of phi in, verified scenes out."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

from scenegen.api.ask import Ask, Wanted, ask
from scenegen.api.model import Model
from scenegen.api.scene_arrays import make_header
from scenegen.api.scenes import SceneSet
from scenegen.api.settled import blamed, check_settle, refuse_model, settling, told
from scenegen.api.spec import Spec
from scenegen.errors import Diagnostic, RequestError

if TYPE_CHECKING:
    import torch
    from torch import Tensor

    from scenegen.engine.stream import Progress
    from scenegen.sampling.auto import Choice
    from scenegen.sampling.collect import Sampled
    from scenegen.sampling.held import Held

IN_MEMORY = 1 << 25  # numbers of a scene set at most: 3 a scene and object, 1 a scene and label; 268 MB

Note = Callable[[str], None]


def sample(
    source: Spec | Model,
    phi: Wanted | None = None,
    n: int = 16,
    *,
    seed: int = 0,
    method: str = "auto",
    spread: str = "flat",
    timeout: float = 60.0,
    raw: bool = False,
    keep_partial: bool = False,
    fix: Mapping[str, Held | tuple[float, ...]] | None = None,
    settle: bool = False,
    workers: int | None = None,
    progress: Progress | None = None,
    on_note: Note | None = None,
) -> SceneSet:
    """n scenes whose phi lies in the wanted range of every label, re-scored by the exact spec in float64.

    `phi` maps labels to (lowest, highest), None for an open end; labels that are not mentioned are free, and of a
    spec's only label the range itself will do. With two ends the range is cut into cells that get equal shares of the
    scenes; `spread="base"` switches that off. From a Spec the scenes are drawn by pruned rejection (`rejection`:
    independent, and exactly distributed within a cell) or by multilevel splitting (`splitting`: Markov chains that
    reach rare ranges, exact in the limit of long chains); `auto` takes what needs fewer evaluations of phi and tells
    `on_note`, and the header, what it took and why. From a Model they are its proposals, moved onto their target:
    approximately distributed. `raw` returns a model's own output instead, neither moved nor filtered. `fix` holds
    objects where they are, (x, y) or (x, y, theta) by name, so that the others complete a given scene. `settle` drops
    every scene in PyBullet for one simulated second and hands out those in which no object moves more than 1 cm or
    turns more than 5 degrees.

    `workers` is the number of processes; left out, small requests stay in this one, others use all cores. The same
    arguments give the same scenes, whatever `workers`; `timeout` (seconds) can only cut a run short. Raises
    RequestError for a request that is wrong or out of reach, where fewer than n scenes were found in time, unless
    `keep_partial`, and for more scenes than go into memory: see `sample_to`.
    """
    asked = ask(source, phi, n, seed=seed, method=method, spread=spread, timeout=timeout, raw=raw, fix=fix)
    check_size(asked)
    if isinstance(source, Model) and asked.method == "model":
        if settle:
            raise refuse_model()
        sampled = _from_model(asked, source, raw, progress)
    else:
        from scenegen.engine.exact import in_memory

        check_settle(settle)
        choice = chosen(asked, on_note)
        with settling(asked, choice, workers, settle) as (choice, crew, refusals):
            sampled = in_memory(choice, asked.budget, workers=crew, progress=progress)
        warnings, shortfall = told(sampled.warnings, refusals), blamed(sampled.shortfall, refusals)
        sampled = dataclasses.replace(sampled, warnings=warnings, shortfall=shortfall)
    return _hand_out(asked, sampled, keep_partial)


def chosen(asked: Ask, on_note: Note | None = None) -> Choice:
    """The plan of a request to a spec; a choice by `auto` is told."""
    from scenegen.sampling.auto import choose

    choice = choose(asked.problem, asked.method, asked.budget)
    if choice.reason is not None and on_note is not None:
        on_note(f"{choice.plan.name}: {choice.reason}")
    return choice


def check_size(asked: Ask) -> None:
    """Refuse more scenes than go into memory. Raises RequestError."""
    problem = asked.problem
    each = len(problem.lowest) + len(problem.spec.labels)
    most = IN_MEMORY // each
    if problem.request.n > most:
        title = f"{problem.request.n:,} scenes of {len(problem.spec.objects)} objects are too many for memory"
        help_ = f"write them to a file with --out scenes.parquet (in Python, sample_to), or ask for at most {most:,}"
        raise RequestError(Diagnostic(title, help=help_))


def partial(shortfall: Diagnostic) -> Diagnostic:
    """The warning that goes with fewer scenes than wanted."""
    return dataclasses.replace(shortfall, title=f"{shortfall.title}; these are kept", severity="warning")


def _from_model(asked: Ask, model: Model, raw: bool, progress: Progress | None) -> Sampled:
    from scenegen.sampling.guided import guided, unrefined
    from scenegen.sampling.verify import verify

    def propose(phi: Tensor, generator: torch.Generator) -> Tensor:
        # a model knows the labels, not the requirement that may stand after them
        return model.trained.propose(phi[: len(model.spec.labels)], generator)

    if raw:
        sampled = unrefined(asked.problem, propose, model.name)
    else:
        sampled = guided(asked.problem, propose, model.name, asked.budget, progress)
        verify(asked.problem, sampled.rows, sampled.phi)
    if model.trained.steps is None:
        return sampled
    return dataclasses.replace(sampled, info={**sampled.info, "steps": model.trained.steps})


def _hand_out(asked: Ask, sampled: Sampled, keep_partial: bool) -> SceneSet:
    """The scene set of what a sampler found. Raises RequestError where that is too little."""
    problem = asked.problem
    warnings = list(sampled.warnings)
    if sampled.shortfall is not None:
        if not (keep_partial and sampled.count):
            raise RequestError(sampled.shortfall)
        warnings.append(partial(sampled.shortfall))
    header = make_header(problem.spec, sampled.info, asked.data)
    # a view of (3N, n) storage, in which each coordinate is contiguous
    poses = sampled.rows.T.reshape(sampled.count, len(problem.spec.objects), 3)
    phi = dict(zip(problem.spec.labels, sampled.phi, strict=False))
    return SceneSet(poses, phi, header, tuple(warnings))
