"""A spec and a request, made ready for the samplers."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, NoReturn

import numpy as np
import numpy.typing as npt

from scenegen.arrays import Array, Bool, as_numbers
from scenegen.errors import Diagnostic, RequestError
from scenegen.errors.requests import (
    ALL_HELD,
    CANNOT_BE_HELD,
    NO_TIME_TO_CHECK,
    NOT_A_POSE,
    TOO_IMPROBABLE,
    UNKNOWN_OBJECT,
)
from scenegen.geometry import NUMPY
from scenegen.lang.formula.core import Coord, Core, gate, read_rows
from scenegen.lang.formula.interpret import phi as evaluate
from scenegen.lang.prior import prior_rows
from scenegen.lang.spec import CheckedSpec
from scenegen.pose import FLAT, PLACE, THETA, TWO_PI, X, Y, owner, row_count, row_of, span_of
from scenegen.sampling.cells import Cells, cut
from scenegen.sampling.request import FixedPose, Range, SampleRequest, within_reach
from scenegen.search import label_bounds
from scenegen.search.contract import (
    CONTRACT_SLACK,
    SWEEPS,
    Bounds,
    contract,
    contract_box,
    label_demand,
    push_down,
    size_of,
    start,
)
from scenegen.search.effort import Budget, Effort, StoppedError
from scenegen.search.tape import Tape, make_tape

if TYPE_CHECKING:
    from scenegen.search.surfaces import Stand

SCENES_IN_CACHE = 16_384  # scenes that are scored at a time: what is computed on the way stays in cache
LIVE_NUMBERS = 1 << 22  # numbers in memory at a time meanwhile: specs of thousands of atoms get fewer scenes
PIECE_SCENES = 65_536  # scenes of one piece; piece k of a run draws from SeedSequence(seed, k) in any process
PIECE_NUMBERS = 1 << 22  # numbers of one piece: specs with very many objects get fewer scenes

# above so many nodes times cells, cells are compared with plain bounds instead of being contracted
MAX_CONTRACTED = 1 << 22
THIN_WIDTH = 1e-11  # of the size of coordinates: more than what contraction adds for rounding, less than any tolerance
DRAWING_COST = 16  # cost of drawing, sorting into cells and verifying, in nodes per evaluation (measured)


@dataclass(frozen=True, slots=True)
class Problem:
    """A checked request, with all that plans need from its spec. `core` and `cells` are over the gate core: if the
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
        return len(self.core.nodes) + DRAWING_COST

    def scenes(self, rows: Array) -> Array:
        """The scenes of a plan as they begin, (3N, B): all of them, but for switches of choices."""
        return rows[: row_count(len(self.spec.objects))]

    @property
    def fixed_poses(self) -> dict[str, tuple[float, ...]]:
        """The places of objects that the request fixes: (x, y) or (x, y, theta), headings in [0, 2 pi)."""
        return {name: tuple(pose) for name, pose in self.request.fix.items() if not isinstance(pose, FixedPose)}

    @property
    def chooses(self) -> bool:
        """Whether things choose their surfaces, as far as phi can tell."""
        if not self.spec.choices:
            return False
        from scenegen.search.surfaces import chooses

        return chooses(self.core)

    @property
    def stands(self) -> tuple[Stand, ...]:
        """What stands on things or on one of several surfaces, in a spec with choices of these."""
        if not self.spec.choices:
            return ()
        from scenegen.search.surfaces import stands_of

        return stands_of(self.spec, self.lowest, self.highest)

    def demand(self, cell: int | None = None) -> dict[int, Bounds]:
        """The demand of a cell, or of the whole range, on each formula node of the core."""
        low, high = (self.cells.low, self.cells.high) if cell is None else self.cells.limits(cell)
        return label_demand(self.core, low, high)

    def demand_between(self, low: Array, high: Array) -> dict[int, Bounds]:
        """That phi of every label lies in low..high, (L,) each, as demands on formula nodes of the core."""
        return label_demand(self.core, low, high)

    def phi(self, rows: Array) -> Array:
        """Exact phi of float64 rows, (3N, B) -> (L, B), the requirement's last: it determines which scenes are in
        range."""
        values = evaluate(self.core, list(rows), NUMPY)
        return np.stack([np.broadcast_to(value, rows.shape[1]) for value in values.values()])

    @property
    def log_excess(self) -> float:
        """What to add to the natural logarithm of a share of the box of poses for the probability under the base
        distribution, in which every centre without a prior is uniform over the workspace, whatever it stands on."""
        return self.spec.log_excess(self.lowest, self.highest)

    @property
    def moving(self) -> int:
        """How many rows of the scenes are not held."""
        return int((self.lowest < self.highest).sum())

    @property
    def piece_size(self) -> int:
        """Scenes of one piece."""
        return max(16, min(PIECE_SCENES, PIECE_NUMBERS // row_count(len(self.spec.objects))))


def make_problem(
    spec: CheckedSpec,
    request: SampleRequest,
    budget: Budget | None = None,
    *,
    rounds: int = SWEEPS,
    most: float = math.inf,
    effort: Effort | None = None,
) -> Problem:
    """Check a request against its spec, and cut it into about `most` cells at most. Raises RequestError, also if
    contraction in so many rounds proves the whole range empty, and if the time of `budget` is long up before that is
    known, or `effort` is stopped."""
    effort = effort or (Effort() if budget is None else Effort(lambda: budget.overdrawn))
    try:
        lowest, highest, fixed = hold_fixed(spec, request.fix)
        if fixed:
            refuse_turned_priors(spec, lowest == highest)
        core = gate(spec.core)
        low, high = label_bounds(spec.core, lowest, highest, effort)
        bounds = dict(zip(spec.core.labels, zip(low.tolist(), high.tolist(), strict=True), strict=True))
        tape = make_tape(core, lowest, highest, effort)
        phi, point, touching = request.phi, False, False
        for name, one in phi.items():
            point |= one.low is not None and one.low == one.high
            touching |= name in bounds and (one.low == bounds[name][1] or one.high == bounds[name][0])
        if point or touching:  # few requests need this
            from scenegen.sampling.refusals import move_shared_bounds, refuse_points
        if point:
            refuse_points(core, lowest, highest, phi, tuple(fixed), effort)
        if touching:
            phi, bounds = move_shared_bounds(core, lowest, highest, phi, bounds, effort)
        checked, warnings = within_reach(dataclasses.replace(request, fix=fixed, phi=phi), bounds)
        warnings = (*warnings, *doubts_of_fixed(spec, request.fix))
        cells = cut(checked, tuple(core.labels), most)
        if core is not spec.core:
            cells.low[-1] = 0.0
        possible, improbable = _possible(core, tape, cells, lowest, highest, effort, rounds, choices=bool(spec.choices))
        problem = Problem(spec, core, lowest, highest, checked, cells, possible, tape, warnings, improbable)
        if not possible:
            refuse_impossible(problem, effort)
        return problem
    except StoppedError:
        raise RequestError(NO_TIME_TO_CHECK()) from None


def refuse_turned_priors(spec: CheckedSpec, held: Bool) -> None:
    """Raises RequestError where a thing is held, rows (3N, ...), and one that it usually is relative to, or drawn
    together with, is not: the other would have to follow it."""
    for prior in spec.priors:
        rows = prior_rows([prior])
        before = {node.row for node in prior.nodes if isinstance(node, Coord)}
        if prior.part == "pose":
            before |= set(rows)
        for row in rows:
            for other in sorted(before):
                if (held[row] & ~held[other]).any():
                    name, free = spec.objects[owner(row)], spec.objects[owner(other)]
                    raise RequestError(CANNOT_BE_HELD(name=name, free=f"theta({name})" if free == name else free))


def refuse_impossible(problem: Problem, effort: Effort) -> NoReturn:
    """Raises RequestError for a request of which no cell is left: no scene has it, or some cells are too improbable."""
    from scenegen.sampling.refusals import impossible, ranges_text  # few requests are refused

    asked = problem.request.phi
    if problem.improbable:
        raise RequestError(TOO_IMPROBABLE(wanted=ranges_text(asked)))
    core, lowest, highest = problem.core, problem.lowest, problem.highest
    raise RequestError(impossible(core, lowest, highest, asked, problem.demand(), tuple(problem.fixed_poses), effort))


def phi_varies(problem: Problem) -> bool:
    """Whether anything that phi depends on can move: otherwise all scenes have the same phi, and rejection is the
    method."""
    rows = np.array([*read_rows(problem.core)], dtype=np.intp)
    return bool((problem.lowest[rows] < problem.highest[rows]).any())


def narrow_problem(
    problem: Problem, core: Core, box: tuple[Array, Array], phi: Mapping[str, Range], seed: int, effort: Effort
) -> Problem:
    """The same request for the labels of another core over the same objects, without requirement, in another box of
    poses, (3N,) each. Raises RequestError if contraction proves it empty, and what `effort` raises."""
    request = dataclasses.replace(problem.request, phi=phi, seed=seed)
    cells = cut(request, tuple(core.labels))
    tape = make_tape(core, *box, effort)
    possible, improbable = _possible(core, tape, cells, *box, effort, choices=bool(problem.spec.choices))
    made = Problem(problem.spec, core, *box, request, cells, possible, tape, improbable=improbable)
    if not possible:
        refuse_impossible(made, effort)
    return made


def over_numbers(problem: Problem, spec: CheckedSpec, effort: Effort) -> Problem:
    """The same request for a spec with the same formulas over other numbers that fill the same box: see
    `sampling.prior`. Raises RequestError if contraction proves it empty, and what `effort` raises."""
    core = gate(spec.core)
    tape = make_tape(core, problem.lowest, problem.highest, effort)
    choices = bool(spec.choices)
    possible, improbable = _possible(
        core, tape, problem.cells, problem.lowest, problem.highest, effort, choices=choices
    )
    possible, improbable = possible & problem.possible, improbable & problem.possible | problem.improbable
    made = dataclasses.replace(problem, spec=spec, core=core, tape=tape, possible=possible, improbable=improbable)
    if not possible:
        refuse_impossible(made, effort)
    return made


def _possible(
    core: Core,
    tape: Tape,
    cells: Cells,
    lowest: Array,
    highest: Array,
    effort: Effort,
    rounds: int = SWEEPS,
    *,
    choices: bool,
) -> tuple[frozenset[int], frozenset[int]]:
    """The cells that are not proved empty, by contraction or, for very large specs, by bounds alone: those in which
    scenes can be found, and those whose scenes are too improbable, which contraction shows where there are
    `choices` of surfaces."""
    if len(tape.nodes) * cells.count > MAX_CONTRACTED:
        least, most = label_bounds(core, lowest, highest, effort)
        limits = map(cells.limits, range(cells.count))
        return frozenset(
            cell for cell, (low, high) in enumerate(limits) if ((low <= most) & (high >= least)).all()
        ), frozenset()
    wanted = [push_down(core, label_demand(core, *cells.limits(cell))) for cell in range(cells.count)]
    boxes = lowest[:, None], highest[:, None]
    alive = _alive(tape, wanted, *boxes, effort, rounds)
    likely = alive
    if choices:
        from scenegen.search.surfaces import worlds

        boxes = worlds(core, lowest, highest)
    if boxes[0].shape[1] > 1 and len(tape.nodes) * cells.count * boxes[0].shape[1] <= MAX_CONTRACTED:
        narrowest = min((float(np.diff(edge).min()) for edge in cells.edges), default=math.inf)
        thin = THIN_WIDTH * size_of(lowest, highest)
        likely = alive & _alive(tape, wanted, *boxes, effort, rounds, thin if narrowest > 100.0 * thin else 0.0)
        doubtful = np.flatnonzero(alive & ~likely)
        if len(doubtful):
            alive[doubtful] = _alive(tape, [wanted[cell] for cell in doubtful], *boxes, effort, rounds)
    return frozenset(np.flatnonzero(likely).tolist()), frozenset(np.flatnonzero(alive & ~likely).tolist())


def _alive(
    tape: Tape,
    wanted: Sequence[Mapping[int, Bounds]],
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
    lo, hi = start(tape, every, low, high, slack=0.0 if thin else CONTRACT_SLACK)
    alive = contract(tape.nodes, lo, hi, rounds, batches=tape.batches, effort=effort)
    if thin:
        from scenegen.search.surfaces import improbable

        alive &= ~improbable(tape, lo, hi, thin)
    return np.asarray(alive.reshape(len(wanted), count).any(axis=1))


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
