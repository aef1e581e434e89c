"""Which facts hold in scenes: every statement is expanded by the checker itself, into one core beside the labels.

The core shares equal formulas, so a part of a label is found among the facts by its node.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import permutations, product
from typing import Literal as OneOf

import numpy as np
import numpy.typing as npt

from scenegen.errors import RequestError, Source, SpecError
from scenegen.errors.requests import UNKNOWN_CHOICE
from scenegen.errors.worlds import FACTS_MEAN_NOTHING, PDDL_TOO_LARGE
from scenegen.geometry import NUMPY
from scenegen.geometry.primitives import ANGLE, LENGTH
from scenegen.lang.check.lowering import Lowering
from scenegen.lang.check.names import resolve
from scenegen.lang.check.scope import LABEL, Declared, Scope, signature_of
from scenegen.lang.check.values import CallFrame, FormulaValue, NumberValue, ObjectValue, RegionValue, Value
from scenegen.lang.checker import check_module
from scenegen.lang.formula.builder import FALSE, TRUE, FormulaTooLarge
from scenegen.lang.formula.core import Atom, Coord, Core, Junction
from scenegen.lang.formula.interpret import phi
from scenegen.lang.spec import CheckedSpec
from scenegen.lang.syntax import ast
from scenegen.lang.syntax.parse import parse
from scenegen.lang.syntax.printer import print_expr
from scenegen.planning.goal import relation as meaning

THING, PLACE = "thing", "region"
MAX_ARGUMENTS = 3  # of relations that are asked for by name
OVER_PLACES = ("on", "inside", "restsOn", "insideOf")  # their second argument is a region, too, by default
MAX_DEFINITION_LENGTH = 100  # characters of a definition in a comment


@dataclass(frozen=True, slots=True)
class RelationTemplate:
    """A formula over `_slot0`, `_slot1`, ...: things and regions by `kinds`, then numbers, which `numbers` holds.
    `required`: some call of it has to mean something."""

    name: str
    text: str
    kinds: tuple[str, ...]
    comment: str = ""
    numbers: Mapping[str, Value] = field(default_factory=dict)
    required: bool = False


def templates(
    scope: Scope, wanted: Sequence[str] | None, own: Mapping[str, str] | None
) -> tuple[RelationTemplate, ...]:
    """The relations whose facts are written. Raises RequestError for an unknown name."""
    if own is not None:
        known = [name for name, written in own.items() if _formula(written)]
        _refuse_unknown(wanted, known)
        return tuple(one for name in known if wanted is None or name in wanted for one in _own_facts(name, own[name]))
    known = [name for name, one in scope.definitions.items() if _arity(one) <= MAX_ARGUMENTS]
    _refuse_unknown(wanted, known)
    if wanted is None:
        wanted = [name for name in known if 1 <= _arity(scope.definitions[name]) <= 2]
        wanted.sort(key=lambda name: scope.definitions[name].source is scope.prelude)
    found: list[RelationTemplate] = []
    for name in dict.fromkeys(wanted):
        declared = scope.definitions[name]
        needed, comment = _arity(declared), _comment(declared, scope)
        found.append(RelationTemplate(name, _call(name, needed), (THING,) * needed, comment))
        if name in OVER_PLACES and declared.source is scope.prelude:
            found.append(RelationTemplate(name, _call(name, 2), (THING, PLACE), comment))
    return tuple(found)


def _refuse_unknown(wanted: Sequence[str] | None, known: Sequence[str]) -> None:
    for name in wanted or ():
        if name not in known:
            raise RequestError(UNKNOWN_CHOICE(what="relation", name=name, known=known))


def _arity(declared: Declared) -> int:
    assert isinstance(declared.statement, ast.Definition)
    return signature_of(declared.statement).needed


def _call(name: str, count: int) -> str:
    return f"{name}({', '.join(f'_slot{place}' for place in range(count))})"


def _comment(declared: Declared, scope: Scope) -> str:
    """The comment above a definition of the prelude; of another one what it says."""
    assert isinstance(declared.statement, ast.Definition)
    if declared.source is scope.prelude:
        above = declared.source.text[: declared.statement.start].rstrip().splitlines()
        lines: list[str] = []
        while above and above[-1].startswith("# "):
            lines.insert(0, above.pop()[2:])
        return " ".join(lines)
    text = print_expr(declared.statement.body)
    return text if len(text) <= MAX_DEFINITION_LENGTH else f"{text[: MAX_DEFINITION_LENGTH - 3]}..."


def _formula(written: str) -> str:
    """The formula of a map's predicate; empty where it has no geometry."""
    found = meaning(written)
    return {"on": "restsOn($1, $2)", "in": "insideOf($1, $2)"}.get(found.holds, found.formula)


