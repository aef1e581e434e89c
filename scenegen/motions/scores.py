"""phi over motions in numpy, from a spec over time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scenegen.lang.headings import bare_rows
from scenegen.lang.interpret import phi as evaluate
from scenegen.lang.timed import Numpy, Timed, over_time
from scenegen.motions.variables import within_a_turn
from scenegen.primitives import NUMPY

Array = npt.NDArray[np.float64]

STATES = 1 << 16  # states scored at a time, which stay in cache
ALIVE = 1 << 25  # numbers alive meanwhile; large formulas get fewer states


@dataclass(frozen=True, slots=True)
class TraceScores:
    """Poses (N, 3, T + 1, B) -> (L + 1, B): phi of every label at moment 0, then the least margin of the requirement
    over time, infinity where nothing is required."""

    timed: Timed

    def __call__(self, poses: Array) -> Array:
        count = poses.shape[-1]
        nodes = len(self.timed.state.nodes) + 2 * len(self.timed.nodes)
        some = max(1, min(STATES, ALIVE // nodes) // poses.shape[2])
        if count <= some:
            return self._some(poses)
        parts = [poses[..., start : start + some] for start in range(0, count, some)]
        return np.concatenate([self._some(part) for part in parts], axis=1)

    def signals(self, poses: Array) -> Array:
        """phi of every label at every moment: (N, 3, T + 1, B) -> (L, T + 1, B)."""
        return np.array([value.T for value in self._values(poses, list(self.timed.labels.values()))])

    def _some(self, poses: Array) -> Array:
        timed, count = self.timed, poses.shape[-1]
        required = [] if timed.requirement is None else [timed.requirement]
        labels = self._values(poses, [*timed.labels.values(), *required])
        out = np.empty((len(timed.labels) + 1, count))
        for row, value in zip(out, labels, strict=False):
            row[:] = value[:, 0]
        out[-1] = labels[-1].min(axis=1) if required else np.inf
        return out

    def _values(self, poses: Array, nodes: list[int]) -> list[Array]:
        """The values of nodes at every moment, (B, T + 1) each."""
        timed, (things, axes, moments, count) = self.timed, poses.shape
        if bare_rows(timed.state):
            poses = within_a_turn(poses.copy())
        rows = list(poses.reshape(things * axes, moments * count))
        if timed.steps:
            before = np.concatenate([poses[:, :, :1], poses[:, :, :-1]], axis=2)
            rows += list(before.reshape(things * axes, moments * count))
        signals = evaluate(timed.state, rows, NUMPY).values()

        def everywhere(value: float) -> Array:
            return np.full((moments, count), value).T  # time is the last axis of formulas, and the first in memory

        shape = (moments, count)
        arrays = [np.broadcast_to(one, moments * count).reshape(shape).T for one in signals]
        values = over_time(Numpy(), timed, arrays, everywhere)
        return [values[node] for node in nodes]
