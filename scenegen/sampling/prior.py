"""The base distribution of a spec with priors, as a function of uniform numbers.

Samplers draw boxes of uniform numbers. So the spec is pulled back: wherever its formulas read a coordinate that has a
prior, they get the `quantile` of numbers that are uniform over the same box. A scene of the pulled-back spec, drawn
exactly by any sampler, is then placed: its numbers become coordinates. Shares of the box are probabilities of the
prior, bounds and contraction go through quantiles, and a narrow prior costs no rejections. Coordinates that are held
keep their values.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, cast

import numpy as np

from scenegen.arrays import Array
from scenegen.errors import RequestError
from scenegen.errors.requests import TOO_IMPROBABLE
from scenegen.geometry import NUMPY
from scenegen.geometry.footprint import Box, Footprint, Rectangle
from scenegen.geometry.quantile import QUANTILE, UNIT_SLACK, NormalRun, Quantile, Run, UniformRun, region_runs
from scenegen.geometry.workspace import wrap_headings
from scenegen.lang.formula.core import Apply, Const, Coord, Node, TapeWriter, nodes_below, renumber
from scenegen.lang.formula.interpret import Numbers, fold
from scenegen.lang.prior import Distribution, Normal, Prior, Recorded, UniformHeading, UniformPlace, prior_rows
from scenegen.lang.spec import CheckedSpec
from scenegen.pose import PLACE, THETA, X, axis_of, owner, row_of
from scenegen.sampling.plan import Account, Piece, Plan, Selection, Tally, digest, verify
from scenegen.sampling.problem import MAX_CONTRACTED, Problem, over_numbers
from scenegen.search.contract import contract, push_down, start
from scenegen.search.effort import Effort

DISC_CORNERS = 256  # of the polygon that stands for a disc: less than 0.02 % of its radius off
LEAST_SHARE = 1e-12  # of a distribution that scenes may need: uniform numbers are 1e-16 apart
RIGHT_ANGLE_TOLERANCE = 1e-12  # radians: a region turned by less from the axes is a rectangle along them


@dataclass(frozen=True, slots=True, eq=False)
class BaseDistribution:
    """How uniform numbers become coordinates: `at` maps each row that has a prior to its node on a tape over the rows
    of uniform numbers; `ends` are the least and the largest value of such a row, which rounding could miss."""

    nodes: tuple[Node, ...]
    at: dict[int, int]
    ends: dict[int, tuple[float, float]]

    def poses(self, rows: Array, given: Array | None = None) -> Array:
        """The scenes (3N, B) that uniform numbers are, headings in [0, 2 pi). Coordinates that are `given` (3N, B), not
        NaN, are these, and what is relative to them follows."""
        if not self.at:
            return rows if given is None else np.where(np.isnan(given), rows, given)
        placed = fold(self.nodes, _Coordinates(rows, given, {node: row for row, node in self.at.items()}))
        out = rows.copy() if given is None else np.where(np.isnan(given), rows, given)
        for row, node in self.at.items():
            out[row] = placed[node] if axis_of(row) == THETA else np.clip(placed[node], *self.ends[row])
        return wrap_headings(out)


class _Coordinates(Numbers):
    """What nodes over uniform numbers are worth, with the coordinates that are given as they are."""

    def __init__(self, rows: Array, given: Array | None, coordinates: dict[int, int]) -> None:
        super().__init__(NUMPY, list(rows))
        self._given, self._coordinates = given, coordinates

    def apply(self, index: int, node: Apply, args: list[Any]) -> Any:
        value = super().apply(index, node, args)
        row = self._coordinates.get(index)
        if self._given is None or row is None:
            return value
        return np.where(np.isnan(self._given[row]), value, self._given[row])


def pull_back(spec: CheckedSpec, lowest: Array, highest: Array) -> tuple[CheckedSpec, BaseDistribution]:
    """The spec over uniform numbers, and what these become; `lowest` and `highest` (3N,) are the box of poses, with
    equal ends where a coordinate is held. Without priors that is the spec itself."""
    if not spec.priors:
        return spec, BaseDistribution((), {}, {})
    priors = {row: one for row, one in prior_rows(spec.priors).items() if lowest[row] < highest[row]}
    writer = _Writer(priors=priors, lowest=lowest, highest=highest)
    place: dict[int, int] = {}
    for index, node in enumerate(spec.core.nodes):
        place[index] = writer.coordinate(node.row) if isinstance(node, Coord) else writer.add(renumber(node, place))
    labels = {name: place[node] for name, node in spec.core.labels.items()}
    required = None if spec.core.requirement is None else place[spec.core.requirement]
    at = {row: writer.coordinate(row) for row in sorted(priors)}
    core = replace(spec.core, nodes=tuple(writer.nodes), labels=labels, requirement=required)
    needed = max(nodes_below(writer.nodes, at.values()), default=-1) + 1
    ends = {row: (float(lowest[row]), float(highest[row])) for row in at}
    return replace(spec, core=core), BaseDistribution(tuple(writer.nodes[:needed]), at, ends)


@dataclass(slots=True)
class _Writer(TapeWriter):
    """Writes coordinates as quantiles: of the rows that have one of the `priors`, in the box lowest..highest (3N,)."""

    priors: Mapping[int, Prior] = field(kw_only=True)
    lowest: Array = field(kw_only=True)
    highest: Array = field(kw_only=True)
    written: dict[int, int] = field(default_factory=dict)

    def coordinate(self, row: int) -> int:
        """The node of a coordinate."""
        if row not in self.priors:
            return self._number(row)
        if row not in self.written:
            self.written[row] = self._quantile(row, self.priors[row])
        return self.written[row]

    def _number(self, row: int) -> int:
        return self.add(Coord(owner(row), axis_of(row)))

    def _quantile(self, row: int, prior: Prior) -> int:
        thing, axis = owner(row), axis_of(row)
        chooser = row
        if prior.part == "place":
            chooser = row_of(thing, X)
        elif prior.part == "pose":
            chooser = row_of(prior.things[0], X)
        given: list[int] = []
        runs, weights = list[Run](), list[float]()
        for option, weight in zip(prior.options, prior.weights, strict=True):
            made = self._runs(option, prior, thing, axis, given)
            runs.append(made)
            weights += [weight / made.count] * made.count
        ends = np.cumsum(weights) / sum(weights)
        ends[-1] = 1.0
        ranges = self._range(chooser), self._range(row)
        before: list[int] = []
        match runs:
            case [NormalRun(middle=int()) as run]:  # a sum: what is asked of how they lie is asked of the offset
                runs, before = [replace(run, offset=True)], given[:1]
        of = Quantile(*ranges, ends, tuple(runs), alone=chooser == row)
        # in formulas that people write, the constants of primitives are footprints
        constants = cast(tuple[Footprint, ...], (of,))
        found = self.add(Apply(QUANTILE, (self._number(chooser), self._number(row), *given), constants))
        return self.add(Apply("add", (*before, found))) if before else found

    def _range(self, row: int) -> tuple[float, float]:
        return float(self.lowest[row]), float(self.highest[row])

    def _runs(self, option: Distribution, prior: Prior, thing: int, axis: int, given: list[int]) -> Run:
        """An option as it says where one coordinate is; `given` gets the nodes that it is relative to."""
        low, high = self._range(row_of(thing, axis))
        match option:
            case Normal(middle, deviation):
                at = self._argument(self._node(prior.nodes, middle[0 if axis == THETA else axis]), given)
                if axis == THETA:
                    return NormalRun(at, deviation, -math.inf, math.inf, math.pi)
                return NormalRun(at, deviation, low, high)
            case UniformHeading(first, last):
                return UniformRun(np.array([first]), np.array([last]))
            case UniformPlace():
                return self._in_region(option, thing, axis, given)
            case Recorded(rows, reach, turn):
                which = prior.things.index(thing)
                boxes = [self._box(one) for one in prior.things]
                kept = sorted((row for row in rows if option.is_reachable(row, boxes)), key=_along_curve)
                was = np.array([row[which][axis] for row in kept])
                if axis == THETA:
                    return UniformRun(was - min(turn, math.pi), was + min(turn, math.pi))
                return UniformRun(np.maximum(was - reach, low), np.minimum(was + reach, high))

    def _box(self, thing: int) -> Rectangle:
        x, y = (self._range(row_of(thing, axis)) for axis in PLACE)
        return x[0], y[0], x[1], y[1]

    def _node(self, nodes: Sequence[Node], wanted: int) -> int:
        """The node of a prior's own tape, over coordinates."""
        place: dict[int, int] = {}
        for index in sorted(nodes_below(nodes, [wanted])):
            node = nodes[index]
            place[index] = self.coordinate(node.row) if isinstance(node, Coord) else self.add(renumber(node, place))
        return place[wanted]

    def _argument(self, node: int, given: list[int]) -> float | int:
        """A number, or the place of a node among the arguments."""
        found = self.nodes[node]
        if isinstance(found, Const):
            return float(found.value)
        if node not in given:
            given.append(node)
        return given.index(node)

    def _in_region(self, region: UniformPlace, thing: int, axis: int, given: list[int]) -> Run:
        points = region.corners_within(self._box(thing), DISC_CORNERS)
        if isinstance(region.footprint, Box) and _is_along_axes(region.pose[2]):
            ends = [point[axis] for point in points]
            return UniformRun(np.array([min(ends)]), np.array([max(ends)]))
        if axis == X:
            return region_runs(points, 0)[0]
        at = self._argument(self.coordinate(row_of(thing, X)), given)
        assert isinstance(at, int)
        return region_runs(points, at)[1]


