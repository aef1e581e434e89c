"""The formulas of a spec, lowered: one for each label, and one for all that is required."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from collections.abc import Set as AbstractSet
from typing import Literal

from scenegen.errors import Diagnostic, Span, SpecError
from scenegen.errors.declarations import CONSTANT_LABEL, IMPOSSIBLE_REQUIREMENT, STACKED_AND_APART
from scenegen.errors.language import NO_FORMULA
from scenegen.geometry.units import BARE
from scenegen.lang.check.draft import Draft
from scenegen.lang.check.expressions import Lowering
from scenegen.lang.check.functions import meant
from scenegen.lang.check.scope import LABEL
from scenegen.lang.check.values import CallFrame
from scenegen.lang.formula.builder import FALSE, TRUE, CoreBuilder
from scenegen.lang.formula.core import Apply, Atom, Const, Coord, Junction, Node, Temporal, children
from scenegen.lang.formula.interpret import phi
from scenegen.lang.spec import Support
from scenegen.lang.syntax import ast
from scenegen.pose import PLACE

# --------------------------------------------------------------------------------------------------------------------
# Requirements beside declared supports: what contradicts them, and what they make superfluous.


DEPTH = 4  # of min and max in a margin that is taken apart: apart() has two


def clashing(
    lowering: Lowering, requirement: int, found: Mapping[int, Support], choices: Mapping[int, Sequence[Support]]
) -> Diagnostic | None:
    """What to say where a requirement keeps an object's footprint clear of what it stands on: of all that it can stand
    on, where that is a choice."""
    nodes, coordinate = lowering.builder.nodes, lowering.coerce.coordinate
    pairs = {}
    options = {upper: [under] for upper, under in found.items()} | dict(choices)
    carriers = {upper: [under.carrier for under in unders] for upper, unders in options.items()}
    for upper, all_ in carriers.items():
        for carrier in all_:
            if carrier is not None and None not in all_:
                first, second = (tuple(coordinate(one, axis) for axis in PLACE) for one in (upper, carrier))
                pairs[first, second] = pairs[second, first] = upper, carrier
    apart: dict[int, set[int]] = {}
    stack = [requirement]
    while stack:
        node = nodes[index] if (index := stack.pop()) >= 0 else None
        if isinstance(node, Junction) and node.kind == "min":
            stack.extend(node.args)
        if not isinstance(node, Atom):
            continue
        margin = nodes[node.margin]
        if isinstance(margin, Apply) and margin.primitive == "gap" and len(margin.args) == 6:
            pair = pairs.get((margin.args[:2], margin.args[3:5]))
            if pair is not None:
                apart.setdefault(pair[0], set()).add(pair[1])
                if apart[pair[0]] < set(carriers[pair[0]]):
                    continue
                one, other = (lowering.builder.objects[which] for which in pair)
                return STACKED_AND_APART(node.spans[-1], upper=one, lower=other)
    return None


def relaxed(lowering: Lowering, formula: int, known: AbstractSet[int]) -> int:
    """A requirement that is satisfied by the same scenes, without the constants in it and without the atoms `known` to
    be required already: of what is required only the sign counts, most pairs of `noCollision` are apart by their
    heights, and what stands in a tray is clear of its walls."""
    builder = lowering.builder
    margins = {atom.margin for which in known if isinstance(atom := builder.nodes[which], Atom)}
    needed, stack = set[int](), [formula]
    while stack:
        if (index := stack.pop()) >= 0 and index not in needed:
            needed.add(index)
            node = builder.nodes[index]
            stack.extend(node.args if isinstance(node, Junction) else ())
    made = {TRUE: TRUE, FALSE: FALSE}
    for index in sorted(needed):  # children first
        node = builder.nodes[index]
        if isinstance(node, Junction):
            made[index] = builder.junction(node.kind, [made[part] for part in node.args], node.text)
        elif isinstance(node, Atom):
            made[index] = _split(lowering, node.margin, node, margins, DEPTH)
    return made[formula]


def _split(lowering: Lowering, margin: int, atom: Atom, known: AbstractSet[int], depth: int) -> int:
    builder = lowering.builder
    node = builder.nodes[margin]
    if isinstance(node, Const):
        return TRUE if node.value >= 0.0 else FALSE
    if margin in known:
        return TRUE
    if depth and isinstance(node, Apply) and node.primitive == "pick":
        switch, end, *sides = node.args
        before, after = (_split(lowering, part, atom, known, depth) for part in sides)
        early, late = (
            builder.atom(*ends, f"{builder.text(ends[0])} <= {builder.text(ends[1])}", BARE, atom.spans)
            for ends in ((switch, end), (end, switch))
        )
        either = [builder.junction("max", [late, before]), builder.junction("max", [early, after])]
        return builder.junction("min", either)
    if depth and isinstance(node, Apply) and node.primitive in ("min", "max"):
        kind: Literal["min", "max"] = "min" if node.primitive == "min" else "max"
        return builder.junction(kind, [_split(lowering, part, atom, known, depth - 1) for part in node.args])
    text = atom.text if margin == atom.margin else f"{builder.text(margin)} >= 0"
    return builder.atom_of(margin, builder.const(0.0), margin, text, atom.unit, atom.spans)


def lower_labels(draft: Draft) -> dict[str, int]:
    """The formula of each label; mistakes in one do not hide those in another."""
    problems, formulas = draft.problems, draft.formulas()
    if not formulas and not problems:
        end = len(draft.source.text.rstrip())
        problems.append(NO_FORMULA(Span(draft.source, end, end), file=draft.source.name))
    labels: dict[str, int] = {}
    for name, source, formula in formulas:
        if problems.full:
            break
        with problems:
            value = draft.lowering.evaluate(formula, CallFrame(source))
            labels[name] = draft.lowering.coerce.formula(value, f"`{name}`")
    for name, source, formula in formulas:
        if labels.get(name, 0) < 0 and not problems:
            problems.append(CONSTANT_LABEL(formula.span(source), name=name))
    return labels


def lower_requirement(draft: Draft) -> int:
    """The conjunction of all `require` statements, after what supports require."""
    lowering = draft.lowering
    parts = [*draft.standing]
    declared = lowering.supports or lowering.choices
    options = {which: choice.options for which, choice in lowering.choices.items()}
    for one in draft.placed:
        if isinstance(one.statement, ast.Require) and not draft.problems.full:
            with draft.problems:
                value = lowering.evaluate(one.statement.formula, CallFrame(one.source))
                part = lowering.coerce.formula(value, "what `require` demands")
                here = one.statement.formula.span(one.source)
                if part == FALSE or _never(part, lowering.builder):
                    raise SpecError(IMPOSSIBLE_REQUIREMENT(here, meant=meant(lowering, here)))
                part, *later = _by_time(part, lowering.builder)
                parts.extend(later)
                problem = clashing(lowering, part, lowering.supports, options)
                if problem is not None:
                    raise SpecError(problem)
                part = relaxed(lowering, part, frozenset(draft.standing)) if declared else part
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
