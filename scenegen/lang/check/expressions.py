"""Expanding formulas: syntax tree -> core formula, with kinds and units checked on the way.

Definitions are expanded where they are called, each once for the same arguments. Every value remembers where the user
wrote it, so a mistake that shows deep inside the prelude is reported at the argument that caused it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import pairwise
from typing import Any, TypeGuard

from scenegen.errors import Span
from scenegen.errors.declarations import NO_OBJECTS, WORKSPACE_OF_ITSELF
from scenegen.errors.language import (
    EQUALITY,
    MISPLACED_VALUE,
    NOT_TWO_COORDINATES,
    NUMBER_TOO_LARGE,
    WRONG_DIVISOR,
    WRONG_NAME,
)
from scenegen.geometry.primitives import LENGTH, quantity
from scenegen.lang.check.functions import (
    OF_SUPPORT,
    function,
    join_lists,
    list_function,
    note_elsewhere,
    step_function,
    temporal,
)
from scenegen.lang.check.heights import height_function, index, member
from scenegen.lang.check.lowering import Environment, Lowering
from scenegen.lang.check.names import bind
from scenegen.lang.check.quantifiers import quantify
from scenegen.lang.check.scope import HEIGHTS, LIST_FUNCTIONS, SIGHT, STEPS, Declared
from scenegen.lang.check.sight import check_shares, sight_function
from scenegen.lang.check.values import (
    AnyValue,
    CallFrame,
    CameraValue,
    FormulaValue,
    ListValue,
    NumberValue,
    ObjectValue,
    PointValue,
    RegionValue,
    Row,
    SurfaceValue,
    Value,
    check_alike,
    key_of,
)
from scenegen.lang.formula.builder import FALSE, TRUE
from scenegen.lang.syntax import ast


def refer(lowering: Lowering, node: ast.Name, env: Mapping[str, Value], frame: CallFrame) -> Value:
    if node.id in env:
        return env[node.id]
    origin = lowering.origin(node, frame)
    if node.id in lowering.scope.things or node.id == "objects":
        return objects(lowering, node, frame, origin)
    if node.id == "workspace" or node.id in lowering.scope.regions:
        if node.id not in lowering.areas and node.id not in lowering.levels:
            _region(lowering, node, frame)
        lowering.used.add(node.id)
        if node.id in lowering.levels:
            names = [f"{node.id}[{which}]" for which in range(1, lowering.levels[node.id] + 1)]
            return ListValue(
                tuple(RegionValue(name, lowering.areas[name], origin=origin) for name in names), origin=origin
            )
        return RegionValue(node.id, lowering.areas[node.id], origin=origin)
    if node.id in lowering.cameras:
        lowering.used.add(node.id)
        return CameraValue(lowering.cameras[node.id], origin=origin)
    if node.id not in lowering.values:
        declared = lowering.scope.constants.get(node.id) or lowering.scope.labels[node.id]
        (expr,) = ast.expressions(declared.statement)
        value: Value = lowering.lower(expr, {}, CallFrame(declared.source))
        if isinstance(declared.statement, ast.Label):
            lowering.coerce.formula(value, f"`{node.id}`")
        lowering.values[node.id] = value
    lowering.used.add(node.id)
    # The value is the constant's, the place to blame is where the name was used.
    return lowering.values[node.id].moved(origin)


def _region(lowering: Lowering, node: ast.Name, frame: CallFrame) -> None:
    from scenegen.lang.check.regions import areas

    if node.id == "workspace":
        raise lowering.error(WORKSPACE_OF_ITSELF, node, frame)
    areas(lowering, lowering.scope.regions[node.id])


def objects(lowering: Lowering, node: ast.Name, frame: CallFrame, origin: Span) -> Value:
    """An object, an array or all objects. Raises SpecError while the objects are still being declared."""
    if not lowering.scope.things:
        raise lowering.error(NO_OBJECTS, node, frame)
    if not lowering.scope.objects:
        raise lowering.error(WRONG_NAME, node, frame, name=node.id)
    if node.id in lowering.scope.objects:
        return ObjectValue(lowering.scope.objects[node.id], origin=origin)
    places = range(len(lowering.scope.objects)) if node.id == "objects" else lowering.scope.arrays[node.id]
    return ListValue(Row(places, origin), origin=origin)


def call(lowering: Lowering, node: ast.Call, env: Mapping[str, Value], frame: CallFrame) -> Value:
    name = node.function.id
    values: dict[str, Value] = {}
    for parameter, argument, role in _arguments(lowering, node, frame):
        value = lowering.at_once(argument, env, frame) or lowering.lower(argument, env, frame)
        values[parameter] = value if value.role else value.moved(value.origin, role)
    declared = lowering.scope.definition(name, frame.source)
    if declared is not None:
        return _expand(lowering, declared, values, node, frame)
    if name in HEIGHTS:
        return height_function(lowering, name, list(values.values()), node, frame)
    if name in SIGHT:
        return sight_function(lowering, name, list(values.values()), node, frame)
    if name in STEPS:
        return step_function(lowering, name, values, node, frame)
    if name in LIST_FUNCTIONS:
        return list_function(lowering, name, values["items"], node, frame)
    given = list(values.values())
    if len(given) > 1 or not isinstance(given[0], ListValue):
        return function(lowering, name, given, node, frame)
    key = (name, key_of(given[0]))
    if key not in lowering.expansions:  # mean(gaps(items)), in each round
        lowering.expansions[key] = (function(lowering, name, given, node, frame), given)
    return lowering.expansions[key][0].moved(lowering.origin(node, frame))


def _arguments(lowering: Lowering, node: ast.Call, frame: CallFrame) -> list[tuple[str, ast.Expr, str]]:
    """Parameter, argument and the argument's role, for each argument of a call; worked out once per call."""
    known = lowering.calls.get(id(node))
    if known is None:
        name = node.function.id
        signature = lowering.scope.called(name, frame.source)
        assert signature is not None
        given = bind(node, signature, frame.source)
        assert isinstance(given, dict)
        several = len(signature.parameters) > 1 and not signature.variadic
        known = lowering.calls[id(node)] = [
            (parameter, argument, f"the argument{f' `{parameter}`' if several else ''} of `{name}`")
            for parameter, argument in given.items()
        ]
    return known


