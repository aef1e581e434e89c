"""Why growth has no plan: how far it got, and what refused the rest."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from scenegen.arrays import Array
from scenegen.errors import Diagnostic, RequestError, Span, quote_names
from scenegen.errors.requests import NO_ROOM, NO_TIME_TO_GROW, TABLE_TOO_FULL
from scenegen.geometry import NUMPY, PRIMITIVES
from scenegen.geometry.footprint import POINT
from scenegen.lang.formula.core import Atom, Core, Junction
from scenegen.lang.spec import options_of
from scenegen.pose import FLAT, row_of
from scenegen.sampling.growth.constraints import is_within, make_values
from scenegen.sampling.growth.model import GrowthModel, MoveTally, make_growth_model
from scenegen.sampling.growth.packing import area
from scenegen.sampling.growth.population import Grown, PlacementFailed, explore
from scenegen.sampling.plan import NoPlan
from scenegen.sampling.problem import Problem
from scenegen.sampling.report import too_early
from scenegen.search.effort import Effort, StoppedError, TooMuchError


@dataclass(frozen=True, slots=True, eq=False)
class GrowthFailed(NoPlan):
    """No plan: time was up (`stuck` is None), there was no room for an object, a `proof` (facts of
    TABLE_TOO_FULL) says that there is none for all of them, or it is `dear`: it takes longer than was allowed."""

    model: GrowthModel | None
    stuck: PlacementFailed | None
    evaluations: float
    proof: Mapping[str, str] = field(default_factory=dict)
    dear: bool = False

    @property
    def time_is_up(self) -> bool:
        return self.stuck is None and not self.proof and not self.dear

    @property
    def final(self) -> bool:
        return self.time_is_up or bool(self.proof)

    @property
    def is_crowded(self) -> bool:
        """Whether poses met all clauses but those that keep objects apart: the table is too full."""
        return self.stuck is not None and self.stuck.placed.attracted > 0

    @property
    def too_dear(self) -> bool:
        return self.dear

    def error(self, problem: Problem) -> RequestError:
        tried = f"{int(self.evaluations):,} evaluations of growth"
        if self.proof:
            return RequestError(TABLE_TOO_FULL(**self.proof))
        if self.model is None:
            return RequestError(too_early(problem, tried, problem.cells.count))
        if self.stuck is None:
            return RequestError(late_message(self.model, tried))
        with np.errstate(all="ignore"):
            placed = refused_objects(problem, self.model, self.stuck)
            return RequestError(stuck_message(self.model, self.stuck, placed, tried))


PROBED_POSES = 64  # poses in each of so many scenes, by which it is judged which clauses refuse an object
MAX_CLAUSES_SHOWN = 3  # clauses that an error names
TIGHT_SHARE = 0.5  # of an area: more than objects that are put down at random take
MAX_OTHERS_REFUSED = 3  # further objects of which it is seen whether they are refused, too
RETRY_SCENES, RETRY_EVALUATIONS = 256, 1e5  # scenes for that, and evaluations that each may take at least


def refused_objects(problem: Problem, model: GrowthModel, end: PlacementFailed) -> tuple[int, tuple[int, ...]]:
    """How many objects can be placed at once, and which are refused then: those that have been are left to the last, as
    far as a little work goes."""
    refused = [model.order[end.stage]]
    most = end.stage
    for attempt in range(MAX_OTHERS_REFUSED):
        number = np.arange(RETRY_SCENES)
        cell = end.particles.cell[number % end.particles.count]
        try:
            again = make_growth_model(problem, refused, deadline=model.deadline)
        except StoppedError:
            break
        again.most = max(RETRY_EVALUATIONS, model.work)
        try:
            found, _ = explore(again, cell, number % 2, np.random.default_rng(attempt), MoveTally())
        except (StoppedError, TooMuchError):
            most = max(most, again.furthest)
            break
        if isinstance(found, Grown):  # in another order there was room for all: few scenes were lucky
            break
        most = max(most, found.stage)
        thing = again.order[found.stage]
        if thing in refused:
            break
        refused.append(thing)
    return most, tuple(refused)


def stuck_message(
    model: GrowthModel, end: PlacementFailed, placed: tuple[int, tuple[int, ...]], tried: str
) -> Diagnostic:
    """The objects that could be `placed`, see `refused_objects`; the clauses that refuse the first one that could not
    be; and how full the table is."""
    problem, order = model.problem, model.order
    names = problem.core.objects
    most, refused_things = placed
    thing = order[end.stage]
    facts: dict[str, Any] = {
        "names": tuple(names[one] for one in refused_things),
        "placed": str(most),
        "count": len(order),
        **_fullness(model, thing),
    }
    refused = _refusing_clauses(model, end)
    if end.placed.attracted > 0:
        by_footprints, by_distances = _blocking_shares(model, end)
        if not by_distances or by_distances[0][2] < by_footprints:
            crowd = {"crowded": end.placed.attracted, "tries": end.placed.tries, "first": names[thing]}
            return NO_ROOM(tried=tried, **crowd, **facts)
        refused = by_distances
    span: Span | None = None
    if refused:
        text, span, share = refused[0]
        also = "; ".join(f"`{text}` {share:.0%}" for text, _, share in refused[1:MAX_CLAUSES_SHOWN])
        facts |= {"clause": text, "share": share, "others": also}
    return NO_ROOM(span, tried=tried, **facts)


def late_message(model: GrowthModel, tried: str) -> Diagnostic:
    """What to say where time is up while scenes grow."""
    count = len(model.order)
    placed = None if model.furthest == count else str(model.furthest)
    fullest = max((_fullness(model, thing) for thing in model.order), key=lambda facts: facts["filled"])
    return NO_TIME_TO_GROW(
        tried=tried, placed=placed, count=count, tight=fullest["filled"] >= TIGHT_SHARE or None, **fullest
    )


def _fullness(model: GrowthModel, thing: int) -> dict[str, Any]:
    """How full the surfaces are on which an object can stand: the share of their area that the footprints take of those
    that stand nowhere else; of the workspace where it stands on nothing."""
    spec = model.problem.spec
    options = {one: options_of(one, spec.supports, spec.choices) for one in model.order if one < len(spec.shapes)}
    mine = options.get(thing, ())
    things = [one for one, own in options.items() if set(own) <= set(mine) and bool(own) == bool(mine)]
    (left, right), (bottom, top) = spec.workspace.x, spec.workspace.y
    space = sum(area(one.outline) for one in mine) if mine else (right - left) * (top - bottom)
    where = quote_names([one.name for one in mine]) if mine else "the workspace"
    filled = sum(area(spec.shapes[one].footprint) for one in things) / space
    return {"standing": len(things), "filled": filled, "where": where}


def _blocking_shares(model: GrowthModel, end: PlacementFailed) -> tuple[float, list[tuple[str, Span | None, float]]]:
    """The share of the poses in the object's room that footprints refuse; and of those that distances do which the
    spec asks for by name, with the text of each clause."""
    thing, particles = model.order[end.stage], end.particles
    some = np.arange(min(PROBED_POSES, particles.count))
    scenes, cell = particles.scenes[:, some], particles.cell[some]
    poses = model.room(thing, end.stage).boxes(scenes, cell, Effort()).draw(PROBED_POSES, np.random.default_rng(0))
    rows: list[Array] = list(scenes)
    for row, values in zip(model.constraints[thing].rows, poses, strict=True):
        rows[row] = values
    placed = set(model.order[: end.stage + 1])
    pairs = [pair for pair in model.graph.pairs if thing in pair.objects and pair.objects <= placed]
    by_footprints, found = np.zeros((PROBED_POSES, len(some)), dtype=bool), []
    for pair in pairs:
        ends = [
            [rows[row_of(end, axis)] for axis in FLAT] if isinstance(end, int) else end
            for end in (pair.first, pair.second)
        ]
        gap = PRIMITIVES["gap"].evaluate(NUMPY, *pair.shapes, *ends[0], *ends[1])
        refused = gap < (pair.low[cell] if len(pair.low) > 1 else pair.low[0])
        if pair.shapes == (POINT, POINT):
            found.append((*_clause_text(model.problem.core, pair.node), float(np.mean(refused))))
        else:
            by_footprints |= refused
    return float(np.mean(by_footprints)), sorted(found, key=lambda one: -one[2])


def _refusing_clauses(model: GrowthModel, end: PlacementFailed) -> list[tuple[str, Span | None, float]]:
    """The clauses other than pairs that touch the object, with the share of poses of its box that each refuses."""
    thing = model.order[end.stage]
    constraints = model.constraints[thing]
    clauses = constraints.clauses_at(end.stage)
    if not clauses:
        return []
    particles, rng = end.particles, np.random.default_rng(0)
    some = np.arange(min(PROBED_POSES, particles.count))
    cell = particles.cell[some]
    rows: list[Array] = list(particles.scenes[:, some])
    for row in constraints.rows:
        low, high = model.graph.low[row][cell], model.graph.high[row][cell]
        rows[row] = low + rng.random((PROBED_POSES, len(some))) * (high - low)
    values = make_values(model.problem.core, [clause.node for clause in clauses])(rows)
    found = []
    for clause, value in zip(clauses, values, strict=True):
        inside = is_within(value, clause, cell)
        if inside is not None:
            text, span = _clause_text(model.problem.core, clause.node)
            found.append((text, span, 1.0 - float(np.mean(inside))))
    return sorted(found, key=lambda one: -one[2])


def _clause_text(core: Core, node: int) -> tuple[str, Span | None]:
    at = core.nodes[node]
    if isinstance(at, Atom):
        return at.text, at.spans[0] if at.spans else None
    assert isinstance(at, Junction)
    text, span = _clause_text(core, at.args[0])
    return at.text or f"{text} {'and' if at.kind == 'min' else 'or'} ...", span
