"""What is said where no scene has room for all objects: how far it got, and what refused the rest."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from scenegen.bounds.effort import Effort, StoppedError, TooMuchError
from scenegen.errors import Diagnostic, Span, quoted
from scenegen.errors.requests import NO_ROOM, NO_TIME_TO_GROW
from scenegen.lang.choices import options_of
from scenegen.lang.core import Atom, Core, Junction
from scenegen.pose import FLAT, row_of
from scenegen.primitives import NUMPY, PRIMITIVES
from scenegen.primitives.footprint import POINT
from scenegen.sampling.growth.full import area
from scenegen.sampling.growth.grow import Grown, Stuck, explore
from scenegen.sampling.growth.machine import Machine, make_machine
from scenegen.sampling.growth.tally import Tally
from scenegen.sampling.growth.touch import within
from scenegen.sampling.growth.values import make_values
from scenegen.sampling.problem import Problem

Array = npt.NDArray[np.float64]

TRIED = 64  # poses in each of so many scenes, by which it is judged which clauses refuse an object
SHOWN = 3
TIGHT = 0.5  # of an area: more than objects that are put down at random take
MORE = 3  # further objects of which it is seen whether they are refused, too
SCENES, EFFORT = 256, 1e5  # scenes for that, and evaluations that each may take at least


def others(problem: Problem, machine: Machine, end: Stuck) -> tuple[int, tuple[int, ...]]:
    """How many objects can be placed at once, and which are refused then: those that have been are left to the last, as
    far as a little work goes."""
    refused = [machine.order[end.stage]]
    most = end.stage
    for attempt in range(MORE):
        number = np.arange(SCENES)
        cell = end.particles.cell[number % end.particles.count]
        try:
            again = make_machine(problem, refused, deadline=machine.deadline)
        except StoppedError:
            break
        again.most = max(EFFORT, machine.work)
        try:
            found, _ = explore(again, cell, number % 2, np.random.default_rng(attempt), Tally())
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


def why_stuck(machine: Machine, end: Stuck, placed: tuple[int, tuple[int, ...]], tried: str) -> Diagnostic:
    """The objects that could be `placed`, see `others`; the clauses that refuse the first one that could not be; and
    how full the table is."""
    problem, order = machine.problem, machine.order
    names = problem.core.objects
    most, refused_things = placed
    thing = order[end.stage]
    facts: dict[str, Any] = {
        "names": tuple(names[one] for one in refused_things),
        "placed": str(most),
        "count": len(order),
        **_filled(machine, thing),
    }
    refused = _refused(machine, end)
    if end.placed.attracted > 0:
        by_footprints, by_distances = _in_the_way(machine, end)
        if not by_distances or by_distances[0][2] < by_footprints:
            crowd = {"crowded": end.placed.attracted, "tries": end.placed.tries, "first": names[thing]}
            return NO_ROOM(tried=tried, **crowd, **facts)
        refused = by_distances
    span: Span | None = None
    if refused:
        text, span, share = refused[0]
        also = "; ".join(f"`{text}` {share:.0%}" for text, _, share in refused[1:SHOWN])
        facts |= {"clause": text, "share": share, "others": also}
    return NO_ROOM(span, tried=tried, **facts)


def how_far(machine: Machine, tried: str) -> Diagnostic:
    """What to say where time is up while scenes grow."""
    count = len(machine.order)
    placed = None if machine.furthest == count else str(machine.furthest)
    fullest = max((_filled(machine, thing) for thing in machine.order), key=lambda facts: facts["filled"])
    return NO_TIME_TO_GROW(tried=tried, placed=placed, count=count, tight=fullest["filled"] >= TIGHT or None, **fullest)


def _filled(machine: Machine, thing: int) -> dict[str, Any]:
    """How full the surfaces are on which an object can stand: the share of their area that the footprints take of those
    that stand nowhere else; of the workspace where it stands on nothing."""
    spec = machine.problem.spec
    options = {one: options_of(one, spec.supports, spec.choices) for one in machine.order if one < len(spec.shapes)}
    mine = options.get(thing, ())
    things = [one for one, own in options.items() if set(own) <= set(mine) and bool(own) == bool(mine)]
    space = sum(area(one.outline) for one in mine) if mine else _table(machine)
    where = quoted([one.name for one in mine]) if mine else "the workspace"
    filled = sum(area(spec.shapes[one].footprint) for one in things) / space
    return {"standing": len(things), "filled": filled, "where": where}


def _in_the_way(machine: Machine, end: Stuck) -> tuple[float, list[tuple[str, Span | None, float]]]:
    """The share of the poses in the object's room that footprints refuse; and of those that distances do which the
    spec asks for by name, with the text of each clause."""
    thing, particles = machine.order[end.stage], end.particles
    some = np.arange(min(TRIED, particles.count))
    scenes, cell = particles.scenes[:, some], particles.cell[some]
    poses = machine.room(thing, end.stage).boxes(scenes, cell, Effort()).draw(TRIED, np.random.default_rng(0))
    rows: list[Array] = list(scenes)
    for row, values in zip(machine.touch[thing].rows, poses, strict=True):
        rows[row] = values
    placed = set(machine.order[: end.stage + 1])
    pairs = [pair for pair in machine.graph.pairs if thing in pair.objects and pair.objects <= placed]
    by_footprints, found = np.zeros((TRIED, len(some)), dtype=bool), []
    for pair in pairs:
        ends = [
            [rows[row_of(end, axis)] for axis in FLAT] if isinstance(end, int) else end
            for end in (pair.first, pair.second)
        ]
        gap = PRIMITIVES["gap"].evaluate(NUMPY, *pair.shapes, *ends[0], *ends[1])
        refused = gap < (pair.low[cell] if len(pair.low) > 1 else pair.low[0])
        if pair.shapes == (POINT, POINT):
            found.append((*_said(machine.problem.core, pair.node), float(np.mean(refused))))
        else:
            by_footprints |= refused
    return float(np.mean(by_footprints)), sorted(found, key=lambda one: -one[2])


def _refused(machine: Machine, end: Stuck) -> list[tuple[str, Span | None, float]]:
    """The clauses other than pairs that touch the object, with the share of poses of its box that each refuses."""
    thing = machine.order[end.stage]
    touch = machine.touch[thing]
    clauses = touch.in_force(end.stage)
    if not clauses:
        return []
    particles, rng = end.particles, np.random.default_rng(0)
    some = np.arange(min(TRIED, particles.count))
    cell = particles.cell[some]
    rows: list[Array] = list(particles.scenes[:, some])
    for row in touch.rows:
        low, high = machine.graph.low[row][cell], machine.graph.high[row][cell]
        rows[row] = low + rng.random((TRIED, len(some))) * (high - low)
    values = make_values(machine.problem.core, [clause.node for clause in clauses])(rows)
    found = []
    for clause, value in zip(clauses, values, strict=True):
        inside = within(value, clause, cell)
        if inside is not None:
            text, span = _said(machine.problem.core, clause.node)
            found.append((text, span, 1.0 - float(np.mean(inside))))
    return sorted(found, key=lambda one: -one[2])


def _said(core: Core, node: int) -> tuple[str, Span | None]:
    at = core.nodes[node]
    if isinstance(at, Atom):
        return at.text, at.spans[0] if at.spans else None
    assert isinstance(at, Junction)
    text, span = _said(core, at.args[0])
    return at.text or f"{text} {'and' if at.kind == 'min' else 'or'} ...", span


def _table(machine: Machine) -> float:
    space = machine.problem.spec.workspace
    return (space.x[1] - space.x[0]) * (space.y[1] - space.y[0])
