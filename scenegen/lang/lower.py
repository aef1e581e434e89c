"""Expanding formulas: syntax tree -> core formula, with kinds and units checked on the way.

Definitions are expanded where they are called, each once for the same arguments. Every value remembers where the user
wrote it, so a mistake that shows deep inside the prelude is reported at the argument that caused it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

from scenegen.errors import Diagnostic, Span, SpecError
from scenegen.lang import ast, blame
from scenegen.lang.blame import Frame
from scenegen.lang.builder import FALSE, TRUE, CoreBuilder, TooLarge
from scenegen.lang.functions import function, joined, key_of, list_function
from scenegen.lang.kinds import Kinds
from scenegen.lang.places import Area
from scenegen.lang.quantify import MAX_STEPS, MOST_FORESEEN, quantify, too_many
from scenegen.lang.resolve import bind
from scenegen.lang.scope import LIST_FUNCTIONS, Declared, Scope
from scenegen.lang.select import index, member
from scenegen.lang.template import placeholders
from scenegen.lang.trampoline import Call
from scenegen.lang.values import (
    FormulaValue,
    ListValue,
    NumberValue,
    ObjectValue,
    PointValue,
    RegionValue,
    Row,
    Value,
)
from scenegen.primitives import PRIMITIVES, Footprint, UnitMismatch
from scenegen.primitives.units import ANGLE, BARE, LENGTH, Unit, agree, quantity
from scenegen.scene.workspace import TWO_PI

Environment = Mapping[str, Value]

MAX_WORK = 4_000_000  # expressions to expand
MAX_INSIDE = 150_000  # of these, in rounds of quantifiers and in definitions; two or three seconds
FOR_A_CHARACTER = 2  # that many more for each character of the text: what is written out is its author's affair

_ANY = 0.7320508  # any number: one that no body of a definition is likely to turn into a division by zero
_UNITS_HELP = "lengths are in m, cm or mm; angles in rad, deg or turn"


class Lowering:
    """Expands the expressions of one spec into one builder.

    The declarations are evaluated first and fill in `areas` (regions and `workspace`), the shapes of the objects, and
    the poses of those that are held in place. `length` is that of the texts, in characters.
    """

    def __init__(self, scope: Scope, builder: CoreBuilder, length: int = 0) -> None:
        self.scope = scope
        self.builder = self.root = builder
        self.kinds = Kinds(scope, builder, _ANY)
        self.used: set[str] = set()  # definitions, constants and regions that something used
        self.areas: dict[str, Area] = {}
        self.steps = 0  # rounds of quantifiers so far
        self.inside = 0  # expressions expanded in them and in definitions
        self.most_inside = MAX_INSIDE + FOR_A_CHARACTER * length
        self.made = 0  # steps of templates taken for rounds
        self.placeholders = placeholders()
        self.expansions: dict[object, tuple[Value, list[Value]]] = {}  # with the arguments: see key_of
        self._work = 0  # expressions expanded so far
        self._globals: dict[str, Value] = {}
        self._calls: dict[int, list[tuple[str, ast.Expr, str]]] = {}

    def rounds(self, more: int, node: ast.Quantifier, frame: Frame, foreseen: int = 0) -> None:
        """Raises SpecError where a quantifier takes too many rounds, with what is foreseen for those around it."""
        if self.steps + more > MAX_STEPS or foreseen > MOST_FORESEEN:
            raise too_many(self, node.domain, frame)

    def spend(self, steps: int, frame: Frame) -> None:
        """Counts what is expanded. Raises TooLarge."""
        self._work += steps
        if self._work > MAX_WORK:
            raise TooLarge(f"takes more than {MAX_WORK:,} steps to expand")
        if frame.where or frame.text:
            self.inside += steps
            if self.inside > self.most_inside:
                self.foresee(0)

    def foresee(self, more: int) -> None:
        """Raises TooLarge where so many more expressions are too many."""
        if self.inside + more > self.most_inside:
            raise TooLarge(f"takes more than {self.most_inside:,} steps to expand its quantifiers and definitions")

    def use(self, builder: CoreBuilder) -> None:
        """Expands into another builder from now on."""
        self.builder = self.kinds.builder = builder

    # ---- where to put the blame

    def spans(self, node: ast.Node, frame: Frame) -> tuple[Span, ...]:
        return blame.spans(node, frame, self.scope.prelude)

    def origin(self, node: ast.Node, frame: Frame) -> Span:
        return blame.origin(node, frame, self.scope.prelude)

    def error(self, title: str, node: ast.Node, frame: Frame, label: str = "", help: str = "") -> SpecError:
        where = [f"{name} = {self.text(value)}" for choice in frame.where for name, value in choice.items()]
        return blame.error(title, node, frame, self.scope.prelude, where, label, help)

    # ---- expressions

    def lower(self, node: ast.Expr, env: Environment, frame: Frame) -> Call[Value]:
        """The value of an expression, as a call for `trampoline.run`. Raises SpecError, and TooLarge."""
        self.spend(1, frame)
        origin = self.origin(node, frame)
        value: Value
        match node:
            case ast.Name():
                value = yield self._name(node, env, frame)
                return value
            case ast.Quantity():
                return self._quantity(node, frame)
            case ast.Truth(truth):
                return FormulaValue(TRUE if truth else FALSE, origin=origin)
            case ast.Point(coordinates):
                point: Value = yield self._point(node, coordinates, env, frame)
                return point
            case ast.List(items):
                values = []
                for item in items:
                    value = yield self.lower(item, env, frame)
                    values.append(value)
                return ListValue(tuple(values), origin=origin)
            case ast.Member(base, name):
                value = yield self.lower(base, env, frame)
                return member(self, value, node, name.id, frame)
            case ast.Index(base, place):
                value = self._at_once(base, env, frame) or (yield self.lower(base, env, frame))
                which = self._at_once(place, env, frame) or (yield self.lower(place, env, frame))
                return index(self, value, self.kinds.number(which, "an index"), node, frame)
            case ast.Quantifier():
                over: Value = yield quantify(self, node, env, frame)
                return over
            case ast.Negative() | ast.Binary():
                result: Value = yield self._arithmetic(node, env, frame)
                return result
            case ast.Compare():
                compared: Value = yield self._compare(node, env, frame)
                return compared
            case ast.Not(inner):
                value = yield self.lower(inner, env, frame)
                turned = self.builder.negate(self.kinds.formula(value, "what `!` negates"))
                return FormulaValue(turned, origin=origin)
            case ast.And(parts) | ast.Or(parts):
                symbol = "&" if isinstance(node, ast.And) else "|"
                formulas = []
                for part in parts:
                    value = yield self.lower(part, env, frame)
                    formulas.append(self.kinds.formula(value, f"each side of `{symbol}`"))
                text = frame.text if node is frame.body else ""
                kind: Any = "min" if isinstance(node, ast.And) else "max"
                return FormulaValue(self.builder.junction(kind, formulas, text), origin=origin)
            case ast.Implies(condition, consequence):
                before = yield self.lower(condition, env, frame)
                after = yield self.lower(consequence, env, frame)
                sides = [
                    self.builder.negate(self.kinds.formula(before, "what stands before `->`")),
                    self.kinds.formula(after, "what stands after `->`"),
                ]
                text = frame.text if node is frame.body else ""
                return FormulaValue(self.builder.junction("max", sides, text), origin=origin)
            case ast.Call():
                called: Value = yield self._call(node, env, frame)
                return called
            case ast.Range():
                help_ = "a range stands in a quantifier: forall i in 1..6: ..."
                raise self.error("a range cannot stand here", node, frame, "", help_)
        raise AssertionError(f"the resolver let {type(node).__name__} pass")

    def _at_once(self, node: ast.Expr, env: Environment, frame: Frame) -> Value | None:
        """The value of an expression that is a variable, a number or an object: a call for it would cost more."""
        match node:
            case ast.Name(name):
                if name in env:
                    return env[name]
                if name in self.scope.things:
                    return self._objects(node, frame, self.origin(node, frame))
                return None
            case ast.Quantity():
                return self._quantity(node, frame)
            case _:
                return None

    def _quantity(self, node: ast.Quantity, frame: Frame) -> NumberValue:
        amount, unit = quantity(node.number, node.unit)
        if not math.isfinite(amount):
            raise self.error("this number is too large", node, frame)
        return NumberValue(self.builder.const(amount), unit, origin=self.origin(node, frame))

    # ---- names

    def _name(self, node: ast.Name, env: Environment, frame: Frame) -> Call[Value]:
        if node.id in env:
            return env[node.id]
        origin = self.origin(node, frame)
        if node.id in self.scope.things or node.id == "objects":
            return self._objects(node, frame, origin)
        if node.id == "workspace" or node.id in self.scope.regions:
            if node.id not in self.areas:
                (yield self._region(node, frame))
            self.used.add(node.id)
            return RegionValue(node.id, self.areas[node.id], origin=origin)
        if node.id not in self._globals:
            declared = self.scope.constants.get(node.id) or self.scope.labels[node.id]
            (expr,) = ast.expressions(declared.statement)
            value: Value = yield self.lower(expr, {}, Frame(declared.source))
            if isinstance(declared.statement, ast.Label):
                self.kinds.formula(value, f"`{node.id}`")
            self._globals[node.id] = value
        self.used.add(node.id)
        # The value is the constant's, the place to blame is where the name was used.
        return self._globals[node.id].moved(origin)

    def _region(self, node: ast.Name, frame: Frame) -> Call[None]:
        from scenegen.lang.regions import area

        if node.id == "workspace":
            raise self.error("the workspace cannot be measured by itself", node, frame)
        self.areas[node.id] = yield area(self, self.scope.regions[node.id])

    def _objects(self, node: ast.Name, frame: Frame, origin: Span) -> Value:
        """An object, an array or all objects. Raises SpecError while the objects are still being declared."""
        if not self.scope.things:
            raise self.error("there are no objects", node, frame, "none is declared", "declare them: object mug, plate")
        if not self.scope.objects:
            title = f"`{node.id}` is not a constant"
            raise self.error(title, node, frame, "only numbers and constants can stand here")
        if node.id in self.scope.objects:
            return ObjectValue(self.scope.objects[node.id], origin=origin)
        places = range(len(self.scope.objects)) if node.id == "objects" else self.scope.arrays[node.id]
        return ListValue(Row(places, origin), origin=origin)

    def _point(self, node: ast.Point, coordinates: tuple[ast.Expr, ...], env: Environment, frame: Frame) -> Call[Value]:
        if len(coordinates) != 2:
            given = f"{len(coordinates)} given"
            help_ = "a heading stands only behind `at`"
            raise self.error("a point has two coordinates, x and y", node, frame, given, help_)
        numbers = []
        for coordinate in coordinates:
            value = yield self.lower(coordinate, env, frame)
            number = self.kinds.number(value, "a coordinate")
            self.agree(node, frame, "used as", number.unit, LENGTH)
            numbers.append(number.node)
        return PointValue(*numbers, origin=self.origin(node, frame))

    # ---- arithmetic and comparisons

    def _arithmetic(self, node: ast.Negative | ast.Binary, env: Environment, frame: Frame) -> Call[Value]:
        parts = [node.value] if isinstance(node, ast.Negative) else [node.left, node.right]
        symbol = "-" if isinstance(node, ast.Negative) else node.operator
        values = []
        for part in parts:
            values.append(self._at_once(part, env, frame) or (yield self.lower(part, env, frame)))
        if isinstance(node, ast.Binary) and symbol == "+":
            both = joined(self, values, node, frame)
            if both is not None:
                return both
        numbers = [self.kinds.number(value, f"what `{symbol}` works on") for value in values]
        if symbol in ("+", "-"):
            self.refuse_degrees(numbers)
        name = "neg" if len(parts) == 1 else {"+": "add", "-": "sub", "*": "mul", "/": "div"}[symbol]
        if name == "div":
            divisor = self.builder.divisor(numbers[1].node)
            if divisor is None:
                help_ = "multiply both sides of the comparison by it instead"
                raise self.error("only a constant can divide", parts[1], frame, "this depends on the scene", help_)
            if divisor == 0.0:
                raise self.error("division by zero", parts[1], frame)
        units = [number.unit for number in numbers]
        return self.apply(name, units, [number.node for number in numbers], (), node, frame)

    def apply(
        self,
        name: str,
        units: Sequence[Unit],
        args: Sequence[int],
        shapes: tuple[Footprint, ...],
        node: ast.Node,
        frame: Frame,
    ) -> NumberValue:
        try:
            unit = PRIMITIVES[name].unit(*units)
            result = self.builder.apply(name, args, shapes)
        except UnitMismatch as mismatch:
            if len(units) == 1 or "place" in PRIMITIVES[name].params or "footprint" in PRIMITIVES[name].params:
                title = f"`{name}` takes {mismatch.right.words}, not {mismatch.left.words}"
                raise self.error(title, node, frame, help=_UNITS_HELP) from None
            raise self._mismatch(mismatch, "combined with", node, frame) from None
        except OverflowError:
            raise self.error("this number is too large", node, frame) from None
        return NumberValue(result, unit, origin=self.origin(node, frame))

    def _mismatch(self, mismatch: UnitMismatch, verb: str, node: ast.Node, frame: Frame) -> SpecError:
        title = f"{mismatch.left.words} is {verb} {mismatch.right.words}"
        return self.error(title, node, frame, help=_UNITS_HELP)

    def refuse_degrees(self, numbers: Sequence[NumberValue]) -> None:
        """A bare number beside an angle counts in radians; one beyond a turn was meant in degrees."""
        if not any(number.unit == ANGLE for number in numbers):
            return
        for number in numbers:
            amount = self.builder.value(number.node) if number.unit == BARE else None
            if amount is not None and abs(amount) > TWO_PI:
                title = f"{amount:g} radians are more than a turn"
                help_ = f"write {amount:g} deg, or {amount:g} rad if you mean it"
                raise SpecError(Diagnostic(title, number.origin, "a bare number beside an angle is in radians", help_))

    def agree(self, node: ast.Node, frame: Frame, verb: str, *units: Unit) -> Unit:
        try:
            return agree(*units)
        except UnitMismatch as mismatch:
            raise self._mismatch(mismatch, verb, node, frame) from None

    def _compare(self, node: ast.Compare, env: Environment, frame: Frame) -> Call[Value]:
        numbers: list[NumberValue] = []
        for operand in node.operands:
            value = self._at_once(operand, env, frame) or (yield self.lower(operand, env, frame))
            numbers.append(self.kinds.number(value, "each side of a comparison"))
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
                raise self.error("this number is too large", node, frame) from None
        return FormulaValue(self.builder.junction("min", atoms), origin=places[0])

    # ---- calls

    def _call(self, node: ast.Call, env: Environment, frame: Frame) -> Call[Value]:
        name = node.function.id
        values: dict[str, Value] = {}
        for parameter, argument, role in self._arguments(node, frame):
            value = self._at_once(argument, env, frame) or (yield self.lower(argument, env, frame))
            values[parameter] = value if value.role else value.moved(value.origin, role)
        if name in self.scope.definitions:
            expanded: Value = yield self._expand(self.scope.definitions[name], values, node, frame)
            return expanded
        if name in LIST_FUNCTIONS:
            return list_function(self, name, values["items"], node, frame)
        given = list(values.values())
        if len(given) > 1 or not isinstance(given[0], ListValue):
            return function(self, name, given, node, frame)
        key = (name, key_of(given[0]))
        if key not in self.expansions:  # mean(gaps(items)), in each round
            self.expansions[key] = (function(self, name, given, node, frame), given)
        return self.expansions[key][0].moved(self.origin(node, frame))

    def _arguments(self, node: ast.Call, frame: Frame) -> list[tuple[str, ast.Expr, str]]:
        """Parameter, argument and the argument's role, for each argument of a call; worked out once per call."""
        known = self._calls.get(id(node))
        if known is None:
            name = node.function.id
            signature = self.scope.signature(name)
            assert signature is not None
            given = bind(node, signature, frame.source)
            assert isinstance(given, dict)
            several = len(signature.parameters) > 1 and not signature.variadic
            known = self._calls[id(node)] = [
                (parameter, argument, f"the argument{f' `{parameter}`' if several else ''} of `{name}`")
                for parameter, argument in given.items()
            ]
        return known

    def _expand(self, declared: Declared, values: dict[str, Value], node: ast.Call, frame: Frame) -> Call[Value]:
        definition = declared.statement
        assert isinstance(definition, ast.Definition)
        self.used.add(definition.name.id)
        places = self.spans(node, frame)
        for parameter in definition.parameters:
            if parameter.name.id not in values:
                assert parameter.default is not None
                value = yield self.lower(parameter.default, {}, Frame(declared.source, places))
                values[parameter.name.id] = value.moved(value.origin)
        ordered = [values[parameter.name.id] for parameter in definition.parameters]
        key = (definition.name.id, *map(key_of, ordered))
        if key not in self.expansions:
            text = f"{definition.name.id}({', '.join(map(self.text, ordered))})"
            inside = Frame(declared.source, places, text, definition.body, frame.where)
            expanded: Value = yield self.lower(definition.body, values, inside)
            self.expansions[key] = (expanded, ordered)
        return self.expansions[key][0].moved(places[0])

    def text(self, value: Value) -> str:
        """A value as an argument is shown in the text of an atom."""
        match value:
            case ObjectValue(place):
                return self.builder.objects[place]
            case RegionValue(name, _):
                return name
            case PointValue(x, y):
                return f"({self.builder.text(x)}, {self.builder.text(y)})"
            case NumberValue(node, _):
                return self.builder.text(node)
            case ListValue(items) if len(items) <= 3:
                return f"[{', '.join(map(self.text, items))}]"
            case ListValue(items):
                return f"[{self.text(items[0])}, ..., {self.text(items[-1])}]"
            case _:
                return "..."
