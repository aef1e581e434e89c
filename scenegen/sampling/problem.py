"""A spec and a request, made ready for the samplers."""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from scenegen.arrays import Array, Index, as_numbers
from scenegen.errors import Diagnostic, RequestError
from scenegen.errors.requests import (
    ALL_HELD,
    CANNOT_BE_HELD,
    NO_SUCH_SCENE,
    NO_TIME_TO_CHECK,
    NOT_A_POSE,
    TOO_IMPROBABLE,
    UNKNOWN_OBJECT,
)
from scenegen.geometry import NUMPY
from scenegen.lang.formula.core import REQUIRE, Core, gate, read_rows
from scenegen.lang.formula.interpret import phi as evaluate
from scenegen.lang.spec import CheckedSpec
from scenegen.pose import FLAT, PLACE, THETA, TWO_PI, X, Y, row_count, row_of, span_of
from scenegen.sampling.request import FixedPose, Range, SampleRequest, empty_range, within_reach
from scenegen.search import label_bounds
from scenegen.search.contract import (
    EVERYTHING,
    ROUNDS,
    SLACK,
    Ends,
    both,
    contract,
    contract_box,
    push_down,
    size_of,
    start,
)
from scenegen.search.effort import Effort, StoppedError, TooMuchError, scoring
from scenegen.search.surfaces import improbable, worlds
from scenegen.search.tape import Tape, make_tape

# --------------------------------------------------------------------------------------------------------------------
# Cutting the requested range of phi into cells that get equal shares of the scenes (docs/sampling.md).


CELLS_PER_LABEL = {0: 1, 1: 32, 2: 16}  # cells along each bounded label; 8 for three or more


@dataclass(frozen=True, slots=True)
class Cells:
    """The product of the bounded ranges, cut into equal cells, plus the constraints of all labels.

    `edges[k]` are the borders along bounded label `bounded[k]` (an index into the labels); `low` and `high` are (L,)
    with infinities for open ends.
    """

    labels: tuple[str, ...]
    bounded: tuple[int, ...]
    edges: tuple[Array, ...]
    low: Array
    high: Array

    @property
    def count(self) -> int:
        return math.prod(len(edge) - 1 for edge in self.edges)

    def find(self, phi: Array) -> Index:
        """The cell of each of B scenes from their phi, (L, B) -> (B,); -1 if a label is out of its range."""
        inside = ((phi >= self.low[:, None]) & (phi <= self.high[:, None])).all(axis=0)
        cell = np.zeros(phi.shape[1], dtype=np.intp)
        for label, edge in zip(self.bounded, self.edges, strict=True):
            along = np.searchsorted(edge, phi[label], side="right") - 1
            cell = cell * (len(edge) - 1) + np.clip(along, 0, len(edge) - 2)
        return np.where(inside, cell, -1)

    def limits(self, cell: int) -> tuple[Array, Array]:
        """Lowest and highest phi of every label in a cell, each (L,)."""
        low, high = self.low.copy(), self.high.copy()
        for label, edge in zip(reversed(self.bounded), reversed(self.edges), strict=True):
            cell, along = divmod(cell, len(edge) - 1)
            low[label], high[label] = edge[along], edge[along + 1]
        return low, high

    def describe(self, cell: int) -> str:
        """The cell as ranges of phi: `task 0.05:0.054`."""
        low, high = self.limits(cell)
        return ", ".join(f"{self.labels[k]} {low[k]:.4g}:{high[k]:.4g}" for k in self.bounded) or "the whole range"


