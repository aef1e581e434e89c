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

from scenegen.bounds import label_bounds
from scenegen.bounds.effort import Effort
from scenegen.lang.headings import bare_rows
from scenegen.lang.interpret import phi as evaluate
from scenegen.lang.timed import Numpy, Timed, over_time
from scenegen.motions.bounds import step_bounds
from scenegen.pose import TWO_PI, as_rows, is_angle, owner
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
    _steps: Array = field(init=False)  # (3N,): how far a step goes
    _values: list[Array] = field(init=False)  # of every node over time, (2, B, T + 1)

    def __post_init__(self) -> None:
        timed, moments = self.timed, self.timed.horizon.moments
        far = np.stack(self._bounds(self.lowest[:, None], self.highest[:, None]), axis=1)  # (S, 2, 1)
        self._signals = np.broadcast_to(far[..., None], (len(far), 2, self.count, moments)).copy()
        away, turn = step_bounds(timed)
        rows = range(len(self.lowest))
        self._steps = np.array([turn[owner(row)] if is_angle(row) else away[owner(row)] for row in rows])

    def add(self, poses: Array) -> tuple[dict[str, Array], Array | None]:
        """The next moment, (B, N, 3). By label the least and the largest phi that the motions can still have, (2, B),
        and of the least margin of the requirement; None where nothing is required."""
        rows = as_rows(poses)
        before = self._before if self.seen else rows
        state = np.concatenate([rows, before]) if self.timed.steps else rows
        if bare_rows(self.timed.state):
            angles = [row for row in range(len(state)) if is_angle(row)]
            state = state.copy()
            state[angles] = np.mod(state[angles], TWO_PI)
        values = list(evaluate(self.timed.state, list(state), NUMPY).values())
        self._signals[..., self.seen] = np.stack([np.broadcast_to(one, self.count) for one in values])[:, None]
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
        low, high = self._boxes(np.arange(many + 1.0))  # (3N, B, many + 1)
        if not self.reach:
            low[..., 1:], high[..., 1:] = self.lowest[:, None, None], self.highest[:, None, None]
        shape = (len(low), -1)
        ends = self._bounds(
            low[..., 1:].reshape(shape), high[..., 1:].reshape(shape), low[..., :-1].reshape(shape),
            high[..., :-1].reshape(shape),
        )  # fmt: skip
        ahead = self._signals[..., self.seen : self.seen + many]
        for end, value in zip((LOW, HIGH), ends, strict=True):
            ahead[:, end] = value.reshape(len(ahead), self.count, many)

    def _boxes(self, steps: Array) -> tuple[Array, Array]:
        """Where coordinates can be after so many steps from now, two (3N, B, K): within the limits and reach; a heading
        that can pass the end of the circle can be anywhere."""
        now = self._before[..., None]
        with np.errstate(invalid="ignore"):
            way = np.where(steps == 0.0, 0.0, self._steps[:, None] * steps)[:, None]
        low, high = now - way, now + way
        for row in range(len(now)):
            least, most = self.lowest[row], self.highest[row]
            if is_angle(row):
                round_ = ((low[row] < 0.0) | (high[row] >= TWO_PI)) & (steps > 0.0)
                low[row], high[row] = np.where(round_, 0.0, low[row]), np.where(round_, TWO_PI, high[row])
                continue
            inside = (now[row] >= least) & (now[row] <= most)
            low[row] = np.where(inside, np.maximum(low[row], least), low[row])
            high[row] = np.where(inside, np.minimum(high[row], most), high[row])
        return low, high

    def _bounds(
        self, low: Array, high: Array, before_low: Array | None = None, before_high: Array | None = None
    ) -> tuple[Array, Array]:
        """Bounds of the state's formulas over K boxes, two (S, K)."""
        if self.timed.steps:
            low = np.concatenate([low, low if before_low is None else before_low])
            high = np.concatenate([high, high if before_high is None else before_high])
        with np.errstate(over="ignore", invalid="ignore"):
            return label_bounds(self.timed.state, low, high, Effort())

    def _outlook(self) -> tuple[dict[str, Array], Array | None]:
        def everywhere(value: float) -> Array:
            return np.full(self._signals.shape[1:], value)

        timed = self.timed
        values = over_time(Numpy(), timed, list(self._signals), everywhere)
        self._values = values
        phi = {name: values[node][..., 0] for name, node in timed.labels.items()}
        return phi, None if timed.requirement is None else values[timed.requirement].min(axis=-1)
