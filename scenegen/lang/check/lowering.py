"""What all readers of expressions share while a spec is expanded.

Names, what the declarations say, the builder, how much was expanded, and where to put the blame.
"""

from __future__ import annotations

import sys
import threading
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from types import MappingProxyType, TracebackType
from typing import Any

from scenegen.errors import Diagnostic, Kind, Span, SpecError
from scenegen.errors.language import (
    MORE_THAN_A_TURN,
    NOT_A_WHOLE_NUMBER,
    NOT_CONSTANT,
    NUMBER_TOO_LARGE,
    UNIT_MISMATCH,
    WRONG_UNIT,
)
from scenegen.geometry import PRIMITIVES, Footprint, UnitMismatch
from scenegen.geometry.primitives import ANGLE, BARE, LENGTH, Unit, agree
from scenegen.geometry.workspace import Workspace
from scenegen.lang.check.scope import Scope
from scenegen.lang.check.values import (
    MAX_NOTED_VARIABLES,
    Area,
    CallFrame,
    CameraValue,
    ChosenValue,
    Coercion,
    ListValue,
    NumberValue,
    ObjectValue,
    PointValue,
    RegionValue,
    SurfaceValue,
    Value,
)
from scenegen.lang.formula.builder import CoreBuilder, DependsOnRound, FormulaTooLarge
from scenegen.lang.formula.timed import Horizon
from scenegen.lang.spec import SpecCamera, Support, SurfaceChoice
from scenegen.lang.syntax import ast
from scenegen.lang.syntax.tokens import UNITS_OF_TIME
from scenegen.pose import TWO_PI
from scenegen.things import Shape


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
                sys.setrecursionlimit(MAX_FRAMES)
            self._inside += 1

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with self._lock:
            self._inside -= 1
            if not self._inside:
                sys.setrecursionlimit(self._usual)


_DEEP = _DeepRecursion()


Environment = Mapping[str, Value]

MAX_BLAMED_CALLS = 32  # how far outwards the blame goes: definitions may call each other thousands deep

MAX_WORK = 4_000_000  # expressions to expand
MAX_INSIDE = 500_000  # of these, in rounds of quantifiers and in definitions; about eight seconds
INSIDE_PER_CHARACTER = 2  # that many more for each character of the text: what is written out is its author's affair

MAX_FRAMES = 4 * MAX_WORK  # of Python: no expression takes more

_ANY = 0.7320508  # any number: one that no body of a definition is likely to turn into a division by zero