def _own_facts(name: str, written: str) -> Iterator[RelationTemplate]:
    text = _formula(written)
    count = max((int(one) for one in re.findall(r"\$(\d)", text)), default=0)
    text = re.sub(r"\$(\d)", lambda one: f"_slot{int(one[1]) - 1}", text)
    required = not meaning(written).holds
    yield RelationTemplate(name, text, (THING,) * count, written, required=required)
    if count == 2:
        yield RelationTemplate(name, text, (THING, PLACE), written)


def call_templates(
    lowering: Lowering, node: Callable[[str, Mapping[str, Value]], int | None]
) -> dict[int, tuple[RelationTemplate, tuple[str, ...]]]:
    """The calls of definitions that were expanded so far and whose arguments are things, regions and fixed numbers: the
    node of each, with its relation and the names of its things and regions. Numbers are part of a predicate's name:
    `closeTo-30cm`. Where several calls share a node, the outermost one counts."""
    found: dict[int, tuple[RelationTemplate, tuple[str, ...]]] = {}
    made: dict[tuple[str, tuple[str, ...]], RelationTemplate] = {}
    for key, (value, given) in list(lowering.expansions.items()):
        declared = key[0] if isinstance(key, tuple) else None
        if not isinstance(declared, Declared) or not isinstance(value, FormulaValue) or value.node < 0:
            continue
        assert isinstance(declared.statement, ast.Definition)
        name = declared.statement.name.id
        if declared is not lowering.scope.definitions.get(name):
            continue  # the prelude's own of a name that the spec gave another meaning
        arguments = [_name(lowering, one) for one in given]
        texts = [_number(lowering, one) for one in given]
        count = next((place for place, one in enumerate(arguments) if not one), len(given))
        if not count or any(not one for one in texts[count:]):
            continue
        needed = _arity(declared)
        env = {f"_slot{place}": one for place, one in enumerate(given)}
        last = next(
            (last for last in range(max(count, needed), len(given)) if node(_call(name, last), env) == value.node),
            len(given),
        )  # numbers that are the default are left out
        kinds = tuple(THING if isinstance(one, ObjectValue) else PLACE for one in given[:count])
        title = "-".join((name, *texts[count:last]))
        if (title, kinds) not in made:
            numbers = {f"_slot{place}": given[place] for place in range(count, last)}
            comment = f"{name}({', '.join(['...'] * count + texts[count:last])})" if texts[count:last] else ""
            comment = comment or _comment(declared, lowering.scope)
            made[title, kinds] = RelationTemplate(title, _call(name, last), kinds, comment, numbers)
        found[value.node] = made[title, kinds], tuple(arguments[:count])
    return found


def _name(lowering: Lowering, value: Value) -> str:
    if isinstance(value, ObjectValue):
        return lowering.builder.objects[value.index]
    return value.name if isinstance(value, RegionValue) else ""


def _number(lowering: Lowering, value: Value) -> str:
    """A fixed number as a part of a name; empty for what is none."""
    amount = lowering.builder.value(value.node) if isinstance(value, NumberValue) else None
    if amount is None:
        return ""
    assert isinstance(value, NumberValue)
    scale, unit = {LENGTH: (100.0, "cm"), ANGLE: (180.0 / math.pi, "deg")}.get(value.unit, (1.0, ""))
    said = f"{amount * scale:.6g}{unit}".replace("+", "")
    return f"minus{said[1:]}" if said.startswith("-") else said


Truths = npt.NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Literal:
    """A fact by its number, or that it is not there."""

    fact: int
    holds: bool = True


@dataclass(frozen=True, slots=True)
class FactJunction:
    """Conjunction or disjunction; of nothing it is true, or false."""

    kind: OneOf["and", "or"]
    parts: tuple[Formula, ...]


Formula = Literal | FactJunction


def truth_of(formula: Formula, truths: Truths) -> Truths:
    """Whether it holds in each of n scenes, (n,), where facts hold as in `truths` (F, n)."""
    if isinstance(formula, Literal):
        found: Truths = truths[formula.fact]
        return found if formula.holds else ~found
    start = np.full(truths.shape[1], formula.kind == "and")
    for part in formula.parts:
        found = truth_of(part, truths)
        start = start & found if formula.kind == "and" else start | found
    return start