def _expand(
    lowering: Lowering, declared: Declared, values: dict[str, Value], node: ast.Call, frame: CallFrame
) -> Value:
    definition = declared.statement
    assert isinstance(definition, ast.Definition)
    if declared is lowering.scope.definitions.get(definition.name.id):
        lowering.used.add(definition.name.id)
    places = lowering.spans(node, frame)
    for parameter in definition.parameters:
        if parameter.name.id not in values:
            assert parameter.default is not None
            value = lowering.lower(parameter.default, {}, CallFrame(declared.source, places))
            values[parameter.name.id] = value.moved(value.origin)
    if definition.name.id in OF_SUPPORT and declared.source is lowering.scope.prelude:
        note_elsewhere(lowering, definition.name.id, values, node, frame)
    if definition.name.id == "visible" and declared.source is lowering.scope.prelude:
        check_shares(lowering, values["least"], values["most"], node, frame)
    ordered = [values[parameter.name.id] for parameter in definition.parameters]
    key = (declared, *map(key_of, ordered))
    if key not in lowering.expansions:
        text = f"{definition.name.id}({', '.join(map(lowering.text, ordered))})"
        inside = CallFrame(declared.source, places, text, definition.body, frame.where)
        expanded: Value = lowering.lower(definition.body, values, inside)
        lowering.expansions[key] = (expanded, ordered)
    return lowering.expansions[key][0].moved(places[0])


