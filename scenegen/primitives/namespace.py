"""The functions a primitive may use, for plain floats and for numpy arrays (torch's are in scenegen.robustness).

All three round alike, operation by operation, so that the scalar interpreter and numpy give the same bits but for sin,
cos and atan2, whose last bit is the library's. So does torch, but for its sqrt as well: on large batches it may be off
by one unit in the last place.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
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
    def sqrt(self, a: Any) -> Any:
        """Of a >= 0; its gradient at 0 must be 0, not NaN."""
        ...

    def hypot(self, a: Any, b: Any) -> Any:
        """sqrt(a * a + b * b), rounded in these steps; its gradient at (0, 0) must be 0, not NaN."""
        ...

    def atan2(self, y: Any, x: Any) -> Any:
        """The angle of (x, y), 0 for (0.0, 0.0); its gradient there must be 0, not NaN."""
        ...

    def clip(self, a: Any, lowest: float, highest: float) -> Any:
        """The number nearest to `a` between two constants."""
        ...

    def where(self, condition: Any, a: Any, b: Any) -> Any:
        """a where the condition holds, b elsewhere. Both are computed: neither may have a NaN gradient."""
        ...


def _math_hypot(a: float, b: float) -> float:
    return math.sqrt(a * a + b * b)


def _math_clip(a: float, lowest: float, highest: float) -> float:
    return min(max(a, lowest), highest)


def _math_where(condition: bool, a: float, b: float) -> float:
    return a if condition else b


def _numpy_hypot(a: Any, b: Any) -> Any:
    return np.sqrt(a * a + b * b)


def _numpy_clip(a: Any, lowest: float, highest: float) -> Any:
    return np.minimum(np.maximum(a, lowest), highest)


class _Math:
    """Plain Python floats: the oracle of the tests."""

    minimum = staticmethod(min)
    maximum = staticmethod(max)
    absolute = staticmethod(abs)
    ceil = staticmethod(math.ceil)
    sin = staticmethod(math.sin)
    cos = staticmethod(math.cos)
    sqrt = staticmethod(math.sqrt)
    hypot = staticmethod(_math_hypot)
    atan2 = staticmethod(math.atan2)
    clip = staticmethod(_math_clip)
    where = staticmethod(_math_where)


class _Numpy:
    """Arrays of any shape."""

    minimum = staticmethod(np.minimum)
    maximum = staticmethod(np.maximum)
    absolute = staticmethod(np.absolute)
    ceil = staticmethod(np.ceil)
    sin = staticmethod(np.sin)
    cos = staticmethod(np.cos)
    sqrt = staticmethod(np.sqrt)
    hypot = staticmethod(_numpy_hypot)
    atan2 = staticmethod(np.arctan2)
    clip = staticmethod(_numpy_clip)
    where = staticmethod(np.where)


MATH: Namespace = _Math()
NUMPY: Namespace = _Numpy()


class Turning:
    """A namespace that works out the sine and cosine of each of the `angles` once, however many footprints turn by it.
    The values are the same bits; an angle is known by being the same object."""

    def __init__(self, of: Namespace, angles: Iterable[Any]) -> None:
        self._of = of
        self._angles = {id(angle): angle for angle in angles}  # kept: an id is good for as long as its object lives
        self._sin: dict[int, Any] = {}
        self._cos: dict[int, Any] = {}

    def __getattr__(self, name: str) -> Any:
        return getattr(self._of, name)

    def sin(self, a: Any) -> Any:
        return self._once(self._sin, self._of.sin, a)

    def cos(self, a: Any) -> Any:
        return self._once(self._cos, self._of.cos, a)

    def _once(self, known: dict[int, Any], function: Callable[[Any], Any], a: Any) -> Any:
        key = id(a)
        if key not in self._angles:
            return function(a)
        if key not in known:
            known[key] = function(a)
        return known[key]


def turning(of: Namespace, angles: Iterable[Any]) -> Namespace:
    """The namespace for one run over a formula whose headings are `angles`."""
    return cast(Namespace, Turning(of, angles))
