"""What the parts of lowering need of each other: the state of one spec, and the way back to its expressions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

from scenegen.errors import Span, SpecError
from scenegen.lang import ast
from scenegen.lang.blame import Frame
from scenegen.lang.builder import CoreBuilder
from scenegen.lang.kinds import Kinds
from scenegen.lang.scope import Scope
from scenegen.lang.trampoline import Call
from scenegen.lang.values import NumberValue, Value
from scenegen.primitives import Footprint
from scenegen.primitives.units import Unit


class Context(Protocol):
    """The `Lowering` that a function works for (lower.py says what its fields and methods are)."""

    scope: Scope
    builder: CoreBuilder
    kinds: Kinds
    steps: int
    expansions: dict[object, tuple[Value, list[Value]]]

    def origin(self, node: ast.Node, frame: Frame) -> Span:
        """Where the user wrote what an expression stands for."""

    def error(self, title: str, node: ast.Node, frame: Frame, label: str = "", help: str = "") -> SpecError:
        """The diagnostic for an expression."""

    def lower(self, node: ast.Expr, env: Mapping[str, Value], frame: Frame) -> Call[Value]:
        """The value of an expression, as a call for `trampoline.run`."""

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
