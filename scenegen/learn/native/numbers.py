"""Numbers that write down, in C, how they are computed: one line for each operation, equal ones once."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from scenegen.geometry.namespace import MATH


class CodeLines:
    """The lines of a function's body so far."""

    def __init__(self, most: int) -> None:
        self.lines: list[str] = []
        self._most = most
        self._names: dict[str, str] = {}

    def name(self, kind: str, expression: str) -> str:
        """The variable that holds the expression; `kind` is its type in C. Raises TooLargeError."""
        known = self._names.get(expression)
        if known is None:
            if len(self.lines) == self._most:
                raise TooLargeError
            known = self._names[expression] = f"v{len(self.lines)}"
            self.lines.append(f"{kind} {known} = {expression};")
        return known


class TooLargeError(Exception):
    """A formula of more operations than are compiled."""


class ComparisonResult:
    """The result of a comparison."""

    def __init__(self, name: str) -> None:
        self.name = name


class Number:
    """A number of the scene that the function works on. Floats mix with it as they do with arrays."""

    def __init__(self, lines: CodeLines, name: str) -> None:
        self.lines, self._name = lines, name

    @property
    def name(self) -> str:
        """What it is called in C."""
        return self._name

    def __add__(self, other: Any) -> Number:
        return made(self.lines, "{} + {}", self, other)

    def __radd__(self, other: float) -> Number:
        return made(self.lines, "{} + {}", other, self)

    def __sub__(self, other: Any) -> Number:
        return made(self.lines, "{} - {}", self, other)

    def __rsub__(self, other: float) -> Number:
        return made(self.lines, "{} - {}", other, self)

    def __mul__(self, other: Any) -> Number:
        return made(self.lines, "{} * {}", self, other)

    def __rmul__(self, other: float) -> Number:
        return made(self.lines, "{} * {}", other, self)

    def __truediv__(self, other: Any) -> Number:
        return made(self.lines, "{} / {}", self, other)

    def __neg__(self) -> Number:
        return made(self.lines, "-{}", self)

    def __lt__(self, other: Any) -> ComparisonResult:
        return self._compared("<", other)

    def __gt__(self, other: Any) -> ComparisonResult:
        return self._compared(">", other)

    def _compared(self, sign: str, other: Any) -> ComparisonResult:
        return ComparisonResult(self.lines.name("int", f"{self.name} {sign} {_text(other)}"))


class _Root(Number):
    """The root of a square, with a sign, that is taken only where it is needed: the least of several roots is the root
    of the least square, bit for bit, because roots are rounded. `square` has the sign of the root."""

    def __init__(self, square: Number) -> None:
        super().__init__(square.lines, "")
        self.square = square

    @property
    def name(self) -> str:
        return made(self.lines, "COPYSIGN(SQRT(FABS({0})), {0})", self.square).name


def made(lines: CodeLines, expression: str, *numbers: Any) -> Number:
    """What an expression in C says of these numbers."""
    return Number(lines, lines.name("number", expression.format(*map(_text, numbers))))


def _text(value: Any) -> str:
    if isinstance(value, Number):
        return value.name
    if not math.isfinite(value):
        return "NAN" if math.isnan(value) else "INFINITY" if value > 0 else "(-INFINITY)"
    return f"(number){float(value).hex()}" if value >= 0 else f"(number)({float(value).hex()})"


def _function(name: str, expression: str) -> Callable[..., Any]:
    """A function of the namespace: of floats alone, what the scalar interpreter says."""

    def call(self: Functions, *values: Any) -> Any:
        if not any(isinstance(value, (Number, ComparisonResult)) for value in values):
            return getattr(MATH, name)(*values)
        return made(self.lines, expression, *values)

    return call


class Functions:
    """The functions that primitives may use (scenegen.geometry.Namespace). `angles` are all whose sine or cosine was
    taken: they must not be too large."""

    def __init__(self, lines: CodeLines) -> None:
        self.lines = lines
        self.angles: list[Number] = []

    absolute = _function("absolute", "FABS({})")
    ceil = _function("ceil", "CEIL({})")
    sqrt = _function("sqrt", "SQRT({})")
    hypot = _function("hypot", "SQRT({0} * {0} + {1} * {1})")
    atan2 = _function("atan2", "angle({}, {})")
    clip = _function("clip", "LEAST(MOST({}, {}), {})")
    beyond = _function("beyond", "MOST(FABS({}) - {}, (number)0)")
    copysign = _function("copysign", "COPYSIGN({}, {})")
    _least = _function("minimum", "LEAST({}, {})")
    _most = _function("maximum", "MOST({}, {})")

    def minimum(self, a: Any, b: Any) -> Any:
        if isinstance(a, _Root) and isinstance(b, _Root):
            return _Root(self._least(a.square, b.square))
        return self._least(a, b)

    def maximum(self, a: Any, b: Any) -> Any:
        if isinstance(a, _Root) and isinstance(b, _Root):
            return _Root(self._most(a.square, b.square))
        return self._most(a, b)

    def signed_root(self, square: Any, signed: Any) -> Any:
        if isinstance(square, Number) or isinstance(signed, Number):
            return _Root(made(self.lines, "COPYSIGN({}, {})", square, signed))
        return MATH.signed_root(square, signed)

    def where(self, condition: Any, a: Any, b: Any) -> Any:
        if not isinstance(condition, ComparisonResult):
            return a if condition else b
        return made(self.lines, f"{condition.name} ? {{}} : {{}}", a, b)

    def turn(self, a: Any) -> tuple[Any, Any]:
        if not isinstance(a, Number):
            return MATH.turn(a)
        self.angles.append(a)
        halves = self.lines.name("struct turn", f"turn({a.name})")
        return made(self.lines, f"{halves}.cosine"), made(self.lines, f"{halves}.sine")

    def sin(self, a: Any) -> Any:
        return self.turn(a)[1]

    def cos(self, a: Any) -> Any:
        return self.turn(a)[0]
