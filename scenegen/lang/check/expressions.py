"""Expanding formulas: syntax tree -> core formula, with kinds and units checked on the way.

Definitions are expanded where they are called, each once for the same arguments. Every value remembers where the user
wrote it, so a mistake that shows deep inside the prelude is reported at the argument that caused it.
"""

from __future__ import annotations

import math
import sys
import threading
from collections.abc import Mapping, Sequence
from itertools import pairwise
from types import MappingProxyType, TracebackType
from typing import Any, TypeGuard

from scenegen.errors import Diagnostic, Kind, Span, SpecError
from scenegen.errors.declarations import NO_OBJECTS, WORKSPACE_OF_ITSELF
from scenegen.errors.language import (
    EQUALITY,
    MISPLACED_VALUE,
    MORE_THAN_A_TURN,
    NOT_A_WHOLE_NUMBER,
    NOT_CONSTANT,
    NOT_TWO_COORDINATES,
    NUMBER_TOO_LARGE,
    UNIT_MISMATCH,
    WRONG_DIVISOR,
    WRONG_NAME,
    WRONG_UNIT,
)
from scenegen.geometry import PRIMITIVES, Footprint, UnitMismatch
from scenegen.geometry.units import ANGLE, BARE, LENGTH, Unit, agree, quantity
from scenegen.geometry.workspace import Workspace
from scenegen.lang.check.functions import (
    OF_SUPPORT,
    function,
    joined,
    list_function,
    note_elsewhere,
    step_function,
    temporal,
)
from scenegen.lang.check.heights import height_function, index, member
from scenegen.lang.check.names import bind
from scenegen.lang.check.quantifiers import MAX_STEPS, MOST_FORESEEN, quantify, too_many
from scenegen.lang.check.scope import HEIGHTS, LIST_FUNCTIONS, STEPS, Declared, Scope
from scenegen.lang.check.template import FIRST, DependsOnValue, placeholders
from scenegen.lang.check.values import (
    MOST_VARIABLES,
    AnyValue,
    Area,
    CallFrame,
    ChosenValue,
    Coercion,
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
from scenegen.lang.formula.builder import FALSE, TRUE, CoreBuilder, FormulaTooLarge
from scenegen.lang.formula.timed import Horizon
from scenegen.lang.spec import Support, SurfaceChoice
from scenegen.lang.syntax import ast
from scenegen.lang.syntax.tokens import UNITS_OF_TIME
from scenegen.pose import TWO_PI
from scenegen.things import Shape

# --------------------------------------------------------------------------------------------------------------------
# What a name stands for: a bound value, objects, a region, a constant or a label.


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


# --------------------------------------------------------------------------------------------------------------------
# Calls: definitions expanded once for each set of arguments, primitives, and functions of lists and heights.


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
    ordered = [values[parameter.name.id] for parameter in definition.parameters]
    key = (declared, *map(key_of, ordered))
    if key not in lowering.expansions:
        text = f"{definition.name.id}({', '.join(map(lowering.text, ordered))})"
        inside = CallFrame(declared.source, places, text, definition.body, frame.where)
        expanded: Value = lowering.lower(definition.body, values, inside)
        lowering.expansions[key] = (expanded, ordered)
    return lowering.expansions[key][0].moved(places[0])


# --------------------------------------------------------------------------------------------------------------------
# Formulas as deep as the parser lets them be.


class _DeepRecursion:
    """Python's limit of recursion, lifted while some thread expands a formula, and then as it was. Calls from Python to
    Python take no room on the C stack; how much is expanded at all is limited below."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._inside = 0
        self._usual = 0

    def __enter__(self) -> None:
        with self._lock:
            if not self._inside:
                self._usual = sys.getrecursionlimit()
                sys.setrecursionlimit(MOST_FRAMES)
            self._inside += 1

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with self._lock:
            self._inside -= 1
            if not self._inside:
                sys.setrecursionlimit(self._usual)


_DEEP = _DeepRecursion()

# --------------------------------------------------------------------------------------------------------------------
# Expressions, each with its kind and unit.


Environment = Mapping[str, Value]

MOST_CALLS = 32  # how far outwards the blame goes: definitions may call each other thousands deep

MAX_WORK = 4_000_000  # expressions to expand
MAX_INSIDE = 150_000  # of these, in rounds of quantifiers and in definitions; two or three seconds
FOR_A_CHARACTER = 2  # that many more for each character of the text: what is written out is its author's affair

MOST_FRAMES = 4 * MAX_WORK  # of Python: no expression takes more

_ANY = 0.7320508  # any number: one that no body of a definition is likely to turn into a division by zero


class Lowering:
    """Expands the expressions of one spec into one builder.

    The declarations are evaluated first and fill in `areas` (regions and `workspace`), the shapes of the objects, and
    the poses of those that are held in place. `length` is that of the texts, in characters.
    """

    def __init__(self, scope: Scope, builder: CoreBuilder, length: int = 0) -> None:
        self.scope = scope
        self.builder = self.root = builder
        self.coerce = Coercion(scope, builder, _ANY)
        self.used: set[str] = set()  # definitions, constants and regions that something used
        self.areas: dict[str, Area] = {}
        self.space = Workspace()
        self.levels: dict[str, int] = {}  # how many regions stand under the name of several
        self.shapes: Sequence[Shape] = ()  # of the objects
        self.supports: Mapping[int, Support] = {}  # what objects were declared to stand on
        self.choices: Mapping[int, SurfaceChoice] = {}  # likewise, where it is one of several
        # of the objects' lowest points, once they are known; None where a choice says how high
        self.heights: Sequence[float | None] | None = None
        self.steps = 0  # rounds of quantifiers so far
        self.inside = 0  # expressions expanded in them and in definitions
        self.most_inside = MAX_INSIDE + FOR_A_CHARACTER * length
        self.made = 0  # steps of templates taken for rounds
        self.placeholders = placeholders()
        self.expansions: dict[object, tuple[Value, list[Value]]] = {}  # with the arguments: see key_of
        self._work = 0  # expressions expanded so far
        self.values: dict[str, Value] = {}
        self.horizon: Horizon | None = None
        self.noticed: list[Diagnostic] = []  # warnings
        self.calls: dict[int, list[tuple[str, ast.Expr, str]]] = {}

    def rounds(self, more: int, node: ast.Quantifier, frame: CallFrame, foreseen: int = 0) -> None:
        """Raises SpecError where a quantifier takes too many rounds, with what is foreseen for those around it."""
        if self.steps + more > MAX_STEPS or foreseen > MOST_FORESEEN:
            raise too_many(self, node.domain, frame)

    def spend(self, steps: int, frame: CallFrame) -> None:
        """Counts what is expanded. Raises FormulaTooLarge."""
        self._work += steps
        if self._work > MAX_WORK:
            raise FormulaTooLarge(f"takes more than {MAX_WORK:,} steps to expand")
        if frame.where or frame.text:
            self.inside += steps
            if self.inside > self.most_inside:
                self.foresee(0)

    def foresee(self, more: int) -> None:
        """Raises FormulaTooLarge where so many more expressions are too many."""
        if self.inside + more > self.most_inside:
            raise FormulaTooLarge(
                f"takes more than {self.most_inside:,} steps to expand its quantifiers and definitions"
            )

    def use(self, builder: CoreBuilder) -> None:
        """Expands into another builder from now on."""
        self.builder = self.coerce.builder = builder

    # ---- where to put the blame

    def spans(self, node: ast.Node, frame: CallFrame) -> tuple[Span, ...]:
        """The user's places for a node, innermost first: the prelude's own lines are of no help to anybody."""
        places = (node.span(frame.source), *frame.calls)
        own = tuple(span for span in places if span.source is not self.scope.prelude)
        return (own or places)[:MOST_CALLS]

    def origin(self, node: ast.Node, frame: CallFrame) -> Span:
        """The user's innermost place for a node."""
        if frame.source is self.scope.prelude and frame.calls:
            return frame.calls[0]
        return Span(frame.source, node.start, node.end)

    def error(self, kind: Kind, node: ast.Node, frame: CallFrame, /, **facts: Any) -> SpecError:
        """A mistake at a node, told at the user's own place, with the way that led there and what the variables of
        quantifiers stand for."""
        places = self.spans(node, frame)
        called = places[1].place if len(places) > 1 else None
        where = [f"{name} = {self.text(value)}" for choice in frame.where for name, value in choice.items()]
        shown = ", ".join(where[-MOST_VARIABLES:])
        return SpecError(kind(places[0], expansion=frame.text, where=shown, called=called, **facts))

    # ---- expressions

    def evaluate(self, node: ast.Expr, frame: CallFrame, env: Environment = MappingProxyType({})) -> Value:
        """The value of an expression, however deep. Raises SpecError, and FormulaTooLarge."""
        with _DEEP:
            return self.lower(node, env, frame)

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

    def constant(
        self, value: Value, node: ast.Expr, frame: CallFrame, what: str, /, *units: Unit, **facts: Any
    ) -> float:
        """A number that no scene decides, in one of some units. Raises SpecError; `facts` say more of a wrong unit."""
        number = self.coerce.number(value, what)
        amount = self.builder.value(number.node)
        if amount is None:
            raise self.error(NOT_CONSTANT, node, frame, what=what)
        if number.unit not in units:
            raise self.error(WRONG_UNIT, node, frame, **{"what": what, "found": number.unit.words, **facts})
        return amount

    def count(self, value: Value, node: ast.Expr, frame: CallFrame, what: str) -> int:
        """A whole number without a unit. Raises SpecError."""
        amount = self.constant(value, node, frame, what, BARE)
        if amount != int(amount):
            raise self.error(NOT_A_WHOLE_NUMBER, node, frame, what=what, value=amount)
        return int(amount)

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

    # ---- arithmetic and comparisons

    def _arithmetic(self, node: ast.Negative | ast.Binary, env: Environment, frame: CallFrame) -> Value:
        parts = [node.value] if isinstance(node, ast.Negative) else [node.left, node.right]
        symbol = "-" if isinstance(node, ast.Negative) else node.operator
        values = []
        for part in parts:
            values.append(self.at_once(part, env, frame) or self.lower(part, env, frame))
        if isinstance(node, ast.Binary) and symbol == "+":
            both = joined(self, values, node, frame)
            if both is not None:
                return both
        numbers = [self.coerce.number(value, f"what `{symbol}` works on") for value in values]
        if symbol in ("+", "-"):
            self.refuse_degrees(numbers)
        name = "neg" if len(parts) == 1 else {"+": "add", "-": "sub", "*": "mul", "/": "div"}[symbol]
        if name == "div":
            divisor = self.builder.divisor(numbers[1].node)
            if divisor is None:
                raise self.error(WRONG_DIVISOR, parts[1], frame)
            if divisor == 0.0:
                raise self.error(WRONG_DIVISOR, parts[1], frame, zero=True)
        units = [number.unit for number in numbers]
        return self.apply(name, units, [number.node for number in numbers], (), node, frame)

    def apply(
        self,
        name: str,
        units: Sequence[Unit],
        args: Sequence[int],
        shapes: tuple[Footprint, ...],
        node: ast.Node,
        frame: CallFrame,
    ) -> NumberValue:
        try:
            unit = PRIMITIVES[name].unit(*units)
            result = self.builder.apply(name, args, shapes)
        except UnitMismatch as mismatch:
            if len(units) == 1 or PRIMITIVES[name].spatial:
                left, right = mismatch.left.words, mismatch.right.words
                raise self.error(WRONG_UNIT, node, frame, name=name, wanted=right, found=left) from None
            raise self._mismatch(mismatch, "combined with", node, frame) from None
        except OverflowError:
            raise self.error(NUMBER_TOO_LARGE, node, frame) from None
        return NumberValue(result, unit, origin=self.origin(node, frame))

    def _mismatch(self, mismatch: UnitMismatch, verb: str, node: ast.Node, frame: CallFrame) -> SpecError:
        facts = {"left": mismatch.left.words, "verb": verb, "right": mismatch.right.words}
        if mismatch.left.time or mismatch.right.time:
            facts["times"] = UNITS_OF_TIME
        return self.error(UNIT_MISMATCH, node, frame, **facts)

    def refuse_degrees(self, numbers: Sequence[NumberValue]) -> None:
        """A bare number beside an angle counts in radians; one beyond a turn was meant in degrees."""
        if not any(number.unit == ANGLE for number in numbers):
            return
        for number in numbers:
            amount = self.builder.value(number.node) if number.unit == BARE else None
            if amount is not None and abs(amount) > TWO_PI:
                raise SpecError(MORE_THAN_A_TURN(number.origin, amount=amount))

    def agree(self, node: ast.Node, frame: CallFrame, verb: str, *units: Unit) -> Unit:
        try:
            return agree(*units)
        except UnitMismatch as mismatch:
            raise self._mismatch(mismatch, verb, node, frame) from None

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
            if isinstance(value, ObjectValue) and value.index >= FIRST:
                raise DependsOnValue
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

    def text(self, value: Value) -> str:
        """A value as an argument is shown in the text of an atom."""
        match value:
            case ObjectValue(place):
                return self.builder.objects[place]
            case RegionValue(name, _):
                return name
            case SurfaceValue(place, surface):
                return f"{self.builder.objects[place]}.{surface.name}"
            case ChosenValue(chooser, _):
                return f"base({self.builder.objects[chooser]})"
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


def _by_name(value: Value) -> TypeGuard[FormulaValue]:
    """Whether the names in a formula say that it holds, or that it does not."""
    return isinstance(value, FormulaValue) and value.named
