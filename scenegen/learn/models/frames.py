"""Where the objects of a spec can be: the box that contraction leaves each of them, for what is required and wanted.

What stands on a thing that moves is told relative to it. A network that sees places in these frames sees a bottle in
the cell of a rack as it sees a mug on a table.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from scenegen.arrays import Array
from scenegen.geometry.footprint import Circle
from scenegen.lang.formula.core import REQUIRE, Core, read_rows
from scenegen.lang.spec import CheckedSpec
from scenegen.pose import SIZE, THETA, row_of
from scenegen.search.contract import contract_box
from scenegen.search.effort import Effort
from scenegen.search.tape import Tape, make_tape

OBJECT_FEATURES = 3 + 1 + SIZE + 1 + 4 + 3  # footprint; held; which coordinates matter; carried; frame in two units
HELD, MATTERS = 3, slice(4, 4 + SIZE)


@dataclass(frozen=True, slots=True, eq=False)
class Frames:
    """Of N objects: `carrier` is what each moves with, -1 for the table; `apart` are the pairs of rows whose difference
    is a node of the tape, with its sign."""

    spec: CheckedSpec
    core: Core
    tape: Tape
    carrier: tuple[int, ...]
    apart: Mapping[tuple[int, int], tuple[int, float]]

    def within(self, wanted: Mapping[str, tuple[float, float]]) -> tuple[Array, Array]:
        """Lowest and highest poses (3N,), places relative to what carries the object, of all scenes that meet what is
        required and have phi of these labels in these ranges."""
        lowest, highest = self.spec.box()
        labels = self.core.labels
        demand = {labels[name]: ends for name, ends in wanted.items()}
        demand |= {labels[REQUIRE]: (0.0, math.inf)} if REQUIRE in labels else {}
        found = contract_box(self.tape, lowest, highest, demand, Effort())
        if not found.alive:  # nothing is there to be framed
            return self.within({}) if wanted else (lowest, highest)
        for row, node in self.tape.rows.items():
            lowest[row], highest[row] = found.lo[node], found.hi[node]
        for thing, under in enumerate(self.carrier):
            for axis in range(THETA) if under >= 0 else ():
                node, sign = self.apart[row_of(thing, axis), row_of(under, axis)]
                ends = sign * found.lo[node], sign * found.hi[node]
                lowest[row_of(thing, axis)], highest[row_of(thing, axis)] = min(ends), max(ends)
        return lowest, highest

    def under(self, thing: int) -> list[int]:
        """What carries a thing, from below it to the table."""
        found = []
        while (thing := self.carrier[thing]) >= 0:
            found.append(thing)
        return found

    def features(self, low: Array, high: Array) -> Tensor:
        """What a network sees of objects (N, OBJECT_FEATURES) whose poses are from low to high (3N,)."""
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


def frames_of(spec: CheckedSpec, core: Core) -> Frames:
    """The frames of a spec without time and choices of surfaces; `core` is its gated formula."""
    tape = make_tape(core, *spec.box())
    apart = {pair: (node, 1.0) for node, pair in tape.differences.items()}
    apart |= {(b, a): (node, -1.0) for (a, b), (node, _) in apart.items()}
    carrier = [-1] * len(spec.objects)
    for thing, support in spec.supports.items():
        under = support.carrier
        if under is not None and not {thing, under} & spec.fixed.keys():
            pairs = [(row_of(thing, axis), row_of(under, axis)) for axis in range(THETA)]
            carrier[thing] = under if all(pair in apart for pair in pairs) else -1
    return Frames(spec, core, tape, tuple(carrier), apart)
