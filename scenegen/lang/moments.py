"""One motion under a spec over time, in numpy: phi at every moment, and which atom decides it, at which moment."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from scenegen.lang.core import Atom, Everywhere, Junction, Moment, Until, Window
from scenegen.lang.interpret import deciding_atom, evaluate
from scenegen.lang.timed import Numpy, Signal, Timed, over_time
from scenegen.pose import SIZE
from scenegen.primitives import NUMPY

Array = npt.NDArray[np.float64]


class Decides(NamedTuple):
    """The atom whose margin is phi, and the moment at which it is: it alone would have to change for phi to change."""

    atom: Atom
    moment: int


@dataclass(frozen=True, slots=True)
class Scored:
    """The values of a motion: of every node of the state core and of every formula over time, each (T + 1,)."""

    timed: Timed
    states: list[Array]
    values: list[Array]

    @property
    def phi(self) -> dict[str, float]:
        """phi of every label: its formula's value at moment 0."""
        return {name: float(self.values[node][0]) for name, node in self.timed.labels.items()}

    @property
    def signals(self) -> dict[str, Array]:
        """The value of every label's formula at every moment, (T + 1,); infinite where it looks beyond the last."""
        return {name: self.values[node] for name, node in self.timed.labels.items()}

    @property
    def required(self) -> Array | None:
        """What is required, at every moment, (T + 1,): met where it is >= 0. None where nothing is."""
        return None if self.timed.requirement is None else self.values[self.timed.requirement]

    def decides(self, label: str | None) -> Decides:
        """What decides phi of a label; None: the requirement, where it is least."""
        if label is not None:
            return self._walk(self.timed.labels[label], 0)
        assert self.timed.requirement is not None
        return self._walk(self.timed.requirement, int(self.values[self.timed.requirement].argmin()))

    def _walk(self, index: int, t: int) -> Decides:
        while True:
            node, values = self.timed.nodes[index], self.values
            value = values[index][t]
            match node:
                case Signal(place):
                    label = str(place)
                    core = self.timed.state
                    now = [float(one[t]) for one in self.states]
                    atom = core.nodes[deciding_atom(core, label, now)]
                    assert isinstance(atom, Atom)
                    return Decides(atom, t)
                case Junction(_, args):
                    index = next(arg for arg in args if values[arg][t] == value)
                case Window(_, arg, lowest, highest):
                    index, t = arg, t + lowest + _first(values[arg][t + lowest : t + highest + 1], value)
                case Moment(which, arg):
                    index, t = arg, {"first": 0, "last": len(values[arg]) - 1, "steps": t}[which]
                case Until():
                    index, t = self._until(node, t, value)
                case Everywhere():
                    raise ValueError("a value that is infinite in every motion has no atom")

    def _until(self, node: Until, t: int, value: float) -> tuple[int, int]:
        sign = 1.0 if node.kind == "max" else -1.0
        left, right = (sign * self.values[part][t : t + node.highest + 1] for part in (node.left, node.right))
        held = np.minimum.accumulate(left)
        if not node.closed:
            held = np.concatenate([[math.inf], held[:-1]])
        both = np.minimum(held, right)
        end = node.lowest + _first(both[node.lowest :], sign * value)
        if right[end] == sign * value:
            return node.right, t + end
        return node.left, t + _first(left, sign * value)


def _first(values: Array, value: float) -> int:
    return int((values == value).argmax())


def score(timed: Timed, poses: Array) -> Scored:
    """The values of a motion, (T + 1, N, 3)."""
    moments = len(poses)
    before = np.concatenate([poses[:1], poses[:-1]])
    states = np.concatenate([poses, before], axis=1) if timed.steps else poses
    rows: Sequence[Array] = list(states.reshape(moments, states.shape[1] * SIZE).T.copy())
    found = [np.broadcast_to(value, moments) for value in evaluate(timed.state, rows, NUMPY)]

    def everywhere(value: float) -> Array:
        return np.full(moments, value)

    signals = [found[node] for node in timed.state.labels.values()]
    return Scored(timed, found, over_time(Numpy(), timed, signals, everywhere))
