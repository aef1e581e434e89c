"""Messages between the server and its worker processes: JSON, each behind its length."""

from __future__ import annotations

import json
import math
import struct
from typing import Any

import numpy as np

SIZE = struct.Struct("!I")
LARGEST = 256 << 20  # bytes of one message


def packed(value: Any) -> bytes:
    """A message as it travels. Numbers that JSON cannot hold become null."""
    data = dumps(value)
    return SIZE.pack(len(data)) + data


def dumps(value: Any) -> bytes:
    """JSON that browsers read: no NaN, no infinity."""
    try:
        return json.dumps(value, allow_nan=False, separators=(",", ":"), default=_plain).encode()
    except ValueError:
        return json.dumps(finite(value), allow_nan=False, separators=(",", ":"), default=_plain).encode()


def finite(value: Any) -> Any:
    """The value with null in the place of NaN and infinity."""
    if isinstance(value, np.ndarray):
        return finite(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {key: finite(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [finite(one) for one in value]
    return value


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray | np.generic):
        return finite(value.tolist())
    raise TypeError(f"{type(value).__name__} is no JSON")
