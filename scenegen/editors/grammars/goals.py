"""The rules of whole answers: labels over given declarations."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Literal

from scenegen.editors.grammars.forms import MEASURES, Form
from scenegen.editors.grammars.rules import Grammar, Part, Ref, Repeat, Text, Whole, choice, seq
from scenegen.editors.grammars.trial import EXACT, Extra, Findings, Statement

# --------------------------------------------------------------------------------------------------------------------
# Rows of names as rules: which arguments may stand together, shared by all relations that take the same.


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
            known = self._known[key] = self._named(self._made(wanted, between))
        return known

    def _made(self, rows: frozenset[Row], between: Row) -> Part:
        if not between:
            return choice([Text(name) for (name,) in sorted(rows)])
        rests: dict[str, set[Row]] = {}
        for first, *rest in sorted(rows):
            rests.setdefault(first, set()).add(tuple(rest))
        same: dict[frozenset[Row], list[str]] = {}
        for first, left in rests.items():
            same.setdefault(frozenset(left), []).append(first)
        options = []
        for left_set, names in same.items():
            rest_part = self.rows(left_set, between[1:])
            head = choice([Text(name) for name in names])
            options.append(seq(head, Text(between[0]), rest_part))
        return choice(options)

    def _named(self, part: Part) -> Part:
        if isinstance(part, Text):
            return part
        name = f"{self.prefix}{len(self.rules) + 1}"
        self.rules[name] = part
        return Ref(name)


# --------------------------------------------------------------------------------------------------------------------
# Statements as rules: one rule for each relation, with the arguments and numbers that it can have.


MOST_NUMBER = 100  # in the unit's own suffix


class Literals:
    """Makes rules of statements; those of rules begin with `name`, the rule for any of them has it for a name."""

    def __init__(self, found: Findings, statements: Sequence[Statement], name: str) -> None:
        self.found = found
        self.name = name
        self.sets = Sets(f"{name}args")
        self.relations: dict[str, list[Part]] = {}
        self.base: dict[Form, dict[Row, tuple[float, float]]] = {}
        self.extras: dict[Form, dict[Extra, dict[str, dict[Row, float]]]] = {}
        for one in statements:
            if one.extra is None:
                self.base.setdefault(one.form, {})[one.arguments] = (one.low, one.high)
            else:
                values = self.extras.setdefault(one.form, {}).setdefault(one.extra, {})
                values.setdefault(one.value, {})[one.arguments] = one.high
        for form, rows in self.base.items():
            made = self._compared(form, rows) if form.number else self._called(form, rows)
            if made:
                self.relations.setdefault(form.relation, []).extend(made)

    def rules(self) -> dict[str, Part]:
        """The rule for any statement, one for each relation, and those of their arguments; none without statements."""
        if not self.relations:
            return {}
        named = {f"{self.name}{place}": choice(parts) for place, parts in enumerate(self.relations.values(), start=1)}
        return {self.name: choice([Ref(name) for name in named]), **named, **self.sets.rules}

    def _call(self, form: Form, rows: Iterable[Row], end: Part) -> Part:
        """The form with any of the rows, and `end` before its last parenthesis."""
        head, *between = form.pieces
        arguments = self.sets.rows(rows, tuple(between[:-1])) if form.kinds else Text("")
        last = between[-1] if between else ""
        if not form.kinds:
            head, last = head[:-1], ")"
        before, bracket, after = last.partition(")")
        return seq(Text(head), arguments, Text(before), end, Text(bracket + after))

    def _called(self, form: Form, rows: dict[Row, tuple[float, float]]) -> list[Part]:
        """The plain call, and one with each further argument."""
        possible = [row for row, (_, high) in rows.items() if high >= 0.0]
        made = [self._call(form, possible, Text(""))] if possible else []
        for extra, shifts in self.found.shifts.get(form, {}).items():
            table = {value: {row: high + shift for row, (_, high) in rows.items()} for value, shift in shifts.items()}
            made += self._with(form, extra, table, between=True)
        for extra, table in self.extras.get(form, {}).items():
            made += self._with(form, extra, table, between=False)
        return made

    def _with(self, form: Form, extra: Extra, table: dict[str, dict[Row, float]], *, between: bool) -> list[Part]:
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
            number: Part = seq(Whole(steps[first], steps[last]), Text(extra.measure.suffix))
        else:
            number = choice([Text(value) for value in values[first : last + 1]])
        return [self._call(form, rows, seq(Text(extra.before), number))]

    def _compared(self, form: Form, rows: dict[Row, tuple[float, float]]) -> list[Part]:
        """A function compared with numbers that it is at most, and at least, in some scene."""
        measure = MEASURES[self.found.units[form]]
        made = []
        least = {row: max(1, math.ceil(low / measure.scale + EXACT)) for row, (low, _) in rows.items()}
        most = {row: math.floor(high / measure.scale - EXACT) for row, (_, high) in rows.items()}
        low_rows = {row: low for row, low in least.items() if low < MOST_NUMBER}
        high_rows = {row: high for row, high in most.items() if high >= 2}
        for sign, chosen in (("<=", low_rows), (">=", high_rows)):
            if not chosen:
                continue
            low = max(chosen.values()) if sign == "<=" else 1
            high = MOST_NUMBER if sign == "<=" else min(MOST_NUMBER, min(chosen.values()))
            number = seq(Whole(low, high), Text(measure.suffix))
            made.append(seq(self._call(form, chosen, Text("")), Text(f" {sign} "), number))
        return made


Shape = Literal["goals", "formulas"]

GOALS = 8  # labels at most
OPTIONS = 2  # further options of one goal
CONJUNCTS = 8
DEPTH = 3  # of parentheses in free formulas


def grammar(found: Findings, declared: str, names: tuple[str, ...], shape: Shape = "goals") -> Grammar:
    """The grammar of a spec: `declared`, if anything, then labels called `names`, in this order. With the shape "goals"
    each is one statement that some scene satisfies, or a choice of them; with "formulas" anything can be joined."""
    literals = Literals(found, found.statements, "state").rules()
    moving = Literals(found, found.moving, "step").rules()
    timed = found.words is not None and found.words.timed
    rules: dict[str, Part] = {"start": seq(Text(declared), Ref("goal1"))}
    for place, name in enumerate(names, start=1):
        last = place == len(names)
        more = () if last else (Repeat(seq(Text("\n"), Ref(f"goal{place + 1}")), 0, 1),)
        rules[f"goal{place}"] = seq(Text(f"{name}: "), Ref("formula"), *more)
    if shape == "formulas":
        rules.update(_free(timed, found.steps, bool(moving)))
    elif timed:
        rules["formula"] = seq(Ref("timed"), Repeat(seq(Text(" & "), Ref("timed")), 0, CONJUNCTS - 1))
        rules["timed"] = _timed(found.steps, "state", moving=bool(moving))
    else:
        rules["formula"] = seq(Ref("state"), Repeat(seq(Text(" | "), Ref("state")), 0, OPTIONS))
    return Grammar({**rules, **literals, **moving})


def _free(timed: bool, steps: int, moving: bool) -> dict[str, Part]:
    """Formulas that nest: every pair of parentheses is one level."""
    rules: dict[str, Part] = {}
    for depth in range(DEPTH):
        options: list[Part] = [Ref("state"), seq(Text("!"), Ref("state"))]
        if depth:
            inner = Ref(f"nested{depth}")
            both = [seq(Text("("), inner, Repeat(seq(Text(sign), inner), 1, 3), Text(")")) for sign in (" & ", " | ")]
            options += [*both, seq(Text("("), inner, Text(" -> "), inner, Text(")"))]
        rules[f"nested{depth + 1}"] = choice(options)
    top = f"nested{DEPTH}"
    if timed:
        rules["timed"] = _timed(steps, top, moving=moving)
        top = "timed"
    conjunct = Ref(top)
    rules["formula"] = seq(conjunct, Repeat(seq(Text(" & "), conjunct), 0, CONJUNCTS - 1))
    return rules


def _timed(steps: int, inner: str, *, moving: bool) -> Part:
    """A formula over time of formulas of a moment. Windows end with the motion: they begin with the moment, or end with
    the last one; where operators are nested, the inner one takes all moments that are left. What an operator takes
    stands in parentheses, whatever binds how. What needs a step (`moving`) is not asked of the first moment."""
    state = Ref(inner)
    taken = seq(Text(" ("), state, Text(")"))
    windows: list[Part] = [Text(""), seq(Text("[0, "), Whole(1, steps), Text("]"))]
    windows.append(seq(Text("["), Whole(0, steps), Text(f", {steps}]")))
    window = choice(windows)
    always, eventually = Text("(always"), Text("(eventually")
    once = choice([Text("(initially"), Text("(finally")])
    options: list[Part] = [state, seq(once, taken, Text(")"))]
    options += [seq(word, window, taken, Text(")")) for word in (always, eventually)]
    options += [
        seq(Text("(always eventually"), taken, Text(")")),
        seq(Text("(eventually always"), taken, Text(")")),
        seq(Text("("), state, choice([Text(" until"), Text(" until_with")]), window, taken, Text(")")),
    ]
    if moving:
        step = seq(Text(" ("), Ref("step"), Text(")"))
        span = seq(Text("[1, "), Whole(1, steps), Text("]"))
        options += [seq(word, span, step, Text(")")) for word in (always, eventually)]
        options.append(seq(Text("(finally"), step, Text(")")))
    return choice(options)
