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

from scenegen.arrays import Array
from scenegen.geometry import NUMPY
from scenegen.lang.formula.interpret import bare_rows
from scenegen.lang.formula.interpret import phi as evaluate
from scenegen.lang.formula.timed import Numpy, Timed, over_time
from scenegen.pose import TWO_PI, is_angle, owner
from scenegen.sampling.motions.bounds import step_bounds
from scenegen.search import label_bounds
from scenegen.search.effort import Effort
from scenegen.search.tape import BatchedTape, make_batches


@dataclass(frozen=True, slots=True, eq=False)
class MotionLimits:
    """Where objects can be some steps from now, and bounds of the state's formulas there: of a spec over time, with the
    limits of poses `lowest` and `highest`, (3N,)."""

    timed: Timed
    lowest: Array
    highest: Array
    _steps: Array = field(init=False)  # (3N,): how far a step goes
    _batches: BatchedTape = field(init=False)

    def __post_init__(self) -> None:
        away, turn = step_bounds(self.timed)
        rows = range(len(self.lowest))
        steps = np.array([turn[owner(row)] if is_angle(row) else away[owner(row)] for row in rows])
        object.__setattr__(self, "_steps", steps)
        object.__setattr__(self, "_batches", make_batches(self.timed.state.nodes))

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
            return label_bounds(self.timed.state, low, high, Effort(), self._batches)


LOW, HIGH = 0, 1
ALL_MOTIONS = slice(None)

Places = npt.NDArray[np.intp]


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
    """B motions side by side, each at a moment of its own. `lowest` and `highest` (3N,) are the limits of poses; with
    `reach` later poses are also within the steps that the requirement allows."""

    timed: Timed
    lowest: Array
    highest: Array
    reach: bool
    count: int
    seen: Places = field(init=False)  # (B,): moments of each motion
    required: Array = field(init=False)  # (2, B): what the requirement's least margin can be; infinity without one
    _far: Array = field(init=False)  # (S, 2, 1, 1): bounds of the state's formulas anywhere
    _signals: Array = field(init=False)  # (S, 2, B, T + 1)
    _before: Array = field(init=False)  # (3N, B)
    _ends: Array = field(init=False)  # of every node over time, at moment 0: (K, 2, B)
    _reach: MotionLimits = field(init=False)

    def __post_init__(self) -> None:
        timed, count = self.timed, self.count
        self._reach = MotionLimits(timed, self.lowest, self.highest)
        self.seen, self.required = np.zeros(count, dtype=np.intp), np.full((2, count), np.inf)
        far = np.stack(self._reach.bounds(self.lowest[:, None], self.highest[:, None]), axis=1)
        self._far = far[..., None]
        self._signals = np.broadcast_to(self._far, (len(far), 2, count, timed.horizon.moments)).copy()
        self._before = np.zeros((len(self.lowest), count))
        self._ends = np.zeros((len(timed.nodes), 2, count))

    @property
    def possible(self) -> npt.NDArray[np.bool_]:
        """Whether the requirement can still hold, (B,)."""
        return np.asarray(self.required[HIGH] >= 0.0)

    @property
    def phi(self) -> dict[str, Array]:
        """By label the least and the largest phi that the motions can still have, (2, B)."""
        return {name: self._ends[node] for name, node in self.timed.labels.items()}

    def begin(self, who: Places) -> None:
        """New motions, of which nothing is seen."""
        self.seen[who] = 0
        self._signals[:, :, who] = self._far

    def back(self, before: Array, who: Places | slice = ALL_MOTIONS) -> None:
        """Forget the last moment of motions, before which they were at `before`, (3N, K); another one follows."""
        self.seen[who] -= 1
        self._before[:, who] = before

    def add(self, rows: Array, who: Places | slice = ALL_MOTIONS) -> None:
        """The next moment of K motions, (3N, K)."""
        who = np.arange(self.count)[who]
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
            self.required[:, who] = values[self.timed.requirement].min(axis=-1)

    def bounds(self, nodes: Sequence[int]) -> Array:
        """The least and the largest value that nodes of the spec can still have at moment 0, (K, 2, B)."""
        return self._ends[list(nodes)]

    def _look_ahead(self, who: Places, now: Array, seen: Places) -> None:
        """Bounds of the state's formulas at later moments, of all motions together: of the next one, which knows where
        objects were; with `reach` of all."""
        if not (self.reach or self.timed.steps):
            return
        last = self._signals.shape[-1] if self.reach else np.minimum(seen[:, None] + 1, self._signals.shape[-1])
        moments = np.arange(self._signals.shape[-1])
        which, moment = np.nonzero((moments >= seen[:, None]) & (moments < last))
        if not len(which):
            return
        here, steps = now[:, which], (moment - seen[which] + 1).astype(float)
        if self.reach:
            low, high = self._reach.boxes(here, steps)
        else:
            low, high = (np.repeat(end[:, None], len(which), axis=1) for end in (self.lowest, self.highest))
        before = self._reach.boxes(here, steps - 1.0) if self.timed.steps else ()
        for end, value in zip((LOW, HIGH), self._reach.bounds(low, high, *before), strict=True):
            self._signals[:, end, who[which], moment] = value
