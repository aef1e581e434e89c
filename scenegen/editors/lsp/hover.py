"""Hover texts for the place under the cursor, in Markdown."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from scenegen.editors.lsp import names
from scenegen.editors.lsp.document import Document
from scenegen.editors.lsp.names import Binding, Occurrence
from scenegen.errors import Source, SpecError
from scenegen.geometry import Box, Circle, Footprint, Interval
from scenegen.geometry.primitives import ANGLE, LENGTH, Unit, quantity
from scenegen.lang.check.expressions import FormulaLowering
from scenegen.lang.check.imports import inline
from scenegen.lang.check.objects import name_objects
from scenegen.lang.check.regions import areas
from scenegen.lang.check.scope import Scope, collect
from scenegen.lang.check.values import CallFrame, FormulaValue, NumberValue, PointValue, Value, whole
from scenegen.lang.formula.builder import TRUE, CoreBuilder, FormulaTooLarge
from scenegen.lang.formula.core import Atom, Core
from scenegen.lang.spec import CheckedSpec
from scenegen.lang.syntax import ast
from scenegen.lang.syntax.printer import print_expr
from scenegen.lang.syntax.tokens import KEYWORDS as RESERVED
from scenegen.lang.syntax.tokens import Token
from scenegen.search import node_bounds
from scenegen.things import ASSETS, Shape, shape_of

# The value of the expression under the cursor, and the bounds of its phi.
# The core does not record the source of every sub-formula, so the statements that lead to the cursor are expanded
# once more, by the checker's own code, and the results at the nodes around the cursor are kept. Inside a definition
# or a quantifier one node has many results, one for each call and each iteration.


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


class _RecordingLowering(FormulaLowering):
    """Keeps the values of the nodes in `recorded`, by the identity of the node."""

    def __init__(self, scope: Scope, builder: CoreBuilder) -> None:
        super().__init__(scope, builder)
        self.recorded: dict[int, list[Value]] = {}

    def lower(self, node: ast.Expr, env: Mapping[str, Value], frame: CallFrame) -> Value:
        value = super().lower(node, env, frame)
        if id(node) in self.recorded:
            self.recorded[id(node)].append(value)
        return value


def path_to(module: ast.Module, offset: int) -> tuple[ast.Statement | None, list[ast.Expr]]:
    """The statement at an offset (None: the unnamed formula), and the expressions around it, outermost first."""
    if module.bare is not None:
        return None, _descend([module.bare], offset)
    statement = next((one for one in module.statements if one.start <= offset < one.end), None)
    return statement, [] if statement is None else _descend(ast.expressions(statement), offset)


def _descend(level: Sequence[ast.Expr | ast.Argument], offset: int) -> list[ast.Expr]:
    path: list[ast.Expr] = []
    while inside := [node for node in level if node.start <= offset < node.end]:
        node = inside[-1]
        if not isinstance(node, ast.Argument):
            path.append(node)
        level = ast.children(node)
    return path


def extents(document: Document, offset: int) -> list[Extent]:
    """The extents of the expressions around an offset, innermost first; empty if the text has errors, or if there is
    nothing to expand."""
    part = document.salvage
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
    part = document.salvage
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
    return [] if statement is None else [(module.source, expr) for expr in ast.expressions(statement)]


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
            lowering.evaluate(expr, CallFrame(source))
    except (SpecError, FormulaTooLarge):
        if document.lowering is None:
            return []
        document.lowering = None  # what earlier hovers expanded counts towards its limits
        return _outcomes(document, module, spec, roots, path, fresh)
    return list(_extents(lowering, spec, path))


def _lowering(document: Document, module: ast.Module, spec: CheckedSpec, fresh: bool) -> _RecordingLowering:
    """The document's lowering, which knows the labels and constants that an earlier hover has met."""
    kept = None if fresh else document.lowering
    lowering = kept if isinstance(kept, _RecordingLowering) else _new_lowering(document, module, spec)
    lowering.steps = 0  # the limit is for one hover, not for all of them
    if not fresh:
        document.lowering = lowering
    return lowering


