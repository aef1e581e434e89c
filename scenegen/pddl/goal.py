"""A goal -> a formula of the language, over the instances of its quantifiers.

What has no geometry is left out, and told. The formula stays a necessary condition of the goal: of a conjunction the
rest remains; of a disjunction, a negation or an implication with such a part nothing does.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from scenegen.errors import DataError
from scenegen.errors.planning import PDDL_FORM, PDDL_TOO_LARGE
from scenegen.pddl.problem import Problem, typed
from scenegen.pddl.read import Atom, Group, Node

MOST = 20_000  # instances of a formula

Names = Mapping[str, str]  # of variables


@dataclass(frozen=True, slots=True)
class Meaning:
    """A formula, None where nothing of it is about places; `whole` if all of it is."""

    text: str | None
    whole: bool = True


Lower = Callable[[Group, Sequence[str], bool], Meaning]  # an atom with the names of its arguments; whether it is wanted


@dataclass(slots=True)
class Goal:
    """Reads formulas of a problem; `atom` says what an atom means."""

    problem: Problem
    atom: Lower
    instances: int = field(default=0)

    def read(self, node: Node, names: Names, wanted: bool = True) -> Meaning:
        """Raises DataError for what is no formula."""
        self.instances += 1
        if self.instances > MOST:
            raise DataError(PDDL_TOO_LARGE(node.span, what="this formula", limit=MOST))
        if not isinstance(node, Group) or not node.items:
            if isinstance(node, Group):
                return Meaning("true")
            raise DataError(PDDL_FORM(node.span, wanted="a formula", reason="(PREDICATE ...) belongs here"))
        match node.head:
            case "and":
                return both([self.read(one, names, wanted) for one in node.rest])
            case "or":
                return either([self.read(one, names, wanted) for one in node.rest])
            case "not":
                (inner,) = self._parts(node, 1)
                return negation(self.read(inner, names, not wanted))
            case "imply" | "implies":
                first, second = self._parts(node, 2)
                return either([negation(self.read(first, names, not wanted)), self.read(second, names, wanted)])
            case "forall" | "exists":
                variables, body = self._parts(node, 2)
                found = [self.read(body, {**names, **one}, wanted) for one in self._choices(variables)]
                return both(found) if node.head == "forall" else either(found)
            case "forn":
                count, variables, body = self._parts(node, 3)
                found = [self.read(body, {**names, **one}, wanted) for one in self._choices(variables)]
                return self._exactly(self._count(count), found, node)
            case "forpairs":
                one, other, body = self._parts(node, 3)
                return self._pairs(None, one, other, body, names, wanted, node)
            case "fornpairs":
                count, one, other, body = self._parts(node, 4)
                return self._pairs(self._count(count), one, other, body, names, wanted, node)
            case "":
                raise DataError(PDDL_FORM(node.span, wanted="a formula", reason="a word comes first"))
        arguments = []
        for part in node.rest:
            if not isinstance(part, Atom):
                raise DataError(PDDL_FORM(part.span, wanted="a name", reason="arguments are names"))
            arguments.append(names.get(part.text, part.text.removeprefix("?")))
        return self.atom(node, arguments, wanted)

    def _parts(self, node: Group, count: int) -> tuple[Node, ...]:
        if len(node.rest) != count:
            raise DataError(PDDL_FORM(node.span, wanted=f"a formula with `{node.head}`", reason=f"it takes {count}"))
        return node.rest

    def _choices(self, variables: Node) -> list[dict[str, str]]:
        if not isinstance(variables, Group):
            raise DataError(PDDL_FORM(variables.span, wanted="a list of variables", reason="(?x - TYPE) belongs here"))
        kinds = {name: kind for name, (kind, _) in typed(variables.items).items()}
        known = [[one for one in self.problem.things if self.problem.is_a(one, kind)] for kind in kinds.values()]
        if math.prod(len(each) for each in known) > MOST:
            raise DataError(PDDL_TOO_LARGE(variables.span, what="this quantifier", limit=MOST))
        return [dict(zip(kinds, chosen, strict=True)) for chosen in itertools.product(*known)]

    def _count(self, node: Node) -> int:
        word = node.items[0] if isinstance(node, Group) and len(node.items) == 1 else node
        if not isinstance(word, Atom) or not word.text.isdecimal() or len(word.text) > 6:
            raise DataError(PDDL_FORM(node.span, wanted="a count", reason="(3), say"))
        return int(word.text)

    def _exactly(self, count: int, found: Sequence[Meaning], node: Group) -> Meaning:
        more = self._least(count + 1, found, node)
        return both([self._least(count, found, node), negation(more)])

    def _least(self, count: int, found: Sequence[Meaning], node: Group) -> Meaning:
        """At least `count` of them hold: some subset of that size does."""
        if math.comb(len(found), min(count, len(found))) * max(count, 1) > MOST:
            raise DataError(PDDL_TOO_LARGE(node.span, what="this count", limit=MOST))
        return either([both(one) for one in itertools.combinations(found, count)])

    def _pairs(
        self, count: int | None, one: Node, other: Node, body: Node, names: Names, wanted: bool, node: Group
    ) -> Meaning:
        """As many of either side as there are on the smaller one, or `count`, have a partner on the other side."""
        rows, columns = self._choices(one), self._choices(other)
        if len(rows) * len(columns) > MOST:
            raise DataError(PDDL_TOO_LARGE(node.span, what="this formula", limit=MOST))
        count = min(len(rows), len(columns)) if count is None else count
        table = [[self.read(body, {**names, **row, **column}, wanted) for column in columns] for row in rows]
        by_column = [either(each) for each in zip(*table, strict=True)]
        return both([self._least(count, [either(row) for row in table], node), self._least(count, by_column, node)])


def both(parts: Sequence[Meaning]) -> Meaning:
    """All of them, as far as they are about places."""
    texts = list(dict.fromkeys(one.text for one in parts if one.text is not None and one.text != "true"))
    whole = all(one.whole for one in parts)
    if "false" in texts:
        return Meaning("false", whole)
    if not texts:
        return Meaning("true" if whole else None, whole)
    return Meaning(texts[0] if len(texts) == 1 else "(" + " & ".join(texts) + ")", whole)


def either(parts: Sequence[Meaning]) -> Meaning:
    """One of them; nothing, where one of them is not about places."""
    if any(one.text is None for one in parts):
        return Meaning(None, whole=False)
    texts = list(dict.fromkeys(one.text for one in parts if one.text is not None and one.text != "false"))
    whole = all(one.whole for one in parts)
    if not texts:
        return Meaning("false", whole)
    if "true" in texts:
        return Meaning("true", whole)
    return Meaning(texts[0] if len(texts) == 1 else "(" + " | ".join(texts) + ")", whole)


def negation(part: Meaning) -> Meaning:
    """Not it; nothing, where only some of it is about places."""
    if part.text is None or not part.whole:
        return Meaning(None, whole=False)
    return Meaning({"true": "false", "false": "true"}.get(part.text, f"!({part.text})"))
