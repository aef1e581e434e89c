"""Sampling: a spec or a model and a range of phi in, verified scenes out."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from numbers import Real
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from scenegen.api.scenes import SceneSet, evaluate, make_header
from scenegen.api.spec import Spec
from scenegen.api.train import Model
from scenegen.errors import Diagnostic, RequestError, suggest
from scenegen.lang.core import REQUIRE
from scenegen.lang.interpret import phi as interpret
from scenegen.primitives import NUMPY
from scenegen.scene.data import RequestData

if TYPE_CHECKING:
    import torch
    from torch import Tensor

    from scenegen.sampling.collect import Sampled
    from scenegen.sampling.held import Held
    from scenegen.sampling.problem import Budget, Problem, Progress
    from scenegen.sampling.request import Range

METHODS = ("auto", "rejection", "splitting", "model")

Ends = tuple[float | None, float | None]


def sample(
    source: Spec | Model,
    phi: Mapping[str, Ends | Range] | None = None,
    n: int = 16,
    *,
    seed: int = 0,
    method: str = "auto",
    spread: str = "flat",
    timeout: float = 60.0,
    raw: bool = False,
    keep_partial: bool = False,
    fix: Mapping[str, Held | tuple[float, ...]] | None = None,
    progress: Progress | None = None,
) -> SceneSet:
    """n scenes whose phi lies in the wanted range of every label, re-scored by the exact spec in float64.

    `phi` maps labels to (lowest, highest), None for an open end; labels that are not mentioned are free. With two ends
    the range is cut into cells that get equal shares of the scenes; `spread="base"` switches that off. From a Spec the
    scenes are drawn by pruned rejection: independent, and exactly distributed within a cell; the method `splitting`
    reaches rare ranges with Markov chains, exact in the limit of long chains. From a Model they are its proposals,
    moved onto their target: approximately distributed. `raw` returns a model's own output instead, neither moved nor
    filtered. `fix` holds objects where they are, (x, y) or (x, y, theta) by name, so that the others complete a given
    scene.

    The same arguments give the same scenes; `timeout` (seconds) can only cut a run short. Raises RequestError for a
    request that is wrong or out of reach, and where fewer than n scenes were found in time, unless `keep_partial`.
    """
    from scenegen.sampling.problem import Budget, pose

    spec = source.spec if isinstance(source, Model) else source
    method = _method(method, source, raw)
    if not (math.isfinite(timeout) and timeout > 0):
        raise RequestError(
            Diagnostic(f"the timeout cannot be {timeout:g} s", help="give it a positive number of seconds")
        )
    ranges = {label: _range(label, ends) for label, ends in (phi or {}).items()}
    if raw and fix:
        title = "`raw` is a model's own output, and a model does not know of objects that are held"
        raise RequestError(Diagnostic(title, help="leave --raw or --fix out"))
    problem = pose(spec.checked, ranges, n=n, seed=seed, spread=spread, fixed=fix)
    budget = Budget(timeout)
    if method == "model":
        assert isinstance(source, Model)
        sampled = _from_model(problem, source, budget, raw, progress)
    elif method == "splitting":
        from scenegen.sampling.splitting import splitting

        sampled = splitting(problem, budget, progress)
    else:
        from scenegen.sampling.rejection import rejection

        sampled = rejection(problem, budget, progress)
    return _hand_out(problem, sampled, raw, keep_partial)


def _range(label: str, ends: object) -> Range:
    """A range as people write it in Python. Raises RequestError for anything but two ends."""
    from scenegen.sampling.request import Range

    if isinstance(ends, Range):
        return ends
    if (
        not isinstance(ends, tuple | list)
        or len(ends) != 2
        or not all(end is None or isinstance(end, Real) for end in ends)
    ):
        help_ = "write (lowest, highest), with None for an open end"
        raise RequestError(Diagnostic(f"phi of `{label}` is asked for as {ends!r}", help=help_))
    low, high = ends
    return Range(None if low is None else float(low), None if high is None else float(high))


def _method(method: str, source: Spec | Model, raw: bool) -> str:
    if method not in METHODS:
        raise RequestError(
            Diagnostic(f"unknown method `{method}`", help=suggest(method, METHODS, f"one of {', '.join(METHODS)}"))
        )
    if method == "auto":
        method = "model" if isinstance(source, Model) else "rejection"
    if method == "model" and not isinstance(source, Model):
        title = "the method `model` needs a trained model, not a spec"
        raise RequestError(Diagnostic(title, help="name the model file: scenegen sample model.safetensors --phi ..."))
    if raw and method != "model":
        title = "`raw` is a model's own output, and no model takes part here"
        raise RequestError(Diagnostic(title, help="name a model file, or leave --raw out"))
    return method


def _from_model(problem: Problem, model: Model, budget: Budget, raw: bool, progress: Progress | None) -> Sampled:
    from scenegen.sampling.guided import guided, unrefined

    def propose(phi: Tensor, generator: torch.Generator) -> Tensor:
        # a model knows the labels, not the requirement that may stand after them
        return model.trained.propose(phi[: len(model.spec.labels)], generator)

    if raw:
        return unrefined(problem, propose, model.name)
    return guided(problem, propose, model.name, budget, progress)


def _hand_out(problem: Problem, sampled: Sampled, raw: bool, keep_partial: bool) -> SceneSet:
    """The scene set of what a sampler found, after a second look by another evaluator."""
    warnings = list(sampled.warnings)
    if sampled.shortfall is not None:
        if not (keep_partial and sampled.count):
            raise RequestError(sampled.shortfall)
        kept = f"{sampled.shortfall.title}; these are kept"
        warnings.append(dataclasses.replace(sampled.shortfall, title=kept, severity="warning"))
    request = problem.request
    asked = {label: (wanted.low, wanted.high) for label, wanted in request.ranges.items()}
    header = make_header(problem.spec, sampled.info, RequestData(phi=asked, n=request.n, spread=request.spread))
    objects = len(problem.spec.objects)
    poses = np.ascontiguousarray(sampled.rows.T).reshape(sampled.count, objects, 3)
    scenes = SceneSet(poses, {}, header, tuple(warnings))
    phi = evaluate(problem.spec, scenes)
    _verify(problem, sampled, phi, raw)
    return dataclasses.replace(scenes, phi=phi)


def _verify(problem: Problem, sampled: Sampled, phi: Mapping[str, npt.NDArray[np.float64]], raw: bool) -> None:
    """A second look at what is handed out. What fails here is a bug of ours, and is never handed out."""
    again = np.array(list(phi.values())).reshape(len(phi), sampled.count)
    if not np.allclose(again, sampled.phi[: len(phi)], rtol=0.0, atol=1e-9):
        raise AssertionError("two evaluators of the same spec disagree about phi")
    if raw:
        return
    if problem.spec.core.requirement is not None:
        margin = interpret(problem.core, list(sampled.rows), NUMPY)[REQUIRE]
        again = np.vstack([again, np.broadcast_to(margin, (1, sampled.count))])
    inside = (again >= problem.cells.low[:, None]) & (again <= problem.cells.high[:, None])
    still = problem.lowest == problem.highest
    held = (sampled.rows[still] == problem.lowest[still, None]).all()
    if not (problem.spec.workspace.contains(sampled.rows).all() and inside.all() and held):
        raise AssertionError("a sampler handed out a scene that was not asked for")
