"""The rounds of a quantifier: expanded one by one at first, from a template where many are alike, and where an order of
constants says which of them count, those alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from scenegen.errors import SpecError
from scenegen.lang import ast
from scenegen.lang.builder import TooLarge
from scenegen.lang.core import Atom, Const, Junction
from scenegen.lang.monotone import Chain, chain, evaluate
from scenegen.lang.provenance import MOST_VARIABLES, Frame
from scenegen.lang.template import Depends, Template
from scenegen.lang.trampoline import Call
from scenegen.lang.values import NumberValue, ObjectValue, Value
from scenegen.primitives.units import BARE

if TYPE_CHECKING:
    from scenegen.lang.context import Context

FEW = 16  # rounds that are not worth a template
ALONE = 2  # rounds of a kind that are expanded by themselves first: a mistake shows there, and most kinds are rarer
MANY = 256  # rounds over numbers of which the hardest alone may be kept
MAX_MADE = 1_200_000  # steps of templates, of a whole spec; about five seconds

Kind = tuple[object, ...]
Array = npt.NDArray[np.float64]


class Made(NamedTuple):
    """A template with its result, the rounds of quantifiers inside, and the steps that count."""

    template: Template
    result: int
    inner: int
    cost: int


class Rounds:
    """The rounds of one quantifier, `count` of them, around a body. `formula` expands one, with a template for the
    kinds of choices (numbers with the same unit, free objects with the same footprint) that come up often."""

    def __init__(
        self, lowering: Context, node: ast.Quantifier, env: Mapping[str, Value], frame: Frame, count: int
    ) -> None:
        self.lowering = lowering
        self.node = node
        self.names = [variable.id for variable in node.variables]
        self.env = env
        self.frame = frame  # of the body, but for what the variables stand for
        self.left = count
        self.seen: dict[Kind, int] = {}
        self.templates: dict[Kind, Made | None] = {}  # with its result, and rounds inside
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

    def formula(self, choice: Sequence[Value]) -> Call[int]:
        """The formula of the body for one choice, expanded by itself. Raises SpecError, and TooLarge."""
        lowering = self.lowering
        self.left -= 1
        before = lowering.inside
        chosen = {name: value.moved(value.origin) for name, value in zip(self.names, choice, strict=True)}
        value = yield self._body(chosen)
        formula = lowering.coerce.formula(value, f"the formula of `{self.node.kind}`")
        if self.left < FEW and not self.templates:
            return formula
        kind = self._kind(choice)
        if kind is not None and kind not in self.templates:
            self.seen[kind] = self.seen.get(kind, 0) + 1
            if self.seen[kind] >= ALONE:
                self.templates[kind] = yield self._template(choice, self.left)
        elif self.left:
            lowering.foresee((lowering.inside - before) * self.left // 2)  # later rounds may have less to do
        return formula

    def _body(self, chosen: Mapping[str, Value]) -> Call[Value]:
        frame = self.frame
        inside = Frame(
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

    def _template(self, choice: Sequence[Value], left: int) -> Call[Made | None]:
        """The body for a choice of this kind. None where it has no template.

        Raises SpecError and TooLarge for one that is too large for so many rounds.
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
            value = yield self._body(chosen)
            result = lowering.coerce.formula(value, "")
        except (Depends, SpecError):
            return None  # a mistake shows again, where it belongs, in the round itself
        finally:
            lowering.use(below)
        inner = lowering.steps - steps
        lowering.steps = steps
        cost = template.cost
        if lowering.made + cost * left > MAX_MADE:
            raise TooLarge(f"takes more than {MAX_MADE:,} steps to expand the rounds of its quantifiers")
        lowering.rounds(inner * left, self.node, self.frame)
        return Made(template, result, inner, cost)

    # ---- rounds over numbers, of which the hardest are enough

    def hardest(self, domain: range) -> Call[list[int] | None]:
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
        found = yield self._template([number] * len(self.names), 1)
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


def _parts(template: Template, result: int, kind: str) -> list[tuple[int, Chain | None]] | None:
    """What a formula is the junction of: atoms that hang on one constant each, and what is the same in every round
    (None). None where there is anything else."""
    found: list[tuple[int, Chain | None]] = []
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


def _extreme(template: Template, hanging: Chain, kind: str, choices: Array) -> list[float] | None:
    """The numbers of the round whose constant makes a margin smallest ("min") or largest; None where that is not
    known. `choices` is (variables, K)."""
    with np.errstate(all="ignore"):
        values = np.broadcast_to(evaluate(template, hanging.constant, choices), choices.shape[1:])
    if not np.isfinite(values).all():
        return None
    smallest = hanging.grows == (kind == "min")
    numbers: list[float] = choices[:, values.argmin() if smallest else values.argmax()].tolist()
    return numbers
