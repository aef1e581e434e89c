"""What the parts of lowering need of each other: the state of one spec, and the way back to its expressions."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Protocol

from scenegen.assets import Shape
from scenegen.errors import Diagnostic, Kind, Span, SpecError
from scenegen.lang import ast
from scenegen.lang.builder import CoreBuilder
from scenegen.lang.coercion import Coercion
from scenegen.lang.horizon import Horizon
from scenegen.lang.places import Area
from scenegen.lang.provenance import Frame
from scenegen.lang.scope import Scope
from scenegen.lang.spec import Choice, Support
from scenegen.lang.trampoline import Call
from scenegen.lang.values import NumberValue, Value
from scenegen.primitives import Footprint
from scenegen.primitives.units import Unit


class Context(Protocol):
    """The `Lowering` that a function works for (lower.py says what its fields and methods are)."""

    scope: Scope
    builder: CoreBuilder
    root: CoreBuilder
    coerce: Coercion
    shapes: Sequence[Shape]
    supports: Mapping[int, Support]
    choices: Mapping[int, Choice]
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

    def rounds(self, more: int, node: ast.Quantifier, frame: Frame, foreseen: int = 0) -> None:
        """Raises SpecError where a quantifier takes too many rounds."""

    def spend(self, steps: int, frame: Frame) -> None:
        """Counts what is expanded. Raises TooLarge."""

    def foresee(self, more: int) -> None:
        """Raises TooLarge where so many more expressions are too many."""

    def use(self, builder: CoreBuilder) -> None:
        """Expands into another builder from now on."""

    def spans(self, node: ast.Node, frame: Frame) -> tuple[Span, ...]:
        """The place of an expression, and the calls that it was expanded in."""

    def origin(self, node: ast.Node, frame: Frame) -> Span:
        """Where the user wrote what an expression stands for."""

    def error(self, kind: Kind, node: ast.Node, frame: Frame, /, **facts: Any) -> SpecError:
        """The diagnostic for an expression."""

    def lower(self, node: ast.Expr, env: Mapping[str, Value], frame: Frame) -> Call[Value]:
        """The value of an expression, as a call for `trampoline.run`."""

    def at_once(self, node: ast.Expr, env: Mapping[str, Value], frame: Frame) -> Value | None:
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
        frame: Frame,
    ) -> NumberValue:
        """A primitive of numbers."""

    def refuse_degrees(self, numbers: Sequence[NumberValue]) -> None:
        """Raises SpecError for a bare number beside an angle that was meant in degrees."""