CURVE_BITS, CURVE_STEP = 10, 0.01  # of a coordinate, and metres of the lowest one


def _along_curve(row: Sequence[tuple[float, ...]]) -> int:
    """Where the first thing of a recorded row is along a curve that visits the plane square by square (Morton 1966):
    rows that follow one another are near each other, so that parts of their order are small parts of the table."""
    x, y = (int(row[0][axis] / CURVE_STEP) & ((1 << CURVE_BITS) - 1) for axis in PLACE)
    return sum((x >> bit & 1) << 2 * bit | (y >> bit & 1) << 2 * bit + 1 for bit in range(CURVE_BITS))


def _is_along_axes(heading: float) -> bool:
    return abs(math.remainder(heading, math.pi / 2.0)) < RIGHT_ANGLE_TOLERANCE


@dataclass(frozen=True, slots=True, eq=False)
class Placed(Selection):
    """A plan over uniform numbers, whose scenes are placed and scored again: `base` says how."""

    base: BaseDistribution

    @property
    def plan_digest(self) -> str:
        return digest("placed", self.plan.plan_digest, self.problem.spec.source)

    @property
    def fact_count(self) -> int:
        return self.plan.fact_count

    @property
    def seconds(self) -> float:
        return self.plan.seconds

    def draw(self, k: int) -> Piece:
        made = self.plan.draw(k)
        rows = self.base.poses(made.rows)
        with np.errstate(all="ignore"):  # as in the plan: candidates out of the range may be anywhere
            phi = self.problem.phi(rows)
        # headings lose full turns, which can move phi by a rounding across the end of a cell
        cell = np.where(self.cells.find(phi) == made.cell, made.cell, -1)
        return Piece(rows, phi, cell, made.facts)

    def account(self, tally: Tally) -> Account:
        return self.plan.account(tally)

    def shortfall_of(self, tally: Tally) -> tuple[Plan, int | None]:
        return self.plan.shortfall_of(tally)

    def check(self, rows: Array, phi: Array) -> None:
        verify(self.problem, rows, phi)


