"""Arguments of public calls, held against what they can be: numpy's whole numbers are as good as Python's, and what is
of another kind is refused before any work is done."""

from __future__ import annotations

import math
import os
from numbers import Integral, Real
from os import PathLike
from pathlib import Path
from typing import Any

from scenegen.errors import RequestError
from scenegen.errors.requests import ODD_FILE_NAME, WRONG_VALUE


def as_int(name: str, value: object) -> int:
    """A whole number as Python has it; True and False are none. Raises RequestError."""
    if isinstance(value, bool) or not isinstance(value, Integral):
        raise RequestError(WRONG_VALUE(argument=name, value=repr(value), wanted="a whole number"))
    return int(value)


def as_seconds(name: str, value: object) -> float:
    """A span of time. Raises RequestError for what is none, or not above 0."""
    if isinstance(value, bool) or not isinstance(value, Real) or not 0.0 < float(value) < math.inf:
        raise RequestError(WRONG_VALUE(argument=name, value=repr(value), wanted="a number of seconds above 0"))
    return float(value)


def as_number(name: str, value: object) -> float:
    """A finite number. Raises RequestError."""
    if isinstance(value, bool) or not isinstance(value, Real) or not math.isfinite(value):
        raise RequestError(WRONG_VALUE(argument=name, value=repr(value), wanted="a finite number"))
    return float(value)


def as_point(name: str, value: Any) -> tuple[float, float, float]:
    """Three finite numbers. Raises RequestError."""
    try:
        x, y, z = map(float, value)
    except (TypeError, ValueError):
        x = y = z = math.nan
    if not math.isfinite(x + y + z):
        raise RequestError(WRONG_VALUE(argument=name, value=repr(value), wanted="a point (x, y, z)"))
    return x, y, z


def as_list(value: object) -> object:
    """A tuple, a list, an array or a tensor as a list, numbers as Python has them; anything else as it is."""
    tolist = getattr(value, "tolist", None)
    value = tolist() if callable(tolist) else value
    if not isinstance(value, tuple | list):
        return value
    return [one.item() if getattr(one, "shape", None) == () else one for one in value]  # a number of numpy or torch


def as_words(name: str, value: object, example: str) -> tuple[str, ...]:
    """A list of words, not one by itself, whose letters would be taken for words. Raises RequestError."""
    if not isinstance(value, list | tuple) or not all(isinstance(one, str) for one in value):
        raise RequestError(WRONG_VALUE(argument=name, value=repr(value), wanted=f"a list: {name}={example}"))
    return tuple(value)


def as_path(name: str, value: object) -> Path:
    """Raises RequestError for what is no path, and for a name that no file can have."""
    given = os.fspath(value) if isinstance(value, str | PathLike) else None
    if not isinstance(given, str):
        raise RequestError(WRONG_VALUE(argument=name, value=repr(value), wanted="the path of a file"))
    odd = "a NUL character" if "\0" in given else "" if _encodes(given) else "half of a character"
    if odd:
        raise RequestError(ODD_FILE_NAME(argument=name, value=ascii(given), odd=odd))
    return Path(given)


def _encodes(text: str) -> bool:
    try:
        os.fsencode(text)
    except UnicodeEncodeError:
        return False
    return True
