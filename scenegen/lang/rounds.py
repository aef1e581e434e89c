"""The rounds of a quantifier: expanded one by one at first, from a template where many are alike, and where an order of
constants says which of them count, those alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import TYPE_CHECKING, Literal

import numpy as np

from scenegen.errors import SpecError
from scenegen.lang import ast
from scenegen.lang.blame import MOST_VARIABLES, Frame
from scenegen.lang.builder import TooLarge
from scenegen.lang.core import Atom, Const, Junction
from scenegen.lang.monotone import Chain, chain, evaluate
from scenegen.lang.template import Depends, Template
from scenegen.lang.trampoline import Call
from scenegen.lang.values import NumberValue, ObjectValue, Value
from scenegen.primitives.units import BARE

if TYPE_CHECKING:
    from scenegen.lang.lower import Lowering

FEW = 16  # rounds that are not worth a template
ALONE = 2  # rounds of a kind that are expanded by themselves first: a mistake shows there, and most kinds are rarer
MANY = 256  # rounds over numbers of which the hardest alone may be kept
MAX_MADE = 2_500_000  # steps of templates, of a whole spec; about five seconds

Kind = tuple[object, ...]


class Rounds:
    """The rounds of one quantifier, `count` of them, around a body. `formula` expands one, with a template for the
    kinds of choices (numbers with the same unit, free objects with the same footprint) that come up often."""

    def __init__(
        self, lowering: Lowering, node: ast.Quantifier, env: Mapping[str, Value], frame: Frame, count: int
    ) -> None:
        self.lowering = lowering
        self.node = node
        self.names = [variable.id for variable in node.variables]
        self.env = env
        self.frame = frame  # of the body, but for what the variables stand for
        self.left = count
        self.seen: dict[Kind, int] = {}
        self.templates: dict[Kind, tuple[Template, int, int] | None] = {}  # with its result, and rounds inside
        self._kinds: dict[int, object] = {}  # of objects

    def made(self, choice: Sequence[Value]) -> int | None:
        """The formula of the body for one choice of the variables, if there is a template for it."""
        if not self.templates:
            return None
        kind = self._kind(choice)
        known = None if kind is None else self.templates.get(kind)
        if known is None:
            return None
        template, result, inner = known
        lowering = self.lowering
        lowering.steps += inner
        lowering.made += len(template.steps) + 1
        given = [value.index if isinstance(value, ObjectValue) else value.node for value in choice]  # type: ignore[attr-defined]
        made = template.make(result, given)
        self.left -= made is not None
        return made

    def formula(self, choice: Sequence[Value]) -> Call[int]:
        """The formula of the body for one choice, expanded by itself. Raises SpecError, and TooLarge."""
        lowering = self.lowering
        self.left -= 1
        before = lowering.inside
        chosen = {name: value.moved(value.origin) for name, value in zip(self.names, choice, strict=True)}
        value = yield self._body(chosen)
        formula = lowering.kinds.formula(value, f"the formula of `{self.node.kind}`")
        if self.left < FEW and not self.templates:
            return formula
        kind = self._kind(choice)
        if kind is not None and kind not in self.templates:
            self.seen[kind] = self.seen.get(kind, 0) + 1
            if self.seen[kind] >= ALONE:
                self.templates[kind] = yield self._template(choice)
        elif self.left:
            lowering.foresee((lowering.inside - before) * self.left // 3)  # later rounds may have less to do
        return formula

    def _body(self, chosen: Mapping[str, Value]) -> Call[Value]:
        frame = self.frame
        inside = Frame(frame.source, frame.calls, frame.text, frame.body, (*frame.where, chosen)[-MOST_VARIABLES:], frame.rounds)
        return self.lowering.lower(self.node.body, {**self.env, **chosen}, inside)

    def _kind(self, choice: Sequence[Value]) -> Kind | None:
        kind: list[object] = []
        for value in choice:
            if isinstance(value, ObjectValue):
                known = self._kinds.get(value.index)
                if known is None:
                    kinds = self.lowering.kinds
                    free = value.index not in kinds.fixed and kinds.footprints
                    known = self._kinds[value.index] = kinds.covers(value.index) if free else ()
                if known == ():
                    return None
                kind.append(known)
            elif isinstance(value, NumberValue) and isinstance(self.lowering.builder.nodes[value.node], Const):
                kind.append(value.unit)
            else:
                return None
        return tuple(kind)

    def _template(self, choice: Sequence[Value]) -> Call[tuple[Template, int, int] | None]:
        """The body for a choice of this kind, with its result and the rounds inside. None where it has no template.
        Raises TooLarge for one that is too large for the rounds that are left."""
        lowering = self.lowering
        below, steps = lowering.builder, lowering.steps
        objects = [value.index for value in choice if isinstance(value, ObjectValue)]
        longest = max((len(name) for name in below.objects), default=0) if objects else 0
        template = Template(below, lowering.placeholders, longest)
        chosen: dict[str, Value] = {}
        for name, value in zip(self.names, choice, strict=True):
            if isinstance(value, ObjectValue):
                stand_in = template.thing()
                lowering.kinds.stand_ins[stand_in] = lowering.kinds.covers(value.index)
                chosen[name] = ObjectValue(stand_in, origin=value.origin)
            elif isinstance(value, NumberValue):
                chosen[name] = NumberValue(template.number(), value.unit, origin=value.origin)
        lowering.use(template)
        try:
            value = yield self._body(chosen)
            result = lowering.kinds.formula(value, "")
        except (Depends, SpecError):
            return None  # a mistake shows again, where it belongs, in the round itself
        finally:
            lowering.use(below)
        inner = lowering.steps - steps
        lowering.steps = steps
        if lowering.made + len(template.steps) * self.left > MAX_MADE:
            raise TooLarge(f"takes more than {MAX_MADE:,} steps to expand the rounds of its quantifiers")
        lowering.rounds(inner * self.left, self.node, self.frame)
        return template, result, inner

    # ---- rounds over numbers, of which the hardest are enough

    def hardest(self, domain: range) -> Call[list[int] | None]:
        """The formulas of the rounds over numbers that the others follow from, if that is known.

        Atoms that differ in a constant only, and grow with it, rounding included, are all satisfied by the same margin
        or more where the one with the smallest constant is: a minimum is that atom, whatever the scene.
        """
        lowering = self.lowering
        if lowering.builder.nodes is not lowering.root.nodes or self.left < MANY:
            return None
        number = NumberValue(lowering.builder.const(float(domain[0])), BARE, origin=self.node.domain.span(self.frame.source))
        found = yield self._template_or_none([number] * len(self.names))
        if found is None or found[2]:
            return None
        template, result, _ = found
        kind: Literal["min", "max"] = "min" if self.node.kind == "forall" else "max"
        chains = _chains(template, result, kind)
        if chains is None:
            return None
        chosen = _extremes(template, chains, kind, domain, len(self.names))
        if chosen is None:
            return None
        remark = f" (the {'tightest' if kind == 'min' else 'loosest'} of {self.left:,})"
        formulas = []
        for numbers in chosen:
            made = template.make(result, [lowering.builder.const(float(number)) for number in numbers], remark)
            if made is None:
                return None
            formulas.append(made)
        return formulas

    def _template_or_none(self, choice: Sequence[Value]) -> Call[tuple[Template, int, int] | None]:
        try:
            return (yield self._template(choice))
        except TooLarge:
            return None


def _chains(template: Template, result: int, kind: str) -> list[Chain] | None:
    """How the margin of each atom of a formula hangs on one constant; None where that is not known for all."""
    found: list[Chain] = []
    waiting = [result]
    while waiting:
        index = waiting.pop()
        node = template.own.get(index)
        if isinstance(node, Junction) and node.kind == kind and len(node.args) > 1:
            waiting.extend(node.args)
        elif isinstance(node, Atom):
            one = chain(template, node.margin)
            if one is None:
                return None
            found.append(one)
        elif index in template.own:
            return None
    return found


def _extremes(
    template: Template, chains: Sequence[Chain], kind: str, domain: range, many: int
) -> list[tuple[int, ...]] | None:
    """The choices at which some constant is the smallest or largest that matters, in their order."""
    numbers = np.array(list(combinations(domain, many)), dtype=np.float64).T
    places = set[int]() if chains else {0}  # every round says the same
    for one in chains:
        with np.errstate(all="ignore"):
            values = np.broadcast_to(evaluate(template, one.constant, numbers), numbers.shape[1:])
        if not np.isfinite(values).all():
            return None
        smallest = one.grows == (kind == "min")
        places.add(int(values.argmin() if smallest else values.argmax()))
    return [tuple(int(number) for number in numbers[:, place]) for place in sorted(places)]
