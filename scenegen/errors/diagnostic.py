"""Kinds of problems, and problems."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from scenegen.errors.names import nearest
from scenegen.errors.source import Span
from scenegen.errors.template import Spell, Text, fill, fill_title, python_name

Severity = Literal["error", "warning", "note"]

NEAREST = "did you mean `{nearest}`?"
EXPANSION = "[[in the expansion of `{expansion}`]][[, where {where}]][[, called at {called}]][[, with {counted}]]"


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of problem: its stable code, and templates (see template.py) of its texts.

    Calling a kind makes a problem of it: `UNKNOWN_FORMAT(name="xml", known=FORMATS)`, with a place as the only
    positional argument. Where the facts have a `name` and what is `known`, `nearest` is the known name that it
    may stand for.
    """

    code: str
    title: Text
    label: Text = ""
    help: Text = ""
    note: Text = EXPANSION
    severity: Severity = "error"

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