class Lowering(ABC):
    """Expands the expressions of one spec into one builder.

    The declarations are evaluated first and fill in `areas` (regions and `workspace`), the shapes of the objects, and
    the poses of those that are held in place. `length` is that of the texts, in characters.
    """

    def __init__(self, scope: Scope, builder: CoreBuilder, length: int = 0) -> None:
        self.scope = scope
        self.builder = builder
        self.coerce = Coercion(scope, builder, _ANY)
        self.used: set[str] = set()  # definitions, constants and regions that something used
        self.areas: dict[str, Area] = {}
        self.space = Workspace()
        self.cameras: dict[str, SpecCamera] = {}
        self.levels: dict[str, int] = {}  # how many regions stand under the name of several
        self.shapes: Sequence[Shape] = ()  # of the objects
        self.supports: Mapping[int, Support] = {}  # what objects were declared to stand on
        self.choices: Mapping[int, SurfaceChoice] = {}  # likewise, where it is one of several
        # of the objects' lowest points, once they are known; None where a choice says how high
        self.heights: Sequence[float | None] | None = None
        self.steps = 0  # rounds of quantifiers so far
        self.inside = 0  # expressions expanded in them and in definitions
        self.most_inside = MAX_INSIDE + INSIDE_PER_CHARACTER * length
        self.expansions: dict[object, tuple[Value, list[Value]]] = {}  # with the arguments: see key_of
        self._work = 0  # expressions expanded so far
        self.values: dict[str, Value] = {}
        self.horizon: Horizon | None = None
        self.noticed: list[Diagnostic] = []  # warnings
        self.numbered = False  # whether something asks how many things there are
        self.calls: dict[int, list[tuple[str, ast.Expr, str]]] = {}
        self.named_in: dict[int, set[str]] = {}  # the names in a quantifier
        self.seen: dict[tuple[int, str], None] = {}  # objects and cameras of shares that formulas ask for
        self.alone: dict[str, None] = {}  # objects of whose shares formulas ask where nothing can hide them
        self.hands: dict[tuple[int, int, float, float], int] = {}  # object, robot, yaw and depth of a hand: its room

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

    def spans(self, node: ast.Node, frame: CallFrame) -> tuple[Span, ...]:
        """The user's places for a node, innermost first: the prelude's own lines are of no help to anybody."""
        places = (node.span(frame.source), *frame.calls)
        own = tuple(span for span in places if span.source is not self.scope.prelude)
        return (own or places)[:MAX_BLAMED_CALLS]

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
        shown = ", ".join(where[-MAX_NOTED_VARIABLES:])
        return SpecError(kind(places[0], expansion=frame.text, where=shown, called=called, **facts))

    def evaluate(self, node: ast.Expr, frame: CallFrame, env: Environment = MappingProxyType({})) -> Value:
        """The value of an expression, however deep. Raises SpecError, and FormulaTooLarge."""
        with _DEEP:
            return self.lower(node, env, frame)

    @abstractmethod
    def lower(self, node: ast.Expr, env: Environment, frame: CallFrame) -> Value:
        """The value of an expression inside of another. Raises SpecError, and FormulaTooLarge."""

    @abstractmethod
    def at_once(self, node: ast.Expr, env: Environment, frame: CallFrame) -> Value | None:
        """The value of an expression that is a variable, a number or an object: a call for it would cost more."""

    def constant(
        self, value: Value, node: ast.Expr, frame: CallFrame, what: str, /, *units: Unit, **facts: Any
    ) -> float:
        """A number that no scene decides, in one of some units. Raises SpecError; `facts` say more of a wrong unit."""
        number = self.coerce.number(value, what)
        amount = self.builder.value(number.node)
        if amount is None:
            raise self.error(NOT_CONSTANT, node, frame, what=what)
        if number.unit not in units:
            named = [word for unit, word in ((LENGTH, "length"), (ANGLE, "angle")) if unit in units]
            more = {word: True for word in named if len(named) == 1}
            raise self.error(WRONG_UNIT, node, frame, **{"what": what, "found": number.unit.words, **more, **facts})
        return amount

    def count(self, value: Value, node: ast.Expr, frame: CallFrame, what: str) -> int:
        """A whole number without a unit. Raises SpecError."""
        amount = self.constant(value, node, frame, what, BARE)
        if amount != int(amount):
            raise self.error(NOT_A_WHOLE_NUMBER, node, frame, what=what, value=amount)
        return int(amount)

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
        facts: dict[str, Any] = {"left": mismatch.left.words, "verb": verb, "right": mismatch.right.words}
        if mismatch.left.share or mismatch.right.share:
            facts["share"] = True
        if mismatch.left.time or mismatch.right.time:
            facts["times"] = UNITS_OF_TIME
        return self.error(UNIT_MISMATCH, node, frame, **facts)

    def refuse_degrees(self, numbers: Sequence[NumberValue]) -> None:
        """A bare number beside an angle counts in radians; one beyond a turn was meant in degrees."""
        if not any(number.unit == ANGLE for number in numbers):
            return
        for number in numbers:
            if number.unit == BARE and number.node in self.builder.varying:
                raise DependsOnRound
            amount = self.builder.value(number.node) if number.unit == BARE else None
            if amount is not None and abs(amount) > TWO_PI:
                raise SpecError(MORE_THAN_A_TURN(number.origin, amount=amount))

    def agree(self, node: ast.Node, frame: CallFrame, verb: str, *units: Unit) -> Unit:
        try:
            return agree(*units)
        except UnitMismatch as mismatch:
            raise self._mismatch(mismatch, verb, node, frame) from None

    def text(self, value: Value) -> str:
        """A value as an argument is shown in the text of an atom."""
        match value:
            case ObjectValue(place):
                return self.builder.objects[place]
            case RegionValue(name, _):
                return name
            case CameraValue(camera):
                return camera.name
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
