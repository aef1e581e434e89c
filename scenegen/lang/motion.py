"""Functions of a step: what an object did since the moment before.

The state that a formula is evaluated on has every object twice: as it stands now, and as it stood at the moment before.
At moment 0 both are the same, so nothing has moved yet.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from scenegen.errors.language import UNIT_OF_ARGUMENT
from scenegen.lang import ast
from scenegen.lang.provenance import Frame
from scenegen.lang.values import AnyValue, FormulaValue, NumberValue, ObjectValue, Value
from scenegen.pose import THETA
from scenegen.primitives.units import ANGLE, BARE, LENGTH, SPEED, TURN_RATE

if TYPE_CHECKING:
    from scenegen.lang.context import Context

EPS_STILL = 0.001  # metres, and radians: what still counts as not having moved

Pose = Sequence[int]  # the nodes of x, y and theta


def step_function(
    lowering: Context, name: str, values: Mapping[str, Value], node: ast.Call, frame: Frame
) -> NumberValue | FormulaValue:
    """A call of a function of a step. Raises SpecError."""
    origin = lowering.origin(node, frame)
    builder, horizon = lowering.builder, lowering.horizon
    assert horizon is not None
    now, before = _poses(lowering, values["a"], f"what `{name}` is about")
    if name == "carried":
        other_now, other_before = _poses(lowering, values["b"], "what carries")
        now, before = _seen_from(lowering, other_now, now), _seen_from(lowering, other_before, before)
    way = builder.apply("dist", (*now[:THETA], *before[:THETA]))
    turned = builder.apply("abs", (builder.apply("wrap", (builder.apply("sub", (now[THETA], before[THETA])),)),))
    shown = f"({', '.join(lowering.text(value) for value in values.values())})"
    if name in ("displacement", "speed", "spin"):
        unit = {"displacement": LENGTH, "speed": SPEED, "spin": TURN_RATE}[name]
        number = turned if name == "spin" else way
        if name != "displacement" and horizon.dt != 1.0:
            number = builder.apply("div", (number, builder.const(horizon.dt)))
        if builder.value(number) is None:
            builder.called.setdefault(number, name + shown)
        return NumberValue(number, unit, origin=origin)
    limit = builder.const(EPS_STILL)
    given = values.get("within") or values.get("by")
    if given is not None:
        number_ = lowering.coerce.number(given, f"the limit of `{name}`")
        if number_.unit not in (BARE, LENGTH):
            raise lowering.error(UNIT_OF_ARGUMENT, node, frame, name=name, wanted="a length", found=number_.unit.words)
        limit = number_.node
    words = f"{name}{shown}"
    if name == "moved":
        words = f"!{words}"
    places = lowering.spans(node, frame)
    stayed = builder.junction(
        "min",
        [
            builder.atom(way, limit, words, LENGTH, places),
            builder.atom(turned, limit, f"{words} (heading)", ANGLE, places),
        ],
        words,
    )
    return FormulaValue(builder.negate(stayed) if name == "moved" else stayed, origin=origin)


def _poses(lowering: Context, value: Value, what: str) -> tuple[Pose, Pose]:
    """The pose of an object now, and at the moment before. Raises SpecError."""
    coerce, builder = lowering.coerce, lowering.builder
    if isinstance(value, AnyValue):
        some = [coerce.number(value, what).node] * 3
        return some, some
    if not isinstance(value, ObjectValue):
        raise coerce.wrong(value, "an object", what)
    axes = range(THETA + 1)
    now = [coerce.coordinate(value.index, axis) for axis in axes]
    held = value.index in coerce.fixed
    return now, now if held else [builder.before(value.index, axis) for axis in axes]


def _seen_from(lowering: Context, frame: Pose, pose: Pose) -> Pose:
    """A pose in the frame of another."""
    apply = lowering.builder.apply
    right, up = (apply("sub", (pose[axis], frame[axis])) for axis in range(THETA))
    cosine, sine = apply("cos", (frame[THETA],)), apply("sin", (frame[THETA],))
    x = apply("add", (apply("mul", (right, cosine)), apply("mul", (up, sine))))
    y = apply("sub", (apply("mul", (up, cosine)), apply("mul", (right, sine))))
    return x, y, apply("sub", (pose[THETA], frame[THETA]))
