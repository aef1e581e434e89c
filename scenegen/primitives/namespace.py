"""The functions a primitive may use, for plain floats and for numpy arrays (torch's are in scenegen.robustness).

All three round alike, operation by operation, so that the scalar interpreter and numpy give the same bits but for sin
and cos, whose last bit is the library's. So does torch, but for its sqrt as well: on large batches it may be off by one
unit in the last place.
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
    def hypot(self, a: Any, b: Any) -> Any:
        """sqrt(a * a + b * b), rounded in these steps; its gradient at (0, 0) must be 0, not NaN."""
        ...


def _math_hypot(a: float, b: float) -> float:
    return math.sqrt(a * a + b * b)


def _numpy_hypot(a: Any, b: Any) -> Any:
    return np.sqrt(a * a + b * b)


class _Math:
    """Plain Python floats: the oracle of the tests."""

    minimum = staticmethod(min)
    maximum = staticmethod(max)
    absolute = staticmethod(abs)
    ceil = staticmethod(math.ceil)
    sin = staticmethod(math.sin)
    cos = staticmethod(math.cos)
    hypot = staticmethod(_math_hypot)


class _Numpy:
    """Arrays of any shape."""

    minimum = staticmethod(np.minimum)
    maximum = staticmethod(np.maximum)
    absolute = staticmethod(np.absolute)
    ceil = staticmethod(np.ceil)
    sin = staticmethod(np.sin)
    cos = staticmethod(np.cos)
    hypot = staticmethod(_numpy_hypot)


MATH: Namespace = _Math()
NUMPY: Namespace = _Numpy()