class FormulaLowering(Lowering):
    """Expands expressions of every kind."""

    def lower(self, node: ast.Expr, env: Environment, frame: CallFrame) -> Value:
        """The value of an expression inside of another. Raises SpecError, and FormulaTooLarge."""
        self.spend(1, frame)
        origin = self.origin(node, frame)
        value: Value
        match node:
            case ast.Name():
                return refer(self, node, env, frame)
            case ast.Quantity():
                return self._quantity(node, frame)
            case ast.Truth(truth):
                return FormulaValue(TRUE if truth else FALSE, origin=origin)
            case ast.Point(coordinates):
                return self._point(node, coordinates, env, frame)
            case ast.List(items):
                values = []
                for item in items:
                    value = self.lower(item, env, frame)
                    values.append(value)
                check_alike(values)
                return ListValue(tuple(values), origin=origin)
            case ast.Member(base, name):
                value = self.lower(base, env, frame)
                return member(self, value, node, name.id, frame)
            case ast.Index(base, place):
                value = self.at_once(base, env, frame) or self.lower(base, env, frame)
                which = self.at_once(place, env, frame) or self.lower(place, env, frame)
                return index(self, value, self.coerce.number(which, "an index"), node, frame)
            case ast.Quantifier():
                return quantify(self, node, env, frame)
            case ast.Negative() | ast.Binary():
                return self._arithmetic(node, env, frame)
            case ast.Compare():
                return self._compare(node, env, frame)
            case ast.Not(inner):
                value = self.lower(inner, env, frame)
                turned = self.builder.negate(self.coerce.formula(value, "what `!` negates"))
                return FormulaValue(turned, _by_name(value), origin=origin)
            case ast.And(parts) | ast.Or(parts):
                symbol = "&" if isinstance(node, ast.And) else "|"
                formulas, named, absorbing = [], True, FALSE if isinstance(node, ast.And) else TRUE
                for part in parts:
                    value = self.lower(part, env, frame)
                    formulas.append(self.coerce.formula(value, f"each side of `{symbol}`"))
                    if _by_name(value) and formulas[-1] == absorbing:
                        return FormulaValue(absorbing, True, origin=origin)
                    named = named and _by_name(value)
                text = frame.text if node is frame.body else ""
                kind: Any = "min" if isinstance(node, ast.And) else "max"
                return FormulaValue(self.builder.junction(kind, formulas, text), named, origin=origin)
            case ast.Implies(condition, consequence):
                before = self.lower(condition, env, frame)
                if _by_name(before) and before.node == FALSE:
                    return FormulaValue(TRUE, True, origin=origin)
                after = self.lower(consequence, env, frame)
                sides = [
                    self.builder.negate(self.coerce.formula(before, "what stands before `->`")),
                    self.coerce.formula(after, "what stands after `->`"),
                ]
                text = frame.text if node is frame.body else ""
                return FormulaValue(self.builder.junction("max", sides, text), origin=origin)
            case ast.Call():
                return call(self, node, env, frame)
            case ast.Temporal() | ast.Until():
                return temporal(self, node, env, frame)
            case ast.Range():
                raise self.error(MISPLACED_VALUE, node, frame)
        raise AssertionError(f"the resolver let {type(node).__name__} pass")

    def at_once(self, node: ast.Expr, env: Environment, frame: CallFrame) -> Value | None:
        """The value of an expression that is a variable, a number or an object: a call for it would cost more."""
        match node:
            case ast.Name(name):
                if name in env:
                    return env[name]
                if name in self.scope.things:
                    return objects(self, node, frame, self.origin(node, frame))
                return None
            case ast.Quantity():
                return self._quantity(node, frame)
            case _:
                return None

    def _quantity(self, node: ast.Quantity, frame: CallFrame) -> NumberValue:
        amount, unit = quantity(node.number, node.unit)
        if not math.isfinite(amount):
            raise self.error(NUMBER_TOO_LARGE, node, frame)
        return NumberValue(self.builder.const(amount), unit, origin=self.origin(node, frame))

    def _point(self, node: ast.Point, coordinates: tuple[ast.Expr, ...], env: Environment, frame: CallFrame) -> Value:
        if len(coordinates) != 2:
            raise self.error(NOT_TWO_COORDINATES, node, frame, given=len(coordinates))
        numbers = []
        for coordinate in coordinates:
            value = self.lower(coordinate, env, frame)
            number = self.coerce.number(value, "a coordinate")
            self.agree(node, frame, "used as", number.unit, LENGTH)
            numbers.append(number.node)
        return PointValue(*numbers, origin=self.origin(node, frame))

    def _arithmetic(self, node: ast.Negative | ast.Binary, env: Environment, frame: CallFrame) -> Value:
        parts = [node.value] if isinstance(node, ast.Negative) else [node.left, node.right]
        symbol = "-" if isinstance(node, ast.Negative) else node.operator
        values = []
        for part in parts:
            values.append(self.at_once(part, env, frame) or self.lower(part, env, frame))
        if isinstance(node, ast.Binary) and symbol == "+":
            both = join_lists(self, values, node, frame)
            if both is not None:
                return both
        numbers = [self.coerce.number(value, f"what `{symbol}` works on") for value in values]
        if symbol in ("+", "-"):
            self.refuse_degrees(numbers)
        name = "neg" if len(parts) == 1 else {"+": "add", "-": "sub", "*": "mul", "/": "div"}[symbol]
        if name == "div":
            divisor = self.builder.value(numbers[1].node)
            if divisor is None and numbers[1].node not in self.builder.varying:
                raise self.error(WRONG_DIVISOR, parts[1], frame)
            if divisor == 0.0:
                raise self.error(WRONG_DIVISOR, parts[1], frame, zero=True)
        units = [number.unit for number in numbers]
        return self.apply(name, units, [number.node for number in numbers], (), node, frame)

    def _different(self, node: ast.Compare, env: Environment, frame: CallFrame) -> Value:
        """`a != b`: whether two things, or two constants, are different ones. Names say that, not scenes."""
        if len(node.operands) > 2:
            raise self.error(EQUALITY, node, frame, instead="write a != b & b != c")
        values: list[Value] = []
        for operand in node.operands:
            values.append(self.at_once(operand, env, frame) or self.lower(operand, env, frame))
        first, second = values
        origin = self.origin(node, frame)
        if any(isinstance(one, AnyValue) for one in values):
            return FormulaValue(TRUE, origin=origin)
        if isinstance(first, NumberValue) and isinstance(second, NumberValue):
            amounts = [self.builder.value(one.node) for one in (first, second)]
            if None in amounts:
                raise self.error(EQUALITY, node, frame, instead="write abs(a - b) >= 0.01")
            self.agree(node, frame, "compared with", first.unit, second.unit)
            return FormulaValue(TRUE if amounts[0] != amounts[1] else FALSE, True, origin=origin)
        for value in values:
            if not isinstance(value, ObjectValue | RegionValue | SurfaceValue):
                raise self.coerce.wrong(value, "an object, a surface or a region", "each side of `!=`")
        return FormulaValue(TRUE if first != second else FALSE, True, origin=origin)

    def _compare(self, node: ast.Compare, env: Environment, frame: CallFrame) -> Value:
        if "!=" in node.operators:
            return self._different(node, env, frame)
        numbers: list[NumberValue] = []
        for operand in node.operands:
            value = self.at_once(operand, env, frame) or self.lower(operand, env, frame)
            numbers.append(self.coerce.number(value, "each side of a comparison"))
        self.refuse_degrees(numbers)
        atoms = []
        places = self.spans(node, frame)
        named = frame.text if node is frame.body else ""
        for (left, right), operator in zip(pairwise(numbers), node.operators, strict=True):
            unit = self.agree(node, frame, "compared with", left.unit, right.unit)
            low, high = (left.node, right.node) if operator == "<=" else (right.node, left.node)
            text = named or f" {operator} ".join(map(self.text, (left, right)))
            try:
                atoms.append(self.builder.atom(low, high, text, unit, places))
            except OverflowError:
                raise self.error(NUMBER_TOO_LARGE, node, frame) from None
        return FormulaValue(self.builder.junction("min", atoms), origin=places[0])


def _by_name(value: Value) -> TypeGuard[FormulaValue]:
    """Whether the names in a formula say that it holds, or that it does not."""
    return isinstance(value, FormulaValue) and value.named
