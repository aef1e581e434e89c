"""The base distributions of specs with priors, drawn in the most naive way: what is cut off is drawn again.

Written from the meaning of the language alone (docs/priors.md), with nothing of scenegen's samplers: this is what they
are held against. Places are (x, y), arrays (n,) in metres; headings are (n,), in radians.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import stats

REDRAWS = 16  # what is then still beyond the ends, far from its middle, scipy draws
Floats = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]
Place = tuple[Floats, Floats]
Posed = tuple[Place, Floats]  # a place and a heading
IsInside = Callable[[Floats, Floats], Bools]
"""x and y, (n,) each -> which points lie in a region."""


@dataclass(frozen=True)
class Draws:
    """n scenes in a workspace, `x` by `y` in metres."""

    rng: np.random.Generator
    n: int
    x: tuple[float, float] = (0.0, 1.0)
    y: tuple[float, float] = (0.0, 1.0)

    def anywhere(self) -> Place:
        """Uniform over the workspace."""
        return self.rng.uniform(*self.x, self.n), self.rng.uniform(*self.y, self.n)

    def circle(self) -> Floats:
        """Uniform over the circle."""
        return self.rng.uniform(0.0, math.tau, self.n)

    def normal(self, x: float | Floats, y: float | Floats, deviation: float) -> Place:
        """Round a place: each coordinate by itself, cut off at the workspace."""
        return self._cut_normal(x, deviation, self.x), self._cut_normal(y, deviation, self.y)

    def uniform(self, is_inside: IsInside) -> Place:
        """Over the part of a region that lies in the workspace."""
        x, y = self.anywhere()
        while len(wrong := np.flatnonzero(~is_inside(x, y))):
            x[wrong], y[wrong] = self.rng.uniform(*self.x, len(wrong)), self.rng.uniform(*self.y, len(wrong))
        return x, y

    def turn_normal(self, mean: float | Floats, deviation: float) -> Floats:
        """Round a heading, cut off half a turn away from it."""
        return np.mod(mean + self._cut_normal(0.0, deviation, (-math.pi, math.pi)), math.tau)

    def turn_uniform(self, low: float, high: float) -> Floats:
        return np.mod(self.rng.uniform(low, high, self.n), math.tau)

    def pick(self, weights: Sequence[float]) -> npt.NDArray[np.intp]:
        """Numbers from 0, (n,), in proportion to the weights."""
        return self.rng.choice(len(weights), self.n, p=np.array(weights) / sum(weights))

    def place_mixture(self, options: Sequence[tuple[float, Place]]) -> Place:
        which = self.pick([weight for weight, _ in options])
        x, y = (np.choose(which, [place[axis] for _, place in options]) for axis in (0, 1))
        return x, y

    def turn_mixture(self, options: Sequence[tuple[float, Floats]]) -> Floats:
        which = self.pick([weight for weight, _ in options])
        found: Floats = np.choose(which, [heading for _, heading in options])
        return found

    def recorded(self, rows: Floats, reach: float, turn: float) -> list[Posed]:
        """Poses of the things of `rows` (K, things, 3): all rows are equally likely, each number is moved by itself."""
        chosen = rows[self.rng.integers(len(rows), size=self.n)]
        found = []
        for thing in range(rows.shape[1]):
            x, y, heading = chosen[:, thing].T
            place = self._cut_uniform(x, reach, self.x), self._cut_uniform(y, reach, self.y)
            found.append((place, np.mod(heading + self.rng.uniform(-turn, turn, self.n), math.tau)))
        return found

    def _cut_normal(self, mean: float | Floats, deviation: float, ends: tuple[float, float]) -> Floats:
        middle = self._each(mean)
        found = self.rng.normal(middle, deviation)
        for _ in range(REDRAWS):
            if not len(wrong := self._beyond(found, ends)):
                return found
            found[wrong] = self.rng.normal(middle[wrong], deviation)
        wrong = self._beyond(found, ends)
        low, high = ((end - middle[wrong]) / deviation for end in ends)
        found[wrong] = stats.truncnorm.rvs(low, high, middle[wrong], deviation, random_state=self.rng)
        return np.clip(found, *ends)  # rounding

    def _cut_uniform(self, middle: Floats, reach: float, ends: tuple[float, float]) -> Floats:
        found = self.rng.uniform(middle - reach, middle + reach)
        while len(wrong := self._beyond(found, ends)):
            found[wrong] = self.rng.uniform(middle[wrong] - reach, middle[wrong] + reach)
        return found

    def _each(self, number: float | Floats) -> Floats:
        return np.broadcast_to(np.asarray(number, dtype=np.float64), self.n)

    @staticmethod
    def _beyond(found: Floats, ends: tuple[float, float]) -> npt.NDArray[np.intp]:
        return np.flatnonzero((found < ends[0]) | (found > ends[1]))


def rectangle(left: float, bottom: float, right: float, top: float) -> IsInside:
    return lambda x, y: (x >= left) & (x <= right) & (y >= bottom) & (y <= top)


def turned_box(x0: float, y0: float, heading: float, length: float, width: float) -> IsInside:
    """A box round (x0, y0), its length along the heading."""

    def is_inside(x: Floats, y: Floats) -> Bools:
        along = (x - x0) * math.cos(heading) + (y - y0) * math.sin(heading)
        across = (y - y0) * math.cos(heading) - (x - x0) * math.sin(heading)
        return (np.abs(along) <= length / 2.0) & (np.abs(across) <= width / 2.0)

    return is_inside


def disc(x0: float, y0: float, radius: float) -> IsInside:
    return lambda x, y: np.hypot(x - x0, y - y0) <= radius


def polygon(corners: Sequence[tuple[float, float]]) -> IsInside:
    """Convex, corners counter-clockwise."""

    def is_inside(x: Floats, y: Floats) -> Bools:
        found = np.ones(len(x), dtype=bool)
        for (x0, y0), (x1, y1) in zip(corners, [*corners[1:], corners[0]], strict=True):
            found &= (x1 - x0) * (y - y0) - (y1 - y0) * (x - x0) >= 0.0
        return found

    return is_inside
