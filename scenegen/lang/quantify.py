"""`forall` and `exists`: a formula for every way to choose the variables, joined by min or max."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations
from math import comb
from typing import TYPE_CHECKING, Literal

from scenegen.errors import SpecError
from scenegen.errors.declarations import TOO_MANY_ROUNDS
from scenegen.errors.language import EMPTY_LIST, EMPTY_RANGE, ONE_NEIGHBOUR, TOO_FEW_TO_CHOOSE
from scenegen.lang import ast
from scenegen.lang.print import print_expr
from scenegen.lang.provenance import Frame
from scenegen.lang.rounds import Rounds
from scenegen.lang.select import whole_number
from scenegen.lang.trampoline import Call
from scenegen.lang.values import AnyValue, FormulaValue, NeighboursValue, NumberValue, Value
from scenegen.primitives.units import BARE

if TYPE_CHECKING:
    from scenegen.lang.context import Context

MAX_STEPS = 200_000  # rounds of all quantifiers of a spec together
MOST_FORESEEN = 10 * MAX_STEPS  # refused at once, in case that later rounds of an outer one have less to do inside
LONGEST = 40  # characters of the domain that a sub-formula's name shows


def quantify(lowering: Context, node: ast.Quantifier, env: Mapping[str, Value], frame: Frame) -> Call[Value]:
    """The junction of the body over the domain. Several variables over a list take unordered groups of its members,
    over `consecutive(list)` neighbours, over a range increasing numbers. Raises SpecError, and TooLarge."""
    names = [variable.id for variable in node.variables]
    domain: Value | range
    if isinstance(node.domain, ast.Range):
        domain = yield _range(lowering, node.domain, env, frame)
    else:
        domain = yield lowering.lower(node.domain, env, frame)
    origin = lowering.origin(node, frame)
    if isinstance(domain, AnyValue):
        env = {**env, **{name: AnyValue(origin=origin) for name in names}}
        value: Value = yield lowering.lower(node.body, env, frame)
        lowering.coerce.formula(value, f"what `{node.kind}` ranges over")
        return FormulaValue(lowering.coerce.formula(value, ""), origin=origin)
    count, choices = _choices(lowering, domain, node, frame)
    around = frame.rounds * count
    lowering.rounds(count, node, frame, around)
    lowering.steps += count
    inside = Frame(frame.source, frame.calls, frame.text, frame.body, frame.where, around)
    rounds = Rounds(lowering, node, env, inside, count)
    formulas = (yield rounds.hardest(domain)) if isinstance(domain, range) else None
    if formulas is None:
        formulas = []
        for choice in choices:
            formula = rounds.made(choice)
            if formula is None:
                formula = yield rounds.formula(choice)
            formulas.append(formula)
    shown = print_expr(node.domain)
    shown = shown if len(shown) <= LONGEST else shown[:LONGEST] + "..."
    text = frame.text if node is frame.body else f"{node.kind} {', '.join(names)} in {shown}"
    kind: Literal["min", "max"] = "min" if node.kind == "forall" else "max"
    return FormulaValue(lowering.builder.junction(kind, formulas, text), origin=origin)


def too_many(lowering: Context, node: ast.Expr, frame: Frame) -> SpecError:
    """Nested quantifiers make a spec larger than its text shows."""
    return lowering.error(TOO_MANY_ROUNDS, node, frame, limit=MAX_STEPS)


def _range(lowering: Context, node: ast.Range, env: Mapping[str, Value], frame: Frame) -> Call[range | AnyValue]:
    ends = []
    for end in (node.lowest, node.highest):
        value = yield lowering.lower(end, env, frame)
        if isinstance(value, AnyValue):
            return value
        number = lowering.coerce.number(value, "an end of a range")
        ends.append(whole_number(lowering, number, end, frame, "an end of a range"))
    lowest, highest = ends
    if lowest > highest:
        written = isinstance(node.lowest, ast.Quantity) and isinstance(node.highest, ast.Quantity)
        instead = f"{highest}..{lowest}" if written else None
        raise lowering.error(EMPTY_RANGE, node, frame, lowest=lowest, highest=highest, instead=instead)
    if highest - lowest >= MAX_STEPS:
        raise too_many(lowering, node, frame)
    return range(lowest, highest + 1)


def _choices(
    lowering: Context, domain: Value | range, node: ast.Quantifier, frame: Frame
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
            raise lowering.error(ONE_NEIGHBOUR, node, frame, kind=node.kind, domain=print_expr(node.domain))
    else:
        items = lowering.coerce.items(domain, f"what `{node.kind}` ranges over")
    if len(items) < many and not _may_be_empty(lowering, frame):
        needs = f"`{node.kind}` has nothing to range over"
        if not items:
            raise lowering.error(EMPTY_LIST, node.domain, frame, needs=needs)
        found = f"{len(items)} element{'s' * (len(items) != 1)}"
        raise lowering.error(TOO_FEW_TO_CHOOSE, node.domain, frame, needed=many, found=found, kind=node.kind)
    if isinstance(domain, NeighboursValue):
        count = max(0, len(items) - many + 1)
        return count, (tuple(items[at : at + many]) for at in range(count))
    return comb(len(items), many), combinations(items, many)


def _may_be_empty(lowering: Context, frame: Frame) -> bool:
    """Relations of the prelude hold of too few things as they do of many: one object overlaps no other."""
    return frame.source is lowering.scope.prelude
