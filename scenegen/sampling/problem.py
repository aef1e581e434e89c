"""A spec and a request, made ready for the samplers."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from scenegen.bounds import label_bounds, spec_bounds
from scenegen.lang.core import Core, gated
from scenegen.lang.interpret import phi as evaluate
from scenegen.lang.spec import CheckedSpec
from scenegen.primitives import NUMPY
from scenegen.robustness import Robustness
from scenegen.sampling.base import draw, piece_generator, piece_size
from scenegen.sampling.cells import Cells, cut
from scenegen.sampling.collect import Collector
from scenegen.sampling.request import Range, Request, check_request

Array = npt.NDArray[np.float64]
Progress = Callable[[int, int, int], None]
"""Told after each piece: scenes found, scenes wanted, candidates looked at."""

SLACK = 1e-9  # how far from the range torch's phi is trusted to tell that a scene is out of it

SHUFFLE, PILOT, GUIDED = 1, 2, 3  # random streams beside the base draws' (stream 0)


@dataclass(frozen=True, slots=True)
class Budget:
    """When to stop looking. Time only ever cuts a run short; what it hands out until then does not depend on it."""

    seconds: float = 60.0
    started: float = field(default_factory=time.monotonic)

    @property
    def spent(self) -> bool:
        return time.monotonic() - self.started >= self.seconds


@dataclass(frozen=True, slots=True)
class Problem:
    """What every sampler gets. `core`, `robustness` and `cells` are over the gated core: where the spec requires
    something, its margin is one label more, the last, wanted from 0 up. `lowest` and `highest` (3N,) are the box of
    poses; their rows are equal for objects that are held in place."""

    spec: CheckedSpec
    core: Core
    lowest: Array
    highest: Array
    request: Request
    robustness: Robustness
    cells: Cells
    possible: frozenset[int]

    def collector(self) -> Collector:
        seed = np.random.SeedSequence([self.request.seed, SHUFFLE])
        return Collector(self.cells, self.request.n, self.possible, np.random.default_rng(seed))

    def score(self, rows: Tensor) -> Array:
        """Exact phi of float64 rows, (3N, B) -> (L, B).

        torch scores them all; what comes near the wanted range is scored again by numpy, whose square root, unlike
        torch's, is rounded correctly in batches of any size. So `scenegen eval` finds the very same bits later.
        """
        with torch.no_grad():
            phi = np.array(self.robustness.rows(rows, check=False).numpy())
        low, high = self.cells.low[:, None] - SLACK, self.cells.high[:, None] + SLACK
        near = np.flatnonzero(((phi >= low) & (phi <= high)).all(axis=0))
        if len(near):
            exact = evaluate(self.core, list(rows.numpy()[:, near]), NUMPY)
            phi[:, near] = np.stack([np.broadcast_to(value, len(near)) for value in exact.values()])
        return phi

    @property
    def piece_size(self) -> int:
        """Scenes of one piece."""
        return piece_size(len(self.spec.objects))

    def base(self, piece: int, *, stream: int = 0) -> Tensor:
        """Piece k of the base distribution, (3N, piece_size)."""
        generator = piece_generator(self.request.seed, piece, stream)
        return draw(self.lowest, self.highest, self.piece_size, generator)


def pose(spec: CheckedSpec, ranges: Mapping[str, Range], *, n: int, seed: int = 0, spread: str = "flat") -> Problem:
    """Check a request against its spec. Raises RequestError, also where interval bounds rule the whole range out."""
    request = check_request(ranges, n, seed, spread, spec_bounds(spec))
    core = gated(spec.core)
    cells = cut(request, tuple(core.labels))
    if core is not spec.core:
        cells.low[-1] = 0.0
    lowest, highest = spec.box()
    least, most = label_bounds(core, lowest, highest)
    possible = []
    for cell in range(cells.count):
        low, high = cells.limits(cell)
        if ((low <= most) & (high >= least)).all():
            possible.append(cell)
    return Problem(spec, core, lowest, highest, request, Robustness(core), cells, frozenset(possible))
