"""`forall` and `exists`: a formula for every way to choose the variables, joined by min or max."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from math import comb
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from scenegen.arrays import Array
from scenegen.errors import SpecError
from scenegen.errors.declarations import SPEC_TOO_LARGE
from scenegen.errors.language import EMPTY_RANGE, TOO_FEW_ELEMENTS
from scenegen.geometry import NUMPY, PRIMITIVES
from scenegen.geometry.primitives import BARE
from scenegen.lang.check.values import (
    MAX_NOTED_VARIABLES,
    AnyValue,
    CallFrame,
    FormulaValue,
    NeighboursValue,
    NumberValue,
    Value,
    key_of,
)
from scenegen.lang.formula.builder import CoreBuilder, DependsOnRound
from scenegen.lang.formula.core import Apply, Atom, Const, Junction, children
from scenegen.lang.syntax import ast
from scenegen.lang.syntax.printer import print_expr

if TYPE_CHECKING:
    from scenegen.lang.check.lowering import Lowering


MAX_ROUNDS = 200_000  # rounds of all quantifiers of a spec together
MAX_FORESEEN_STEPS = (
    10 * MAX_ROUNDS
)  # refused at once, in case that later rounds of an outer one have less to do inside
MAX_DOMAIN_LENGTH = 40  # characters of the domain that a sub-formula's name shows
UNFORESEEN_ROUNDS = 2  # the first ones, which say nothing of later ones: they expand what all share
MIN_FOLDED_ROUNDS = 256  # over numbers, of which the hardest alone may be kept


@dataclass(frozen=True, slots=True)
class QuantifierRounds:
    """The rounds of one quantifier, `count` of them, around its body. `frame` is the body's, but for what the variables
    stand for."""

    lowering: Lowering
    node: ast.Quantifier
    env: Mapping[str, Value]
    frame: CallFrame
    count: int

    def formula(self, choice: Sequence[Value]) -> int:
        """The formula of the body for one choice of the variables. Raises SpecError, and FormulaTooLarge."""
        frame, lowering = self.frame, self.lowering
        names = [variable.id for variable in self.node.variables]
        chosen = {name: value.with_origin(value.origin) for name, value in zip(names, choice, strict=True)}
        inside = CallFrame(
            frame.source,
            frame.calls,
            frame.text,
            frame.body,
            (*frame.where, chosen)[-MAX_NOTED_VARIABLES:],
            frame.rounds,
        )
        value = lowering.lower(self.node.body, {**self.env, **chosen}, inside)
        return lowering.coerce.formula(value, f"the formula of `{self.node.kind}`")

    def formulas(self, choices: Iterable[Sequence[Value]]) -> list[int]:
        """Those of all rounds. Raises SpecError, and FormulaTooLarge, early where so many rounds are too many."""
        lowering = self.lowering
        formulas = []
        for done, choice in enumerate(choices, 1):
            before = lowering.inside
            formulas.append(self.formula(choice))
            if UNFORESEEN_ROUNDS < done < self.count:  # later rounds may have less to do
                lowering.foresee((lowering.inside - before) * (self.count - done) // 2)
        return formulas

    def hardest(self, domain: range) -> list[int] | None:
        """The formulas of the rounds over numbers that the others follow from, if that is known.

        Atoms that differ in a constant only, and grow with it, rounding included, are all satisfied by the same margin
        or more where the one with the smallest constant is: a minimum is that atom, whatever the scene. The body is
        expanded once with numbers that stand for those of all rounds, to see that, and then for the rounds kept.
        """
        builder = self.lowering.builder
        if self.count < MIN_FOLDED_ROUNDS:
            return None
        kind: Literal["min", "max"] = "min" if self.node.kind == "forall" else "max"
        choices = np.array(list(combinations(domain, len(self.node.variables))), dtype=np.float64).T
        try:
            atoms, hardest = self._atoms_of_all(kind, choices)
            kept = {choice: _parts(builder, self._formula_of(choice), kind) for choice in set(hardest.values())}
        except (DependsOnRound, SpecError):
            return None  # a mistake shows again, where it belongs, in the round itself
        if any(len(parts) != len(atoms) for parts in kept.values()):
            return None
        remark = f" (the {'tightest' if kind == 'min' else 'loosest'} of {self.count:,})"
        for place, choice in hardest.items():
            atoms[place] = builder.add_remark(kept[choice][place], remark)
        return atoms

    def _formula_of(self, choice: Sequence[float]) -> int:
        """The formula of a round over numbers."""
        origin = self.node.domain.span(self.frame.source)
        builder = self.lowering.builder
        return self.formula([NumberValue(builder.const(number), BARE, origin=origin) for number in choice])

    def _atoms_of_all(
        self, kind: Literal["min", "max"], choices: Array
    ) -> tuple[list[int], dict[int, tuple[float, ...]]]:
        """The atoms of the body with numbers that stand for those of all rounds, and, for those (by their place) that
        depend on them, the numbers of the hardest round. `choices` is (variables, K). Raises SpecError, and
        DependsOnRound where anything else is in the body."""
        builder = self.lowering.builder
        origin = self.node.domain.span(self.frame.source)
        variables = [builder.variable(variable.id) for variable in self.node.variables]
        try:
            body = self.formula([NumberValue(variable, BARE, origin=origin) for variable in variables])
            varying = frozenset(builder.varying)
        finally:
            builder.varying.clear()
        parts = _parts(builder, body, kind)
        nodes = builder.nodes
        dependent = set(varying)
        for index in range(variables[0], len(nodes)):
            if not dependent.isdisjoint(children(nodes[index])):
                dependent.add(index)
        values: dict[int, Any] = dict(zip(variables, choices, strict=True))
        hardest = {}
        for place, part in enumerate(parts):
            if part not in dependent:
                continue
            atom = nodes[part]
            if not isinstance(atom, Atom):
                raise DependsOnRound
            constant, grows = _dependence(builder, atom.margin, dependent, varying)
            numbers = _evaluate(builder, constant, values)
            best = numbers.argmin() if grows == (kind == "min") else numbers.argmax()
            hardest[place] = tuple(choices[:, best].tolist())
        return parts, hardest


def _parts(builder: CoreBuilder, formula: int, kind: str) -> list[int]:
    """What a formula is the junction of, in order."""
    parts = []
    waiting = [formula]
    while waiting:
        index = waiting.pop()
        node = None if index < 0 else builder.nodes[index]
        if isinstance(node, Junction) and node.kind == kind:
            waiting.extend(reversed(node.args))
        else:
            parts.append(index)
    return parts


def _dependence(
    builder: CoreBuilder, margin: int, dependent: Collection[int], varying: Collection[int]
) -> tuple[int, bool]:
    """The number that variables alone decide (`varying`) and that a margin depends on, in one place, and whether it
    grows with it or falls: every step from there to the margin is monotone; rounded, it then is, too. Raises
    DependsOnRound where it is not so."""
    grows = True
    index = margin
    while index not in varying:
        node = builder.nodes[index]
        places = [place for place, arg in enumerate(children(node)) if arg in dependent]
        if not isinstance(node, Apply) or len(places) != 1:
            raise DependsOnRound
        primitive = PRIMITIVES[node.primitive]
        if not primitive.monotone:
            values = [None if arg in dependent else builder.value(arg) for arg in node.args]
            slopes = None if primitive.slopes is None else primitive.slopes(values)
            if slopes is None:
                raise DependsOnRound
            grows ^= slopes[places[0]] < 0.0
        index = node.args[places[0]]
    return index, grows


def _evaluate(builder: CoreBuilder, number: int, values: dict[int, Any]) -> Any:
    """A number that variables alone decide in every round, (K,); of `values` that are known, which grow by this one.
    Raises DependsOnRound where another library might round it differently, or it is not finite somewhere."""
    if number not in values:
        node = builder.nodes[number]
        if isinstance(node, Const):
            return node.value
        if not isinstance(node, Apply) or not PRIMITIVES[node.primitive].exact:
            raise DependsOnRound
        args = [_evaluate(builder, arg, values) for arg in node.args]
        with np.errstate(all="ignore"):
            values[number] = PRIMITIVES[node.primitive].evaluate(NUMPY, *args)
        if not np.isfinite(values[number]).all():
            raise DependsOnRound
    return values[number]


def quantify(lowering: Lowering, node: ast.Quantifier, env: Mapping[str, Value], frame: CallFrame) -> Value:
    """The junction of the body over the domain. Several variables over a list take unordered groups of its members,
    over `consecutive(list)` neighbours, over a range increasing numbers; what does not depend on the rounds around is
    expanded once for all of them. Raises SpecError, and FormulaTooLarge."""
    if lowering.builder.varying:
        raise DependsOnRound
    if not frame.where:
        return _expand(lowering, node, env, frame)
    if id(node) not in lowering.named_in:
        lowering.named_in[id(node)] = {one.id for one, _ in ast.walk(node) if isinstance(one, ast.Name)}
    values = [env[name] for name in env if name in lowering.named_in[id(node)]]
    key = (id(node), frame.calls, *map(key_of, values))
    if key not in lowering.expansions:
        lowering.expansions[key] = (_expand(lowering, node, env, frame), values)
    return lowering.expansions[key][0]


def _expand(lowering: Lowering, node: ast.Quantifier, env: Mapping[str, Value], frame: CallFrame) -> Value:
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
        formulas = rounds.formulas(choices)
    shown = print_expr(node.domain)
    shown = shown if len(shown) <= MAX_DOMAIN_LENGTH else shown[:MAX_DOMAIN_LENGTH] + "..."
    text = frame.text if node is frame.body else f"{node.kind} {', '.join(names)} in {shown}"
    kind: Literal["min", "max"] = "min" if node.kind == "forall" else "max"
    return FormulaValue(lowering.builder.junction(kind, formulas, text), origin=origin)


def count_rounds(lowering: Lowering, more: int, node: ast.Quantifier, frame: CallFrame, foreseen: int = 0) -> None:
    """Raises SpecError where a quantifier takes too many rounds, with what is foreseen for those around it."""
    if lowering.steps + more > MAX_ROUNDS or foreseen > MAX_FORESEEN_STEPS:
        raise too_many(lowering, node.domain, frame)


def too_many(lowering: Lowering, node: ast.Expr, frame: CallFrame) -> SpecError:
    """Nested quantifiers make a spec larger than its text shows."""
    return lowering.error(SPEC_TOO_LARGE, node, frame, limit=MAX_ROUNDS)


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
    if highest - lowest >= MAX_ROUNDS:
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
