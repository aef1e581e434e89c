"""Difficulty: 0 at the easy end of a range, where phi is highest, 1 at the hard end.

With several labels the hardest counts: a scene is as hard as the label that is furthest on its way from its highest to
its lowest phi, just as the phi of a conjunction is the minimum of its parts. So the scenes between two difficulties
form a shell around the easy corner. It consists of L boxes; one is drawn by its volume. The shells fill the range and
contain the mixed scenes (one label easy, another hard), which the straight line between the two corners would miss.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from numbers import Real

import numpy as np

from scenegen.curriculum.tasks import PhiBox
from scenegen.errors import RequestError
from scenegen.errors.learning import LABEL_NOT_THERE, NOT_A_REACH, REACH_ENDS, UNEVEN_REACH


class Axis:
    """Difficulty in `space`, along those `labels` (positions; None: all) whose range is not a single value; `count` of
    them."""

    def __init__(self, space: PhiBox, labels: Sequence[int] | None = None) -> None:
        check(space)
        named = range(len(space.low)) if labels is None else labels
        for label in named:
            if not 0 <= label < len(space.low):
                raise RequestError(LABEL_NOT_THERE(label=label, last=len(space.low) - 1))
        self.space = space
        self.along = tuple(label for label in sorted(set(named)) if space.low[label] < space.high[label])
        self.count = len(self.along)
        self._ends = tuple((k, space.high[k], space.high[k] - space.low[k]) for k in self.along)

    def shares(self, phi: Sequence[float]) -> tuple[float, ...] | None:
        """How far along its way each label of `along` is, in [0, 1]; None outside of the space, and for NaN."""
        if not self.space.holds(tuple(phi)):
            return None
        return tuple(min(1.0, (high - phi[k]) / width) for k, high, width in self._ends)

    def difficulty(self, phi: Sequence[float]) -> float | None:
        """The share of the hardest label, in [0, 1]; None outside of the space."""
        shares = self.shares(phi)
        return None if shares is None else max(shares, default=0.0)

    def box(self, near: Sequence[float], far: Sequence[float]) -> PhiBox:
        """Scenes whose labels of `along` have shares from `near` to `far`; the other labels have their whole range."""
        low, high = list(self.space.low), list(self.space.high)
        for (k, top, width), easy, hard in zip(self._ends, near, far, strict=True):
            # a share of 1 is the low end itself, without rounding of the product
            low[k] = max(low[k], top - hard * width) if hard < 1.0 else low[k]
            high[k] = max(low[k], top - max(easy, 0.0) * width)
        return PhiBox(tuple(low), tuple(high))

    def shell(self, near: float, far: float) -> list[tuple[float, PhiBox]]:
        """The boxes, with their volumes in shares, that make up the difficulties from `near` to `far`. Box i contains
        the scenes whose i-th label is the hardest; labels before it are easier than `near`, so that boxes do not
        overlap."""
        if not self.count:
            return [(1.0, self.space)]
        found = []
        for i in range(self.count):
            after = self.count - 1 - i
            volume = near**i * (far - near) * far**after
            if volume > 0.0 or i == 0:
                box = self.box([0.0] * i + [near] + [0.0] * after, [near] * i + [far] * (1 + after))
                found.append((volume, box))
        return found


def pick(boxes: Sequence[tuple[float, PhiBox]], rng: np.random.Generator) -> PhiBox:
    """One of the boxes by their volumes; a single box is returned without using a random number."""
    if len(boxes) == 1:
        return boxes[0][1]
    left = rng.random() * math.fsum(volume for volume, _ in boxes)
    for volume, box in boxes:
        left -= volume
        if left < 0.0:
            return box
    return boxes[-1][1]


def check(space: PhiBox) -> None:
    """Raises RequestError unless `space` has as many lows as highs, all finite, each low at most its high."""
    if not isinstance(space, PhiBox) or not all(_numbers(ends) for ends in (space.low, space.high)):
        raise RequestError(NOT_A_REACH(value=repr(space)))
    if len(space.low) != len(space.high) or not space.low:
        raise RequestError(UNEVEN_REACH(low=len(space.low), high=len(space.high)))
    for label, (low, high) in enumerate(zip(space.low, space.high, strict=True)):
        if not (math.isfinite(low) and math.isfinite(high) and low <= high):
            raise RequestError(REACH_ENDS(label=label, low=low, high=high))


def _numbers(ends: object) -> bool:
    return isinstance(ends, tuple) and all(isinstance(end, Real) for end in ends)
