"""`forall` and `exists`: a formula for every way to choose the variables, joined by min or max."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from math import comb
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from scenegen.arrays import Array
from scenegen.errors import SpecError
from scenegen.errors.declarations import SPEC_TOO_LARGE
from scenegen.errors.language import EMPTY_RANGE, TOO_FEW_ELEMENTS
from scenegen.geometry import NUMPY, PRIMITIVES
from scenegen.geometry.primitives import BARE
from scenegen.lang.check.template import DependsOnValue, Template
from scenegen.lang.check.values import (
    MOST_VARIABLES,
    AnyValue,
    CallFrame,
    FormulaValue,
    NeighboursValue,
    NumberValue,
    ObjectValue,
    Value,
)
from scenegen.lang.formula.builder import FormulaTooLarge
from scenegen.lang.formula.core import Apply, Atom, Const, Junction
from scenegen.lang.syntax import ast
from scenegen.lang.syntax.printer import print_expr

if TYPE_CHECKING:
    from scenegen.lang.check.lowering import Lowering


# --------------------------------------------------------------------------------------------------------------------
# Margins of a template that grow or fall with one constant: the same expression in every round, but for that.


@dataclass(frozen=True, slots=True)
class MonotoneDependence:
    """The constant of a template that a number depends on alone, and whether it grows with it or falls."""

    constant: int
    grows: bool


def chain(template: Template, margin: int) -> MonotoneDependence | None:
    """How a number hangs on the constants that differ from round to round, where it is one, in one place, and every
    step from there to the number is monotone; rounded, it then is, too."""
    grows = True
    index = margin
    while index not in template.constant:
        node = template.own.get(index)
        if not isinstance(node, Apply):
            return None
        mine = [place for place, arg in enumerate(node.args) if arg in template.own]
        if len(mine) != 1:
            return None
        (place,) = mine
        primitive = PRIMITIVES[node.primitive]
        if not primitive.monotone:
            values = [None if arg in template.own else template.below.value(arg) for arg in node.args]
            slopes = None if primitive.slopes is None else primitive.slopes(values)
            if slopes is None:
                return None
            grows ^= slopes[place] < 0.0
        index = node.args[place]
    return MonotoneDependence(index, grows)


def evaluate(template: Template, constant: int, given: npt.NDArray[np.float64]) -> Any:
    """A constant of a template in every round, (K,); `given` is (variables, K)."""
    values: dict[int, Any] = dict(zip(template.given, given, strict=True))
    for slot, kind, *rest in template.steps:
        if kind == "constant":
            primitive, args, _ = rest
            numbers = [values[arg] if arg in values else template.below.value(arg) for arg in args]
            function = PRIMITIVES[primitive]
            values[slot] = function.evaluate(NUMPY, *numbers) if function.exact else np.nan
    return values[constant]


# --------------------------------------------------------------------------------------------------------------------
# The rounds of a quantifier: expanded one by one at first, from a template where many are alike, and where an order
# of constants says which of them count, those alone.


FEW = 16  # rounds that are not worth a template
ALONE = 2  # rounds of a kind that are expanded by themselves first: a mistake shows there, and most kinds are rarer
MANY = 256  # rounds over numbers of which the hardest alone may be kept
MAX_MADE = 1_200_000  # steps of templates, of a whole spec; about five seconds

Kind = tuple[object, ...]


class InstantiatedTemplate(NamedTuple):
    """A template with its result, the rounds of quantifiers inside, and the steps that count."""

    template: Template
    result: int
    inner: int
    cost: int


class QuantifierRounds:
    """The rounds of one quantifier, `count` of them, around a body. `formula` expands one, with a template for the
    kinds of choices (numbers with the same unit, free objects with the same footprint) that come up often."""

    def __init__(
        self, lowering: Lowering, node: ast.Quantifier, env: Mapping[str, Value], frame: CallFrame, count: int
    ) -> None:
        self.lowering = lowering
        self.node = node
        self.names = [variable.id for variable in node.variables]
        self.env = env
        self.frame = frame  # of the body, but for what the variables stand for
        self.left = count
        self.seen: dict[Kind, int] = {}
        self.templates: dict[Kind, InstantiatedTemplate | None] = {}  # with its result, and rounds inside
        self._kinds: dict[int, object] = {}  # of objects

    def made(self, choice: Sequence[Value]) -> int | None:
        """The formula of the body for one choice of the variables, if there is a template for it."""
        if not self.templates:
            return None
        kind = self._kind(choice)
        known = None if kind is None else self.templates.get(kind)
        if known is None:
            return None
        template, result, inner, cost = known
        lowering = self.lowering
        lowering.steps += inner
        lowering.made += cost
        given = [value.index if isinstance(value, ObjectValue) else value.node for value in choice]  # type: ignore[attr-defined]
        made = template.make(result, given)
        self.left -= made is not None
        return made

    def formula(self, choice: Sequence[Value]) -> int:
        """The formula of the body for one choice, expanded by itself. Raises SpecError, and FormulaTooLarge."""
        lowering = self.lowering
        self.left -= 1
        before = lowering.inside
        chosen = {name: value.moved(value.origin) for name, value in zip(self.names, choice, strict=True)}
        value = self._body(chosen)
        formula = lowering.coerce.formula(value, f"the formula of `{self.node.kind}`")
        if self.left < FEW and not self.templates:
            return formula
        kind = self._kind(choice)
        if kind is not None and kind not in self.templates:
            self.seen[kind] = self.seen.get(kind, 0) + 1
            if self.seen[kind] >= ALONE:
                self.templates[kind] = self._template(choice, self.left)
        elif self.left:
            lowering.foresee((lowering.inside - before) * self.left // 2)  # later rounds may have less to do
        return formula

    def _body(self, chosen: Mapping[str, Value]) -> Value:
        frame = self.frame
        inside = CallFrame(
            frame.source, frame.calls, frame.text, frame.body, (*frame.where, chosen)[-MOST_VARIABLES:], frame.rounds
        )
        return self.lowering.lower(self.node.body, {**self.env, **chosen}, inside)

    def _kind(self, choice: Sequence[Value]) -> Kind | None:
        kind: list[object] = []
        for value in choice:
            if isinstance(value, ObjectValue):
                known = self._kinds.get(value.index)
                if known is None:
                    coerce = self.lowering.coerce
                    free = value.index not in coerce.fixed and coerce.footprints
                    known = self._kinds[value.index] = coerce.covers(value.index) if free else ()
                if known == ():
                    return None
                kind.append(known)
            elif isinstance(value, NumberValue) and isinstance(self.lowering.builder.nodes[value.node], Const):
                kind.append(value.unit)
            else:
                return None
        return tuple(kind)

    def _template(self, choice: Sequence[Value], left: int) -> InstantiatedTemplate | None:
        """The body for a choice of this kind. None where it has no template.

        Raises SpecError and FormulaTooLarge for one that is too large for so many rounds.
        """
        lowering = self.lowering
        below, steps = lowering.builder, lowering.steps
        objects = [value.index for value in choice if isinstance(value, ObjectValue)]
        longest = max((len(name) for name in below.objects), default=0) if objects else 0
        template = Template(below, lowering.placeholders, longest)
        chosen: dict[str, Value] = {}
        for name, value in zip(self.names, choice, strict=True):
            if isinstance(value, ObjectValue):
                stand_in = template.thing()
                lowering.coerce.stand_ins[stand_in] = lowering.coerce.covers(value.index)
                chosen[name] = ObjectValue(stand_in, origin=value.origin)
            elif isinstance(value, NumberValue):
                chosen[name] = NumberValue(template.number(), value.unit, origin=value.origin)
        lowering.use(template)
        try:
            value = self._body(chosen)
            result = lowering.coerce.formula(value, "")
        except (DependsOnValue, SpecError):
            return None  # a mistake shows again, where it belongs, in the round itself
        finally:
            lowering.use(below)
        inner = lowering.steps - steps
        lowering.steps = steps
        cost = template.cost
        if lowering.made + cost * left > MAX_MADE:
            raise FormulaTooLarge(f"takes more than {MAX_MADE:,} steps to expand the rounds of its quantifiers")
        count_rounds(lowering, inner * left, self.node, self.frame)
        return InstantiatedTemplate(template, result, inner, cost)

    # ---- rounds over numbers, of which the hardest are enough

    def hardest(self, domain: range) -> list[int] | None:
        """The formulas of the rounds over numbers that the others follow from, if that is known.

        Atoms that differ in a constant only, and grow with it, rounding included, are all satisfied by the same margin
        or more where the one with the smallest constant is: a minimum is that atom, whatever the scene.
        """
        lowering = self.lowering
        if lowering.builder.nodes is not lowering.root.nodes or self.left < MANY:
            return None
        number = NumberValue(
            lowering.builder.const(float(domain[0])), BARE, origin=self.node.domain.span(self.frame.source)
        )
        found = self._template([number] * len(self.names), 1)
        if found is None or found.inner:
            return None
        template, result, *_ = found
        kind: Literal["min", "max"] = "min" if self.node.kind == "forall" else "max"
        parts = _parts(template, result, kind)
        if parts is None:
            return None
        remark = f" (the {'tightest' if kind == 'min' else 'loosest'} of {self.left:,})"
        choices = np.array(list(combinations(domain, len(self.names))), dtype=np.float64).T
        formulas = []
        for part, hanging in parts:
            if hanging is None:
                formulas.append(part)
                continue
            numbers = _extreme(template, hanging, kind, choices)
            made = None if numbers is None else template.make(part, list(map(lowering.builder.const, numbers)), remark)
            if made is None:
                return None
            formulas.append(made)
        return formulas


def _parts(template: Template, result: int, kind: str) -> list[tuple[int, MonotoneDependence | None]] | None:
    """What a formula is the junction of: atoms that hang on one constant each, and what is the same in every round
    (None). None where there is anything else."""
    found: list[tuple[int, MonotoneDependence | None]] = []
    waiting = [result]
    while waiting:
        index = waiting.pop()
        node = template.own.get(index)
        if node is None:
            found.append((index, None))
        elif isinstance(node, Junction) and node.kind == kind and len(node.args) > 1:
            waiting.extend(reversed(node.args))
        elif isinstance(node, Atom) and (one := chain(template, node.margin)) is not None:
            found.append((index, one))
        else:
            return None
    return found


def _extreme(template: Template, hanging: MonotoneDependence, kind: str, choices: Array) -> list[float] | None:
    """The numbers of the round whose constant makes a margin smallest ("min") or largest; None where that is not
    known. `choices` is (variables, K)."""
    with np.errstate(all="ignore"):
        values = np.broadcast_to(evaluate(template, hanging.constant, choices), choices.shape[1:])
    if not np.isfinite(values).all():
        return None
    smallest = hanging.grows == (kind == "min")
    numbers: list[float] = choices[:, values.argmin() if smallest else values.argmax()].tolist()
    return numbers


MAX_STEPS = 200_000  # rounds of all quantifiers of a spec together
MOST_FORESEEN = 10 * MAX_STEPS  # refused at once, in case that later rounds of an outer one have less to do inside
LONGEST = 40  # characters of the domain that a sub-formula's name shows


def quantify(lowering: Lowering, node: ast.Quantifier, env: Mapping[str, Value], frame: CallFrame) -> Value:
    """The junction of the body over the domain. Several variables over a list take unordered groups of its members,
    over `consecutive(list)` neighbours, over a range increasing numbers. Raises SpecError, and FormulaTooLarge."""
    names = [variable.id for variable in node.variables]
    domain: Value | range
    if isinstance(node.domain, ast.Range):
        domain = _range(lowering, node.domain, env, frame)
    else:
        domain = lowering.lower(node.domain, env, frame)
    origin = lowering.origin(node, frame)
    if isinstance(domain, AnyValue):
        env = {**env, **{name: AnyValue(origin=origin) for name in names}}
        value: Value = lowering.lower(node.body, env, frame)
        lowering.coerce.formula(value, f"what `{node.kind}` ranges over")
        return FormulaValue(lowering.coerce.formula(value, ""), origin=origin)
    count, choices = _choices(lowering, domain, node, frame)
    around = frame.rounds * count
    count_rounds(lowering, count, node, frame, around)
    lowering.steps += count
    inside = CallFrame(frame.source, frame.calls, frame.text, frame.body, frame.where, around)
    rounds = QuantifierRounds(lowering, node, env, inside, count)
    formulas = rounds.hardest(domain) if isinstance(domain, range) else None
    if formulas is None:
        formulas = []
        for choice in choices:
            formula = rounds.made(choice)
            if formula is None:
                formula = rounds.formula(choice)
            formulas.append(formula)
    shown = print_expr(node.domain)
    shown = shown if len(shown) <= LONGEST else shown[:LONGEST] + "..."
    text = frame.text if node is frame.body else f"{node.kind} {', '.join(names)} in {shown}"
    kind: Literal["min", "max"] = "min" if node.kind == "forall" else "max"
    return FormulaValue(lowering.builder.junction(kind, formulas, text), origin=origin)


def count_rounds(lowering: Lowering, more: int, node: ast.Quantifier, frame: CallFrame, foreseen: int = 0) -> None:
    """Raises SpecError where a quantifier takes too many rounds, with what is foreseen for those around it."""
    if lowering.steps + more > MAX_STEPS or foreseen > MOST_FORESEEN:
        raise too_many(lowering, node.domain, frame)


def too_many(lowering: Lowering, node: ast.Expr, frame: CallFrame) -> SpecError:
    """Nested quantifiers make a spec larger than its text shows."""
    return lowering.error(SPEC_TOO_LARGE, node, frame, limit=MAX_STEPS)


def _range(lowering: Lowering, node: ast.Range, env: Mapping[str, Value], frame: CallFrame) -> range | AnyValue:
    ends = []
    for end in (node.lowest, node.highest):
        value = lowering.lower(end, env, frame)
        if isinstance(value, AnyValue):
            return value
        ends.append(lowering.count(value, end, frame, "an end of a range"))
    lowest, highest = ends
    if lowest > highest:
        written = isinstance(node.lowest, ast.Quantity) and isinstance(node.highest, ast.Quantity)
        instead = f"{highest}..{lowest}" if written else None
        raise lowering.error(EMPTY_RANGE, node, frame, lowest=lowest, highest=highest, instead=instead)
    if highest - lowest >= MAX_STEPS:
        raise too_many(lowering, node, frame)
    return range(lowest, highest + 1)


def _choices(
    lowering: Lowering, domain: Value | range, node: ast.Quantifier, frame: CallFrame
) -> tuple[int, Iterator[tuple[Value, ...]]]:
    """How many ways there are to choose the variables, and the ways. Raises SpecError where there is none."""
    many = len(node.variables)
    origin = lowering.origin(node.domain, frame)
    if isinstance(domain, range):
        numbers = (NumberValue(lowering.builder.const(float(number)), BARE, origin=origin) for number in domain)
        items: Sequence[Value] = tuple(numbers) if many > 1 else ()
        if many == 1:
            return len(domain), ((number,) for number in numbers)
    elif isinstance(domain, NeighboursValue):
        items = domain.items
        if many == 1:
            raise lowering.error(TOO_FEW_ELEMENTS, node, frame, kind=node.kind, domain=print_expr(node.domain))
    else:
        items = lowering.coerce.items(domain, f"what `{node.kind}` ranges over")
    if len(items) < many and not _may_be_empty(lowering, frame):
        needs = f"`{node.kind}` has nothing to range over"
        if not items:
            raise lowering.error(TOO_FEW_ELEMENTS, node.domain, frame, needs=needs)
        found = f"{len(items)} element{'s' * (len(items) != 1)}"
        raise lowering.error(TOO_FEW_ELEMENTS, node.domain, frame, needed=many, found=found, kind=node.kind)
    if isinstance(domain, NeighboursValue):
        count = max(0, len(items) - many + 1)
        return count, (tuple(items[at : at + many]) for at in range(count))
    return comb(len(items), many), combinations(items, many)


def _may_be_empty(lowering: Lowering, frame: CallFrame) -> bool:
    """Relations of the prelude hold of too few things as they do of many: one object overlaps no other."""
    return frame.source is lowering.scope.prelude