def over_uniform(problem: Problem, effort: Effort) -> tuple[Problem, BaseDistribution]:
    """A problem whose spec has priors over uniform numbers, and what these become. Raises RequestError where it is
    proved to be impossible, or needs less of a distribution than LEAST_SHARE, and what `effort` raises."""
    spec, base = pull_back(problem.spec, problem.lowest, problem.highest)
    return _without_tails(over_numbers(problem, spec, effort), base, effort), base


def _without_tails(over: Problem, base: BaseDistribution, effort: Effort) -> Problem:
    """A problem over uniform numbers, the cells of which need more of each distribution than LEAST_SHARE; the others
    are too improbable. Raises RequestError where all are, and what `effort` raises."""
    cells = sorted(over.possible)
    if len(over.tape.nodes) * len(cells) > MAX_CONTRACTED:
        return over
    boxes = (np.broadcast_to(ends[:, None], (len(ends), len(cells))) for ends in (over.lowest, over.highest))
    lo, hi = start(over.tape, [push_down(over.core, over.demand(cell)) for cell in cells], *boxes)
    contract(over.tape.nodes, lo, hi, batches=over.tape.batches, effort=effort)
    rows = [row for row in over.tape.rows if row in base.at]
    nodes = [over.tape.rows[row] for row in rows]
    # bounds of a number are two slacks wide themselves, and as much is lost once more on the way to them
    least = (LEAST_SHARE + 4.0 * UNIT_SLACK) * (over.highest - over.lowest)[rows, None]
    few = hi[nodes] - lo[nodes] < least
    tails = few.any(axis=0)
    if tails.all():
        thing = over.spec.objects[owner(rows[int(few[:, 0].argmax())])]
        raise RequestError(TOO_IMPROBABLE(thing=thing, share=LEAST_SHARE))
    beyond = frozenset(np.array(cells)[tails].tolist())
    return replace(over, possible=over.possible - beyond, improbable=over.improbable | beyond)


def plan_placed(problem: Problem, make: Callable[[Problem], Plan], effort: Effort) -> Placed:
    """The plan of a problem whose spec has priors: `make` makes one of the pulled-back problem. Raises what it and
    `over_uniform` raise."""
    over, base = over_uniform(problem, effort)
    inner = make(over)
    return Placed(problem, inner, base=base, why=inner.why)
