"""The functions a primitive may use, for plain floats and for numpy arrays (torch's are in scenegen.robustness).

All three round alike, operation by operation, so that the scalar interpreter and numpy give the same bits but for sin,
cos and atan2, whose last bit is the library's. So does torch, but for its sqrt as well: on large batches it may be off
by one unit in the last place.
"""

from __future__ import annotations

import math
from typing import Any, Protocol

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
