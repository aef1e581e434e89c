"""Rows of names as rules: which arguments may stand together, shared by all relations that take the same."""

from __future__ import annotations

from collections.abc import Iterable

from scenegen.grammars.rules import Part, Ref, Text, choice, seq

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
