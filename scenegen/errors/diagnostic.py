"""Kinds of problems, and problems."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from scenegen.errors.template import Spell, Text, fields, fill, fill_title, missing, nearest, python_name

# --------------------------------------------------------------------------------------------------------------------
# Texts that diagnostics point into, and places in them.


@dataclass(frozen=True, slots=True)
class Source:
    """A text that diagnostics can point into: a file, or an option as typed. `name` is then that of the `argument`,
    which is rendered as `--phi` or `phi`."""

    name: str
    text: str
    argument: bool = False

    def position(self, offset: int) -> tuple[int, int]:
        """1-based line and column (in characters) of a character offset."""
        offset = min(max(offset, 0), len(self.text))
        start = self.text.rfind("\n", 0, offset) + 1
        return self.text.count("\n", 0, offset) + 1, offset - start + 1

    def line(self, offset: int) -> str:
        """The line that holds a character offset, without its line break."""
        start = self.text.rfind("\n", 0, min(max(offset, 0), len(self.text))) + 1
        end = self.text.find("\n", start)
        return self.text[start : len(self.text) if end < 0 else end].rstrip("\r")

    def utf16(self, offset: int) -> tuple[int, int]:
        """0-based line and character of a character offset as language servers count: in UTF-16 code units, of which a
        character beyond U+FFFF takes two."""
        line, column = self.position(offset)
        before = self.line(offset)[: column - 1]
        return line - 1, column - 1 + sum(char > "\uffff" for char in before)


@dataclass(frozen=True, slots=True)
class Span:
    """Characters `start` (inclusive) to `end` (exclusive) of a source."""

    source: Source
    start: int
    end: int

    @property
    def place(self) -> str:
        """`file:line:column`."""
        line, column = self.source.position(self.start)
        return f"{self.source.name}:{line}:{column}"

    @property
    def text(self) -> str:
        return self.source.text[self.start : self.end]


Severity = Literal["error", "warning", "note"]

NEAREST = "did you mean `{nearest}`?"
EXPANSION = "[[in the expansion of `{expansion}`]][[, where {where}]][[, called at {called}]][[, with {counted}]]"


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of problem: its stable code, and templates (see template.py) of its texts.

    Calling a kind makes a problem of it: `UNKNOWN_FORMAT(name="xml", known=FORMATS)`, with a place as the only
    positional argument. Where the facts have a `name` and what is `known`, `nearest` is the known name that it
    may stand for. `formerly` are codes of kinds that it took the place of: `scenegen explain` knows them.
    """

    code: str
    title: Text
    label: Text = ""
    help: Text = ""
    note: Text = EXPANSION
    severity: Severity = "error"
    formerly: tuple[str, ...] = ()

    def __call__(self, span: Span | None = None, /, **facts: Any) -> Diagnostic:
        if "known" in facts and "name" in facts:
            known = facts["known"]
            known = sorted(known) if isinstance(known, set | frozenset) else known  # the order of sets is random
            facts["name"], facts["known"] = str(facts["name"]), tuple(map(str, known))
            close = nearest(facts["name"], facts["known"]) if facts["name"] else None
            facts["nearest"] = None if close == facts["name"] else close
        return Diagnostic(self, span, facts, self.severity)


@dataclass(frozen=True, slots=True)
class Diagnostic:
    """One problem: what (`title`), where (`span`, and `label` under it), what to do (`help`), and more (`note`)."""

    kind: Kind
    span: Span | None = None
    facts: Mapping[str, Any] = field(default_factory=dict, hash=False)
    severity: Severity = "error"

    def __str__(self) -> str:
        return self.title

    @property
    def code(self) -> str:
        return self.kind.code

    @property
    def title(self) -> str:
        return self.text("title")

    @property
    def label(self) -> str:
        return self.text("label")

    @property
    def help(self) -> str:
        return self.text("help")

    @property
    def note(self) -> str:
        return self.text("note")

    def text(self, part: str, spell: Spell = python_name) -> str:
        """The title, label, help or note, with the names of arguments as `spell` writes them."""
        return (fill_title if part == "title" else fill)(getattr(self.kind, part), self.facts, spell)

    def but(self, **facts: Any) -> Diagnostic:
        """The same problem with more facts."""
        return replace(self, facts={**self.facts, **facts})


# --------------------------------------------------------------------------------------------------------------------
# The facts of a diagnostic as data: which a kind has, and their values for JSON.


def names(kind: Kind) -> list[str]:
    """The facts that the texts of a kind can show, sorted; those of an expansion, which any kind can have, left out."""
    texts = [
        one
        for text in (kind.title, kind.label, kind.help, kind.note)
        for one in ([text] if isinstance(text, str) else text)
    ]
    return sorted(set[str]().union(*(part for text in texts for part in fields(text))) - fields(EXPANSION)[1])


def as_json(facts: Mapping[str, Any]) -> dict[str, Any]:
    """Facts by name, with the missing ones left out. Texts, whole numbers, booleans and finite numbers are themselves,
    lists and mappings are walked, and anything else is its text: paths, infinity."""
    return {str(name): _plain(fact) for name, fact in facts.items() if not missing(fact)}


def _plain(fact: Any) -> Any:
    if isinstance(fact, bool | int | str):
        return fact
    if isinstance(fact, float):
        return float(fact) if math.isfinite(fact) else str(fact)
    if isinstance(fact, Mapping):
        return as_json(fact)
    if isinstance(fact, tuple | list | set | frozenset):
        return [None if one is None else _plain(one) for one in fact]
    return _plain(fact.item()) if hasattr(fact, "item") and getattr(fact, "ndim", 1) == 0 else str(fact)
