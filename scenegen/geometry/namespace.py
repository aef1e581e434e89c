"""The functions a primitive may use, for plain floats and for numpy arrays (torch's are in scenegen.learn.robustness).

All three round each operation alike, so the scalar interpreter and numpy give the same bits, except for sin, cos and
atan2, whose last bit depends on the library. torch does, too, except that its sqrt may be off by one unit in the last
place on large batches.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from typing import Any, Protocol, cast

import numpy as np


class Namespace(Protocol):
    """Elementwise functions over one kind of number. Arithmetic operators come with the numbers themselves."""

    def minimum(self, a: Any, b: Any) -> Any: ...
    def maximum(self, a: Any, b: Any) -> Any: ...
    def absolute(self, a: Any) -> Any: ...
    def ceil(self, a: Any) -> Any: ...
    def sin(self, a: Any) -> Any: ...
    def cos(self, a: Any) -> Any: ...
    def turn(self, a: Any) -> tuple[Any, Any]:
        """Cosine and sine of an angle by which a footprint is turned."""
        ...

    def sqrt(self, a: Any) -> Any:
        """Of a >= 0; its gradient at 0 must be 0, not NaN."""
        ...

    def hypot(self, a: Any, b: Any) -> Any:
        """sqrt(a * a + b * b), rounded in these steps; its gradient at (0, 0) must be 0, not NaN."""
        ...

    def signed_root(self, square: Any, signed: Any) -> Any:
        """sqrt(square) with the sign of `signed`, whose gradient is the result's where that is 0."""
        ...

    def atan2(self, y: Any, x: Any) -> Any:
        """The angle of (x, y), 0 for (0.0, 0.0); its gradient there must be 0, not NaN."""
        ...

    def clip(self, a: Any, lowest: float, highest: float) -> Any:
        """The number nearest to `a` between two constants."""
        ...

    def beyond(self, a: Any, half: float) -> Any:
        """How far `a` lies outside of [-half, half], with its sign or without; 0 inside."""
        ...

    def copysign(self, size: Any, sign: Any) -> Any:
        """The size of one number, which is not negative, with the sign of the other; where that is zero, either sign.
        No gradient flows to the latter."""
        ...

    def where(self, condition: Any, a: Any, b: Any) -> Any:
        """a where the condition holds, b elsewhere. Both are computed: neither may have a NaN gradient."""
        ...

    def only(self, condition: Any, function: Callable[..., Any], otherwise: Sequence[Any], *numbers: Any) -> Any:
        """function(namespace, *numbers) where the condition holds, a tuple, and `otherwise` elsewhere. It gets
        constants, and arrays with one axis in the place of the condition's, cut down to those places where that saves
        work; axes before these stay."""
        ...

    def spread(self, low: Any, high: Any, count: int) -> Any:
        """(count, n), of arrays (n,): the middles of so many equal parts from one number to another."""
        ...


def _math_hypot(a: float, b: float) -> float:
    return math.sqrt(a * a + b * b)


def _math_clip(a: float, lowest: float, highest: float) -> float:
    return min(max(a, lowest), highest)


def _math_beyond(a: float, half: float) -> float:
    return a - _math_clip(a, -half, half)


def _math_where(condition: bool, a: float, b: float) -> float:
    return a if condition else b


def _math_only(condition: bool, function: Callable[..., Any], otherwise: Sequence[float], *numbers: float) -> Any:
    if not condition:
        return otherwise
    return [float(value[0]) for value in function(NUMPY, *(np.array([number]) for number in numbers))]


def _numpy_only(condition: Any, function: Callable[..., Any], otherwise: Sequence[Any], *numbers: Any) -> Any:
    shape = np.shape(condition)
    places = np.flatnonzero(condition)

    def take(number: Any) -> Any:
        before = np.shape(number)[: max(0, np.ndim(number) - len(shape))]
        return np.broadcast_to(number, (*before, *shape)).reshape(*before, -1)[..., places]

    if not places.size:
        return [np.broadcast_to(other, shape) for other in otherwise]
    found = function(NUMPY, *(take(one) if np.ndim(one) else one for one in numbers))
    filled = []
    for value, other in zip(found, otherwise, strict=True):
        flat = np.broadcast_to(other, shape).reshape(-1)
        whole = np.array(np.broadcast_to(flat, (*value.shape[:-1], flat.size)))
        whole[..., places] = value
        filled.append(whole.reshape(*value.shape[:-1], *shape))
    return filled


