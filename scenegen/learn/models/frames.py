"""Frames of objects: the boxes that interval contraction leaves of their poses, for a requirement and ranges of phi.

The frame of an object on a carrier that moves is relative to the carrier. In these coordinates a bottle that has 2 cm
of room in the cell of a rack and a mug that has 1 m on a table both range from -1 to 1.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from scenegen.arrays import Array
from scenegen.geometry.footprint import Circle
from scenegen.lang.formula.core import REQUIRE, Core, gate, read_rows
from scenegen.lang.spec import CheckedSpec
from scenegen.pose import SIZE, THETA, row_of
from scenegen.search.contract import contract_box
from scenegen.search.effort import Effort
from scenegen.search.tape import Tape, make_tape

OBJECT_FEATURES = 3 + 1 + SIZE + 1 + 4 + 3  # footprint; held; which coordinates matter; carried; frame in two units
MATTERS = slice(4, 4 + SIZE)


@dataclass(frozen=True, slots=True, eq=False)
class Frames:
    """Of N objects: `core` is the gated formula, `tape` that of it. `carrier` is the object that each moves with, -1
    where it moves alone; `offsets` are the rows of places relative to a carrier, with the tape's node of the difference
    and its sign."""

    spec: CheckedSpec
    core: Core
    tape: Tape
    carrier: tuple[int, ...]
    offsets: tuple[tuple[int, int, float], ...]

    def bounds_for(self, wanted: Mapping[str, tuple[float, float]]) -> tuple[Array, Array]:
        """Lowest and highest poses (3N,), metres and radians, places relative to the carrier's, of all scenes that meet
        the requirement and have phi of these labels in these ranges; without the ranges where no scene does."""
        lowest, highest = self.spec.box()
        labels = self.core.labels
        demand = {labels[name]: ends for name, ends in wanted.items()}
        demand |= {labels[REQUIRE]: (0.0, math.inf)} if REQUIRE in labels else {}
        found = contract_box(self.tape, lowest, highest, demand, Effort())
        if not found.alive:
            return self.bounds_for({}) if wanted else (lowest, highest)
        for row, node in self.tape.rows.items():
            lowest[row], highest[row] = found.lo[node], found.hi[node]
        for row, node, sign in self.offsets:
            lowest[row], highest[row] = sorted((sign * found.lo[node], sign * found.hi[node]))
        return lowest, highest

    def carriers(self, thing: int) -> Sequence[int]:
        """The carrier of a thing, the carrier's own, and so on."""
        found = []
        while (thing := self.carrier[thing]) >= 0:
            found.append(thing)
        return found

    def features(self, low: Array, high: Array) -> Tensor:
        """What a network sees of the objects, (N, OBJECT_FEATURES), in the frames from low to high (3N,)."""
        read, rows = read_rows(self.core), []
        (left, right), (bottom, top) = self.spec.workspace.x, self.spec.workspace.y
        begin, size = np.array([left, bottom]), np.array([right - left, top - bottom])
        for which, shape in enumerate(self.spec.shapes):
            mine = [row_of(which, axis) for axis in range(SIZE)]
            round_, (length, width) = isinstance(shape.footprint, Circle), shape.footprint.extent
            lowest, highest = low[mine[:THETA]], high[mine[:THETA]]
            carried = self.carrier[which] >= 0
            middle = (lowest + highest - (0.0 if carried else 2.0 * begin + size)) / size
            metres = np.log(np.maximum(highest - lowest, 1e-3)) / 3.0
            turn = (high[mine[THETA]] - low[mine[THETA]]) / (2.0 * math.pi)
            rows.append([float(round_), 5.0 * length, 5.0 * width, float(which in self.spec.fixed)])
            rows[-1] += [float(row in read) for row in mine]
            rows[-1] += [float(carried), *middle, *((highest - lowest) / size), *metres, turn]
        return torch.tensor(np.array(rows), dtype=torch.float32)


def frames_of(spec: CheckedSpec, effort: Effort | None = None) -> Frames:
    """The frames of a spec without time and choices of surfaces. Raises what `effort` raises."""
    core = gate(spec.core)
    tape = make_tape(core, *spec.box(), effort)
    apart = {pair: (node, 1.0) for node, pair in tape.differences.items()}
    apart |= {(b, a): (node, -1.0) for (a, b), (node, _) in apart.items()}
    carrier, offsets = [-1] * len(spec.objects), list[tuple[int, int, float]]()
    for thing, support in spec.supports.items():
        if (under := support.carrier) is None or {thing, under} & spec.fixed.keys():
            continue
        pairs = [(row_of(thing, axis), row_of(under, axis)) for axis in range(THETA)]
        if all(pair in apart for pair in pairs):
            carrier[thing] = under
            offsets += [(pair[0], *apart[pair]) for pair in pairs]
    return Frames(spec, core, tape, tuple(carrier), tuple(offsets))
