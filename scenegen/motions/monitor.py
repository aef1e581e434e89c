"""What phi of a motion can still become, while it happens: bounds from the moments seen so far.

What is seen is scored; the formulas of the state at later moments get interval bounds over where objects can be.
Formulas over time are made of minima and maxima, so both ends go through them as a motion does (Deshmukh et al. 2017,
robust semantics of partial traces; here with bounds of the state's formulas instead of infinity).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from scenegen.lang.headings import bare_rows
from scenegen.lang.interpret import phi as evaluate
from scenegen.lang.timed import Numpy, Timed, over_time
from scenegen.motions.reach import Reach
from scenegen.pose import TWO_PI, as_rows, is_angle
from scenegen.primitives import NUMPY

Array = npt.NDArray[np.float64]

LOW, HIGH = 0, 1


@dataclass(frozen=True, slots=True, eq=False)
class Mark:
    """What a Watch knew after so many moments."""

    seen: int
    signals: Array
    before: Array
    values: list[Array]


def state_values(timed: Timed, state: Array) -> Array:
    """The state's formulas, of objects and, where `timed.steps` is set, of where they were before: (3N or 6N, B) ->
    (S, B)."""
    if bare_rows(timed.state):
        angles = [row for row in range(len(state)) if is_angle(row)]
        state = state.copy()
        state[angles] = np.mod(state[angles], TWO_PI)
    values = evaluate(timed.state, list(state), NUMPY).values()
    return np.stack([np.broadcast_to(one, state.shape[1]) for one in values])


@dataclass(slots=True)
class Watch:
    """B motions side by side, moment by moment. `lowest` and `highest` (3N,) are the limits of poses; with `reach`
    later poses are also within the steps that the requirement allows."""

    timed: Timed
    lowest: Array
    highest: Array
    reach: bool
    count: int
    seen: int = 0
    _signals: Array = field(init=False)  # (S, 2, B, T + 1)
    _before: Array = field(init=False)  # (3N, B)
    _reach: Reach = field(init=False)
    _values: list[Array] = field(init=False)  # of every node over time, (2, B, T + 1)

    def __post_init__(self) -> None:
        timed, moments = self.timed, self.timed.horizon.moments
        self._reach = Reach(timed, self.lowest, self.highest)
        far = np.stack(self._reach.bounds(self.lowest[:, None], self.highest[:, None]), axis=1)  # (S, 2, 1)
        self._signals = np.broadcast_to(far[..., None], (len(far), 2, self.count, moments)).copy()

    def add(self, poses: Array) -> tuple[dict[str, Array], Array | None]:
        """The next moment, (B, N, 3). By label the least and the largest phi that the motions can still have, (2, B),
        and of the least margin of the requirement; None where nothing is required."""
        rows = as_rows(poses)
        before = self._before if self.seen else rows
        state = np.concatenate([rows, before]) if self.timed.steps else rows
        self._signals[..., self.seen] = state_values(self.timed, state)[:, None]
        self._before, self.seen = rows.copy(), self.seen + 1
        self._look_ahead()
        return self._outlook()

    def bounds(self, nodes: Sequence[int]) -> Array:
        """The least and the largest value that nodes of the spec can still have at moment 0, (K, 2, B)."""
        return np.stack([self._values[node][..., 0] for node in nodes])

    def mark(self) -> Mark:
        """Where the monitor stands, for `back`."""
        return Mark(self.seen, self._signals.copy(), self._before.copy(), list(self._values))

    def back(self, mark: Mark) -> None:
        """Forget what was seen since."""
        self.seen, self._signals, self._before, self._values = mark.seen, mark.signals, mark.before, mark.values

    def _look_ahead(self) -> None:
        """Bounds of the state's formulas at later moments: of the next one, which knows where objects were; with
        `reach` of all."""
        left = self._signals.shape[-1] - self.seen
        if not left or not (self.reach or self.timed.steps):
            return
        many = left if self.reach else 1
        low, high = self._reach.boxes(self._before[..., None], np.arange(many + 1.0))  # (3N, B, many + 1)
        if not self.reach:
            low[..., 1:], high[..., 1:] = self.lowest[:, None, None], self.highest[:, None, None]
        shape = (len(low), -1)
        ends = self._reach.bounds(
            low[..., 1:].reshape(shape), high[..., 1:].reshape(shape), low[..., :-1].reshape(shape),
            high[..., :-1].reshape(shape),
        )  # fmt: skip
        ahead = self._signals[..., self.seen : self.seen + many]
        for end, value in zip((LOW, HIGH), ends, strict=True):
            ahead[:, end] = value.reshape(len(ahead), self.count, many)

    def _outlook(self) -> tuple[dict[str, Array], Array | None]:
        def everywhere(value: float) -> Array:
            return np.full(self._signals.shape[1:], value)

        timed = self.timed
        values = over_time(Numpy(), timed, list(self._signals), everywhere)
        self._values = values
        phi = {name: values[node][..., 0] for name, node in timed.labels.items()}
        return phi, None if timed.requirement is None else values[timed.requirement].min(axis=-1)
