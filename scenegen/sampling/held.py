"""Objects that a request holds in place: `--fix plate=0.5,0.5` completes a given scene."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from scenegen.errors import Diagnostic, RequestError, Source, Span, suggest
from scenegen.lang.spec import CheckedSpec
from scenegen.sampling.request import number
from scenegen.scene.workspace import TWO_PI

Array = npt.NDArray[np.float64]

EXAMPLE = "write NAME=X,Y or NAME=X,Y,THETA, for instance plate=0.5,0.5"


@dataclass(frozen=True, slots=True)
class Held:
    """Where an object is held: metres and, if its heading is held too, radians. `span` is where it was typed."""

    x: float
    y: float
    theta: float | None = None
    span: Span | None = field(default=None, compare=False, repr=False)


def parse_fixed(options: Sequence[str]) -> dict[str, Held]:
    """The objects of `--fix` options as typed, e.g. ["plate=0.5,0.5"]. Raises RequestError with a caret."""
    found: dict[str, Held] = {}
    for text in options:
        source = Source("--fix", text)
        name, equals, rest = text.partition("=")
        whole = Span(source, 0, len(text))
        parts = rest.split(",")
        if not equals or not name.strip() or len(parts) not in (2, 3):
            raise RequestError(Diagnostic("an object is held as NAME=X,Y[,THETA]", whole, "", EXAMPLE))
        values = []
        start = len(name) + 1
        for part in parts:
            value = number(part)
            if value is None:
                here = Span(source, start, start + len(part))
                raise RequestError(Diagnostic(f"`{part}` is not a number", here, "", EXAMPLE))
            values.append(value)
            start += len(part) + 1
        if name.strip() in found:
            raise RequestError(Diagnostic(f"`{name.strip()}` is held twice", whole, "", "give one place per object"))
        found[name.strip()] = Held(values[0], values[1], values[2] if len(values) == 3 else None, whole)
    return found


def hold(
    spec: CheckedSpec, fixed: Mapping[str, Held | tuple[float, ...]]
) -> tuple[Array, Array, dict[str, tuple[float, ...]]]:
    """The box of poses, (3N,) each, with the rows of held objects closed; and the held poses, headings in [0, 2 pi).

    Raises RequestError for an unknown object, one that the spec holds already, a place outside the workspace, numbers
    that are none, and where nothing is left to sample.
    """
    lowest, highest = spec.box()
    for which in spec.fixed:
        lowest[3 * which + 2] = highest[3 * which + 2] = _heading(float(lowest[3 * which + 2]))
    known: dict[str, tuple[float, ...]] = {}
    for name, given in fixed.items():
        held = _as_held(name, given)
        if name not in spec.objects:
            otherwise = f"the spec has {', '.join(spec.objects[:8])}"
            title = f"the spec has no object `{name}`"
            raise RequestError(Diagnostic(title, held.span, "", suggest(name, spec.objects, otherwise)))
        which = spec.objects.index(name)
        if which in spec.fixed:
            title = f"`{name}` is held in place by the spec already"
            raise RequestError(Diagnostic(title, held.span, "", f"leave it out, or take the `at` of `{name}` away"))
        x, y = spec.workspace.x, spec.workspace.y
        if not (x[0] <= held.x <= x[1] and y[0] <= held.y <= y[1]):
            title = f"`{name}` cannot be held at ({held.x:g}, {held.y:g}): that is outside the workspace"
            help_ = f"the workspace is [{x[0]:g}, {x[1]:g}] x [{y[0]:g}, {y[1]:g}]"
            raise RequestError(Diagnostic(title, held.span, "", help_))
        pose = (held.x, held.y) if held.theta is None else (held.x, held.y, _heading(held.theta))
        known[name] = pose
        lowest[3 * which : 3 * which + len(pose)] = highest[3 * which : 3 * which + len(pose)] = pose
    if not (lowest < highest).any():
        raise RequestError(Diagnostic("every object is held in place: nothing is left to sample", help="free one"))
    return lowest, highest, known


def _as_held(name: str, given: object) -> Held:
    if isinstance(given, Held):
        return given
    if isinstance(given, tuple | list) and len(given) in (2, 3):
        try:
            x, y, *theta = (float(value) for value in given)
        except (TypeError, ValueError):
            pass
        else:
            if all(map(math.isfinite, (x, y, *theta))):
                return Held(x, y, theta[0] if theta else None)
    help_ = "write (x, y) or (x, y, theta), in metres and radians"
    raise RequestError(Diagnostic(f"`{name}` is held at {given!r}", help=help_))


def _heading(theta: float) -> float:
    turned = math.remainder(theta, TWO_PI) % TWO_PI
    return 0.0 if turned >= TWO_PI else turned
