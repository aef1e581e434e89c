"""Where motions begin: the numbers that chains change, and the first scenes that these are.

A first pose with a prior is a quantile of uniform numbers, as in `scenegen.sampling.prior`; nothing else of a motion
changes. Chains are exact over any box of numbers. They shift first poses to make up for steps, in metres and radians,
so the box is as wide and lies where its coordinate scatters: a shift of the number is about one of the coordinate.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from scenegen.arrays import Array
from scenegen.lang.formula.core import Core
from scenegen.lang.spec import CheckedSpec
from scenegen.pose import THETA, axis_of
from scenegen.sampling.prior import BaseDistribution, pull_back

PROBED_NUMBERS = 256  # numbers by which it is found out how a coordinate scatters


@dataclass(frozen=True, slots=True, eq=False)
class FirstScenes:
    """What the first numbers of motions become: those of a box `low`..`high` (3N,) by a base distribution over the box
    of poses `lowest`..`highest` (3N,)."""

    base: BaseDistribution
    low: Array
    high: Array
    lowest: Array
    highest: Array

    def poses(self, first: Array) -> Array:
        """The first scenes (N, 3, P) that numbers (N, 3, P) are."""
        numbers = first.reshape(len(self.low), -1)
        held = self.low == self.high
        share = (numbers - self.low[:, None]) / np.where(held, 1.0, self.high - self.low)[:, None]
        rows = self.lowest[:, None] + share * (self.highest - self.lowest)[:, None]
        same = (self.low == self.lowest) & (self.high == self.highest)
        return self.base.poses(np.where(same[:, None], numbers, rows)).reshape(first.shape)


def first_scenes(spec: CheckedSpec, lowest: Array, highest: Array) -> FirstScenes | None:
    """What first numbers become in the box of poses lowest..highest, (3N,) each; None where poses are uniform."""
    if not spec.priors:
        return None
    _, base = pull_back(replace(spec, core=Core((), {}, spec.objects)), lowest, highest)
    low, high = lowest.copy(), highest.copy()
    for row in base.at:
        numbers = np.tile((lowest + highest)[:, None] / 2.0, PROBED_NUMBERS)
        numbers[row] = lowest[row] + (highest[row] - lowest[row]) * (np.arange(PROBED_NUMBERS) + 0.5) / PROBED_NUMBERS
        values = base.poses(numbers)[row]
        values = np.unwrap(values) if axis_of(row) == THETA else values
        reach = math.sqrt(3.0) * float(values.std())  # of a uniform number with this standard deviation
        if reach > 0.0:
            low[row], high[row] = values.mean() - reach, values.mean() + reach
    return FirstScenes(base, low, high, lowest, highest)
