"""Grammars of what a language model may say about a spec."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from scenegen.api.spec import Spec, parse
from scenegen.arrays import Array
from scenegen.editors.grammars.rules import (
    Grammar,
    IntegerRange,
    Part,
    Repeat,
    RuleRef,
    Terminal,
    choice,
    gbnf,
    json,
    lark,
    seq,
)
from scenegen.editors.grammars.statements import EXACT, MEASURES, Extra, Findings, PhraseForm, TrialStatement, findings
from scenegen.editors.grammars.usual import usual_rules
from scenegen.errors import RequestError, Source
from scenegen.errors.requests import OUT_OF_RANGE, REQUIREMENT_NOT_FOUND, UNKNOWN_CHOICE
from scenegen.geometry import NUMPY
from scenegen.lang.formula.core import REQUIRE, Core, gate, part_of
from scenegen.lang.formula.interpret import phi
from scenegen.lang.spec import CheckedSpec
from scenegen.lang.syntax import ast
from scenegen.lang.syntax import ast as traversal
from scenegen.lang.syntax.parse import parse as read
from scenegen.lang.syntax.printer import print_statement
from scenegen.pose import SIZE
from scenegen.search.prune import find_witness

DIALECTS: Mapping[str, Callable[[Grammar], str]] = {"lark": lark, "gbnf": gbnf, "json": json}
GRAMMAR_SHAPES = ("goals", "formulas")
GRAMMAR_PARTS = ("spec", "labels")
MAX_GRAMMAR_OBJECTS = 40  # the time it takes grows with their square: a minute for 40


def grammar_of(about: Spec | Sequence[str], to: str = "lark", *, shape: str = "goals", only: str = "spec") -> str:
    """A context-free grammar of specs about the declarations of a spec, or about objects by name.

    `to`: "lark" (the dialect of llguidance), "json" (its JSON form) or "gbnf" (llama.cpp). With the shape "goals" each
    label is a statement that some scene satisfies, or a choice of a few: all that the grammar makes passes `scenegen
    check`. With "formulas" statements are joined freely; that may contradict itself, which `check` then says. Between
    declarations and labels the model may say where things usually are. `only` = "labels" leaves the declarations and
    this out of what it writes. docs/language-models.md says more.

    Raises RequestError for an unknown choice, for more than 40 objects, and where no scene was found that meets what
    the spec requires; SpecError for names that cannot be objects.
    """
    _one_of("dialect", to, tuple(DIALECTS))
    grammar = rules_of(about, shape=shape, only=only)
    return DIALECTS[to](grammar)


def rules_of(about: Spec | Sequence[str], *, shape: str = "goals", only: str = "spec") -> Grammar:
    """The rules that `grammar_of` writes, as data. Raises what it raises."""
    _one_of("shape", shape, GRAMMAR_SHAPES)
    _one_of("part", only, GRAMMAR_PARTS)
    spec = about if isinstance(about, Spec) else of_objects(about)
    if len(spec.objects) > MAX_GRAMMAR_OBJECTS:
        wanted = f"at most {MAX_GRAMMAR_OBJECTS} objects: a grammar names every pair"
        raise RequestError(OUT_OF_RANGE(argument="objects", value=len(spec.objects), wanted=wanted))
    text = spec.source
    _, least = next(iter(spec.members))  # names what is there whatever the number of things
    scenes = valid_scenes(least.definition)
    if scenes is None:
        raise RequestError(REQUIREMENT_NOT_FOUND(file=spec.definition.name))
    found = findings(Source(spec.definition.name, least.source), scenes)
    declared = declarations(text, spec.objects)
    chosen: Any = shape
    names = label_names(text, MAX_LABELS_WRITTEN)
    if only == "labels":
        return grammar(found, Terminal(""), {}, names, chosen)
    usual, rules = usual_rules(spec.definition, least.objects)
    return grammar(found, seq(Terminal(declared), usual), rules, names, chosen)


def of_objects(names: Sequence[str]) -> Spec:
    """A spec that declares the objects, written as in an `object` statement, and says nothing of them that matters.
    Raises SpecError for what is no object."""
    declared = f"object {', '.join(names)}"
    (statement,) = read(Source("<objects>", declared)).statements
    assert isinstance(statement, ast.Objects)
    first = statement.declarations[0]
    one = first.name.id if first.count is None else f"{first.name.id}[1]"
    return parse(f"{declared}\ngoal: x({one}) >= 0\n", "<objects>")


def _one_of(what: str, value: object, known: tuple[str, ...]) -> None:
    if value not in known:
        raise RequestError(UNKNOWN_CHOICE(what=what, name=value, known=known))


Row = tuple[str, ...]


class Sets:
    """Makes rules of sets of rows, each set once; `rules` are those made so far."""

    def __init__(self, prefix: str) -> None:
        self.prefix = prefix
        self.rules: dict[str, Part] = {}
        self._known: dict[object, Part] = {}

    def rows(self, rows: Iterable[Row], between: Row) -> Part:
        """Any of the rows, all equally long, with the texts `between` their names."""
        wanted = frozenset(rows)
        key = (wanted, between)
        known = self._known.get(key)
        if known is None:
            known = self._known[key] = self._name_rule(self._rule(wanted, between))
        return known

    def _rule(self, rows: frozenset[Row], between: Row) -> Part:
        if not between:
            return choice([Terminal(name) for (name,) in sorted(rows)])
        rests: dict[str, set[Row]] = {}
        for first, *rest in sorted(rows):
            rests.setdefault(first, set()).add(tuple(rest))
        same: dict[frozenset[Row], list[str]] = {}
        for first, left in rests.items():
            same.setdefault(frozenset(left), []).append(first)
        options = []
        for left_set, names in same.items():
            rest_part = self.rows(left_set, between[1:])
            head = choice([Terminal(name) for name in names])
            options.append(seq(head, Terminal(between[0]), rest_part))
        return choice(options)

    def _name_rule(self, part: Part) -> Part:
        if isinstance(part, Terminal):
            return part
        name = f"{self.prefix}{len(self.rules) + 1}"
        self.rules[name] = part
        return RuleRef(name)


MAX_NUMBER = 100  # in the unit's own suffix


class Literals:
    """Makes rules of statements; those of rules begin with `name`, the rule for any of them has it for a name."""

    def __init__(self, found: Findings, statements: Sequence[TrialStatement], name: str) -> None:
        self.found = found
        self.name = name
        self.sets = Sets(f"{name}args")
        self.relations: dict[str, list[Part]] = {}
        self.base: dict[PhraseForm, dict[Row, tuple[float, float]]] = {}
        self.extras: dict[PhraseForm, dict[Extra, dict[str, dict[Row, float]]]] = {}
        for one in statements:
            if one.extra is None:
                self.base.setdefault(one.form, {})[one.arguments] = (one.low, one.high)
            else:
                values = self.extras.setdefault(one.form, {}).setdefault(one.extra, {})
                values.setdefault(one.value, {})[one.arguments] = one.high
        for form, rows in self.base.items():
            made = self._comparisons(form, rows) if form.number else self._call_rules(form, rows)
            if made:
                self.relations.setdefault(form.relation, []).extend(made)

    def rules(self) -> dict[str, Part]:
        """The rule for any statement, one for each relation, and those of their arguments; none without statements."""
        if not self.relations:
            return {}
        named = {f"{self.name}{place}": choice(parts) for place, parts in enumerate(self.relations.values(), start=1)}
        return {self.name: choice([RuleRef(name) for name in named]), **named, **self.sets.rules}

    def _call(self, form: PhraseForm, rows: Iterable[Row], end: Part) -> Part:
        """The form with any of the rows, and `end` before its last parenthesis."""
        head, *between = form.pieces
        arguments = self.sets.rows(rows, tuple(between[:-1])) if form.kinds else Terminal("")
        last = between[-1] if between else ""
        if not form.kinds:
            head, last = head[:-1], ")"
        before, bracket, after = last.partition(")")
        return seq(Terminal(head), arguments, Terminal(before), end, Terminal(bracket + after))

    def _call_rules(self, form: PhraseForm, rows: dict[Row, tuple[float, float]]) -> list[Part]:
        """The plain call, and one with each further argument."""
        possible = [row for row, (_, high) in rows.items() if high >= 0.0]
        made = [self._call(form, possible, Terminal(""))] if possible else []
        for extra, shifts in self.found.shifts.get(form, {}).items():
            table = {value: {row: high + shift for row, (_, high) in rows.items()} for value, shift in shifts.items()}
            made += self._more(form, extra, table, between=True)
        for extra, table in self.extras.get(form, {}).items():
            made += self._more(form, extra, table, between=False)
        return made

    def _more(self, form: PhraseForm, extra: Extra, table: dict[str, dict[Row, float]], *, between: bool) -> list[Part]:
        """The call with one more argument: the run of values with most to say, and the rows that can have all of it.
        `between` two values that were tried lie others as good."""
        values = list(table)
        good = {value: {row for row, high in table[value].items() if high >= EXACT} for value in values}
        best: tuple[int, int, int, set[Row]] | None = None
        for first in range(len(values)):
            rows = set(good[values[first]])
            for last in range(first, len(values)):
                rows &= good[values[last]]
                if rows and (best is None or len(rows) * (last - first + 1) > best[0]):
                    best = (len(rows) * (last - first + 1), first, last, set(rows))
        if best is None:
            return []
        _, first, last, rows = best
        if between and extra.measure is not None:
            steps = [int(value.split(" ")[0]) for value in values]
            number: Part = seq(IntegerRange(steps[first], steps[last]), Terminal(extra.measure.suffix))
        else:
            number = choice([Terminal(value) for value in values[first : last + 1]])
        return [self._call(form, rows, seq(Terminal(extra.before), number))]

    def _comparisons(self, form: PhraseForm, rows: dict[Row, tuple[float, float]]) -> list[Part]:
        """A function compared with numbers that it is at most, and at least, in some scene."""
        measure = MEASURES[self.found.units[form]]
        made = []
        least = {row: max(1, math.ceil(low / measure.scale + EXACT)) for row, (low, _) in rows.items()}
        most = {row: math.floor(high / measure.scale - EXACT) for row, (_, high) in rows.items()}
        low_rows = {row: low for row, low in least.items() if low < MAX_NUMBER}
        high_rows = {row: high for row, high in most.items() if high >= 2}
        for sign, chosen in (("<=", low_rows), (">=", high_rows)):
            if not chosen:
                continue
            low = max(chosen.values()) if sign == "<=" else 1
            high = MAX_NUMBER if sign == "<=" else min(MAX_NUMBER, min(chosen.values()))
            number = seq(IntegerRange(low, high), Terminal(measure.suffix))
            made.append(seq(self._call(form, chosen, Terminal("")), Terminal(f" {sign} "), number))
        return made


Shape = Literal["goals", "formulas"]

MAX_LABELS_WRITTEN = 8  # labels at most
MAX_OPTIONS = 2  # further options of one goal
MAX_CONJUNCTS = 8
MAX_PARENTHESES = 3  # of parentheses in free formulas


def grammar(
    found: Findings, before: Part, more: Mapping[str, Part], names: tuple[str, ...], shape: Shape = "goals"
) -> Grammar:
    """The grammar of a spec: what comes `before`, with `more` rules of it, then labels called `names`, in this order.
    With the shape "goals" each is one statement that some scene satisfies, or a choice of them; with "formulas"
    anything can be joined."""
    literals = Literals(found, found.statements, "state").rules()
    moving = Literals(found, found.moving, "step").rules()
    timed = found.words is not None and found.words.timed
    rules: dict[str, Part] = {"start": seq(before, RuleRef("goal1"))}
    for place, name in enumerate(names, start=1):
        last = place == len(names)
        rest = () if last else (Repeat(seq(Terminal("\n"), RuleRef(f"goal{place + 1}")), 0, 1),)
        rules[f"goal{place}"] = seq(Terminal(f"{name}: "), RuleRef("formula"), *rest)
    if shape == "formulas":
        rules.update(_free_rules(timed, found.steps, bool(moving)))
    elif timed:
        rules["formula"] = seq(RuleRef("timed"), Repeat(seq(Terminal(" & "), RuleRef("timed")), 0, MAX_CONJUNCTS - 1))
        rules["timed"] = _timed_rule(found.steps, "state", moving=bool(moving))
    else:
        rules["formula"] = seq(RuleRef("state"), Repeat(seq(Terminal(" | "), RuleRef("state")), 0, MAX_OPTIONS))
    return Grammar({**rules, **literals, **moving, **more})


def _free_rules(timed: bool, steps: int, moving: bool) -> dict[str, Part]:
    """Formulas that nest: every pair of parentheses is one level."""
    rules: dict[str, Part] = {}
    for depth in range(MAX_PARENTHESES):
        options: list[Part] = [RuleRef("state"), seq(Terminal("!"), RuleRef("state"))]
        if depth:
            inner = RuleRef(f"nested{depth}")
            both = [
                seq(Terminal("("), inner, Repeat(seq(Terminal(sign), inner), 1, 3), Terminal(")"))
                for sign in (" & ", " | ")
            ]
            options += [*both, seq(Terminal("("), inner, Terminal(" -> "), inner, Terminal(")"))]
        rules[f"nested{depth + 1}"] = choice(options)
    top = f"nested{MAX_PARENTHESES}"
    if timed:
        rules["timed"] = _timed_rule(steps, top, moving=moving)
        top = "timed"
    conjunct = RuleRef(top)
    rules["formula"] = seq(conjunct, Repeat(seq(Terminal(" & "), conjunct), 0, MAX_CONJUNCTS - 1))
    return rules


def _timed_rule(steps: int, inner: str, *, moving: bool) -> Part:
    """A formula over time of formulas of a moment. Windows end with the motion: they begin with the moment, or end with
    the last one; where operators are nested, the inner one takes all moments that are left. What an operator takes
    stands in parentheses, whatever binds how. What needs a step (`moving`) is not asked of the first moment."""
    state = RuleRef(inner)
    taken = seq(Terminal(" ("), state, Terminal(")"))
    windows: list[Part] = [Terminal(""), seq(Terminal("[0, "), IntegerRange(1, steps), Terminal("]"))]
    windows.append(seq(Terminal("["), IntegerRange(0, steps), Terminal(f", {steps}]")))
    window = choice(windows)
    always, eventually = Terminal("(always"), Terminal("(eventually")
    once = choice([Terminal("(initially"), Terminal("(finally")])
    options: list[Part] = [state, seq(once, taken, Terminal(")"))]
    options += [seq(word, window, taken, Terminal(")")) for word in (always, eventually)]
    options += [
        seq(Terminal("(always eventually"), taken, Terminal(")")),
        seq(Terminal("(eventually always"), taken, Terminal(")")),
        seq(Terminal("("), state, choice([Terminal(" until"), Terminal(" until_with")]), window, taken, Terminal(")")),
    ]
    if moving:
        step = seq(Terminal(" ("), RuleRef("step"), Terminal(")"))
        span = seq(Terminal("[1, "), IntegerRange(1, steps), Terminal("]"))
        options += [seq(word, span, step, Terminal(")")) for word in (always, eventually)]
        options.append(seq(Terminal("(finally"), step, Terminal(")")))
    return choice(options)


GRAMMAR_SCENES = 512
UNIFORM_BLOCKS = 12  # blocks of uniform scenes that are looked through
ENOUGH_VALID = 64  # valid ones among them, or chains are run from those that there are
CHAIN_ROUNDS = 150  # moves of one object each


def valid_scenes(spec: CheckedSpec) -> Array | None:
    """Up to SCENES scenes (3N, M) that meet what the spec requires, always the same; None where none was found. Uniform
    ones where these are common enough; else moves of single objects lead from one to the next. Of a spec over time they
    are moments, and its requirement is not looked at."""
    lowest, highest = spec.box()
    rng = np.random.default_rng(0)
    if spec.timed is not None:
        return _uniform(lowest, highest, rng)
    core = gate(spec.core)
    if REQUIRE not in core.labels:
        return _uniform(lowest, highest, rng)
    core = part_of(core, (REQUIRE,))
    kept: list[Array] = []
    for _ in range(UNIFORM_BLOCKS):
        rows = _uniform(lowest, highest, rng)
        kept.append(rows[:, _valid(core, rows)])
        if sum(one.shape[1] for one in kept) >= GRAMMAR_SCENES:
            return np.concatenate(kept, axis=1)[:, :GRAMMAR_SCENES]
    found = np.concatenate(kept, axis=1)
    if not found.shape[1]:
        witness = find_witness(core, lowest, highest, {core.labels[REQUIRE]: (0.0, np.inf)}).witness
        if witness is None:
            return None
        found = witness[:, None]
    return found if found.shape[1] >= ENOUGH_VALID else _chains(core, lowest, highest, found, rng)


def _uniform(lowest: Array, highest: Array, rng: np.random.Generator) -> Array:
    return lowest[:, None] + (highest - lowest)[:, None] * rng.random((len(lowest), GRAMMAR_SCENES))


def _valid(core: Core, rows: Array) -> npt.NDArray[np.bool_]:
    return np.broadcast_to(phi(core, list(rows), NUMPY)[REQUIRE], rows.shape[1]) >= 0.0


def _chains(core: Core, lowest: Array, highest: Array, start: Array, rng: np.random.Generator) -> Array:
    """Chains from valid scenes: in each round one object goes to a place of its own, near or far."""
    rows = np.resize(start.T, (GRAMMAR_SCENES, len(lowest))).T.copy()
    objects = len(lowest) // SIZE
    for _ in range(CHAIN_ROUNDS):
        moved = rows.copy()
        which = SIZE * rng.integers(objects, size=GRAMMAR_SCENES)
        near = rng.random(GRAMMAR_SCENES) < 0.5
        for axis in range(SIZE):
            at, ends = (which + axis, np.arange(GRAMMAR_SCENES)), (lowest[which + axis], highest[which + axis])
            far = ends[0] + (ends[1] - ends[0]) * rng.random(GRAMMAR_SCENES)
            step = rows[at] + 0.05 * (ends[1] - ends[0]) * rng.standard_normal(GRAMMAR_SCENES)
            moved[at] = np.clip(np.where(near, step, far), *ends)
        good = _valid(core, moved)
        rows[:, good] = moved[:, good]
    return rows


BASES = ("goal", "aim", "target")  # what labels are called, whichever is free


def declarations(text: str, objects: tuple[str, ...]) -> str:
    """The statements of a canonical text but its labels, one after the other, ending in a line break. Labels that other
    statements use stay; `objects` are declared where the text leaves them to be inferred."""
    module = read(Source("<spec>", text))
    labels = {one.name.id: one for one in module.statements if isinstance(one, ast.Label)}
    rest = [one for one in module.statements if not isinstance(one, ast.Label)]
    kept: set[str] = set()
    waiting: list[ast.Statement] = list(rest)
    while waiting:
        used = _names(waiting.pop()) & labels.keys() - kept
        kept |= used
        waiting += [labels[name] for name in used]
    lines = [print_statement(one) for one in module.statements if not isinstance(one, ast.Label) or one.name.id in kept]
    if not any(isinstance(one, ast.Objects) for one in rest):
        lines.insert(0, f"object {', '.join(objects)}")
    return "".join(line + "\n" for line in lines)


def label_names(text: str, count: int) -> tuple[str, ...]:
    """Names for so many labels that occur nowhere in the text."""
    words = set(re.findall(r"\w+", text))
    number = 0
    while True:
        for base in BASES if not number else (f"goal_{number}_",):
            names = tuple(f"{base}{place}" for place in range(1, count + 1))
            if not words & set(names):
                return names
        number += 1


def _names(statement: ast.Statement) -> set[str]:
    """All names that the expressions of a statement mention."""
    found: set[str] = set()
    stack: list[ast.Expr | ast.Argument] = list(traversal.expressions(statement))
    while stack:
        node = stack.pop()
        if isinstance(node, ast.Name):
            found.add(node.id)
        stack.extend(traversal.children(node))
    return found
