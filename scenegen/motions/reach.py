"""Where objects can be some steps from now, and bounds of the state's formulas there."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from scenegen.bounds import label_bounds
from scenegen.bounds.effort import Effort
from scenegen.lang.timed import Timed
from scenegen.motions.bounds import step_bounds
from scenegen.pose import TWO_PI, is_angle, owner

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Reach:
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
