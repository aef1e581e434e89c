"""A spec and a request, made ready for the samplers."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from scenegen.bounds import label_bounds
from scenegen.bounds.clash import clash, explain
from scenegen.bounds.contract import contract, start
from scenegen.bounds.effort import Effort, StoppedError, TooMuchError
from scenegen.bounds.tape import Tape, make_tape
from scenegen.bounds.wanted import EVERYTHING, Ends, both, push_down
from scenegen.errors import Diagnostic, RequestError
from scenegen.lang.core import REQUIRE, Core, gated
from scenegen.lang.interpret import phi as evaluate
from scenegen.lang.spec import CheckedSpec
from scenegen.primitives import NUMPY
from scenegen.sampling.cells import Cells, cut
from scenegen.sampling.collect import Collector
from scenegen.sampling.held import Held, hold
from scenegen.sampling.piece_size import piece_size
from scenegen.sampling.request import Range, Request, check_request, empty_range

if TYPE_CHECKING:
    from torch import Tensor

    from scenegen.robustness import Robustness

Array = npt.NDArray[np.float64]
Progress = Callable[[int, int, int], None]
"""Told after each piece: scenes found, scenes wanted, candidates looked at."""

SLACK = 1e-9  # how far from the range torch's phi is trusted to tell that a scene is out of it

# random streams beside the base draws' (stream 0)
SHUFFLE, PILOT, GUIDED, PLAN, REJECTION, PAIRED = 1, 2, 3, 4, 5, 7

LARGE = 1 << 22  # nodes times cells from which on cells are held against plain bounds, not contracted


GRACE = 0.5  # seconds


@dataclass(frozen=True, slots=True)
class Budget:
    """When to stop looking. Time only ever cuts a run short; what it hands out until then does not depend on it."""

    seconds: float = 60.0
    started: float = field(default_factory=time.monotonic)

    @property
    def spent(self) -> bool:
        return time.monotonic() - self.started >= self.seconds

    @property
    def overdrawn(self) -> bool:
        """Time has long been up: even what is better finished is stopped."""
        return time.monotonic() - self.started >= self.seconds + GRACE

    def check(self) -> None:
        """Raises StoppedError where time has long been up."""
        if self.overdrawn:
            raise StoppedError


@dataclass(frozen=True, slots=True)
class Problem:
    """What every sampler gets. `core` and `cells` are over the gated core: where the spec requires
    something, its margin is one label more, the last, wanted from 0 up. `lowest` and `highest` (3N,) are the box of
    poses; their rows are equal where an object is held, by the spec or by the request. `possible` are the cells that
    bounds do not rule out; `tape` is the core as contraction reads it.

    It pickles. torch is loaded by what refines a model's scenes alone: the exact samplers, and the processes that they
    run on, do without, which saves more time than drawing a thousand scenes takes."""

    spec: CheckedSpec
    core: Core
    lowest: Array
    highest: Array
    request: Request
    cells: Cells
    possible: frozenset[int]
    tape: Tape

    def collector(self) -> Collector:
        """A collector for the request."""
        seed = np.random.SeedSequence([self.request.seed, SHUFFLE])
        return Collector(self.cells, self.request.n, self.possible, np.random.default_rng(seed))

    def wanted(self, cell: int | None = None) -> dict[int, Ends]:
        """What a cell, or the whole range, wants of each formula node of the core."""
        low, high = (self.cells.low, self.cells.high) if cell is None else self.cells.limits(cell)
        return _wanted(self.core, low, high)

    def phi(self, rows: Array) -> Array:
        """Exact phi of float64 rows, (3N, B) -> (L, B), the requirement's last: what scenes are judged by."""
        values = evaluate(self.core, list(rows), NUMPY)
        return np.stack([np.broadcast_to(value, rows.shape[1]) for value in values.values()])

    @property
    def robustness(self) -> Robustness:
        """phi over torch tensors, with gradients."""
        from scenegen.robustness import Robustness

        return Robustness(self.core)

    def score(self, rows: Tensor) -> Array:
        """Exact phi of float64 rows, (3N, B) -> (L, B), of which most are expected to be far out of the range.

        torch scores them all; what comes near the wanted range is scored again by numpy, whose square root, unlike
        torch's, is rounded correctly in batches of any size. So `scenegen eval` finds the very same bits later.
        """
        import torch

        with torch.no_grad():
            phi = np.array(self.robustness.rows(rows, check=False).numpy())
        low, high = self.cells.low[:, None] - SLACK, self.cells.high[:, None] + SLACK
        near = np.flatnonzero(((phi >= low) & (phi <= high)).all(axis=0))
        if len(near):
            phi[:, near] = self.phi(rows.numpy()[:, near])
        return phi

    @property
    def held(self) -> tuple[Tensor, Tensor] | None:
        """The rows that spec or request hold in place, indices and values, (H,) each; None where there are none."""
        import torch

        rows = np.flatnonzero(self.lowest == self.highest)
        return (torch.from_numpy(rows), torch.from_numpy(self.lowest[rows])) if len(rows) else None

    @property
    def piece_size(self) -> int:
        """Scenes of one piece."""
        return piece_size(len(self.spec.objects))

    def base(self, piece: int, *, stream: int = 0) -> Tensor:
        """Piece k of the base distribution, (3N, piece_size)."""
        from scenegen.sampling.base import draw, piece_generator

        generator = piece_generator(self.request.seed, piece, stream)
        return draw(self.lowest, self.highest, self.piece_size, generator)


