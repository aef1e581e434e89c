"""Statements as rules: one rule for each relation, with the arguments and numbers that it can have."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from scenegen.grammars.forms import Form
from scenegen.grammars.rules import Part, Ref, Text, Whole, choice, seq
from scenegen.grammars.sets import Row, Sets
from scenegen.grammars.trial import EXACT, Extra, Findings, Statement
from scenegen.grammars.vocabulary import MEASURES

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