def _new_lowering(document: Document, module: ast.Module, spec: CheckedSpec) -> _RecordingLowering:
    """A lowering that knows the declarations. Raises SpecError, and FormulaTooLarge."""
    placed, _ = inline(module, document.project())
    scope, _ = collect(module.source, placed, module.bare)
    builder = CoreBuilder(())
    lowering = _RecordingLowering(scope, builder)
    lowering.areas["workspace"] = whole(spec.workspace)
    for region in scope.regions.values():
        areas(lowering, region)
    scope.objects, scope.arrays = name_objects(lowering, list(scope.things.values()))
    builder.objects = spec.core.objects
    lowering.shapes, lowering.supports, lowering.choices = spec.shapes, spec.supports, spec.choices
    lowering.heights = spec.heights or (0.0,) * len(spec.shapes)
    lowering.coerce.footprints = tuple(shape.footprint for shape in spec.shapes)
    lowering.coerce.fixed = spec.fixed
    return lowering


def _extents(lowering: _RecordingLowering, spec: CheckedSpec, path: Sequence[ast.Expr]) -> Iterator[Extent]:
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


MAX_LISTED_OBJECTS = 12  # names that a list of objects shows


def _spec(document: Document) -> CheckedSpec | None:
    return document.salvage[1] if document.salvage is not None else None


def size(footprint: Footprint) -> str:
    """A footprint in words."""
    match footprint:
        case Circle(radius):
            return f"circle of radius {_metres(radius)}"
        case Box(length, width):
            return f"box {_metres(length)} x {_metres(width)}"
        case _:
            return f"convex polygon of {len(footprint.vertices)} corners"


def _metres(length: float) -> str:
    return f"{length:.4g} m" if length >= 1.0 else f"{100.0 * length:.4g} cm"


def _shape(shape: Shape) -> str:
    return f"{shape.asset}: {size(shape.footprint)}, {_metres(shape.height)} high"


def asset(name: str) -> str:
    """The size of an entry of the library."""
    return _shape(shape_of(name)) if name in ASSETS else ""


def thing(document: Document, binding: Binding) -> str:
    """Shape, number and place of an object or array."""
    spec = _spec(document)
    name = f"{binding.name}[1]" if binding.is_array else binding.name
    kind = None if spec is None else next((one for one in spec.counts if one.assets and one.name == name), None)
    if kind is not None:
        return f"one of the assets {', '.join(kind.assets)}"
    if spec is None or name not in spec.objects:
        written = " ".join(binding.source.text[binding.end : binding.closes].split())
        return f"`{binding.name}{' ' if written[:1] not in ('', '[') else ''}{written}`"
    index = spec.objects.index(name)
    words = _shape(spec.shapes[index])
    if binding.is_array:
        count = sum(one.startswith(f"{binding.name}[") for one in spec.objects)
        drawn = next((one for one in spec.counts if one.name == binding.name), None)
        return f"{count if drawn is None else drawn.words} of {words}"
    if index in spec.fixed:
        x, y, theta = spec.fixed[index]
        return f"{words}; held at ({x:.4g}, {y:.4g}), heading {theta:.4g} rad"
    return words


def region(document: Document, name: str) -> list[str]:
    """Shape and centre of a region."""
    spec = _spec(document)
    found = next((one for one in spec.regions if one.name == name), None) if spec is not None else None
    if found is None:
        return []
    x, y, _ = found.pose
    return [f"**region** {size(found.footprint)}, centre ({x:.4g}, {y:.4g})"]


def workspace(document: Document) -> str:
    """The extent of the table."""
    spec = _spec(document)
    if spec is None:
        return ""
    (left, right), (bottom, top) = spec.workspace.x, spec.workspace.y
    return f"[{left:g}, {right:g}] x [{bottom:g}, {top:g}] m"


