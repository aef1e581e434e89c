"""The value of the expression under the cursor, and the bounds of its phi.

The core does not record the source of every sub-formula, so the statements that lead to the cursor are expanded once
more, by the checker's own code, and the results at the nodes around the cursor are kept. Inside a definition or a
quantifier one node has many results, one for each call and each iteration.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from scenegen.bounds import node_bounds
from scenegen.errors import Source, SpecError
from scenegen.lang import ast, traversal
from scenegen.lang.builder import TRUE, CoreBuilder, TooLarge
from scenegen.lang.core import Atom, Core
from scenegen.lang.declare import name_objects
from scenegen.lang.imports import inline
from scenegen.lang.lower import Lowering
from scenegen.lang.places import whole
from scenegen.lang.provenance import Frame
from scenegen.lang.regions import areas
from scenegen.lang.scope import Scope, collect
from scenegen.lang.spec import CheckedSpec
from scenegen.lang.trampoline import Call, run
from scenegen.lang.values import FormulaValue, NumberValue, PointValue, Value
from scenegen.lsp.document import Document
from scenegen.primitives import Interval
from scenegen.primitives.units import LENGTH, Unit


@dataclass(frozen=True, slots=True)
class Extent:
    """The values that an expression can have anywhere in the workspace: low to high over all of its `count` results.

    A formula (of phi, infinite where it always or never holds) and a number have one interval, a point has two, of x
    and y. `unit` is None where units mix.
    """

    node: ast.Expr
    kind: str  # "formula", "number" or "point"
    intervals: tuple[tuple[float, float], ...]
    unit: Unit | None
    count: int


class _Recording(Lowering):
    """Keeps the values of the nodes in `recorded`, by the identity of the node."""

    def __init__(self, scope: Scope, builder: CoreBuilder) -> None:
        super().__init__(scope, builder)
        self.recorded: dict[int, list[Value]] = {}

    def lower(self, node: ast.Expr, env: Mapping[str, Value], frame: Frame) -> Call[Value]:
        value: Value = yield super().lower(node, env, frame)
        if id(node) in self.recorded:
            self.recorded[id(node)].append(value)
        return value


def path_to(module: ast.Module, offset: int) -> tuple[ast.Statement | None, list[ast.Expr]]:
    """The statement at an offset (None: the unnamed formula), and the expressions around it, outermost first."""
    if module.bare is not None:
        return None, _descend([module.bare], offset)
    statement = next((one for one in module.statements if one.start <= offset < one.end), None)
    return statement, [] if statement is None else _descend(traversal.expressions(statement), offset)


def _descend(level: Sequence[ast.Expr | ast.Argument], offset: int) -> list[ast.Expr]:
    path: list[ast.Expr] = []
    while inside := [node for node in level if node.start <= offset < node.end]:
        node = inside[-1]
        if not isinstance(node, ast.Argument):
            path.append(node)
        level = traversal.children(node)
    return path


def extents(document: Document, offset: int) -> list[Extent]:
    """The extents of the expressions around an offset, innermost first; empty if the text has errors, or if there is
    nothing to expand."""
    part = document.salvaged
    if part is None:
        return []
    module, spec = part
    if spec.timed is not None:
        return []  # the bounds of single scenes say nothing of motions
    statement, path = path_to(module, offset)
    if not path or isinstance(statement, ast.Workspace | ast.Objects | ast.Region | ast.Import):
        return []
    return _outcomes(document, module, spec, _roots(module, statement), path, isinstance(statement, ast.Definition))


def of_constant(document: Document, name: str) -> Extent | None:
    """The value of a constant; None if the text gives it none."""
    part = document.salvaged
    node = ast.Name(name)
    found = (
        []
        if part is None or part[1].timed is not None
        else _outcomes(document, *part, [(document.source, node)], [node])
    )
    return found[0] if found else None


def _roots(module: ast.Module, statement: ast.Statement | None) -> list[tuple[Source, ast.Expr]]:
    """The statements to expand for all uses of a statement: the statement itself, or all formulas for a definition."""
    if module.bare is not None:
        return [(module.source, module.bare)]
    if isinstance(statement, ast.Definition):
        formulas = [one.formula for one in module.statements if isinstance(one, ast.Label | ast.Require)]
        return [(module.source, formula) for formula in formulas]
    return [] if statement is None else [(module.source, expr) for expr in traversal.expressions(statement)]


def _outcomes(
    document: Document,
    module: ast.Module,
    spec: CheckedSpec,
    roots: Sequence[tuple[Source, ast.Expr]],
    path: Sequence[ast.Expr],
    fresh: bool = False,
) -> list[Extent]:
    """`fresh`: without cached definitions, whose bodies would not be expanded again."""
    try:
        lowering = _lowering(document, module, spec, fresh)
        lowering.recorded = {id(node): [] for node in path}
        for source, expr in roots:
            run(lowering.lower(expr, {}, Frame(source)))
    except (SpecError, TooLarge):
        if document.lowering is None:
            return []
        document.lowering = None  # what earlier hovers expanded counts towards its limits
        return _outcomes(document, module, spec, roots, path, fresh)
    return list(_extents(lowering, spec, path))


def _lowering(document: Document, module: ast.Module, spec: CheckedSpec, fresh: bool) -> _Recording:
    """The document's lowering, which knows the labels and constants that an earlier hover has met."""
    kept = None if fresh else document.lowering
    lowering = kept if isinstance(kept, _Recording) else _prepared(document, module, spec)
    lowering.steps = 0  # the limit is for one hover, not for all of them
    if not fresh:
        document.lowering = lowering
    return lowering


