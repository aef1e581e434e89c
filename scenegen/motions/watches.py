"""What phi can still become of many motions at once, each of which is at a moment of its own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from scenegen.lang.timed import Numpy, Timed, over_time
from scenegen.motions.monitor import HIGH, LOW, state_values
from scenegen.motions.reach import Reach

Array = npt.NDArray[np.float64]
Places = npt.NDArray[np.intp]


@dataclass(slots=True)
class Watches:
    """B motions, with the bounds that a `Watch` with `reach` has of each, to the last bit. `lowest` and `highest` (3N,)
    are the limits of poses."""

    timed: Timed
    lowest: Array
    highest: Array
    count: int
    seen: Places = field(init=False)  # (B,): moments of each motion
    possible: npt.NDArray[np.bool_] = field(init=False)  # (B,): whether the requirement can still hold
    _signals: Array = field(init=False)  # (S, 2, B, T + 1)
    _before: Array = field(init=False)  # (3N, B)
    _ends: Array = field(init=False)  # of every node over time, at moment 0: (K, 2, B)
    _reach: Reach = field(init=False)

    def __post_init__(self) -> None:
        timed, count = self.timed, self.count
        self.seen, self.possible = np.zeros(count, dtype=np.intp), np.ones(count, dtype=np.bool_)
        self._reach = Reach(timed, self.lowest, self.highest)
        self._signals = np.zeros((len(timed.state.labels), 2, count, timed.horizon.moments))
        self._before = np.zeros((len(self.lowest), count))
        self._ends = np.zeros((len(timed.nodes), 2, count))

    def begin(self, who: Places) -> None:
        """New motions, of which nothing is seen."""
        self.seen[who] = 0

    def back(self, who: Places, before: Array) -> None:
        """Forget the last moment of motions, before which they were at `before`, (3N, K)."""
        self.seen[who] -= 1
        self._before[:, who] = before

    def add(self, who: Places, rows: Array) -> None:
        """The next moment of K motions, (3N, K)."""
        seen = self.seen[who]
        before = np.where(seen > 0, self._before[:, who], rows)
        state = np.concatenate([rows, before]) if self.timed.steps else rows
        self._signals[:, :, who, seen] = state_values(self.timed, state)[:, None]
        self._before[:, who] = rows
        self.seen[who] = seen = seen + 1
        self._look_ahead(who, rows, seen)
        part = self._signals[:, :, who]

        def everywhere(value: float) -> Array:
            return np.full(part.shape[1:], value)

        values = over_time(Numpy(), self.timed, list(part), everywhere)
        self._ends[:, :, who] = np.stack([value[..., 0] for value in values])
        if self.timed.requirement is not None:
            self.possible[who] = values[self.timed.requirement][HIGH].min(axis=-1) >= 0.0

    def bounds(self, nodes: Sequence[int]) -> Array:
        """The least and the largest value that nodes of the spec can still have at moment 0, (K, 2, B)."""
        return self._ends[list(nodes)]

    def _look_ahead(self, who: Places, now: Array, seen: Places) -> None:
        """Bounds of the state's formulas at all later moments, of all motions together."""
        which, moment = np.nonzero(np.arange(self._signals.shape[-1]) >= seen[:, None])
        if not len(which):
            return
        steps = (moment - seen[which] + 1).astype(float)
        boxes = [self._reach.boxes(now[:, which], steps)]
        if self.timed.steps:
            boxes.append(self._reach.boxes(now[:, which], steps - 1.0))
        ends = self._reach.bounds(*(end for box in boxes for end in box))
        for end, value in zip((LOW, HIGH), ends, strict=True):
            self._signals[:, end, who[which], moment] = value