def holding_part(formula: Formula, truths: Truths) -> Formula:
    """What a formula asks for, as it is in one scene (`truths` (F, 1)): a conjunction of literals that hold there. Of a
    disjunction these are the parts that hold. Where the formula does not hold, what it asks for and the scene has."""
    kept: dict[Literal, None] = {}
    stack: list[Formula] = [formula]
    while stack:
        one = stack.pop()
        if isinstance(one, FactJunction):
            stack += [part for part in reversed(one.parts) if one.kind == "and" or truth_of(part, truths)[0]]
        elif truths[one.fact, 0] == one.holds:
            kept[one] = None
    return FactJunction("and", tuple(kept))


def facts_of(formula: Formula) -> tuple[int, ...]:
    """The facts that a formula mentions, in its order."""
    found: dict[int, None] = {}
    stack: list[Formula] = [formula]
    while stack:
        one = stack.pop()
        if isinstance(one, FactJunction):
            stack += reversed(one.parts)
        else:
            found[one.fact] = None
    return tuple(found)


def formula_text(formula: Formula, fact: Callable[[int], str], indent: int = 4) -> str:
    """The formula as PDDL; `fact` writes a fact. Long ones stand on several lines."""
    if isinstance(formula, Literal):
        said = fact(formula.fact)
        return said if formula.holds else f"(not {said})"
    parts = [formula_text(part, fact, indent + 2) for part in formula.parts]
    return _join(formula.kind, parts, indent)


def _join(kind: str, parts: Sequence[str], indent: int) -> str:
    line = f"({kind} {' '.join(parts)})" if parts else f"({kind})"
    if len(line) <= 100 and "\n" not in line:
        return line
    inner = f"\n{' ' * indent}".join(parts)
    return f"({kind}\n{' ' * indent}{inner})"


MAX_FACTS = 60_000  # that could hold in a scene
MAX_GOAL_PARTS = 2_000  # of a goal that is written out; a larger one is the fact of its label
MAX_GOAL_DEPTH = 60
MAX_TRUTH_NUMBERS = 1 << 23  # numbers that a look at some scenes may hold


@dataclass(frozen=True, slots=True)
class Fact:
    """A predicate with the names of its arguments, as the spec has them. `description` is what a predicate without
    arguments stands for, where that is a part of a goal."""

    predicate: str
    arguments: tuple[str, ...] = ()
    description: str = ""