def objects(document: Document) -> str:
    """The names of all objects."""
    spec = _spec(document)
    if spec is None:
        return ""
    more = f", ... ({len(spec.objects)} in all)" if len(spec.objects) > MAX_LISTED_OBJECTS else ""
    return ", ".join(f"`{one}`" for one in spec.objects[:MAX_LISTED_OBJECTS]) + more


_PRIOR_TEXTS = {"usually": names.CLAUSE_TEXTS["usually"], **names.DISTRIBUTION_TEXTS}
MAX_FORMULA_LENGTH = 80  # characters of a formula that a hover repeats


@dataclass(frozen=True, slots=True)
class Hover:
    """Markdown about characters `start` to `end`."""

    markdown: str
    start: int
    end: int


def hover(document: Document, offset: int) -> Hover | None:
    """The meaning of the name or sign at an offset, and the values of the formula around it; None if there is
    nothing."""
    token = _token(document, offset)
    if token is None:
        return None
    found = next(
        (one for one in document.index.names_between(token.start, token.end) if one.start == token.start), None
    )
    around = extents(document, _place(document, token, found))
    parts = _about_name(document, found, around) if found is not None else _about_token(document, token)
    start, end = token.start, token.end
    formula = next((one for one in around if one.kind == "formula"), None)
    if found is not None and found.role == "declaration" and found.local is not None and found.local.kind == "label":
        formula = next((one for one in reversed(around) if one.kind == "formula"), None)
        parts += [_phi(formula)] if formula is not None else []
    elif formula is not None and not (found is not None and found.role == "declaration"):
        parts.append(_phi(formula, written=formula.node.start < start or formula.node.end > end))
        if found is None and token.text not in RESERVED and token.kind != "number":
            start, end = formula.node.start, formula.node.end
    return Hover("\n\n".join(parts), start, end) if parts else None


def _token(document: Document, offset: int) -> Token | None:
    """The token at an offset, or else the name or number that ends there."""
    statement = document.index.statement(offset)
    touching = [one for one in statement.tokens if one.start <= offset <= one.end] if statement is not None else []
    under = next((one for one in touching if offset < one.end), None)
    return under or next((one for one in touching if one.kind in ("name", "number")), None)


def _place(document: Document, token: Token, found: Occurrence | None) -> int:
    """The offset whose expressions are of interest: of a label its formula."""
    if found is not None and found.role == "declaration" and found.local is not None and found.local.kind == "label":
        statement = document.index.statement(token.start)
        if statement is not None and len(statement.tokens) > 2:
            return statement.tokens[2].start
    return token.start


def _about_name(document: Document, found: Occurrence, around: Sequence[Extent]) -> list[str]:
    binding = document.meaning(found)
    own = next((one for one in around if _stands_for(one.node, found)), None)
    value = [_number(own)] if own is not None and own.kind != "formula" else []
    match found.role:
        case "member" if found.name in names.MEMBER_TEXTS:
            return [f"`.{found.name}`: {names.MEMBER_TEXTS[found.name]}", *value]
        case "asset":
            return [f"**asset** `{found.name}`", asset(found.name)]
        case "value" if binding is None and found.name in names.BUILT_IN_TEXTS:
            facts_ = workspace(document) if found.name == "workspace" else objects(document)
            return [f"**built in** `{found.name}`: {names.BUILT_IN_TEXTS[found.name]}", facts_]
        case "call" if binding is None and found.name in names.functions():
            usage, meaning = names.functions()[found.name]
            return [_code(usage), meaning, *value]
        case _:
            return _name_text(document, binding, value) if binding is not None else []


def _stands_for(node: ast.Expr, found: Occurrence) -> bool:
    """Whether the name is the head of the expression: the name itself, the function of a call, the member behind a
    dot."""
    match node:
        case ast.Call(function):
            return function.start == found.start
        case ast.Member(_, member):
            return member.start == found.start
        case _:
            return isinstance(node, ast.Name) and node.start <= found.start and found.end <= node.end


