"""What a learner sees of a scene."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from gymnasium import spaces

from scenegen.curriculum.moves import headings
from scenegen.lang.core import gated
from scenegen.lang.spec import CheckedSpec

Array = npt.NDArray[np.float64]

ONE = np.float32(1.0)


@dataclass(frozen=True, slots=True)
class Views:
    """What a learner sees of a scene, float32 in [-1, 1]: for every object that the spec does not hold in place, x and
    y, from edge to edge of the workspace, and where phi or what is required depends on its heading, the heading's
    cosine and sine. `names` says which is which: `mug.x`, `mug.y`, `knife.cos`, ..."""

    places: npt.NDArray[np.intp]
    middle: Array
    scale: Array
    turned: npt.NDArray[np.intp]
    order: npt.NDArray[np.intp]
    names: tuple[str, ...]

    def space(self) -> spaces.Box:
        return spaces.Box(-1.0, 1.0, (len(self.names),), np.float32)

    def __call__(self, rows: Array) -> npt.NDArray[np.float32]:
        """(3N, B) -> (B, K)."""
        along = (rows[self.places] - self.middle) * self.scale
        if len(self.turned):
            theta = rows[self.turned]
            along = np.concatenate([along, np.cos(theta), np.sin(theta)])[self.order]
        seen = np.ascontiguousarray(along.T, dtype=np.float32)
        np.minimum(seen, ONE, out=seen)
        return np.maximum(seen, -ONE, out=seen)


def make_views(spec: CheckedSpec) -> Views:
    """What is seen of scenes of a spec."""
    depends = headings(gated(spec.core))
    free = [index for index in range(len(spec.objects)) if index not in spec.fixed]
    places = [3 * index + axis for index in free for axis in range(2)]
    turned = [3 * index + 2 for index in free if index in depends]
    low, high = spec.box()
    keys = [(row // 3, row % 3) for row in places] + [(row // 3, 2 + k) for k in range(2) for row in turned]
    order = sorted(range(len(keys)), key=lambda place: keys[place])
    names = tuple(f"{spec.objects[keys[k][0]]}.{('x', 'y', 'cos', 'sin')[keys[k][1]]}" for k in order)
    at = np.array(places, dtype=np.intp)
    middle, half = (low[at] + high[at]) / 2.0, (high[at] - low[at]) / 2.0
    turned_ = np.array(turned, dtype=np.intp)
    return Views(at, middle[:, None], 1.0 / half[:, None], turned_, np.array(order, dtype=np.intp), names)
