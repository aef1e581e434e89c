"""What is said where no scene has room for all objects: how far it got, and what refused the rest."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from scenegen.errors import Diagnostic, Span
from scenegen.lang.core import Atom, Core, Junction
from scenegen.primitives.footprint import Box, Circle, Footprint
from scenegen.primitives.outline import corners
from scenegen.sampling.growth.grow import Stuck
from scenegen.sampling.growth.machine import Machine
from scenegen.sampling.growth.touch import within
from scenegen.sampling.growth.values import make_values

Array = npt.NDArray[np.float64]

TRIED = 64  # poses in each of so many scenes, by which it is judged which clauses refuse an object
SHOWN = 3


def why_stuck(machine: Machine, end: Stuck, tried: str) -> Diagnostic:
    """The objects that could be placed, the clauses that refuse the next, and how full the table is."""
    problem, order = machine.problem, machine.order
    names = problem.core.objects
    thing = order[end.stage]
    many = f"{end.stage} of {len(order)} objects"
    title = f"no room was found for `{names[thing]}` after {many} were placed, in {tried}"
    filled = _area(problem.spec.shapes[one].footprint for one in order) / _table(machine)
    note = f"the footprints of the {len(order)} objects take {filled:.0%} of the workspace"
    refused = _refused(machine, end)
    crowded = end.placed.attracted > 0
    span: Span | None = None
    label = ""
    if crowded:
        note += f"; {end.placed.attracted:,} of {end.placed.tries:,} poses met all else,"
        note += " and none was clear of what stands there"
    elif refused:
        text, span, share = refused[0]
        label = f"`{text}` refused {share:.0%} of the poses"
        others = "; ".join(f"`{text}` {share:.0%}" for text, _, share in refused[1:SHOWN])
        note += f"; also refused: {others}" if others else ""
    help_ = (
        "use fewer or smaller objects, or a larger area" if crowded else "widen the range, or what the spec requires"
    )
    return Diagnostic(title, span, label, help_, note=note)


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


def _area(footprints: object) -> float:
    total = 0.0
    assert hasattr(footprints, "__iter__")
    for footprint in footprints:
        total += area(footprint)
    return total


def area(footprint: Footprint) -> float:
    """The area of a footprint, in square metres."""
    if isinstance(footprint, Circle):
        return float(np.pi * footprint.radius**2)
    if isinstance(footprint, Box):
        return footprint.length * footprint.width
    x, y = np.array(corners(footprint)).T
    return float(0.5 * np.abs(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1))))


def _table(machine: Machine) -> float:
    space = machine.problem.spec.workspace
    return (space.x[1] - space.x[0]) * (space.y[1] - space.y[0])