def _name_text(document: Document, binding: Binding, value: list[str]) -> list[str]:
    told = [names.remark(binding)] if binding.kind not in ("parameter", "variable") else []
    told = [words for words in told if words]
    written = _shorten(" ".join(binding.source.text[binding.opens : binding.closes].split()))
    match binding.kind:
        case "definition":
            usage, formula = names.usage(binding)
            where = "" if binding.source is document.source else f"\n\n*{binding.source.name}*"
            return [_code(usage), *told, f"= `{_shorten(formula)}`{where}", *value]
        case "object":
            what = "array" if binding.is_array else "object"
            note = " (not declared: inferred from its use)" if binding.inferred else ""
            return [f"**{what}** `{binding.name}`{note}", *told, thing(document, binding)]
        case "constant":
            extent = of_constant(document, binding.name)
            return [_code(written), *told, *([_number(extent)] if extent is not None else value)]
        case "region":
            return [_code(written), *told, *region(document, binding.name)]
        case "camera":
            return [_code(written), *told]
        case "label":
            return [f"**label** `{binding.name}`", *told]
        case "parameter":
            return [f"**parameter** `{written}` of `{binding.owner}`", *value]
        case "variable":
            colon = binding.source.text.find(":", binding.closes)
            quantifier = " ".join(binding.source.text[binding.opens : colon].split())
            return [f"**variable** `{binding.name}` of `{_shorten(quantifier)}`", *value]


def _about_token(document: Document, token: Token) -> list[str]:
    statement = document.index.statement(token.start)
    prior = statement is not None and statement.kind == "usually"
    words = {**names.KEYWORDS_IN_WORDS, **(_PRIOR_TEXTS if prior else {})}
    if token.text in words:
        return [f"**{token.text}**: {words[token.text]}"]
    if token.kind == "number":
        number = token.text.rstrip("acdegmnrtu%").rstrip()
        suffix = token.text[len(number) :].strip()
        amount, unit = quantity(number, suffix)
        if unit == ANGLE:
            return [f"{token.text} = {amount:.6g} rad = {math.degrees(amount):.6g} deg"]
        return [f"{token.text} = {amount:.6g} m"] if unit == LENGTH and suffix != "m" else []
    return []


def _phi(extent: Extent, written: bool = False) -> str:
    ((low, high),) = extent.intervals
    of = f" of `{_shorten(print_expr(extent.node))}`" if written else ""
    if low == high and math.isinf(low):
        return f"phi{of}: {'holds' if low > 0 else 'fails'} in every scene"
    unit = f" {extent.unit}" if extent.unit is not None and str(extent.unit) else ""
    uses = f", over {extent.count} uses" if extent.count > 1 else ""
    verdict = ", never satisfied" if high < 0.0 else ", always satisfied" if low >= 0.0 else ""
    return f"phi{of} in [{low:.4g}, {high:.4g}]{unit}{uses}{verdict}"


def _number(extent: Extent) -> str:
    unit = f" {extent.unit}" if extent.unit is not None and str(extent.unit) else ""
    texts = [f"{low:.6g}" if low == high else f"[{low:.4g}, {high:.4g}]" for low, high in extent.intervals]
    uses = f", over {extent.count} uses" if extent.count > 1 else ""
    if extent.kind == "point":
        return f"= ({', '.join(texts)}){unit}{uses}"
    constant = all(low == high for low, high in extent.intervals)
    degrees = f" = {math.degrees(extent.intervals[0][0]):.6g} deg" if constant and extent.unit == ANGLE else ""
    return f"{'=' if constant else 'in'} {texts[0]}{unit}{degrees}{uses}"


def _code(text: str) -> str:
    return f"```spec\n{text}\n```"


def _shorten(text: str) -> str:
    return text if len(text) <= MAX_FORMULA_LENGTH else text[: MAX_FORMULA_LENGTH - 3] + "..."
