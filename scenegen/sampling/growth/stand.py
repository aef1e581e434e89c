"""Placing what stands on one of its surfaces, together with its switch: the places are drawn in the frame of what
carries it, all of them equally likely, so that tries are lost to other things alone."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scenegen.bounds.effort import Effort
from scenegen.bounds.patches import Step
from scenegen.bounds.standing import Stand, step_for
from scenegen.sampling.growth.touch import Touch

Array = npt.NDArray[np.float64]
Bool = npt.NDArray[np.bool_]
Index = npt.NDArray[np.intp]


@dataclass(frozen=True, slots=True, eq=False)
class Places:
    """The places of an object on its surfaces in P scenes: `low`, `width` (R, P) is its box, `volumes` (1, P) the share
    of it that the places take."""

    step: Step
    rows: tuple[int, ...]
    scenes: Array
    low: Array
    width: Array
    volumes: Array

    def draw(self, tries: int, rng: np.random.Generator) -> Array:
        """Poses uniform over all places: (R, tries, P)."""
        shape = (tries, self.scenes.shape[1])
        drawn = self.step.poses(self.scenes, shape, rng)
        rest = [row for row in self.rows if row not in drawn]
        for row, number in zip(rest, rng.random((len(rest), *shape)), strict=True):
            place = self.rows.index(row)
            drawn[row] = self.low[place] + number * self.width[place]
        return np.stack([np.broadcast_to(drawn[row], shape) for row in self.rows])

    def density(self, poses: Array) -> Array:
        """The density of `draw` at poses (R, ..., P) that stand on a surface, relative to that over the whole box:
        (..., P), 0 outside the box."""
        inside: Bool = np.ones(poses.shape[1:], dtype=bool)
        for row, low, width in zip(poses, self.low, self.width, strict=True):
            inside &= (row >= low) & (row <= low + width)
        out: Array = inside / self.volumes[0]
        return out


@dataclass(frozen=True, slots=True, eq=False)
class Standing:
    """The room of what stands. It has no `nodes` to contract, and one branch."""

    touch: Touch
    step: Step

    nodes: tuple[()] = ()
    branches: tuple[None] = (None,)

    def boxes(self, scenes: Array, cell: Index, effort: Effort) -> Places:
        """Its places in each of P scenes, `scenes` (3N, P), `cell` (P,). Raises what `effort` raises."""
        effort.check()
        graph, rows = self.touch.graph, self.touch.rows
        low, high = graph.low[list(rows)][:, cell], graph.high[list(rows)][:, cell]
        width = np.maximum(high - low, 1e-300)
        drawn = {*self.step.rows}
        share = math.exp(self.step.log_volume) / np.prod(
            [wide for row, wide in zip(rows, width, strict=True) if row in drawn], axis=0
        )
        return Places(self.step, rows, scenes, low, width, share[None])


def make_standing(stand: Stand, touch: Touch) -> Standing | None:
    """The places of what stands; None where it has none, or where not all of its rows are read."""
    graph = touch.graph
    step = step_for(stand, lambda row: (float(graph.low[row].min()), float(graph.high[row].max())))
    return Standing(touch, step) if step is not None and {*step.rows} <= {*touch.rows} else None
