"""The types of arrays: numbers in float64, flags, indices."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Bool = npt.NDArray[np.bool_]
Index = npt.NDArray[np.intp]


def as_numbers(values: Any) -> Array:
    """The numbers of an array, a tensor on any device, a column of a data frame or lists of these, copied; NaN where
    they are masked or missing. Raises TypeError and ValueError for anything else, complex numbers and flags too."""
    found = np.asarray(plain_values(values))
    if found.dtype.kind not in "fiuOU":
        raise TypeError(f"{found.dtype} are not real numbers")
    return found.astype(np.float64, copy=not isinstance(values, list | tuple))


def plain_values(values: Any) -> Any:
    """The same numbers, those of tensors and of masked arrays, also within lists, as arrays: NaN where they are masked.
    What is none of these stays as it is."""
    if hasattr(values, "detach"):  # a tensor
        values = values.detach().cpu()
        values = values.double().numpy() if values.is_floating_point() else values.numpy()
    if isinstance(values, np.ma.MaskedArray):
        return values.data if values.dtype.kind in "cb" else np.ma.filled(values.astype(np.float64), np.nan)
    if isinstance(values, list | tuple) and _have_arrays(values):
        return [plain_values(one) for one in values]
    return values


def _have_arrays(lists: Sequence[Any]) -> bool:
    """Whether lists, and lists in these, hold more than numbers. Numbers are judged by the first: they may be many."""
    while {list, tuple}.issuperset(map(type, lists)):
        inner = chain.from_iterable(lists)
        first = next(inner, 0.0)
        if isinstance(first, float | int):
            return False
        lists = [first, *inner]
    return not isinstance(lists[0], float | int)