def cut(request: SampleRequest, labels: Sequence[str], most: float = math.inf) -> Cells:
    """The cells of a request; a single one for `--spread base`, or if no range is bounded. About `most` at most: what
    wants a few scenes needs no more."""
    ranges = [request.phi.get(label, Range()) for label in labels]
    low = np.array([-np.inf if wanted.low is None else wanted.low for wanted in ranges])
    high = np.array([np.inf if wanted.high is None else wanted.high for wanted in ranges])
    bounded = tuple(k for k, wanted in enumerate(ranges) if wanted.bounded) if request.spread == "flat" else ()
    pieces = CELLS_PER_LABEL.get(len(bounded), 8)
    if most < pieces ** len(bounded):
        pieces = math.ceil(most ** (1 / len(bounded)))
    edges = tuple(np.linspace(low[k], high[k], pieces + 1) for k in bounded)
    return Cells(tuple(labels), bounded, edges, low, high)


# --------------------------------------------------------------------------------------------------------------------
# How many scenes a piece of a run has.


PIECE = 65_536  # scenes of one piece; piece k of a run draws from SeedSequence(seed, k) in any process
LARGEST_PIECE = 1 << 22  # numbers of one piece: specs with very many objects get fewer scenes


# random streams, beside that of the base draws (stream 0)
PILOT, GUIDED, PLAN, REJECTION, PAIRED = 2, 3, 4, 5, 7

LARGE = 1 << 22  # above so many nodes times cells, cells are compared with plain bounds instead of being contracted
THIN = 1e-11  # of the size of coordinates: more than what contraction adds for rounding, less than any tolerance
SHARED = 4096  # scenes that tell whether many have phi at its bound
GRACE = 0.25  # seconds
BESIDE = 16  # cost of drawing, sorting into cells and verifying, in nodes per evaluation (measured)


@dataclass(frozen=True, slots=True)
class Budget:
    """When to stop searching. A time limit can only cut a run short; the scenes before the cut do not depend on it.

    When it is pickled for another process, it keeps the seconds that are left, because clocks may differ."""

    seconds: float = 60.0
    started: float = field(default_factory=time.monotonic)

    def __reduce__(self) -> tuple[type[Budget], tuple[float]]:
        return Budget, (self.ends - time.monotonic(),)

    @property
    def ends(self) -> float:
        """When time is up, by this process's monotonic clock."""
        return self.started + self.seconds

    @property
    def seconds_left(self) -> float:
        """The seconds until then; a millisecond at least, which is a time limit, too."""
        return max(self.ends - time.monotonic(), 1e-3)

    @property
    def spent(self) -> bool:
        return time.monotonic() - self.started >= self.seconds

    @property
    def overdrawn(self) -> bool:
        """Time has long been up: even work that should finish is stopped."""
        return time.monotonic() - self.started >= self.seconds + GRACE

    def check(self) -> None:
        """Raises StoppedError if time has long been up."""
        if self.overdrawn:
            raise StoppedError


