"""Formulas over time: horizons and windows, and the operators that look at later moments."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Literal

from scenegen.errors import Source, SpecError
from scenegen.errors.language import NOT_A_PLAIN_NUMBER, NOT_CONSTANT
from scenegen.errors.time import (
    EMPTY_WINDOW,
    HORIZON_OUT_OF_RANGE,
    NOT_A_TIME,
    NOT_FROM_ZERO,
    NOT_WHOLE_STEPS,
    UNKNOWN_MOVERS,
    UNKNOWN_TIME_WORD,
    WINDOW_BEYOND,
    WINDOW_CUT,
    WINDOW_IN_THE_PAST,
)
from scenegen.geometry.units import BARE, TIME
from scenegen.lang.check.values import CallFrame, FormulaValue, NumberValue, Value
from scenegen.lang.formula.timed import MAX_STEPS, Horizon, Movers
from scenegen.lang.syntax import ast
from scenegen.lang.syntax.pieces import print_expr

if TYPE_CHECKING:
    from scenegen.lang.check.lower import Lowering

NEARLY = 1e-9  # steps by which a time may miss a whole number of them: 0.3 s / 0.1 s is not 3 in floating point


def horizon(lowering: Lowering, source: Source, statement: ast.Time) -> Horizon:
    """What a `time` statement says. Raises SpecError."""
    frame = CallFrame(source)
    here = statement.span(source)
    if statement.span_ is None:
        word = statement.word
        if word is not None and word.id != "steps":
            raise SpecError(UNKNOWN_TIME_WORD(word.span(source), name=word.id, known=["steps"]))
        amount, unit = _constant(lowering, statement.amount, frame, "the number of steps")
        if unit != BARE:
            here = statement.amount.span(source)
            raise SpecError(NOT_A_PLAIN_NUMBER(here, what="the number of steps", found=unit.words))
        if not 1 <= amount <= MAX_STEPS:
            raise SpecError(HORIZON_OUT_OF_RANGE(here, steps=amount, limit=MAX_STEPS))
        if amount != round(amount):
            raise SpecError(NOT_WHOLE_STEPS(here, amount=amount, unit="", mended=f"time {round(amount)} steps"))
        return Horizon(round(amount), 1.0)
    ends = []
    for end in (statement.span_.lowest, statement.span_.highest, statement.amount):
        amount, unit = _constant(lowering, end, frame, "a time")
        if unit not in (BARE, TIME):
            raise SpecError(NOT_A_TIME(end.span(source), what="time", wanted="seconds", found=unit.words))
        ends.append(amount)
    start, stop, step = ends
    if start != 0.0:
        raise SpecError(NOT_FROM_ZERO(statement.span_.span(source), start=start, length=max(stop, 1.0)))
    if step <= 0.0:
        such = stop / 20.0 if stop > 0.0 else 0.5
        raise SpecError(HORIZON_OUT_OF_RANGE(statement.amount.span(source), length=step, such=such))
    steps = stop / step
    if not 1.0 - NEARLY <= steps <= MAX_STEPS + NEARLY:
        raise SpecError(HORIZON_OUT_OF_RANGE(here, steps=steps, limit=MAX_STEPS))
    if abs(steps - round(steps)) > NEARLY * steps:
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
            raise SpecError(UNKNOWN_MOVERS(statement.which.span(source), name=other, known=["one", "all"]))


def _constant(lowering: Lowering, expr: ast.Expr, frame: CallFrame, what: str) -> tuple[float, Any]:
    value = lowering.evaluate(expr, frame)
    return _amount(lowering, lowering.coerce.number(value, what), expr, frame, what)


def _amount(lowering: Lowering, number: NumberValue, expr: ast.Expr, frame: CallFrame, what: str) -> tuple[float, Any]:
    amount = lowering.builder.value(number.node)
    if amount is None:
        raise lowering.error(NOT_CONSTANT, expr, frame, what=what)
    return amount, number.unit


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
        raise lowering.error(EMPTY_WINDOW, node.window, frame, swapped=f"[{low}, {high}]")
    if lowest < 0:
        raise lowering.error(WINDOW_IN_THE_PAST, node.window, frame, operator=node.operator)
    if lowest > steps:
        raise lowering.error(WINDOW_BEYOND, node.window, frame, lowest=lowest, steps=steps)
    if highest > steps:
        (problem,) = lowering.error(WINDOW_CUT, node.window, frame, highest=highest, steps=steps).diagnostics
        if problem not in lowering.noticed:
            lowering.noticed.append(problem)
    return lowest, min(highest, steps)


def _moment(lowering: Lowering, number: NumberValue, expr: ast.Expr, frame: CallFrame) -> int:
    """An end of a window in steps: a bare number is one of steps, a time as many as pass in it. Raises SpecError."""
    amount, unit = _amount(lowering, number, expr, frame, "an end of a window")
    if unit not in (BARE, TIME):
        raise lowering.error(NOT_A_TIME, expr, frame, what="a window", wanted="steps or seconds", found=unit.words)
    assert lowering.horizon is not None
    dt = lowering.horizon.dt
    steps = amount if unit == BARE else amount / dt
    if abs(steps - round(steps)) > NEARLY * max(1.0, abs(steps)):
        more: dict[str, Any] = {"unit": "", "mended": f"{round(steps)}"}
        if unit == TIME:
            more = {"unit": " s", "dt": dt, "mended": f"{round(steps) * dt:g} s"}
        raise lowering.error(NOT_WHOLE_STEPS, expr, frame, amount=amount, **more)
    return round(steps)