def _prepared(document: Document, module: ast.Module, spec: CheckedSpec) -> _Recording:
    """A lowering that knows the declarations. Raises SpecError, and TooLarge."""
    placed, _ = inline(module, document.project())
    scope, _ = collect(module.source, placed, module.bare)
    builder = CoreBuilder(())
    lowering = _Recording(scope, builder)
    lowering.areas["workspace"] = whole(spec.workspace)
    for region in scope.regions.values():
        run(areas(lowering, region))
    scope.objects, scope.arrays = name_objects(lowering, list(scope.things.values()))
    builder.objects = spec.core.objects
    lowering.shapes, lowering.supports, lowering.choices = spec.shapes, spec.supports, spec.choices
    lowering.heights = spec.heights or (0.0,) * len(spec.shapes)
    lowering.coerce.footprints = tuple(shape.footprint for shape in spec.shapes)
    lowering.coerce.fixed = spec.fixed
    return lowering


def _extents(lowering: _Recording, spec: CheckedSpec, path: Sequence[ast.Expr]) -> Iterator[Extent]:
    values = {id(node): _nodes(lowering.recorded[id(node)]) for node in path}
    wanted = sorted({one for found in values.values() for one in found if one >= 0})
    core = lowering.builder.finish({str(one): one for one in wanted})
    with np.errstate(over="ignore", invalid="ignore"):  # infinite bounds are an answer, not an accident
        bounds = node_bounds(core, *spec.box())
    place = {one: core.labels[str(one)] for one in wanted}
    for node in reversed(path):
        found = lowering.recorded[id(node)]
        if not found:
            continue
        first = found[0]
        if isinstance(first, FormulaValue):
            ends = [_truth(one) if one < 0 else bounds[place[one]] for one in values[id(node)]]
            units = {_unit(core, place[one]) for one in values[id(node)] if one >= 0}
            unit = units.pop() if len(units) == 1 else None
            yield Extent(node, "formula", (_union(ends),), unit, len(ends))
        elif isinstance(first, NumberValue):
            ends = [bounds[place[one]] for one in values[id(node)]]
            yield Extent(node, "number", (_union(ends),), first.unit, len(ends))
        elif isinstance(first, PointValue):
            ends = [bounds[place[one]] for one in values[id(node)]]
            yield Extent(node, "point", (_union(ends[::2]), _union(ends[1::2])), LENGTH, len(ends) // 2)


def _nodes(values: Sequence[Value]) -> list[int]:
    """The nodes of the core that values stand for: one of a formula or number, x and y of a point."""
    nodes: list[int] = []
    for value in values:
        if isinstance(value, FormulaValue | NumberValue):
            nodes.append(value.node)
        elif isinstance(value, PointValue):
            nodes += [value.x, value.y]
    return nodes


def _unit(core: Core, index: int) -> Unit | None:
    node = core.nodes[index]
    return node.unit if isinstance(node, Atom) else None


def _truth(formula: int) -> Interval:
    end = np.array(math.inf if formula == TRUE else -math.inf)
    return Interval(end, end)


def _union(ends: Sequence[Interval]) -> tuple[float, float]:
    return min(float(one.lo) for one in ends), max(float(one.hi) for one in ends)
