"""Kolmogorov-Smirnov tests of every coordinate and every pair, with Bonferroni correction: which coordinate is wrong?

Two-sample tests of each object's x, y and theta, and of each pair's dx, dy, dtheta and distance. Lengths are tested by
Kolmogorov-Smirnov. Angles have no origin, and Kolmogorov-Smirnov would depend on where the circle is cut; they are
tested by Kuiper's statistic (Kuiper 1960), which does not. Limit distributions with Stephens' correction for finite
samples (Stephens 1970, "Use of the Kolmogorov-Smirnov, Cramer-von Mises and related statistics without extensive
tables", the modified D and V), n replaced by n m / (n + m). The worst p-value times the number of columns bounds the
chance that right scenes look this bad (Bonferroni), however the columns depend on each other.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scenegen.errors import DataError
from scenegen.errors.models import WRONG_SHAPE
from scenegen.evaluation.features import Array, checked_pair
from scenegen.evaluation.tails import kolmogorov_tail, kuiper_tail
from scenegen.pose import THETA, TWO_PI, X, Y, along, object_count


@dataclass(frozen=True, slots=True)
class ScreenedColumn:
    """One column's test: its name, the KS or Kuiper statistic in [0, 1], its own p-value."""

    name: str
    statistic: float
    p: float


@dataclass(frozen=True, slots=True)
class Screen:
    """All columns, worst first, and the Bonferroni-corrected p-value of the worst."""

    columns: tuple[ScreenedColumn, ...]
    corrected: float

    @property
    def worst(self) -> ScreenedColumn:
        return self.columns[0]


def ks_screen(a: npt.ArrayLike, b: npt.ArrayLike, names: Sequence[str] | None = None) -> Screen:
    """Screens scenes `a` (3N, n) against `b` (3N, m); `names` (N of them) are the objects', by default 1 to N.

    Columns in which all scenes of both sets are equal (fixed objects) are not tested nor counted; if there are no
    others, the result is p = 1. Time O((n + m) log(n + m)) for each of 3 N + 2 N (N - 1) columns, 2 ms each for 20,000
    scenes; memory O(n + m). Ties, as between duplicates, make a p-value too high, never too low. Raises DataError if
    the sets have different numbers of objects, one is empty, or the names do not fit.
    """
    first, second = checked_pair(a, b, (1, 1))
    objects = object_count(len(first))
    known = [str(index + 1) for index in range(objects)] if names is None else list(names)
    if len(known) != objects:
        found = f"{len(known)} for {objects} objects"
        raise DataError(WRONG_SHAPE(what="names", found=found, wanted="one name per object"))
    tested: list[ScreenedColumn] = []
    for (name, circular, left), (_, _, right) in zip(_columns(first, known), _columns(second, known), strict=True):
        if left.min() != left.max() or right.min() != right.max() or left[0] != right[0]:
            tested.append(ScreenedColumn(name, *(kuiper(left, right) if circular else kolmogorov_smirnov(left, right))))
    if not tested:
        return Screen((ScreenedColumn("all columns are constant", 0.0, 1.0),), 1.0)
    tested.sort(key=lambda column: column.p)
    return Screen(tuple(tested), min(1.0, tested[0].p * len(tested)))


def kolmogorov_smirnov(a: Array, b: Array) -> tuple[float, float]:
    """Statistic sup |F_a - F_b| and asymptotic p-value of samples (n,) and (m,) of a number."""
    above, below = _deviations(a, b)
    statistic = max(above, below)
    root = math.sqrt(len(a) * len(b) / (len(a) + len(b)))
    return statistic, kolmogorov_tail((root + 0.12 + 0.11 / root) * statistic)


def kuiper(a: Array, b: Array) -> tuple[float, float]:
    """Statistic sup (F_a - F_b) + sup (F_b - F_a) and asymptotic p-value of samples (n,) and (m,) of an angle.

    The angles may lie in any interval of one turn: the statistic does not depend on where it starts.
    """
    above, below = _deviations(a, b)
    root = math.sqrt(len(a) * len(b) / (len(a) + len(b)))
    return above + below, kuiper_tail((root + 0.155 + 0.24 / root) * (above + below))


def _deviations(a: Array, b: Array) -> tuple[float, float]:
    """The greatest excess of a's empirical distribution function over b's, and of b's over a's; both >= 0."""
    a, b = np.sort(a), np.sort(b)
    # F_a - F_b steps up at values of a only, down at values of b only; ties are resolved on the right.
    at_a = np.searchsorted(a, a, side="right") / len(a) - np.searchsorted(b, a, side="right") / len(b)
    at_b = np.searchsorted(b, b, side="right") / len(b) - np.searchsorted(a, b, side="right") / len(a)
    return max(0.0, float(at_a.max())), max(0.0, float(at_b.max()))


def _columns(rows: Array, names: Sequence[str]) -> Iterator[tuple[str, bool, Array]]:
    """Name, whether it is an angle (then in [0, 2 pi)), and values (B,) of every column, one at a time."""
    x, y, theta = rows[along(X)], rows[along(Y)], rows[along(THETA)]
    for i, name in enumerate(names):
        yield f"x({name})", False, x[i]
        yield f"y({name})", False, y[i]
        yield f"theta({name})", True, _on_circle(theta[i])
    for i, first in enumerate(names):
        for j in range(i + 1, len(names)):
            dx, dy = x[j] - x[i], y[j] - y[i]
            yield f"x({names[j]}) - x({first})", False, dx
            yield f"y({names[j]}) - y({first})", False, dy
            yield f"theta({names[j]}) - theta({first})", True, _on_circle(theta[j] - theta[i])
            yield f"dist({first}, {names[j]})", False, np.hypot(dx, dy)


def _on_circle(angle: Array) -> Array:
    """Into [0, 2 pi). A tiny negative angle rounds to 2 pi itself, which is 0."""
    wrapped = np.mod(angle, TWO_PI)
    return np.where(wrapped >= TWO_PI, 0.0, wrapped)