def _numpy_spread(low: Any, high: Any, count: int) -> Any:
    return low + (high - low) * ((np.arange(count) + 0.5) / count)[:, None]


def _math_turn(a: float) -> tuple[float, float]:
    return math.cos(a), math.sin(a)


def _math_signed_root(square: float, signed: float) -> float:
    return math.copysign(math.sqrt(square), signed)


def _numpy_turn(a: Any) -> tuple[Any, Any]:
    return np.cos(a), np.sin(a)


def _numpy_signed_root(square: Any, signed: Any) -> Any:
    return np.copysign(np.sqrt(square), signed)


def _numpy_hypot(a: Any, b: Any) -> Any:
    return np.sqrt(a * a + b * b)


def _numpy_clip(a: Any, lowest: float, highest: float) -> Any:
    return np.minimum(np.maximum(a, lowest), highest)


def _numpy_beyond(a: Any, half: float) -> Any:
    return a - _numpy_clip(a, -half, half)


class _Math:
    """Plain Python floats: the oracle of the tests."""

    minimum = staticmethod(min)
    maximum = staticmethod(max)
    absolute = staticmethod(abs)
    ceil = staticmethod(math.ceil)
    sin = staticmethod(math.sin)
    cos = staticmethod(math.cos)
    turn = staticmethod(_math_turn)
    sqrt = staticmethod(math.sqrt)
    signed_root = staticmethod(_math_signed_root)
    hypot = staticmethod(_math_hypot)
    atan2 = staticmethod(math.atan2)
    clip = staticmethod(_math_clip)
    beyond = staticmethod(_math_beyond)
    copysign = staticmethod(math.copysign)
    where = staticmethod(_math_where)
    only = staticmethod(_math_only)
    spread = staticmethod(_numpy_spread)


class _Numpy:
    """Arrays of any shape."""

    minimum = staticmethod(np.minimum)
    maximum = staticmethod(np.maximum)
    absolute = staticmethod(np.absolute)
    ceil = staticmethod(np.ceil)
    sin = staticmethod(np.sin)
    cos = staticmethod(np.cos)
    turn = staticmethod(_numpy_turn)
    sqrt = staticmethod(np.sqrt)
    signed_root = staticmethod(_numpy_signed_root)
    hypot = staticmethod(_numpy_hypot)
    atan2 = staticmethod(np.arctan2)
    clip = staticmethod(_numpy_clip)
    beyond = staticmethod(_numpy_beyond)
    copysign = staticmethod(np.copysign)
    where = staticmethod(np.where)
    only = staticmethod(_numpy_only)
    spread = staticmethod(_numpy_spread)


MATH: Namespace = _Math()
NUMPY: Namespace = _Numpy()


class Turning:
    """A namespace that computes the sine and cosine of each of the `angles` only once, for any number of footprints.
    The values are bit for bit the same; angles are identified by object identity."""

    def __init__(self, of: Namespace, angles: Iterable[Any] = ()) -> None:
        self._of = of
        self._angles: dict[int, Any] = {}  # keeps the objects alive, so that their ids stay valid
        self._known: dict[tuple[str, int], Any] = {}
        for angle in angles:
            self.keep(angle)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._of, name)

    def keep(self, angle: Any) -> None:
        """From now on, the angle's sine and cosine are cached."""
        self._angles[id(angle)] = angle

    def drop(self, angle: Any) -> None:
        """Drops the angle with its sine and cosine."""
        if self._angles.pop(id(angle), None) is not None:
            for function in ("sin", "cos", "turn"):
                self._known.pop((function, id(angle)), None)

    def sin(self, a: Any) -> Any:
        turn = self._known.get(("turn", id(a)))
        return self._once("sin", a) if turn is None else turn[1]

    def cos(self, a: Any) -> Any:
        turn = self._known.get(("turn", id(a)))
        return self._once("cos", a) if turn is None else turn[0]

    def turn(self, a: Any) -> tuple[Any, Any]:
        turn: tuple[Any, Any] = self._once("turn", a)
        return turn

    def _once(self, function: str, a: Any) -> Any:
        key = (function, id(a))
        if id(a) not in self._angles:
            return getattr(self._of, function)(a)
        if key not in self._known:
            self._known[key] = getattr(self._of, function)(a)
        return self._known[key]


def turning(of: Namespace, angles: Iterable[Any]) -> Namespace:
    """The namespace for one run over a formula whose headings are `angles`."""
    return cast(Namespace, Turning(of, angles))
