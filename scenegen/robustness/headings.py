"""Headings brought to [0, 2 pi), where a formula takes them as numbers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import torch

from scenegen.pose import TWO_PI


def coordinates(rows: Callable[[int], Any], bare: frozenset[int]) -> Callable[[int], Any]:
    """What `run` takes for the rows of poses whose headings may lie outside [0, 2 pi).

    Those that a formula takes as numbers, `bare` (lang.headings.bare_rows), are brought there, with the gradient 1; for
    the others a turn more or less makes no difference, and nothing is done.
    """
    if not bare:
        return rows

    def coordinate(row: int) -> Any:
        theta = rows(row)
        if row not in bare:
            return theta
        rest = torch.remainder(theta, TWO_PI)
        rest = torch.where(rest >= TWO_PI, rest - TWO_PI, rest)  # that of -1e-17 is rounded up
        return torch.where((theta < 0.0) | (theta >= TWO_PI), rest, theta)

    return coordinate
