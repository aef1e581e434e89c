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

from scenegen.geometry import NUMPY
from scenegen.lang.formula.headings import bare_rows
from scenegen.lang.formula.interpret import phi as evaluate
from scenegen.lang.formula.timed import Numpy, Timed, over_time
from scenegen.pose import TWO_PI, as_rows, is_angle, owner
from scenegen.sampling.motions.bounds import step_bounds
from scenegen.search import label_bounds
from scenegen.search.effort import Effort

# --------------------------------------------------------------------------------------------------------------------
# Where objects can be some steps from now, and bounds of the state's formulas there.


Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class MotionLimits:
    """Of a spec over time, with the limits of poses `lowest` and `highest`, (3N,)."""

    timed: Timed
    lowest: Array
    highest: Array
    _steps: Array = field(init=False)  # (3N,): how far a step goes

    def __post_init__(self) -> None:
        away, turn = step_bounds(self.timed)
        rows = range(len(self.lowest))
        steps = np.array([turn[owner(row)] if is_angle(row) else away[owner(row)] for row in rows])
        object.__setattr__(self, "_steps", steps)

    def boxes(self, now: Array, steps: Array) -> tuple[Array, Array]:
        """Where coordinates `now` (3N, ...) can be after so many steps (...), which broadcast: within the limits and
        reach. A heading that can pass the end of the circle can be anywhere."""
        each = self._steps.reshape(-1, *[1] * (now.ndim - 1))
        with np.errstate(invalid="ignore"):
            way = np.where(steps == 0.0, 0.0, each * steps)
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

    def bounds(
        self, low: Array, high: Array, before_low: Array | None = None, before_high: Array | None = None
    ) -> tuple[Array, Array]:
        """Bounds of the state's formulas over K boxes (3N, K), and where objects were one moment before: two (S, K)."""
        if self.timed.steps:
            low = np.concatenate([low, low if before_low is None else before_low])
            high = np.concatenate([high, high if before_high is None else before_high])
        with np.errstate(over="ignore", invalid="ignore"):
            return label_bounds(self.timed.state, low, high, Effort())


LOW, HIGH = 0, 1


@dataclass(frozen=True, slots=True, eq=False)
class MonitorSnapshot:
    """What a BatchMonitor knew after so many moments."""

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
class BatchMonitor:
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
    _reach: MotionLimits = field(init=False)
    _values: list[Array] = field(init=False)  # of every node over time, (2, B, T + 1)

    def __post_init__(self) -> None:
        timed, moments = self.timed, self.timed.horizon.moments
        self._reach = MotionLimits(timed, self.lowest, self.highest)
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

    def mark(self) -> MonitorSnapshot:
        """Where the monitor stands, for `back`."""
        return MonitorSnapshot(self.seen, self._signals.copy(), self._before.copy(), list(self._values))

    def back(self, mark: MonitorSnapshot) -> None:
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


# --------------------------------------------------------------------------------------------------------------------
# What phi can still become of many motions at once, each of which is at a moment of its own.


Places = npt.NDArray[np.intp]


@dataclass(slots=True)
class Watches:
    """B motions, with the bounds that a `BatchMonitor` with `reach` has of each, to the last bit. `lowest` and
    `highest` (3N,) are the limits of poses."""

    timed: Timed
    lowest: Array
    highest: Array
    count: int
    seen: Places = field(init=False)  # (B,): moments of each motion
    possible: npt.NDArray[np.bool_] = field(init=False)  # (B,): whether the requirement can still hold
    _signals: Array = field(init=False)  # (S, 2, B, T + 1)
    _before: Array = field(init=False)  # (3N, B)
    _ends: Array = field(init=False)  # of every node over time, at moment 0: (K, 2, B)
    _reach: MotionLimits = field(init=False)

    def __post_init__(self) -> None:
        timed, count = self.timed, self.count
        self.seen, self.possible = np.zeros(count, dtype=np.intp), np.ones(count, dtype=np.bool_)
        self._reach = MotionLimits(timed, self.lowest, self.highest)
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