@dataclass(frozen=True, slots=True)
class Problem:
    """A checked request, with all that plans need from its spec. `core` and `cells` are over the gated core: if the
    spec requires something, the requirement's margin is an additional label, the last, with the range 0 and above.
    `lowest` and `highest` (3N,) are the box of poses; their rows are equal for an object that the spec or the request
    fixes. `possible` are the cells that scenes are looked for in; of those that are not, bounds prove all but the
    `improbable` ones empty. `tape` is the core as contraction reads it; `warnings` are about the request. It can be
    pickled."""

    spec: CheckedSpec
    core: Core
    lowest: Array
    highest: Array
    request: SampleRequest
    cells: Cells
    possible: frozenset[int]
    tape: Tape
    warnings: tuple[Diagnostic, ...] = ()
    improbable: frozenset[int] = frozenset()

    over_time: ClassVar[bool] = False

    @property
    def labels(self) -> tuple[str, ...]:
        """The spec's labels: without that of the requirement."""
        return self.spec.labels

    @property
    def rows(self) -> int:
        """How many numbers a scene is in storage."""
        return len(self.lowest)

    @property
    def cost(self) -> int:
        """About the cost of drawing and scoring a scene, in visits of nodes."""
        return len(self.core.nodes) + BESIDE

    def scenes(self, rows: Array) -> Array:
        """The scenes of a plan as they begin, (3N, B): all of them, but for switches of choices."""
        return rows[: row_count(len(self.spec.objects))]

    @property
    def fixed(self) -> dict[str, tuple[float, ...]]:
        """The places of objects that the request fixes: (x, y) or (x, y, theta), headings in [0, 2 pi)."""
        return {name: tuple(pose) for name, pose in self.request.fix.items() if not isinstance(pose, FixedPose)}

    def wanted(self, cell: int | None = None) -> dict[int, Ends]:
        """The demand of a cell, or of the whole range, on each formula node of the core."""
        low, high = (self.cells.low, self.cells.high) if cell is None else self.cells.limits(cell)
        return _wanted(self.core, low, high)

    def demand(self, low: Array, high: Array) -> dict[int, Ends]:
        """That phi of every label lies in low..high, (L,) each, as demands on formula nodes of the core."""
        return _wanted(self.core, low, high)

    def phi(self, rows: Array) -> Array:
        """Exact phi of float64 rows, (3N, B) -> (L, B), the requirement's last: it determines which scenes are in
        range."""
        values = evaluate(self.core, list(rows), NUMPY)
        return np.stack([np.broadcast_to(value, rows.shape[1]) for value in values.values()])

    @property
    def log_excess(self) -> float:
        """What to add to the natural logarithm of a share of the box of poses for the probability under the base
        distribution, in which every centre is uniform over the workspace, whatever the object stands on."""
        return self.spec.workspace.log_excess(self.lowest, self.highest, len(self.spec.objects))

    @property
    def moving(self) -> int:
        """How many rows of the scenes are not held."""
        return int((self.lowest < self.highest).sum())

    @property
    def piece_size(self) -> int:
        """Scenes of one piece."""
        return max(16, min(PIECE, LARGEST_PIECE // row_count(len(self.spec.objects))))


def make_problem(
    spec: CheckedSpec,
    request: SampleRequest,
    budget: Budget | None = None,
    *,
    rounds: int = ROUNDS,
    most: float = math.inf,
    effort: Effort | None = None,
) -> Problem:
    """Check a request against its spec, and cut it into about `most` cells at most. Raises RequestError, also if
    contraction in so many rounds proves the whole range empty, and if the time of `budget` is long up before that is
    known, or `effort` is stopped."""
    effort = effort or (Effort() if budget is None else Effort(lambda: budget.overdrawn))
    try:
        lowest, highest, fixed = hold_fixed(spec, request.fix)
        core = gate(spec.core)
        low, high = label_bounds(spec.core, lowest, highest, effort)
        bounds = dict(zip(spec.core.labels, zip(low.tolist(), high.tolist(), strict=True), strict=True))
        tape = make_tape(core, lowest, highest, effort)
        phi, point, touching = request.phi, False, False
        for name, one in phi.items():
            point |= one.low is not None and one.low == one.high
            touching |= name in bounds and (one.low == bounds[name][1] or one.high == bounds[name][0])
        if point:
            _refuse_points(core, lowest, highest, phi, tuple(fixed), effort)
        if touching:
            phi, bounds = _at_shared_bounds(core, lowest, highest, phi, bounds, effort)
        checked, warnings = within_reach(dataclasses.replace(request, fix=fixed, phi=phi), bounds)
        warnings = (*warnings, *doubts_of_fixed(spec, request.fix))
        cells = cut(checked, tuple(core.labels), most)
        if core is not spec.core:
            cells.low[-1] = 0.0
        possible, improbable = _possible(core, tape, cells, lowest, highest, effort, rounds)
        problem = Problem(spec, core, lowest, highest, checked, cells, possible, tape, warnings, improbable)
        if not possible:
            raise RequestError(impossible(problem, effort))
        return problem
    except StoppedError:
        raise RequestError(NO_TIME_TO_CHECK()) from None


def moves(problem: Problem) -> bool:
    """Whether anything that phi depends on can move: otherwise all scenes have the same phi, and rejection is the
    method."""
    rows = np.array([*read_rows(problem.core)], dtype=np.intp)
    return bool((problem.lowest[rows] < problem.highest[rows]).any())


def narrowed(
    problem: Problem,
    core: Core,
    box: tuple[Array, Array],
    phi: Mapping[str, Range],
    seed: int,
    effort: Effort,
) -> Problem:
    """The same request for the labels of another core over the same objects, without requirement, in another box of
    poses, (3N,) each. Raises RequestError if contraction proves it empty, and what `effort` raises."""
    request = dataclasses.replace(problem.request, phi=phi, seed=seed)
    cells = cut(request, tuple(core.labels))
    tape = make_tape(core, *box, effort)
    possible, improbable = _possible(core, tape, cells, *box, effort)
    made = Problem(problem.spec, core, *box, request, cells, possible, tape, improbable=improbable)
    if not possible:
        raise RequestError(impossible(made, effort))
    return made


def impossible(problem: Problem, effort: Effort | None = None) -> Diagnostic:
    """The error for a request of which no cell is left: it is proved to have no scene, and the error names the atoms
    that conflict, if there is time to find out; or some cells are only too improbable."""
    if problem.improbable:
        return TOO_IMPROBABLE(wanted=_asked(problem.request.phi))
    effort = Effort() if effort is None else effort
    asked = problem.request.phi, problem.wanted()
    return _impossible(problem.core, problem.lowest, problem.highest, *asked, tuple(problem.fixed), effort)


def _impossible(
    core: Core,
    lowest: Array,
    highest: Array,
    phi: Mapping[str, Range],
    wanted: Mapping[int, Ends],
    held: Sequence[str],
    effort: Effort,
) -> Diagnostic:
    """The error names the requirement alone where that suffices: then no other range of phi helps."""
    from scenegen.search.clash import clash, explain

    facts: dict[str, object] = {"wanted": _asked(phi)}
    try:
        found = None
        if REQUIRE in core.labels:
            required = {core.labels[REQUIRE]: (0.0, math.inf)}
            found = clash(core, lowest, highest, required, search=False, effort=effort)
        if found is not None:
            facts = {"required": True, "held": held}
        else:
            found = clash(core, lowest, highest, wanted, search=False, effort=effort)
    except (StoppedError, TooMuchError):
        found = None
    return NO_SUCH_SCENE(**facts) if found is None else explain(core, found, NO_SUCH_SCENE, **facts)


def _asked(phi: Mapping[str, Range]) -> str:
    return " and ".join(f"phi of `{name}` in {wanted}" for name, wanted in phi.items())


def _refuse_points(
    core: Core, lowest: Array, highest: Array, phi: Mapping[str, Range], held: Sequence[str], effort: Effort
) -> None:
    """A single value has probability 0, so the error suggests a band; if no scene has the value at all, it says so
    instead."""
    if any(name not in core.labels or empty_range(wanted) is not None for name, wanted in phi.items()):
        return
    low = np.array([-np.inf if (r := phi.get(name)) is None or r.low is None else r.low for name in core.labels])
    high = np.array([np.inf if (r := phi.get(name)) is None or r.high is None else r.high for name in core.labels])
    if REQUIRE in core.labels:
        low[-1] = 0.0
    wanted = _wanted(core, low, high)
    if any(map(np.isnan, (*low, *high))):
        return
    from scenegen.search.clash import clash  # few requests are refused

    if clash(core, lowest, highest, wanted, search=False, effort=effort) is not None:
        raise RequestError(_impossible(core, lowest, highest, phi, wanted, held, effort))


def _at_shared_bounds(
    core: Core,
    lowest: Array,
    highest: Array,
    phi: Mapping[str, Range],
    bounds: dict[str, tuple[float, float]],
    effort: Effort,
) -> tuple[Mapping[str, Range], dict[str, tuple[float, float]]]:
    """The ranges and the bounds of phi, where a range only touches a bound that many scenes share, as where phi is a
    matter of which surface a thing is on: the bound moves by a hair, for it has not probability 0, and a range of that
    value alone has its other end open."""
    ends = {name: wanted for name, wanted in phi.items() if name in bounds}
    count = max(64, min(SHARED, LARGE // len(core.nodes)))
    effort.spend(scoring(core.nodes, count))
    width = (highest - lowest)[:, None]
    rows = lowest[:, None] + width * np.random.default_rng(0).random((len(lowest), count))
    with np.errstate(all="ignore"):
        values = evaluate(core, list(rows), NUMPY)
    phi, bounds = dict(phi), dict(bounds)
    for name, one in ends.items():
        low, high = bounds[name]
        if one.low == high and np.any(values[name] == high):
            bounds[name] = low, float(np.nextafter(high, math.inf))
            phi[name] = dataclasses.replace(one, high=None) if one.high == high else one
        elif one.high == low and np.any(values[name] == low):
            bounds[name] = float(np.nextafter(low, -math.inf)), high
            phi[name] = dataclasses.replace(one, low=None) if one.low == low else one
    return phi, bounds


def _wanted(core: Core, low: Array, high: Array) -> dict[int, Ends]:
    wanted: dict[int, Ends] = {}
    for node, least, most in zip(core.labels.values(), map(float, low), map(float, high), strict=True):
        wanted[node] = both(wanted.get(node, EVERYTHING), (least, most))
    return wanted


def _possible(
    core: Core, tape: Tape, cells: Cells, lowest: Array, highest: Array, effort: Effort, rounds: int = ROUNDS
) -> tuple[frozenset[int], frozenset[int]]:
    """The cells that are not proved empty, by contraction or, for very large specs, by bounds alone: those in which
    scenes can be found, and those whose scenes are too improbable, which contraction shows where surfaces are chosen.
    """
    if len(tape.nodes) * cells.count > LARGE:
        least, most = label_bounds(core, lowest, highest, effort)
        limits = map(cells.limits, range(cells.count))
        return frozenset(
            cell for cell, (low, high) in enumerate(limits) if ((low <= most) & (high >= least)).all()
        ), frozenset()
    wanted = [push_down(core, _wanted(core, *cells.limits(cell))) for cell in range(cells.count)]
    boxes = lowest[:, None], highest[:, None]
    alive = _alive(tape, wanted, *boxes, effort, rounds)
    likely = alive
    choices = worlds(core, lowest, highest)
    if choices[0].shape[1] > 1 and len(tape.nodes) * cells.count * choices[0].shape[1] <= LARGE:
        narrowest = min((float(np.diff(edge).min()) for edge in cells.edges), default=math.inf)
        thin = THIN * size_of(lowest, highest)
        likely = alive & _alive(tape, wanted, *choices, effort, rounds, thin if narrowest > 100.0 * thin else 0.0)
        doubtful = np.flatnonzero(alive & ~likely)
        if len(doubtful):
            alive[doubtful] = _alive(tape, [wanted[cell] for cell in doubtful], *choices, effort, rounds)
    return frozenset(np.flatnonzero(likely).tolist()), frozenset(np.flatnonzero(alive & ~likely).tolist())


def _alive(
    tape: Tape,
    wanted: Sequence[Mapping[int, Ends]],
    low: Array,
    high: Array,
    effort: Effort,
    rounds: int,
    thin: float = 0.0,
) -> npt.NDArray[np.bool_]:
    """Which of C demands can be met in some of the boxes low..high, (3N, W), as far as contraction can tell, (C,). With
    `thin`, those that are met in more than single scenes, as far as contraction without slack and `improbable` tell.
    """
    count = low.shape[1]
    if len(wanted) == count == 1 and not thin:
        return np.array([contract_box(tape, low[:, 0], high[:, 0], wanted[0], effort, rounds).alive])
    every = [demand for demand in wanted for _ in range(count)]
    low, high = np.tile(low, len(wanted)), np.tile(high, len(wanted))
    lo, hi = start(tape, every, low, high, slack=0.0 if thin else SLACK)
    alive = contract(tape.nodes, lo, hi, rounds, batches=tape.batches, effort=effort)
    if thin:
        alive &= ~improbable(tape, lo, hi, thin)
    return np.asarray(alive.reshape(len(wanted), count).any(axis=1))


# --------------------------------------------------------------------------------------------------------------------
# Objects that a request holds.


def hold_fixed(
    spec: CheckedSpec, fixed: Mapping[str, FixedPose | tuple[float, ...]]
) -> tuple[Array, Array, dict[str, tuple[float, ...]]]:
    """The box of poses, (3N,) each, in which the rows of fixed objects have zero width; and the fixed poses, headings
    in [0, 2 pi).

    Raises RequestError for an unknown object, one that the spec already fixes, a place outside the workspace, values
    that are not numbers, and if nothing is left to sample.
    """
    lowest, highest = spec.box()
    for which in spec.fixed:
        row = row_of(which, THETA)
        lowest[row] = highest[row] = _heading(float(lowest[row]))
    known: dict[str, tuple[float, ...]] = {}
    for name, given in fixed.items():
        held = _as_pose(name, given)
        # An object of a category is called after its asset; here its own name stands for whichever it is.
        called = [one for one in spec.objects if one == name or one.startswith(f"{name}:")]
        if not called:
            raise RequestError(UNKNOWN_OBJECT(held.span, name=name, known=spec.objects))
        for which in map(spec.objects.index, called):
            if which in spec.fixed:
                raise RequestError(CANNOT_BE_HELD(held.span, name=name))
            x, y = ((float(lowest[row]), float(highest[row])) for row in (row_of(which, X), row_of(which, Y)))
            if not (x[0] <= held.x <= x[1] and y[0] <= held.y <= y[1]):
                box = f"[{x[0]:g}, {x[1]:g}] x [{y[0]:g}, {y[1]:g}]"
                raise RequestError(CANNOT_BE_HELD(held.span, name=name, x=held.x, y=held.y, workspace=box))
            pose = (held.x, held.y) if held.theta is None else (held.x, held.y, _heading(held.theta))
            known[spec.objects[which]] = pose
            rows = span_of(which, len(pose))
            lowest[rows] = highest[rows] = pose
    if not (lowest < highest).any():
        raise RequestError(ALL_HELD(consequence="nothing is left to sample"))
    return lowest, highest, known


def doubts_of_fixed(spec: CheckedSpec, fixed: Mapping[str, FixedPose | tuple[float, ...]]) -> Iterator[Diagnostic]:
    """Warnings for fixed poses that are in other units by their numbers; what was typed has units, or is refused."""
    for name, given in fixed.items():
        if not isinstance(given, FixedPose):
            from scenegen.scenes.arrange import doubts_of

            yield from doubts_of("`fix`", [name], as_numbers(given)[None, None], spec.workspace, first=0)


def _as_pose(name: str, given: object) -> FixedPose:
    if isinstance(given, FixedPose):
        return given
    try:
        pose = as_numbers(given)
    except (TypeError, ValueError):
        pose = np.empty(0)
    if pose.ndim != 1 or len(pose) not in (len(PLACE), len(FLAT)) or not np.isfinite(pose).all():
        raise RequestError(NOT_A_POSE(name=name, value=repr(given)))
    return FixedPose(*pose.tolist())


def _heading(theta: float) -> float:
    turned = math.remainder(theta, TWO_PI) % TWO_PI
    return 0.0 if turned >= TWO_PI else turned