def pose(
    spec: CheckedSpec,
    ranges: Mapping[str, Range],
    *,
    n: int,
    seed: int = 0,
    spread: str = "flat",
    fixed: Mapping[str, Held | tuple[float, ...]] | None = None,
    budget: Budget | None = None,
) -> Problem:
    """Check a request against its spec. Raises RequestError, also where contraction proves the whole range empty, and
    where the time of `budget` is long up before that is known.

    `fixed` holds objects where they are, (x, y) or (x, y, theta) by name; without theta the heading stays free.
    """
    effort = Effort() if budget is None else Effort(lambda: budget.overdrawn)
    try:
        return _pose(spec, ranges, n, seed, spread, fixed or {}, effort)
    except StoppedError:
        title = "time was up before it was known what the spec's phi can be"
        raise RequestError(Diagnostic(title, help="give it more time with --timeout")) from None


def _pose(
    spec: CheckedSpec,
    ranges: Mapping[str, Range],
    n: int,
    seed: int,
    spread: str,
    fixed: Mapping[str, Held | tuple[float, ...]],
    effort: Effort,
) -> Problem:
    lowest, highest, held = hold(spec, fixed)
    core = gated(spec.core)
    low, high = label_bounds(spec.core, lowest, highest, effort)
    bounds = {name: (float(a), float(b)) for name, a, b in zip(spec.core.labels, low, high, strict=True)}
    tape = make_tape(core, lowest, highest, effort)
    _refuse_points(core, lowest, highest, ranges, effort)
    request = dataclasses.replace(check_request(ranges, n, seed, spread, bounds), fixed=held)
    cells = cut(request, tuple(core.labels))
    if core is not spec.core:
        cells.low[-1] = 0.0
    possible = _possible(core, tape, cells, lowest, highest, effort)
    problem = Problem(spec, core, lowest, highest, request, cells, possible, tape)
    if not possible:
        raise RequestError(impossible(problem, effort))
    return problem


def narrowed(
    problem: Problem,
    core: Core,
    box: tuple[Array, Array],
    ranges: Mapping[str, Range],
    seed: int,
    effort: Effort,
) -> Problem:
    """The same request for the labels of another core over the same objects, none of them required, in another box of
    poses, (3N,) each. Raises RequestError where contraction proves it empty, and what `effort` raises."""
    request = dataclasses.replace(problem.request, ranges=ranges, seed=seed, warnings=())
    cells = cut(request, tuple(core.labels))
    tape = make_tape(core, *box, effort)
    possible = _possible(core, tape, cells, *box, effort)
    made = Problem(problem.spec, core, *box, request, cells, possible, tape)
    if not possible:
        raise RequestError(impossible(made, effort))
    return made


def impossible(problem: Problem, effort: Effort | None = None) -> Diagnostic:
    """What to say of a request that is proved to have no scene: which atoms clash, if there is time to find out."""
    effort = Effort() if effort is None else effort
    return _impossible(problem.core, problem.lowest, problem.highest, problem.request.ranges, problem.wanted(), effort)


def _impossible(
    core: Core,
    lowest: Array,
    highest: Array,
    ranges: Mapping[str, Range],
    wanted: Mapping[int, Ends],
    effort: Effort,
) -> Diagnostic:
    asked = [f"phi of `{name}` in {wanted}" for name, wanted in ranges.items()]
    title = f"no scene can have {' and '.join(asked)}" if asked else "no scene meets what the spec requires"
    try:
        found = clash(core, lowest, highest, wanted, effort=effort)
    except (StoppedError, TooMuchError):
        found = None
    if found is None:
        return Diagnostic(title, help="ask for another range")
    return explain(core, found, title, "ask for another range; `scenegen check` shows what each part can reach")


def _refuse_points(core: Core, lowest: Array, highest: Array, ranges: Mapping[str, Range], effort: Effort) -> None:
    """A single value has probability 0 and is answered with a band; where no scene has it at all, say that instead."""
    if not any(wanted.low is not None and wanted.low == wanted.high for wanted in ranges.values()):
        return
    if any(name not in core.labels or empty_range(wanted) is not None for name, wanted in ranges.items()):
        return
    low = np.array([-np.inf if (r := ranges.get(name)) is None or r.low is None else r.low for name in core.labels])
    high = np.array([np.inf if (r := ranges.get(name)) is None or r.high is None else r.high for name in core.labels])
    if REQUIRE in core.labels:
        low[-1] = 0.0
    wanted = _wanted(core, low, high)
    if any(map(np.isnan, (*low, *high))):
        return
    if clash(core, lowest, highest, wanted, search=False, effort=effort) is not None:
        raise RequestError(_impossible(core, lowest, highest, ranges, wanted, effort))


def _wanted(core: Core, low: Array, high: Array) -> dict[int, Ends]:
    wanted: dict[int, Ends] = {}
    for node, least, most in zip(core.labels.values(), map(float, low), map(float, high), strict=True):
        wanted[node] = both(wanted.get(node, EVERYTHING), (least, most))
    return wanted


def _possible(core: Core, tape: Tape, cells: Cells, lowest: Array, highest: Array, effort: Effort) -> frozenset[int]:
    """The cells that are not proved empty, by contraction or, for very large specs, by bounds alone."""
    if len(tape.nodes) * cells.count > LARGE:
        least, most = label_bounds(core, lowest, highest, effort)
        limits = map(cells.limits, range(cells.count))
        return frozenset(cell for cell, (low, high) in enumerate(limits) if ((low <= most) & (high >= least)).all())
    wanted = [push_down(core, _wanted(core, *cells.limits(cell))) for cell in range(cells.count)]
    shape = (len(lowest), cells.count)
    lo, hi = start(tape, wanted, *(np.broadcast_to(ends[:, None], shape) for ends in (lowest, highest)))
    alive = contract(tape.nodes, lo, hi, batches=tape.batches, effort=effort)
    return frozenset(map(int, np.flatnonzero(alive)))
