"""A request for motions, made ready for the samplers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
import numpy.typing as npt

from scenegen.pose import LENGTHS, TWO_PI
from scenegen.sampling.cells import Cells, cut
from scenegen.sampling.request import SampleRequest

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.intp]
Score = Callable[[Array], Array]
Moves = Literal["one", "all"]

GATES = ("(require)", "(limits)")  # two more rows of scores, at least 0 in every motion that counts


@dataclass(frozen=True, slots=True, eq=False)
class MotionProblem:
    """N objects over `steps` steps of `dt` seconds.

    In the first scene each pose is uniform over its box: `lowest` and `highest` (N, 3), metres and radians; equal rows
    hold a coordinate. In each step one object moves (`moves` "one": chosen uniformly among those that can move), or all
    do, by a displacement uniform over the disc of its `radius` (N,), metres, and a turn uniform over -turn to turn,
    `turn` (N,), radians. Objects with neither stay where they are. The whole is conditioned on all centres within
    lowest to highest at every moment, and on `required` >= 0.

    `phi` maps poses (B, steps + 1, N, 3) to (B, L), `required` to (B,); both must be picklable for several processes.
    `scores` has the labels' phi in its first rows, then those of GATES.
    """

    names: tuple[str, ...]
    labels: tuple[str, ...]
    steps: int
    lowest: Array
    highest: Array
    radius: Array
    turn: Array
    phi: Score
    request: SampleRequest
    required: Score | None = None
    moves: Moves = "one"
    dt: float = 1.0
    cells: Cells = field(init=False)

    def __post_init__(self) -> None:
        cells = cut(self.request, (*self.labels, *GATES))
        cells.low[-len(GATES) :] = 0.0
        object.__setattr__(self, "cells", cells)

    @property
    def reach(self) -> Array:
        """(N, 3): how far a step can take each coordinate."""
        return np.stack([self.radius, self.radius, self.turn], axis=1)

    @property
    def movable(self) -> Index:
        """The objects that can move, (K,)."""
        return np.flatnonzero((self.radius > 0.0) | (self.turn > 0.0))

    @property
    def wide(self) -> npt.NDArray[np.bool_]:
        """(N,): whose first heading is uniform over the whole circle."""
        turned: npt.NDArray[np.bool_] = self.highest[:, 2] - self.lowest[:, 2] >= TWO_PI * (1.0 - 1e-12)
        return turned

    def room(self, poses: Array) -> Array:
        """The least distance of a moving centre from its limits, (B, steps + 1, N, 3) -> (B,), metres; negative
        outside; infinite if nothing moves."""
        flat = list(LENGTHS)
        moving = np.flatnonzero(self.radius > 0.0)
        places = poses[:, :, moving][..., flat]
        low, high = (ends[moving][:, flat] for ends in (self.lowest, self.highest))
        least: Array = np.minimum(places - low, high - places).min(axis=(1, 2, 3), initial=np.inf)
        return least

    def scores(self, poses: Array) -> Array:
        """phi of all labels, the requirement and the room, (B, steps + 1, N, 3) -> (L + 2, B)."""
        out = np.empty((len(self.labels) + len(GATES), len(poses)))
        out[: len(self.labels)] = self.phi(poses).T
        out[-2] = np.inf if self.required is None else self.required(poses)
        out[-1] = self.room(poses)
        return out
