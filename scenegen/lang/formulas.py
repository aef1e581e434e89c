"""The formulas of a spec, lowered: one for each label, and one for all that is required."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from scenegen.errors import SpecError
from scenegen.errors.declarations import CONSTANT_LABEL, IMPOSSIBLE_REQUIREMENT, NO_FORMULA
from scenegen.lang import ast
from scenegen.lang.builder import FALSE, CoreBuilder
from scenegen.lang.core import Coord, Junction, Node, Temporal, children
from scenegen.lang.elsewhere import meant
from scenegen.lang.imports import Placed
from scenegen.lang.interpret import phi
from scenegen.lang.lower import Lowering
from scenegen.lang.provenance import Frame
from scenegen.lang.relax import clashing, relaxed
from scenegen.lang.scope import LABEL
from scenegen.lang.stage import Stage
from scenegen.lang.trampoline import run


def lower_labels(placed: Sequence[Placed], bare: ast.Expr | None, lowering: Lowering, stage: Stage) -> dict[str, int]:
    """The formula of each label; mistakes in one do not hide those in another."""
    formulas = [
        (one.source, one.statement.name.id, one.statement.formula)
        for one in placed
        if isinstance(one.statement, ast.Label)
    ]
    if bare is not None:
        formulas = [(stage.source, LABEL, bare)]
    if not formulas and not stage.problems:
        end = len(stage.source.text.rstrip())
        here = ast.Truth(True, start=end, end=end).span(stage.source)
        stage.problems.append(NO_FORMULA(here, file=stage.source.name))
    labels: dict[str, int] = {}
    for source, name, formula in formulas:
        if stage.full:
            break
        with stage:
            value = run(lowering.lower(formula, {}, Frame(source)))
            labels[name] = lowering.coerce.formula(value, f"`{name}`")
    for source, name, formula in formulas:
        if labels.get(name, 0) < 0 and not stage.problems:
            stage.problems.append(CONSTANT_LABEL(formula.span(source), name=name))
    return labels


def lower_requirement(placed: Sequence[Placed], lowering: Lowering, stage: Stage, standing: Sequence[int]) -> int:
    """The conjunction of all `require` statements, after what supports require."""
    parts = [*standing]
    declared = lowering.supports or lowering.choices
    options = {which: choice.options for which, choice in lowering.choices.items()}
    for one in placed:
        if isinstance(one.statement, ast.Require) and not stage.full:
            with stage:
                value = run(lowering.lower(one.statement.formula, {}, Frame(one.source)))
                part = lowering.coerce.formula(value, "what `require` demands")
                here = one.statement.formula.span(one.source)
                if part == FALSE or _never(part, lowering.builder):
                    raise SpecError(IMPOSSIBLE_REQUIREMENT(here, meant=meant(lowering, here)))
                part, *later = _by_time(part, lowering.builder)
                parts.extend(later)
                problem = clashing(lowering, part, lowering.supports, options)
                if problem is not None:
                    raise SpecError(problem)
                part = relaxed(lowering, part, frozenset(standing)) if declared else part
                if part == FALSE:  # where heights and places are constants
                    raise SpecError(IMPOSSIBLE_REQUIREMENT(here, meant=meant(lowering, here)))
                parts.append(part)
    return lowering.builder.junction("min", parts, "require" if len(parts) > 1 else "")


def _by_time(formula: int, builder: CoreBuilder) -> list[int]:
    """What a requirement demands of single moments; in a spec over time also what it demands of several of them, and of
    steps, at all moments but the first: before that there is no step."""
    if not builder.moving or formula < 0:
        return [formula]
    still: list[int] = []
    steps: list[int] = []
    later: list[int] = []
    stack = [formula]
    while stack:
        node = builder.nodes[index := stack.pop()]
        if isinstance(node, Junction) and node.kind == "min":
            stack.extend(reversed(node.args))
        elif _takes(index, builder, lambda one: isinstance(one, Coord) and one.object >= builder.moving):
            steps.append(index)
        else:
            (later if _takes(index, builder, lambda one: isinstance(one, Temporal)) else still).append(index)
    if not steps and not later:
        return [formula]
    made = builder.junction("min", still)
    return [made, *later, builder.moment("steps", builder.junction("min", steps))]


def _takes(formula: int, builder: CoreBuilder, what: Callable[[Node], bool]) -> bool:
    """Whether a node of some kind takes part in a formula."""
    stack, seen = [formula], set[int]()
    while stack:
        index = stack.pop()
        if index >= 0 and index not in seen:
            seen.add(index)
            node = builder.nodes[index]
            if what(node):
                return True
            stack.extend(children(node))
    return False


def _never(formula: int, builder: CoreBuilder) -> bool:
    """Whether a formula that no coordinate takes part in does not hold."""
    stack, seen = [formula], set[int]()
    while stack:
        index = stack.pop()
        if index < 0 or isinstance(builder.nodes[index], Coord | Temporal):
            return False  # found soon in almost every formula
        if index not in seen:
            seen.add(index)
            stack.extend(children(builder.nodes[index]))
    core = builder.finish({LABEL: formula})
    return bool(phi(core, [])[LABEL] < 0.0)
