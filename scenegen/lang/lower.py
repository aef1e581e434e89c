"""Expanding formulas: syntax tree -> core formula, with kinds and units checked on the way.

Definitions are expanded where they are called, each once for the same arguments. Every value remembers where the user
wrote it, so a mistake that shows deep inside the prelude is reported at the argument that caused it.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from itertools import pairwise
from typing import Any

from scenegen.errors import Diagnostic, Source, Span, SpecError, suggest
from scenegen.lang import ast
from scenegen.lang.builder import FALSE, TRUE, CoreBuilder
from scenegen.lang.describe import describe
from scenegen.lang.resolve import bind
from scenegen.lang.scope import Declared, Scope
from scenegen.lang.trampoline import Call
from scenegen.lang.values import (
    AnyValue,
    FormulaValue,
    NumberValue,
    ObjectValue,
    PointValue,
    Value,
    wrong_kind,
)
from scenegen.primitives import PRIMITIVES, UnitMismatch
from scenegen.primitives.units import ANGLE, BARE, LENGTH, Unit, agree, quantity
from scenegen.scene.workspace import AXES, TWO_PI

Environment = Mapping[str, Value]

MOST_CALLS = 32  # how far outwards the blame goes: definitions may call each other thousands deep
_ANY = 0.7320508  # any number: one that no body of a definition is likely to turn into a division by zero
_UNITS_HELP = "lengths are in m, cm or mm; angles in rad, deg or turn"


@dataclasses.dataclass(frozen=True, slots=True)
class Frame:
    """Where expansion is: the source of the text at hand, and the calls that led here, innermost first.

    `text` is the call being expanded, `body` the definition's formula; both are unset outside definitions.
    """

    source: Source
    calls: tuple[Span, ...] = ()
    text: str = ""
    body: ast.Expr | None = None


class Lowering:
    """Expands the expressions of one spec into one builder."""

    def __init__(self, scope: Scope, builder: CoreBuilder) -> None:
        self.scope = scope
        self.builder = builder
        self.used: set[str] = set()  # definitions that some formula expanded
        self._expansions: dict[object, Value] = {}
        self._globals: dict[str, Value] = {}

    # ---- where to put the blame

    def _spans(self, node: ast.Node, frame: Frame) -> tuple[Span, ...]:
        """The user's places for a node, innermost first: the prelude's own lines are of no help to anybody."""
        spans = (node.span(frame.source), *frame.calls)
        own = tuple(span for span in spans if span.source is not self.scope.prelude)
        return (own or spans)[:MOST_CALLS]

    def _error(self, title: str, node: ast.Node, frame: Frame, label: str = "", help: str = "") -> SpecError:
        spans = self._spans(node, frame)
        note = f"in the expansion of `{frame.text}`" if frame.text else ""
        if len(spans) > 1:
            note += f", called at {spans[1].place}"
        return SpecError(Diagnostic(title, spans[0], label, help, note=note))

    # ---- kinds

    def _wrong_kind(self, value: Value, wanted: str, place: str) -> SpecError:
        name = value.origin.text
        if not (self.scope.inferred and isinstance(value, ObjectValue) and name in self.scope.objects):
            return wrong_kind(value, wanted, place)
        # Nobody declared it: it was taken for an object only because nothing else is called so.
        signature = self.scope.signature(name)
        if signature is not None:
            return SpecError(Diagnostic(f"`{name}` needs its arguments", value.origin, "", f"write {signature.usage}"))
        known = self.scope.constants if wanted == "a number" else {**self.scope.labels, **self.scope.definitions}
        close = suggest(name, known)
        if close:
            return SpecError(Diagnostic(f"unknown name `{name}`", value.origin, f"{wanted} is needed here", close))
        (problem,) = wrong_kind(value, wanted, place).diagnostics
        if place == "what `-` works on" and not value.role:
            help_ = f"{problem.help};\nif `-` is part of a name, write `_` instead"
            problem = dataclasses.replace(problem, help=help_)
        label = "taken for an object: nothing else is called so"
        return SpecError(dataclasses.replace(problem, label=label))

    def formula(self, value: Value, place: str) -> int:
        if isinstance(value, FormulaValue):
            return value.node
        if isinstance(value, AnyValue):
            return TRUE
        raise self._wrong_kind(value, "a formula", place)

    def number(self, value: Value, place: str) -> NumberValue:
        if isinstance(value, NumberValue):
            return value
        if isinstance(value, AnyValue):
            return NumberValue(self.builder.const(_ANY), origin=value.origin)
        raise self._wrong_kind(value, "a number", place)

    def place(self, value: Value, place: str) -> tuple[int, int]:
        """x and y of an object or a point."""
        if isinstance(value, ObjectValue):
            return self.builder.coord(value.index, 0), self.builder.coord(value.index, 1)
        if isinstance(value, PointValue):
            return value.x, value.y
        if isinstance(value, AnyValue):
            return self.builder.const(_ANY), self.builder.const(_ANY)
        raise self._wrong_kind(value, "an object or a point", place)

    # ---- expressions

    def lower(self, node: ast.Expr, env: Environment, frame: Frame) -> Call[Value]:
        """The value of an expression, as a call for `trampoline.run`. Raises SpecError."""
        origin = self._spans(node, frame)[0]
        match node:
            case ast.Name():
                value: Value = yield self._name(node, env, frame)
                return value
            case ast.Quantity(number, suffix):
                amount, unit = quantity(number, suffix)
                if not math.isfinite(amount):
                    raise self._error("this number is too large", node, frame)
                return NumberValue(self.builder.const(amount), unit, origin=origin)
            case ast.Truth(truth):
                return FormulaValue(TRUE if truth else FALSE, origin=origin)
            case ast.Point(coordinates):
                point: Value = yield self._point(node, coordinates, env, frame)
                return point
            case ast.Negative() | ast.Binary():
                result: Value = yield self._arithmetic(node, env, frame)
                return result
            case ast.Compare():
                compared: Value = yield self._compare(node, env, frame)
                return compared
            case ast.Not(inner):
                value = yield self.lower(inner, env, frame)
                turned = self.builder.negate(self.formula(value, "what `!` negates"))
                return FormulaValue(turned, origin=origin)
            case ast.And(parts) | ast.Or(parts):
                symbol = "&" if isinstance(node, ast.And) else "|"
                formulas = []
                for part in parts:
                    value = yield self.lower(part, env, frame)
                    formulas.append(self.formula(value, f"each side of `{symbol}`"))
                text = frame.text if node is frame.body else ""
                kind: Any = "min" if isinstance(node, ast.And) else "max"
                return FormulaValue(self.builder.junction(kind, formulas, text), origin=origin)
            case ast.Implies(condition, consequence):
                before = yield self.lower(condition, env, frame)
                after = yield self.lower(consequence, env, frame)
                sides = [
                    self.builder.negate(self.formula(before, "what stands before `->`")),
                    self.formula(after, "what stands after `->`"),
                ]
                text = frame.text if node is frame.body else ""
                return FormulaValue(self.builder.junction("max", sides, text), origin=origin)
            case ast.Call():
                called: Value = yield self._call(node, env, frame)
                return called
        raise AssertionError(f"the resolver let {type(node).__name__} pass")

    def _name(self, node: ast.Name, env: Environment, frame: Frame) -> Call[Value]:
        if node.id in env:
            return env[node.id]
        origin = self._spans(node, frame)[0]
        if node.id in self.scope.objects:
            return ObjectValue(self.scope.objects[node.id], origin=origin)
        if node.id not in self._globals:
            declared = self.scope.constants.get(node.id) or self.scope.labels[node.id]
            (expr,) = ast.expressions(declared.statement)
            value: Value = yield self.lower(expr, {}, Frame(declared.source))
            if isinstance(declared.statement, ast.Label):
                self.formula(value, f"`{node.id}`")
            self._globals[node.id] = value
        # The value is the constant's, the place to blame is where the name was used.
        return dataclasses.replace(self._globals[node.id], origin=origin)

    def _point(self, node: ast.Point, coordinates: tuple[ast.Expr, ...], env: Environment, frame: Frame) -> Call[Value]:
        if len(coordinates) != 2:
            raise self._error("a point has two coordinates, x and y", node, frame, f"{len(coordinates)} given")
        numbers = []
        for coordinate in coordinates:
            value = yield self.lower(coordinate, env, frame)
            number = self.number(value, "a coordinate")
            self._agree(node, frame, "used as", number.unit, LENGTH)
            numbers.append(number.node)
        return PointValue(*numbers, origin=self._spans(node, frame)[0])

    def _arithmetic(self, node: ast.Negative | ast.Binary, env: Environment, frame: Frame) -> Call[Value]:
        parts = [node.value] if isinstance(node, ast.Negative) else [node.left, node.right]
        symbol = "-" if isinstance(node, ast.Negative) else node.operator
        numbers = []
        for part in parts:
            value = yield self.lower(part, env, frame)
            numbers.append(self.number(value, f"what `{symbol}` works on"))
        if symbol in ("+", "-"):
            self._refuse_degrees(numbers)
        name = "neg" if len(parts) == 1 else {"+": "add", "-": "sub", "*": "mul", "/": "div"}[symbol]
        if name == "div":
            divisor = self.builder.value(numbers[1].node)
            if divisor is None:
                help_ = "multiply both sides of the comparison by it instead"
                raise self._error("only a constant can divide", parts[1], frame, "this depends on the scene", help_)
            if divisor == 0.0:
                raise self._error("division by zero", parts[1], frame)
        return self._apply(name, numbers, [number.node for number in numbers], node, frame)

    def _apply(
        self, name: str, numbers: list[NumberValue], args: list[int], node: ast.Node, frame: Frame
    ) -> NumberValue:
        units = [number.unit for number in numbers] or [LENGTH] * len(PRIMITIVES[name].params)
        try:
            unit = PRIMITIVES[name].unit(*units)
            result = self.builder.apply(name, args)
        except UnitMismatch as mismatch:
            if len(numbers) == 1:
                title = f"`{name}` takes {mismatch.right.words}, not {mismatch.left.words}"
                raise self._error(title, node, frame, help=_UNITS_HELP) from None
            raise self._mismatch(mismatch, "combined with", node, frame) from None
        except OverflowError:
            raise self._error("this number is too large", node, frame) from None
        return NumberValue(result, unit, origin=self._spans(node, frame)[0])

    def _mismatch(self, mismatch: UnitMismatch, verb: str, node: ast.Node, frame: Frame) -> SpecError:
        title = f"{mismatch.left.words} is {verb} {mismatch.right.words}"
        return self._error(title, node, frame, help=_UNITS_HELP)

    def _refuse_degrees(self, numbers: list[NumberValue]) -> None:
        """A bare number beside an angle counts in radians; one beyond a turn was meant in degrees."""
        if not any(number.unit == ANGLE for number in numbers):
            return
        for number in numbers:
            amount = self.builder.value(number.node) if number.unit == BARE else None
            if amount is not None and abs(amount) > TWO_PI:
                title = f"{amount:g} radians are more than a turn"
                help_ = f"write {amount:g} deg, or {amount:g} rad if you mean it"
                raise SpecError(Diagnostic(title, number.origin, "a bare number beside an angle is in radians", help_))

    def _agree(self, node: ast.Node, frame: Frame, verb: str, *units: Unit) -> Unit:
        try:
            return agree(*units)
        except UnitMismatch as mismatch:
            raise self._mismatch(mismatch, verb, node, frame) from None

    def _compare(self, node: ast.Compare, env: Environment, frame: Frame) -> Call[Value]:
        numbers: list[NumberValue] = []
        for operand in node.operands:
            value = yield self.lower(operand, env, frame)
            numbers.append(self.number(value, "each side of a comparison"))
        self._refuse_degrees(numbers)
        atoms = []
        spans = self._spans(node, frame)
        named = frame.text if node is frame.body else ""
        for (left, right), operator in zip(pairwise(numbers), node.operators, strict=True):
            unit = self._agree(node, frame, "compared with", left.unit, right.unit)
            low, high = (left.node, right.node) if operator == "<=" else (right.node, left.node)
            sides = [describe(self.builder.nodes, self.builder.objects, side.node) for side in (left, right)]
            try:
                atoms.append(self.builder.atom(low, high, named or f" {operator} ".join(sides), unit, spans))
            except OverflowError:
                raise self._error("this number is too large", node, frame) from None
        return FormulaValue(self.builder.junction("min", atoms), origin=spans[0])

    # ---- calls

    def _call(self, node: ast.Call, env: Environment, frame: Frame) -> Call[Value]:
        name = node.function.id
        signature = self.scope.signature(name)
        assert signature is not None
        given = bind(node, signature, frame.source)
        assert isinstance(given, dict)
        values: dict[str, Value] = {}
        for parameter, argument in given.items():
            value = yield self.lower(argument, env, frame)
            if not value.role:
                which = f" `{parameter}`" if len(signature.parameters) > 1 and not signature.variadic else ""
                value = dataclasses.replace(value, role=f"the argument{which} of `{name}`")
            values[parameter] = value
        if name in self.scope.definitions:
            expanded: Value = yield self._expand(self.scope.definitions[name], values, node, frame)
            return expanded
        return self._function(name, list(values.values()), node, frame)

    def _function(self, name: str, values: list[Value], node: ast.Call, frame: Frame) -> Value:
        origin = self._spans(node, frame)[0]
        what = f"an argument of `{name}`"
        if name in AXES:
            (value,) = values
            axis = AXES.index(name)
            if axis < 2:
                return NumberValue(self.place(value, what)[axis], LENGTH, origin=origin)
            if isinstance(value, ObjectValue):
                return NumberValue(self.builder.coord(value.index, axis), ANGLE, origin=origin)
            if isinstance(value, AnyValue):
                return NumberValue(self.builder.const(_ANY), ANGLE, origin=origin)
            raise self._wrong_kind(value, "an object (nothing else has a heading)", what)
        if PRIMITIVES[name].params[0] == "place":
            args = [coordinate for value in values for coordinate in self.place(value, what)]
            return self._apply(name, [], args, node, frame)
        numbers = [self.number(value, what) for value in values]
        return self._apply(name, numbers, [number.node for number in numbers], node, frame)

    def _expand(self, declared: Declared, values: dict[str, Value], node: ast.Call, frame: Frame) -> Call[Value]:
        definition = declared.statement
        assert isinstance(definition, ast.Definition)
        self.used.add(definition.name.id)
        for parameter in definition.parameters:
            if parameter.name.id not in values:
                assert parameter.default is not None
                value = yield self.lower(parameter.default, {}, Frame(declared.source, self._spans(node, frame)))
                values[parameter.name.id] = dataclasses.replace(value, role="")
        ordered = [values[parameter.name.id] for parameter in definition.parameters]
        key = (definition.name.id, *ordered)
        origin = self._spans(node, frame)[0]
        if key not in self._expansions:
            text = f"{definition.name.id}({', '.join(map(self.text, ordered))})"
            inside = Frame(declared.source, self._spans(node, frame), text, definition.body)
            self._expansions[key] = yield self.lower(definition.body, values, inside)
        return dataclasses.replace(self._expansions[key], origin=origin, role="")

    def text(self, value: Value) -> str:
        """A value as an argument is shown in the text of an atom."""
        nodes, objects = self.builder.nodes, self.builder.objects
        match value:
            case ObjectValue(index):
                return objects[index]
            case PointValue(x, y):
                return f"({describe(nodes, objects, x)}, {describe(nodes, objects, y)})"
            case NumberValue(node, _):
                return describe(nodes, objects, node)
            case _:
                return "..."
