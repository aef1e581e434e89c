"""What the parts of lowering need of each other: the state of one spec, and the way back to its expressions."""

from __future__ import annotations

import dataclasses
from collections.abc import Generator, Iterator, Mapping, Sequence
from typing import Any, Protocol, TypeVar

from scenegen.errors import Diagnostic, Kind, Source, Span, SpecError
from scenegen.geometry import Footprint
from scenegen.geometry.units import Unit
from scenegen.lang.check.scope import Area, Scope
from scenegen.lang.check.values import Coercion, NumberValue, Value
from scenegen.lang.formula.builder import CoreBuilder
from scenegen.lang.formula.timed import Horizon
from scenegen.lang.spec import Support, SurfaceChoice
from scenegen.lang.syntax import ast
from scenegen.lang.syntax.parse import MOST_ERRORS
from scenegen.things import Shape

# --------------------------------------------------------------------------------------------------------------------
# Where expansion is, and whom to tell when something is wrong there.


MOST_CALLS = 32  # how far outwards the blame goes: definitions may call each other thousands deep
MOST_VARIABLES = 4  # how many variables of quantifiers a note names


@dataclasses.dataclass(frozen=True, slots=True)
class CallFrame:
    """The source of the text at hand, and the calls that led here, innermost first.

    `text` is the call being expanded, `body` the definition's formula; both are unset outside definitions. `where`
    says what the variables of quantifiers stand for, innermost last; `rounds` is how often the quantifiers around, in
    the same formula, come by here.
    """

    source: Source
    calls: tuple[Span, ...] = ()
    text: str = ""
    body: ast.Expr | None = None
    where: tuple[Mapping[str, Value], ...] = ()
    rounds: int = 1


def spans(node: ast.Node, frame: CallFrame, prelude: Source) -> tuple[Span, ...]:
    """The user's places for a node, innermost first: the prelude's own lines are of no help to anybody."""
    places = (node.span(frame.source), *frame.calls)
    own = tuple(span for span in places if span.source is not prelude)
    return (own or places)[:MOST_CALLS]


def origin(node: ast.Node, frame: CallFrame, prelude: Source) -> Span:
    """The user's innermost place for a node."""
    if frame.source is prelude and frame.calls:
        return frame.calls[0]
    return Span(frame.source, node.start, node.end)


def error(
    kind: Kind, node: ast.Node, frame: CallFrame, prelude: Source, where: Sequence[str], /, **facts: Any
) -> SpecError:
    """A mistake at a node, told at the user's own place, with the way that led there; `where` says what the variables
    of quantifiers stand for: "i = 6"."""
    places = spans(node, frame, prelude)
    called = places[1].place if len(places) > 1 else None
    shown = ", ".join(where[-MOST_VARIABLES:])
    return SpecError(kind(places[0], expansion=frame.text, where=shown, called=called, **facts))


# --------------------------------------------------------------------------------------------------------------------
# Recursion without Python's stack.
#
# A recursive function is written as a generator that yields the calls it wants made and is sent their results. So the
# checker reads like the recursive function it is, and a formula 10,000 levels deep is no different from one with two.


T = TypeVar("T")
Call = Generator[Any, Any, T]


def run(call: Call[T]) -> T:
    """The value that a generator of calls returns; exceptions travel up the calls as they would in functions."""
    stack: list[Call[Any]] = [call]
    value: Any = None
    error: BaseException | None = None
    while True:
        try:
            wanted = stack[-1].throw(error) if error is not None else stack[-1].send(value)
        except StopIteration as done:
            value, error = done.value, None
            stack.pop()
            if not stack:
                result: T = value
                return result
        except BaseException as raised:
            error = raised
            stack.pop()
            if not stack:
                raise
        else:
            stack.append(wanted)
            value, error = None, None


class Context(Protocol):
    """The `Lowering` that a function works for (lower.py says what its fields and methods are)."""

    scope: Scope
    builder: CoreBuilder
    root: CoreBuilder
    coerce: Coercion
    shapes: Sequence[Shape]
    supports: Mapping[int, Support]
    choices: Mapping[int, SurfaceChoice]
    heights: Sequence[float | None] | None
    steps: int
    inside: int
    made: int
    placeholders: Iterator[int]
    expansions: dict[object, tuple[Value, list[Value]]]
    calls: dict[int, list[tuple[str, ast.Expr, str]]]
    areas: dict[str, Area]
    levels: dict[str, int]
    used: set[str]
    values: dict[str, Value]
    horizon: Horizon | None
    noticed: list[Diagnostic]

    def rounds(self, more: int, node: ast.Quantifier, frame: CallFrame, foreseen: int = 0) -> None:
        """Raises SpecError where a quantifier takes too many rounds."""

    def spend(self, steps: int, frame: CallFrame) -> None:
        """Counts what is expanded. Raises FormulaTooLarge."""

    def foresee(self, more: int) -> None:
        """Raises FormulaTooLarge where so many more expressions are too many."""

    def use(self, builder: CoreBuilder) -> None:
        """Expands into another builder from now on."""

    def spans(self, node: ast.Node, frame: CallFrame) -> tuple[Span, ...]:
        """The place of an expression, and the calls that it was expanded in."""

    def origin(self, node: ast.Node, frame: CallFrame) -> Span:
        """Where the user wrote what an expression stands for."""

    def error(self, kind: Kind, node: ast.Node, frame: CallFrame, /, **facts: Any) -> SpecError:
        """The diagnostic for an expression."""

    def lower(self, node: ast.Expr, env: Mapping[str, Value], frame: CallFrame) -> Call[Value]:
        """The value of an expression, as a call for `trampoline.run`."""

    def at_once(self, node: ast.Expr, env: Mapping[str, Value], frame: CallFrame) -> Value | None:
        """The value of an expression that needs no call; None for others."""

    def text(self, value: Value) -> str:
        """A value as an argument is shown in the text of an atom."""

    def apply(
        self,
        name: str,
        units: Sequence[Unit],
        args: Sequence[int],
        shapes: tuple[Footprint, ...],
        node: ast.Expr,
        frame: CallFrame,
    ) -> NumberValue:
        """A primitive of numbers."""

    def refuse_degrees(self, numbers: Sequence[NumberValue]) -> None:
        """Raises SpecError for a bare number beside an angle that was meant in degrees."""


# --------------------------------------------------------------------------------------------------------------------
# The stages of checking: each runs to its end and then refuses with all that it found wrong.


def refusal(problems: Sequence[Diagnostic], main: Source) -> SpecError:
    """All problems once, those of the spec itself first, each file's in the order of its text."""

    def place(problem: Diagnostic) -> tuple[bool, str, int]:
        span = problem.span
        return (False, "", 0) if span is None else (span.source is not main, span.source.name, span.start)

    return SpecError(*sorted(dict.fromkeys(problems), key=place)[:MOST_ERRORS])


class ErrorCollector:
    """Runs the steps of a stage and keeps what each found wrong, so that one mistake does not hide another."""

    def __init__(self, source: Source) -> None:
        self.source = source
        self.problems: list[Diagnostic] = []

    def __enter__(self) -> ErrorCollector:
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> bool:
        if isinstance(error, SpecError):
            self.problems.extend(error.diagnostics)
            return True
        return False

    @property
    def full(self) -> bool:
        """Whether nobody would read any more."""
        return len(self.problems) >= MOST_ERRORS

    def close(self) -> None:
        """Raises SpecError where anything was wrong."""
        if self.problems:
            raise refusal(self.problems, self.source)
