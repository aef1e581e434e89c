"""A hash of a plan's values. It does not depend on the version of Python or pickle."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np


def digest(*values: Any) -> str:
    """SHA-256 of nested dataclasses, sequences, mappings, sets, arrays, numbers and texts. Raises TypeError for others.

    Two values have the same digest if all their types, shapes and numbers are the same, bit for bit.
    """
    found = hashlib.sha256()
    waiting: list[Any] = [values]
    while waiting:
        value = waiting.pop()
        found.update(f"{type(value).__name__}:".encode())
        if isinstance(value, np.ndarray):
            found.update(f"{value.dtype.str}{value.shape}".encode())
            found.update(np.ascontiguousarray(value).tobytes())
        elif value is None or isinstance(value, bool | int | float | str | np.generic):
            text = repr(value)  # for floats, the shortest text that reads back to the same bits
            found.update(f"{len(text)}:{text}".encode())
        elif is_dataclass(value):
            waiting += [getattr(value, one.name) for one in fields(value)]
        elif isinstance(value, Mapping):
            found.update(str(len(value)).encode())
            waiting += [part for item in value.items() for part in item]
        elif isinstance(value, tuple | list):
            found.update(str(len(value)).encode())
            waiting += value
        elif isinstance(value, set | frozenset):
            waiting.append(tuple(sorted(value)))
        else:
            raise TypeError(f"no digest of a {type(value).__name__}")
    return found.hexdigest()
