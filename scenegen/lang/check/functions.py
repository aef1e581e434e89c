"""What the language brings along: axes, primitives, functions over lists and of steps, and the words of time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Literal

from scenegen.errors import Source, Span, SpecError
from scenegen.errors.declarations import MEASURED_TOO_EARLY, STANDS_ELSEWHERE
from scenegen.errors.language import (
    HORIZON_OUT_OF_RANGE,
    MIXED_LIST,
    NOT_WHOLE_STEPS,
    SAME_ARGUMENT_TWICE,
    TIME_UNFINISHED,
    TOO_FEW_ELEMENTS,
    WINDOW_CUT,
    WRONG_NUMBER_OF_ARGUMENTS,
    WRONG_UNIT,
    WRONG_WINDOW,
)
from scenegen.geometry import PRIMITIVES, Footprint
from scenegen.geometry.primitives import ANGLE, BARE, LENGTH, SPEED, TIME, TURN_RATE, Unit
from scenegen.lang.check.heights import of_options
from scenegen.lang.check.values import (
    MAX_ECHO_LENGTH,
    AnyValue,
    CallFrame,
    ChosenValue,
    FormulaValue,
    ListValue,
    NeighboursValue,
    NumberValue,
    ObjectValue,
    PointValue,
    RegionValue,
    SurfaceValue,
    Value,
    key_of,
)
from scenegen.lang.formula.timed import MAX_TIME_STEPS, Horizon, Movers
from scenegen.lang.spec import Support, options_of
from scenegen.lang.syntax import ast
from scenegen.lang.syntax.printer import print_expr
from scenegen.pose import NAMES, THETA

if TYPE_CHECKING:
    from scenegen.lang.check.lowering import Lowering


def list_function(lowering: Lowering, name: str, value: Value, node: ast.Call, frame: CallFrame) -> Value:
    """A call of `consecutive` or `gaps` over a list. Raises SpecError."""
    origin = lowering.origin(node, frame)
    if isinstance(value, AnyValue):
        return AnyValue(origin=origin)
    items = lowering.coerce.items(value, f"the argument of `{name}`")
    if name == "consecutive":
        return NeighboursValue(items, origin=origin)
    key = (name, key_of(value))
    if key not in lowering.expansions:  # a quantifier over the gaps may ask for them in each of its rounds
        pairs = [function(lowering, "gap", [first, second], node, frame) for first, second in pairwise(items)]
        lowering.expansions[key] = (ListValue(tuple(pairs), origin=origin), [value])
    return lowering.expansions[key][0].with_origin(origin)


def join_lists(lowering: Lowering, values: list[Value], node: ast.Binary, frame: CallFrame) -> Value | None:
    """The two lists on the sides of a `+` as one; None where neither is a list. Raises SpecError."""
    if not any(isinstance(value, ListValue) for value in values):
        return None
    origin = lowering.origin(node, frame)
    for value, part in zip(values, (node.left, node.right), strict=True):
        if not isinstance(value, ListValue | AnyValue):
            written = value.origin.text
            single = isinstance(value, ObjectValue | PointValue) and len(written) <= MAX_ECHO_LENGTH
            raise lowering.error(MIXED_LIST, part, frame, found=value.kind, single=written if single else None)
    if any(isinstance(value, AnyValue) for value in values):
        return AnyValue(origin=origin)
    key = ("+", *map(key_of, values))
    if key not in lowering.expansions:
        items = tuple(item for value in values for item in lowering.coerce.items(value, ""))
        lowering.spend(len(items), frame)
        lowering.expansions[key] = (ListValue(items, origin=origin), values)
    return lowering.expansions[key][0].with_origin(origin)


def function(lowering: Lowering, name: str, values: list[Value], node: ast.Call, frame: CallFrame) -> NumberValue:
    """A call of an axis or a primitive: the number it is, of arguments whose kinds and units fit. Raises SpecError."""
    origin = lowering.origin(node, frame)
    what = f"an argument of `{name}`"
    if name in NAMES:
        (value,) = values
        axis = NAMES.index(name)
        if isinstance(value, ChosenValue) and axis != THETA:
            return of_options(lowering, value, lambda one: function(lowering, name, [one], node, frame))
        if axis == THETA:
            return NumberValue(lowering.coerce.heading(value, what), ANGLE, origin=origin)
        return NumberValue(lowering.coerce.place(value, what)[axis], LENGTH, origin=origin)
    primitive = PRIMITIVES[name]
    if primitive.variadic:
        values = _spread(lowering, name, values, node, frame)
    params = primitive.params * len(values) if primitive.variadic else primitive.params
    units: list[Unit] = []
    args: list[int] = []
    shapes: list[Footprint] = []
    for at, (kind, value) in enumerate(zip(params, values, strict=True)):
        if isinstance(value, ChosenValue) and kind != "number":
            return _of_options(lowering, name, values, at, node, frame)
        if kind == "number":
            number = lowering.coerce.number(value, what)
            if primitive.of_angle:  # a bare number is in radians
                lowering.refuse_degrees([number, NumberValue(number.node, ANGLE, origin=number.origin)])
            units.append(number.unit)
            args.append(number.node)
            continue
        units.append(LENGTH)
        if kind == "place":
            args.extend(lowering.coerce.place(value, what))
        else:
            footprint, pose = lowering.coerce.footprint(value, what)
            shapes.append(footprint)
            args.extend(pose)
    if len(shapes) == 2 and values[0] == values[1] and not isinstance(values[0], AnyValue):
        raise lowering.error(SAME_ARGUMENT_TWICE, node, frame, name=name)
    return lowering.apply(name, units, args, tuple(shapes), node, frame)


def _of_options(
    lowering: Lowering, name: str, values: list[Value], at: int, node: ast.Call, frame: CallFrame
) -> NumberValue:
    """A call of a primitive, one of whose arguments is what a choice picks."""
    chosen = values[at]
    assert isinstance(chosen, ChosenValue)
    rest = values[:at], values[at + 1 :]
    return of_options(lowering, chosen, lambda one: function(lowering, name, [*rest[0], one, *rest[1]], node, frame))


def _spread(lowering: Lowering, name: str, values: list[Value], node: ast.Call, frame: CallFrame) -> list[Value]:
    """The arguments of min, max, sum and mean: two or more numbers, or a list of them."""
    if len(values) == 1 and isinstance(values[0], NumberValue):
        raise lowering.error(WRONG_NUMBER_OF_ARGUMENTS, node, frame, name=name, one=True)
    spread = [item for value in values for item in (value.items if isinstance(value, ListValue) else (value,))]
    if not spread:
        raise lowering.error(TOO_FEW_ELEMENTS, node, frame, needs=f"`{name}` needs numbers")
    return spread


# Functions of a step: what an object did since the moment before.
#
# The state that a formula is evaluated on has every object twice: as it stands now, and as it stood at the moment
# before. At moment 0 both are the same, so nothing has moved yet.


EPS_STILL = 0.001  # metres, and radians: what still counts as not having moved

Pose = Sequence[int]  # the nodes of x, y and theta


def step_function(
    lowering: Lowering, name: str, values: Mapping[str, Value], node: ast.Call, frame: CallFrame
) -> NumberValue | FormulaValue:
    """A call of a function of a step. Raises SpecError."""
    origin = lowering.origin(node, frame)
    builder, horizon = lowering.builder, lowering.horizon
    if horizon is None:  # in the `time` statement itself
        raise lowering.error(MEASURED_TOO_EARLY, node, frame)
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
            raise lowering.error(WRONG_UNIT, node, frame, name=name, wanted="a length", found=number_.unit.words)
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


def _poses(lowering: Lowering, value: Value, what: str) -> tuple[Pose, Pose]:
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
    return now, now if held else [builder.previous_coord(value.index, axis) for axis in axes]


def _seen_from(lowering: Lowering, frame: Pose, pose: Pose) -> Pose:
    """A pose in the frame of another."""
    apply = lowering.builder.apply
    right, up = (apply("sub", (pose[axis], frame[axis])) for axis in range(THETA))
    cosine, sine = apply("cos", (frame[THETA],)), apply("sin", (frame[THETA],))
    x = apply("add", (apply("mul", (right, cosine)), apply("mul", (up, sine))))
    y = apply("sub", (apply("mul", (up, cosine)), apply("mul", (right, sine))))
    return x, y, apply("sub", (pose[THETA], frame[THETA]))


OF_SUPPORT = ("restsOn", "insideOf")  # relations of the prelude: a on or in b


def note_elsewhere(
    lowering: Lowering, name: str, values: Mapping[str, Value], node: ast.Call, frame: CallFrame
) -> None:
    """Notices a call of one of OF_SUPPORT that holds in no scene, since its first argument stands elsewhere. In
    rounds of quantifiers that is no mistake."""
    upper, lower = values["a"], values["b"]
    if frame.where or lowering.heights is None or not isinstance(upper, ObjectValue):
        return
    options = [*options_of(upper.index, lowering.supports, lowering.choices)]
    stands = [one.name for one in options] or ["workspace"]
    if name == "insideOf":  # what is in a bowl in a drawer is in the drawer
        for one in options:
            more = () if one.carrier is None else options_of(one.carrier, lowering.supports, lowering.choices)
            options.extend(other for other in more if other not in options)
    match lower:
        case ObjectValue(carrier):
            written, meant = lowering.builder.objects[carrier], any(one.carrier == carrier for one in options)
        case SurfaceValue():
            written = lowering.text(lower)
            meant = any(one.name == written for one in options)
        case RegionValue(written, area):
            levels = [_height_of(lowering, one) for one in options] or [0.0]
            meant = any(level is None or level == area.z for level in levels)
        case _:
            return
    if meant or (isinstance(lower, ObjectValue) and lower.index == upper.index):
        return
    called = lowering.builder.objects[upper.index]
    spans = lowering.spans(node, frame)
    plain = "[" not in called and called in lowering.scope.objects
    example = f"object {called} on any of [{', '.join((*stands, written))}]" if plain else None
    problem = STANDS_ELSEWHERE(
        spans[0],
        name=called,
        relation=name,
        lower=written,
        stands=["the table" if one == "workspace" else one for one in stands],
        example=example,
    )
    if problem not in lowering.noticed:
        lowering.noticed.append(problem)


def _height_of(lowering: Lowering, under: Support) -> float | None:
    assert lowering.heights is not None
    below = 0.0 if under.carrier is None else lowering.heights[under.carrier]
    return None if below is None else below + under.height


def find_remedy(lowering: Lowering, here: Span) -> str | None:
    """What to do about a requirement at some part of the text that asks for such a thing; None where it does not."""
    for one in lowering.noticed:
        if one.kind is not STANDS_ELSEWHERE or one.span is None or one.facts["example"] is None:
            continue
        if one.span.source is here.source and here.start <= one.span.start and one.span.end <= here.end:
            return f"let it stand there: {one.facts['example']}"
    return None


STEP_TOLERANCE = 1e-9  # steps by which a time may miss a whole number of them: 0.3 s / 0.1 s is not 3 in floating point


def horizon(lowering: Lowering, source: Source, statement: ast.Time) -> Horizon:
    """What a `time` statement says. Raises SpecError."""
    frame = CallFrame(source)
    here = statement.span(source)
    if statement.span_ is None:
        word = statement.word
        if word is not None and word.id != "steps":
            raise SpecError(TIME_UNFINISHED(word.span(source), name=word.id, known=["steps"]))
        given = lowering.evaluate(statement.amount, frame)
        amount = lowering.constant(given, statement.amount, frame, "the number of steps", BARE)
        if not 1 <= amount <= MAX_TIME_STEPS:
            raise SpecError(HORIZON_OUT_OF_RANGE(here, steps=amount, limit=MAX_TIME_STEPS))
        if amount != round(amount):
            raise SpecError(NOT_WHOLE_STEPS(here, amount=amount, unit="", mended=f"time {round(amount)} steps"))
        return Horizon(round(amount), 1.0)
    ends = []
    for end in (statement.span_.lowest, statement.span_.highest, statement.amount):
        more: dict[str, Any] = {"what": "time", "wanted": "seconds"}
        ends.append(lowering.constant(lowering.evaluate(end, frame), end, frame, "a time", BARE, TIME, **more))
    start, stop, step = ends
    if start != 0.0:
        raise SpecError(HORIZON_OUT_OF_RANGE(statement.span_.span(source), start=start, length=max(stop, 1.0)))
    if step <= 0.0:
        such = stop / 20.0 if stop > 0.0 else 0.5
        raise SpecError(HORIZON_OUT_OF_RANGE(statement.amount.span(source), length=step, such=such))
    steps = stop / step
    if not 1.0 - STEP_TOLERANCE <= steps <= MAX_TIME_STEPS + STEP_TOLERANCE:
        raise SpecError(HORIZON_OUT_OF_RANGE(here, steps=steps, limit=MAX_TIME_STEPS))
    if abs(steps - round(steps)) > STEP_TOLERANCE * steps:
        mended = f"time [0, {round(steps) * step:g} s] every {step:g} s"
        raise SpecError(NOT_WHOLE_STEPS(here, amount=stop, unit=" s", dt=step, mended=mended))
    return Horizon(round(steps), step)


def movers(source: Source, statement: ast.Moves) -> Movers:
    """What a `moves` statement says. Raises SpecError."""
    match statement.which.id:
        case "one":
            return "one"
        case "all":
            return "all"
        case other:
            raise SpecError(
                TIME_UNFINISHED(statement.which.span(source), name=other, known=["one", "all"], movers=True)
            )


def temporal(
    lowering: Lowering, node: ast.Temporal | ast.Until, env: Mapping[str, Value], frame: CallFrame
) -> FormulaValue:
    """A formula over later moments. Raises SpecError."""
    operator = node.operator
    lowest, highest = _window(lowering, node, env, frame)
    parts = []
    for part in (node.value,) if isinstance(node, ast.Temporal) else (node.left, node.right):
        value = lowering.lower(part, env, frame)
        words = f"what `{operator}` is about" if isinstance(node, ast.Temporal) else f"each side of `{operator}`"
        parts.append(lowering.coerce.formula(value, words))
    builder = lowering.builder
    name = operator if node.window is None else f"{operator}[{lowest}, {highest}]"
    text = frame.text if node is frame.body else name
    if isinstance(node, ast.Until):
        made = builder.until("max", parts[0], parts[1], lowest, highest, operator == "until_with", text)
    elif node.operator in ("initially", "finally"):
        which: Literal["first", "last"] = "first" if node.operator == "initially" else "last"
        made = builder.moment(which, parts[0], text)
    else:
        made = builder.window("min" if operator == "always" else "max", parts[0], lowest, highest, text)
    return FormulaValue(made, origin=lowering.origin(node, frame))


def _window(
    lowering: Lowering, node: ast.Temporal | ast.Until, env: Mapping[str, Value], frame: CallFrame
) -> tuple[int, int]:
    """The window of an operator in steps from now, cut at the horizon. Raises SpecError."""
    steps = lowering.horizon.steps if lowering.horizon is not None else 1
    if node.operator == "next":
        return 1, 1
    if node.window is None:
        return 0, steps
    ends = []
    for end in (node.window.lowest, node.window.highest):
        value = lowering.lower(end, env, frame)
        number = lowering.coerce.number(value, "an end of a window")
        ends.append(_moment(lowering, number, end, frame))
    lowest, highest = ends
    if lowest > highest:
        low, high = print_expr(node.window.highest), print_expr(node.window.lowest)
        raise lowering.error(WRONG_WINDOW, node.window, frame, swapped=f"[{low}, {high}]")
    if lowest < 0:
        raise lowering.error(WRONG_WINDOW, node.window, frame, operator=node.operator)
    if lowest > steps:
        raise lowering.error(WRONG_WINDOW, node.window, frame, lowest=lowest, steps=steps)
    if highest > steps:
        (problem,) = lowering.error(WINDOW_CUT, node.window, frame, highest=highest, steps=steps).diagnostics
        if problem not in lowering.noticed:
            lowering.noticed.append(problem)
    return lowest, min(highest, steps)


def _moment(lowering: Lowering, number: NumberValue, expr: ast.Expr, frame: CallFrame) -> int:
    """An end of a window in steps: a bare number is one of steps, a time as many as pass in it. Raises SpecError."""
    more: dict[str, Any] = {"what": "a window", "wanted": "steps or seconds"}
    amount, unit = lowering.constant(number, expr, frame, "an end of a window", BARE, TIME, **more), number.unit
    assert lowering.horizon is not None
    dt = lowering.horizon.dt
    steps = amount if unit == BARE else amount / dt
    if abs(steps - round(steps)) > STEP_TOLERANCE * max(1.0, abs(steps)):
        more = {"unit": "", "mended": f"{round(steps)}"}
        if unit == TIME:
            more = {"unit": " s", "dt": dt, "mended": f"{round(steps) * dt:g} s"}
        raise lowering.error(NOT_WHOLE_STEPS, expr, frame, amount=amount, **more)
    return round(steps)
