"""Objects that a request fixes: `--fix plate=0.5,0.5` completes a given scene."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from scenegen.errors import RequestError, Source, Span
from scenegen.errors.language import MORE_THAN_A_TURN
from scenegen.errors.requests import (
    ALL_HELD,
    HELD_BY_SPEC,
    HELD_OUTSIDE,
    HELD_SYNTAX,
    HELD_TWICE,
    NOT_A_NUMBER,
    NOT_A_POSE,
    UNKNOWN_OBJECT,
)
from scenegen.lang.spec import CheckedSpec
from scenegen.pose import FLAT, PLACE, THETA, TWO_PI, X, Y, row_of, span_of
from scenegen.primitives.units import quantity
from scenegen.sampling.request import FixedPose, number, unit_of
from scenegen.validation import as_list

Array = npt.NDArray[np.float64]

USAGE = "write NAME=X,Y or NAME=X,Y,THETA, for instance plate=0.5,0.5 or plate=50cm,0.5,90deg"
COMPASS = {"EAST": 0, "NORTH": 90, "WEST": 180, "SOUTH": 270}
UNITS = {"m": ("", "m", "cm", "mm"), "rad": ("", "rad", "deg", "turn")}


def parse_fix(options: Sequence[str]) -> dict[str, FixedPose]:
    """The objects of `--fix` options as typed, e.g. ["plate=0.5,0.5"]. Raises RequestError with a caret."""
    found: dict[str, FixedPose] = {}
    for text in options:
        source = Source("fix", text, argument=True)
        name, equals, rest = text.partition("=")
        whole = Span(source, 0, len(text))
        parts = rest.split(",")
        if not equals or not name.strip() or len(parts) not in (len(PLACE), len(FLAT)):
            raise RequestError(HELD_SYNTAX(whole))
        values = []
        start = len(name) + 1
        for place, part in enumerate(parts):
            value = _amount(part, "rad" if place == THETA else "m", Span(source, start, start + len(part)))
            values.append(value)
            start += len(part) + 1
        if name.strip() in found:
            raise RequestError(HELD_TWICE(whole, name=name.strip()))
        found[name.strip()] = FixedPose(values[0], values[1], values[2] if len(values) == len(FLAT) else None, whole)
    return found


def _amount(part: str, base: str, here: Span) -> float:
    """A coordinate in metres, or a heading in radians: a number, with a unit of the language or without. Raises
    RequestError."""
    amount, suffix = unit_of(part)
    value = number(amount)
    if value is None:
        turn = COMPASS.get(part.strip().upper()) if base == "rad" else None
        usage = USAGE if turn is None else f"a heading is a number here: {turn}deg for {part.strip()}"
        raise RequestError(NOT_A_NUMBER(here, text=part, usage=usage))
    if suffix not in UNITS[base]:
        usage = f"it is in {', '.join(UNITS[base][1:])}; {USAGE}"
        raise RequestError(NOT_A_NUMBER(here, text=part, usage=usage))
    if not suffix and base == "rad" and abs(value) > TWO_PI:
        raise RequestError(MORE_THAN_A_TURN(here, amount=value))
    return quantity(amount, suffix)[0]


def hold_fixed(
    spec: CheckedSpec, fixed: Mapping[str, FixedPose | tuple[float, ...]]
) -> tuple[Array, Array, dict[str, tuple[float, ...]]]:
    """The box of poses, (3N,) each, in which the rows of fixed objects have zero width; and the fixed poses, headings
    in [0, 2 pi).

    Raises RequestError for an unknown object, one that the spec already fixes, a place outside the workspace, values
    that are not numbers, and if nothing is left to sample.
    """
    lowest, highest = spec.box()
    for which in spec.fixed:
        row = row_of(which, THETA)
        lowest[row] = highest[row] = _heading(float(lowest[row]))
    known: dict[str, tuple[float, ...]] = {}
    for name, given in fixed.items():
        held = _as_pose(name, given)
        # An object of a category is called after its asset; here its own name stands for whichever it is.
        called = [one for one in spec.objects if one == name or one.startswith(f"{name}:")]
        if not called:
            raise RequestError(UNKNOWN_OBJECT(held.span, name=name, known=spec.objects))
        for which in map(spec.objects.index, called):
            if which in spec.fixed:
                raise RequestError(HELD_BY_SPEC(held.span, name=name))
            x, y = ((float(lowest[row]), float(highest[row])) for row in (row_of(which, X), row_of(which, Y)))
            if not (x[0] <= held.x <= x[1] and y[0] <= held.y <= y[1]):
                box = f"[{x[0]:g}, {x[1]:g}] x [{y[0]:g}, {y[1]:g}]"
                raise RequestError(HELD_OUTSIDE(held.span, name=name, x=held.x, y=held.y, workspace=box))
            pose = (held.x, held.y) if held.theta is None else (held.x, held.y, _heading(held.theta))
            known[spec.objects[which]] = pose
            rows = span_of(which, len(pose))
            lowest[rows] = highest[rows] = pose
    if not (lowest < highest).any():
        raise RequestError(ALL_HELD(consequence="nothing is left to sample"))
    return lowest, highest, known


def _as_pose(name: str, given: object) -> FixedPose:
    if isinstance(given, FixedPose):
        return given
    pose = as_list(given)
    if isinstance(pose, list) and len(pose) in (len(PLACE), len(FLAT)):
        try:
            x, y, *theta = (float(value) for value in pose)
        except (TypeError, ValueError):
            pass
        else:
            if all(map(math.isfinite, (x, y, *theta))):
                return FixedPose(x, y, theta[0] if theta else None)
    raise RequestError(NOT_A_POSE(name=name, value=repr(given)))


def _heading(theta: float) -> float:
    turned = math.remainder(theta, TWO_PI) % TWO_PI
    return 0.0 if turned >= TWO_PI else turned
