"""What people ask for, as they write it in Python, made into a problem for a sampler."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from numbers import Real
from typing import TYPE_CHECKING, TypeAlias

from scenegen.api.model import Model
from scenegen.api.spec import Spec, check_spec
from scenegen.errors import Diagnostic, RequestError, quoted, suggest
from scenegen.given import whole
from scenegen.scene.data import RequestData

if TYPE_CHECKING:
    from scenegen.sampling.held import Held
    from scenegen.sampling.problem import Budget, Problem
    from scenegen.sampling.request import Range

METHODS = ("auto", "rejection", "growth", "splitting", "model")

Ends = tuple[float | None, float | None]
Wanted: TypeAlias = "Mapping[str, Ends | Range] | Ends | Range"
"""phi by label, or of the one label of a spec that has no other."""


@dataclass(frozen=True, slots=True)
class Ask:
    """A checked request: how it is to be served (a model: by itself), and for how long."""

    problem: Problem
    method: str
    budget: Budget

    @property
    def data(self) -> RequestData:
        """The request as scene files tell it."""
        request = self.problem.request
        asked = {label: (wanted.low, wanted.high) for label, wanted in request.ranges.items()}
        return RequestData(phi=asked, n=request.n, spread=request.spread)


def ask(
    source: Spec | Model,
    phi: Wanted | None,
    n: int,
    *,
    seed: int,
    method: str,
    spread: str,
    timeout: float,
    raw: bool,
    fix: Mapping[str, Held | tuple[float, ...]] | None,
) -> Ask:
    """Check a request. Raises RequestError for one that is wrong or provably out of reach."""
    from scenegen.sampling.problem import Budget, pose

    if not isinstance(source, Model):
        check_spec(source, "a Spec or a Model")
    n, seed = whole("n", n), whole("seed", seed)
    if fix is not None and not isinstance(fix, Mapping):
        help_ = 'hold objects by name: fix={"plate": (0.5, 0.5)}'
        raise RequestError(Diagnostic(f"`fix` is {fix!r}", help=help_))
    spec = source.spec if isinstance(source, Model) else source
    method = _method(method, source, raw)
    if not (isinstance(timeout, Real) and math.isfinite(timeout) and timeout > 0):
        raise RequestError(
            Diagnostic(f"the timeout cannot be {_number(timeout)} s", help="give it a positive number of seconds")
        )
    budget = Budget(timeout)
    ranges = _ranges(phi, spec.labels)
    if raw and fix:
        title = "`raw` is a model's own output, and a model does not know of objects that are held"
        raise RequestError(Diagnostic(title, help="leave --raw or --fix out"))
    problem = pose(spec.checked, ranges, n=n, seed=seed, spread=spread, fixed=fix, budget=budget)
    return Ask(problem, method, budget)


def _number(value: object) -> str:
    return f"{value:g}" if isinstance(value, float | int) else repr(value)


def _ranges(phi: object, labels: Sequence[str]) -> dict[str, Range]:
    """The wanted ranges by label. Raises RequestError, also for a lone range where there are several labels."""
    if phi is None:
        return {}
    if isinstance(phi, Mapping):
        return {label: _range(label, ends) for label, ends in phi.items()}
    if len(labels) > 1:
        title = f"this spec has {len(labels)} labels, {quoted(labels)}; of which is phi {phi!r}?"
        raise RequestError(Diagnostic(title, help=f'name it: phi={{"{labels[0]}": (lowest, highest)}}'))
    return {label: _range(label, phi) for label in labels}


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
    """One of METHODS, never auto for a model."""
    if method not in METHODS:
        raise RequestError(
            Diagnostic(f"unknown method `{method}`", help=suggest(method, METHODS, f"one of {', '.join(METHODS)}"))
        )
    if method == "auto" and isinstance(source, Model):
        method = "model"
    if method == "model" and not isinstance(source, Model):
        title = "the method `model` needs a trained model, not a spec"
        raise RequestError(Diagnostic(title, help="name the model file: scenegen sample model.safetensors --phi ..."))
    if raw and method != "model":
        title = "`raw` is a model's own output, and no model takes part here"
        raise RequestError(Diagnostic(title, help="name a model file, or leave --raw out"))
    return method
