"""What an episode is about: the spec's labels, those that have to be satisfied, and how hard that is."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from gymnasium import error

from scenegen.api.spec import Spec
from scenegen.curriculum.faults import names
from scenegen.errors import quoted, suggest
from scenegen.lang.core import Core, Junction, gated
from scenegen.lang.interpret import phi
from scenegen.primitives import MATH, NUMPY

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Aim:
    """`spec` is the one that was given, but where several labels have to be satisfied it has one label more, the last:
    their minimum. `names` are its D labels, `goal` is the number of the one that is satisfied at the end of a
    successful episode, `labels` counts those of the spec that was given, and `wanted` are those that have to be
    satisfied."""

    spec: Spec
    names: tuple[str, ...]
    goal: int
    labels: int
    wanted: tuple[str, ...]


def make_aim(spec: Spec, goal: str | Sequence[str] | None) -> Aim:
    """`goal` names the labels to satisfy, all of them if it is None. Raises gymnasium.error.Error for unknown ones."""
    wanted = spec.labels if goal is None else names("goal", goal, "a label")
    for name in wanted:
        if name not in spec.labels:
            help_ = suggest(name, spec.labels, f"the spec has {quoted(spec.labels)}")
            raise error.Error(f"`goal` names `{name}`, which is no label of the spec; {help_}")
    if not wanted:
        raise error.Error(f"`goal` names no label; leave it out, or name one of {quoted(spec.labels)}")
    if len(wanted) == 1:
        return Aim(spec, spec.labels, spec.labels.index(wanted[0]), len(spec.labels), wanted)
    core = spec.checked.core
    together = Junction("min", tuple(core.labels[name] for name in wanted))
    labels = {**core.labels, " & ".join(wanted): len(core.nodes)}
    aimed = dataclasses.replace(core, nodes=(*core.nodes, together), labels=labels)
    return Aim(
        Spec(dataclasses.replace(spec.checked, core=aimed)), tuple(labels), len(labels) - 1, len(spec.labels), wanted
    )


class Scorer:
    """phi of all D labels of an aim, and of what the spec requires, the last, if it requires anything (R rows).

    One scene is scored by plain Python: some 6 microseconds for a small spec, where torch takes 100 and numpy 9.
    """

    def __init__(self, aim: Aim) -> None:
        self._core: Core = gated(aim.spec.checked.core)
        self.requires = self._core is not aim.spec.checked.core

    def __call__(self, rows: Array) -> Array:
        """(3N, B) -> (R, B)."""
        count = rows.shape[1]
        if count == 1:
            values = phi(self._core, rows[:, 0].tolist(), MATH)
            return np.array(list(values.values()))[:, None]
        values = phi(self._core, list(rows), NUMPY)
        return np.stack([np.broadcast_to(value, count) for value in values.values()])
