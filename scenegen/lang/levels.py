"""How high the objects of drawn scenes stand, where a spec declares it."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from scenegen.lang.spec import CheckedSpec, Choice
from scenegen.pose import X, row_of

Array = npt.NDArray[np.float64]


def chosen(choice: Choice, rows: Array) -> npt.NDArray[np.intp]:
    """(n,): which option each scene has, counted from 0; `rows` are those of the core, (3M, n)."""
    return np.asarray(np.searchsorted(np.array(choice.ends[:-1]), rows[row_of(choice.switch, X)], side="right"))


def levels(spec: CheckedSpec, rows: Array) -> Array | None:
    """(n, N): how high above the table each object's lowest point is, in metres, in scenes with the core's rows
    (3M, n), the switches of choices among them; None where heights follow from the poses."""
    if not spec.declares_heights:
        return None
    found: dict[int, Array] = {}
    waiting = list(range(len(spec.objects)))
    while waiting:  # what carries comes before what it carries: supports have no cycles
        ready = [which for which in waiting if _carriers(spec, which) <= found.keys()]
        for which in ready:
            found[which] = _level(spec, which, rows, found)
        waiting = [which for which in waiting if which not in found]
    return np.stack([found[which] for which in range(len(spec.objects))], axis=1)


def _carriers(spec: CheckedSpec, which: int) -> set[int]:
    if which in spec.choices:
        return {one.carrier for one in spec.choices[which].options if one.carrier is not None}
    under = spec.supports.get(which)
    return set() if under is None or under.carrier is None else {under.carrier}


def _level(spec: CheckedSpec, which: int, rows: Array, found: dict[int, Array]) -> Array:
    count = rows.shape[1]
    known = spec.heights[which]
    if known is not None:
        return np.full(count, known)
    choice = spec.choices.get(which)
    options = (spec.supports[which],) if choice is None else choice.options
    each = np.stack([one.height + (np.zeros(count) if one.carrier is None else found[one.carrier]) for one in options])
    picked = np.zeros(count, dtype=np.intp) if choice is None else chosen(choice, rows)
    return np.asarray(each[picked, np.arange(count)])