@dataclass(frozen=True, slots=True)
class GroundedFacts:
    """All facts that could hold in scenes of a spec. `core` has a label for each that the scene decides, its number;
    `always` holds the others. `goals` has each label's formula over facts. `comments` say what predicates mean."""

    spec: CheckedSpec
    facts: tuple[Fact, ...]
    core: Core
    always: Mapping[int, bool]
    goals: Mapping[str, Formula]
    labels: Mapping[str, int]
    comments: Mapping[str, str]

    def truths(self, rows: npt.NDArray[np.float64]) -> Iterator[tuple[slice, Truths]]:
        """Which facts hold, (F, m), in the m scenes of a slice of `rows` (3N, n): their phi is 0 or more."""
        if self.spec.timed is not None:  # a step in which nothing moves
            rows = np.concatenate([rows, rows])
        block = max(1, MAX_TRUTH_NUMBERS // max(1, len(self.core.nodes) + len(self.facts)))
        for start in range(0, rows.shape[1], block):
            here = slice(start, min(start + block, rows.shape[1]))
            found = np.zeros((len(self.facts), here.stop - here.start), dtype=np.bool_)
            for number, holds in self.always.items():
                found[number] = holds
            for label, values in phi(self.core, list(np.ascontiguousarray(rows[:, here])), NUMPY).items():
                found[int(label)] = values >= 0.0
            yield here, found


def ground(
    source: str,
    name: str,
    wanted: Sequence[str] | None = None,
    own: Mapping[str, str] | None = None,
    explicit: Sequence[tuple[Fact, str]] = (),
    *,
    counts: Mapping[str, int] | None = None,
    parts: dict[tuple[str, int], str] | None = None,
) -> GroundedFacts:
    """The facts of a spec's canonical text. `wanted` names relations of the prelude or of the spec, by default all of
    one or two things; `own` maps predicates to formulas with `$1`, `$2` and takes their place; `explicit` are facts
    with formulas, which take the place of both. `counts` says how many there are of things whose number the spec draws;
    `parts` has the names of what is no relation, for several specs that share a domain, and gets new ones. Raises
    RequestError, SpecError."""
    module = parse(Source(name, source))
    hook = _Expansion(module, wanted, own, explicit, {} if parts is None else parts)
    spec = check_module(module, None, hook, counts)
    return GroundedFacts(spec, tuple(hook.facts), hook.core, hook.always, hook.goals, hook.labels, hook.comments)


@dataclass(slots=True)
class _Expansion:
    module: ast.Module
    wanted: Sequence[str] | None
    own: Mapping[str, str] | None
    explicit: Sequence[tuple[Fact, str]]
    parts: dict[tuple[str, int], str]
    facts: list[Fact] = field(default_factory=list)
    always: dict[int, bool] = field(default_factory=dict)
    goals: dict[str, Formula] = field(default_factory=dict)
    labels: dict[str, int] = field(default_factory=dict)
    comments: dict[str, str] = field(default_factory=dict)
    core: Core = field(default_factory=lambda: Core((), {}, ()))
    _lowering: Lowering = field(init=False)
    _nodes: dict[int, int] = field(default_factory=dict)  # of facts: node -> number
    _decided: dict[int, int] = field(default_factory=dict)  # number -> node
    _numbers: dict[Fact, int] = field(default_factory=dict)
    _values: dict[str, Value] = field(default_factory=dict)
    _parsed: dict[str, ast.Expr] = field(default_factory=dict)
    _calls: dict[int, tuple[RelationTemplate, tuple[str, ...]]] = field(default_factory=dict)
    _parts: int = 0
    _described: Counter[str] = field(default_factory=Counter)

    def __call__(self, lowering: Lowering) -> None:
        self._lowering = lowering
        noticed, used = list(lowering.noticed), set(lowering.used)
        labels = {} if lowering.scope.timed else self._labels()
        self._calls = call_templates(lowering, self.node)
        if self.explicit:
            for fact, text in self.explicit:
                node = self.node(text, {})
                if node is not None:
                    self._add(fact, node)
        else:
            relations = templates(lowering.scope, self.wanted, self.own)
            self._check_size(relations)
            count = len(lowering.scope.objects)
            for relation in relations:
                self._refuse_unknown(relation)
                if not self._add_relation(relation) and relation.required and count >= len(relation.kinds):
                    raise RequestError(FACTS_MEAN_NOTHING(name=relation.name, formula=relation.comment))
        self.labels = {name: self._add(Fact(name, description=name), node, part=False) for name, node in labels.items()}
        for name, node in labels.items():
            if not self.explicit:
                self._parts = 0
                formula = self._goal(node, 0)
                self.goals[name] = Literal(self.labels[name]) if formula is None else formula
        lowering.noticed[:] = noticed
        lowering.used.clear()
        lowering.used.update(used)
        self.core = lowering.builder.finish({str(number): node for number, node in self._decided.items()})

    def _labels(self) -> dict[str, int]:
        bare = self.module.bare
        formulas = {one.name.id: one.formula for one in self.module.statements if isinstance(one, ast.Label)}
        formulas = formulas if bare is None else {LABEL: bare}
        made: dict[str, int] = {}
        for name, formula in formulas.items():
            value = self._lowering.evaluate(formula, CallFrame(self.module.source))
            made[name] = self._lowering.coerce.formula(value, f"`{name}`")
        return made

    def _check_size(self, relations: Sequence[RelationTemplate]) -> None:
        count = len(self._lowering.scope.objects)
        places = len(self._lowering.areas)
        several = sum(math.prod(count if kind == THING else places for kind in one.kinds) for one in relations)
        if several + len(self.facts) > MAX_FACTS:
            raise RequestError(PDDL_TOO_LARGE(count=several, limit=MAX_FACTS))

    def _refuse_unknown(self, relation: RelationTemplate) -> None:
        """Raises RequestError for a formula of a map that cannot be read, or names what there is not."""
        if not relation.required:
            return
        first = next(iter(self._lowering.scope.objects))
        text = re.sub(r"_slot\d", first, relation.text)
        try:
            problems = resolve(
                (), parse(Source("the map", text), self._lowering.scope.timed).bare, self._lowering.scope
            )
        except SpecError as error:
            problems = list(error.diagnostics)
        if problems:
            reason = problems[0].title
            raise RequestError(FACTS_MEAN_NOTHING(name=relation.name, formula=relation.comment, reason=reason))

    def _add(self, fact: Fact, node: int, *, part: bool = True) -> int:
        """`part`: goals with this formula in them refer to this fact."""
        number = self._numbers[fact] = len(self.facts)
        self.facts.append(fact)
        if node in (TRUE, FALSE):
            self.always[number] = node == TRUE
        else:
            self._decided[number] = node
            if part:
                self._nodes.setdefault(self._same(node), number)
        return number

    def _same(self, node: int) -> int:
        """What formulas that are equal have in common: atoms their margin, whatever they are called."""
        if node < 0:
            return node
        found = self._lowering.builder.nodes[node]
        return found.margin if isinstance(found, Atom) else node

    def _add_relation(self, relation: RelationTemplate) -> bool:
        """Adds all facts of a relation; whether there are any."""
        scope = self._lowering.scope
        names = {THING: tuple(scope.objects), PLACE: tuple(self._lowering.areas)}
        many = set(relation.kinds) == {THING}
        ways = (
            permutations(names[THING], len(relation.kinds))
            if many
            else product(*(names[kind] for kind in relation.kinds))
        )
        found = False
        for arguments in ways:
            if Fact(relation.name, arguments) in self._numbers:
                found = True
                continue
            node = self._instance(relation, arguments)
            if node is not None:
                found = True
                self.comments.setdefault(relation.name, relation.comment)
                self._add(Fact(relation.name, arguments), node)
        return found

    def _instance(self, relation: RelationTemplate, arguments: Sequence[str]) -> int | None:
        env = dict(relation.numbers)
        for place, argument in enumerate(arguments):
            env[f"_slot{place}"] = self._value(argument)
        return self.node(relation.text, env)

    def _value(self, name: str) -> Value:
        if name not in self._values:
            node, frame = self._parse(name), self._frame(name)
            place = self._lowering.scope.objects.get(name)
            self._values[name] = (
                self._lowering.evaluate(node, frame)
                if place is None
                else ObjectValue(place, origin=self._lowering.origin(node, frame))  # one that may be missing is there
            )
        return self._values[name]

    def node(self, text: str, env: Mapping[str, Value]) -> int | None:
        """The node of a formula's text; None where the checker refuses it."""
        self._lowering.inside = 0  # the limits are those of one spec, and this is many
        try:
            value = self._lowering.evaluate(self._parse(text), self._frame(text), env)
        except (SpecError, FormulaTooLarge):
            return None
        return value.node if isinstance(value, FormulaValue) else None

    def _parse(self, text: str) -> ast.Expr:
        if text not in self._parsed:
            bare = parse(Source("<facts>", text), self._lowering.scope.timed).bare
            assert bare is not None
            self._parsed[text] = bare
        return self._parsed[text]

    def _frame(self, text: str) -> CallFrame:
        return CallFrame(Source("<facts>", text))

    def _goal(self, node: int, depth: int) -> Formula | None:
        """A formula of the core over facts; None where it is too large to be written out."""
        self._parts += 1
        if self._parts > MAX_GOAL_PARTS or depth > MAX_GOAL_DEPTH:
            return None
        turned = self._lowering.builder.negate(node)
        for one, holds in ((node, True), (turned, False)):
            if self._same(one) in self._nodes or self._add_call(one):
                return Literal(self._nodes[self._same(one)], holds)
        inner = self._lowering.builder.nodes[node]
        if isinstance(inner, Junction):
            parts = []
            for below in inner.args:
                part = self._goal(below, depth + 1)
                if part is None:
                    return None
                parts.append(part)
            return FactJunction("and" if inner.kind == "min" else "or", tuple(parts))
        assert isinstance(inner, Atom)
        words = self._describe(inner)
        name = self.parts.setdefault((words, self._described[words]), f"part-{len(self.parts) + 1}")
        self._described[words] += 1
        self.comments[name] = words
        return Literal(self._add(Fact(name, description=words), node))

    def _describe(self, atom: Atom) -> str:
        """The text of an atom, with its things where these are not in it: heights are written out as numbers."""
        builder, stack, things = self._lowering.builder, [atom.margin], dict[str, None]()
        while stack:
            node = builder.nodes[stack.pop()]
            if isinstance(node, Coord):
                things[builder.objects[node.object]] = None
            stack += getattr(node, "args", ())
        told = dict.fromkeys(one.partition(".")[0] for one in things)  # `mug.on` is the surface of `mug`
        return atom.text if not told or any(one in atom.text for one in told) else f"{atom.text}, of {', '.join(told)}"

    def _add_call(self, node: int) -> bool:
        """Whether a node is a call of a definition over things and numbers: then all facts of it are added."""
        if node not in self._calls:
            return False
        relation, arguments = self._calls[node]
        self._check_size([relation])
        self._add_relation(relation)
        number = self._numbers.get(Fact(relation.name, arguments))
        if number is None:
            return False
        self._nodes[self._same(node)] = number
        return True
