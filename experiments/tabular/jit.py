"""Machine code by numba, with the types kept.

Compiled functions release the GIL, so that threads use all cores, and are kept on disk. numba does not notice that a
function of another file changed: delete `__pycache__` after a change of `rng.py`, `check.py` or `choose.py`.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from typing import Any, TypeVar

from experiments.errors import needs
from scenegen.errors import RequestError

Function = TypeVar("Function", bound=Callable[..., Any])


def compiled(function: Function) -> Function:
    """A function over numbers and arrays, compiled when it is first called. Raises RequestError without numba."""
    try:
        numba: Any = importlib.import_module("numba")
    except ModuleNotFoundError as error:
        if error.name != "numba":
            raise
        raise RequestError(needs("numba", "for the tabular learners")) from error
    try:
        found: Function = numba.njit(nogil=True, cache=True)(function)
    except RuntimeError:  # no folder that could be written to: compiled anew by every process
        found = numba.njit(nogil=True)(function)
    return found
