"""Kinds of problems, problems, the exceptions that carry them; and problems as text and as data, for terminals, pipes,
notebooks, editors and scripts alike."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
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


# --------------------------------------------------------------------------------------------------------------------
# Diagnostics as text, for terminals, pipes and notebooks alike, and as data for editors and scripts.


TAB = 4  # columns a tab takes in a printed source line
WIDTH = 100  # columns of a source line that are shown around the caret
LONGEST_NAME = 80  # characters of a `quoted` name; the middle of a longer one is left out
LONGEST = 1000  # characters of a title, label, note or help

_STYLES = {
    "error": "\x1b[1;31m",
    "warning": "\x1b[1;33m",
    "frame": "\x1b[1;34m",
    "note": "\x1b[1;36m",
    "help": "\x1b[1;36m",
    "bold": "\x1b[1m",
}


def _paint(text: str, style: str, color: bool) -> str:
    return f"{_STYLES[style]}{text}\x1b[0m" if color else text


def _printable(text: str) -> str:
    """The text with tabs widened and control characters shown as a dot, so that a caret stays under its character."""
    return "".join(" " * TAB if char == "\t" else char if char.isprintable() else "\u00b7" for char in text)


def _cut(text: str) -> str:
    """The text without the middle of names that would flood a terminal, and with an end; names in files may hold
    characters that steer a terminal, which are shown as dots."""
    text = "\n".join(map(_printable, text.splitlines()))
    shorter = re.sub(r"`([^`\n]+)`", lambda found: f"`{_shortened(found[1])}`", text)
    return shorter if len(shorter) <= LONGEST else shorter[:LONGEST] + "..."


def _shortened(name: str) -> str:
    half = (LONGEST_NAME - 3) // 2
    return name if len(name) <= LONGEST_NAME else f"{name[:half]}...{name[-half:]}"


def _window(line: str, column: int) -> tuple[str, int]:
    """Cut a long line to the part around the caret; returns it with the caret's new 0-based column."""
    if len(line) <= WIDTH:
        return line, column
    start = max(0, min(column - WIDTH // 3, len(line) - WIDTH))
    head = "..." if start else ""
    tail = "..." if start + WIDTH < len(line) else ""
    return head + line[start : start + WIDTH] + tail, column - start + len(head)


def render(diagnostic: Diagnostic, *, color: bool = False, spell: Spell = python_name) -> str:
    """The text of one diagnostic, several lines, without a final line break.

    If a place covers several lines, the first is shown, with the number of the last. Very long names are cut in the
    middle; `Diagnostic` and `to_json` have them in full.
    """
    title, label = (_cut(diagnostic.text(part, spell).replace("\n", " ")) for part in ("title", "label"))
    note, help_ = (_cut(diagnostic.text(part, spell)) for part in ("note", "help"))
    head = _paint(f"{diagnostic.severity}[{diagnostic.code}]", diagnostic.severity, color)
    out = [head + _paint(f": {title}", "bold", color)]
    gutter = ""
    if diagnostic.span is not None:
        span = diagnostic.span
        number, column = span.source.position(span.start)
        raw = span.source.line(span.start)
        length = max(1, min(span.end - span.start, len(raw) - (column - 1)))
        shown, caret = _window(raw, column - 1)
        before, under = shown[:caret], shown[caret : caret + length]
        pad = "".join(" " * TAB if char == "\t" else " " for char in before)
        carets = "^" * max(1, sum(TAB if char == "\t" else 1 for char in under))
        gutter = " " * len(str(number))
        bar = _paint("|", "frame", color)
        last = span.source.position(max(span.start, span.end - 1))[0]
        if last > number:
            carets += "..."
        under_it = " ".join(["", *filter(None, [label, f"(to line {last})" if last > number else ""])])
        out.append(f"{gutter}{_paint('-->', 'frame', color)} {_place(span, spell)}")
        out.append(f"{gutter} {bar}")
        out.append(f"{_paint(str(number), 'frame', color)} {bar} {_printable(shown)}".rstrip())
        out.append(f"{gutter} {bar} {pad}{_paint(carets + under_it, diagnostic.severity, color)}")
    for kind, text in (("note", note), ("help", help_)):
        if text:
            first, *rest = text.splitlines()
            out.append(f"{gutter} {_paint(f'= {kind}:', 'help', color)} {first}")
            out.extend(f"{gutter}   {' ' * len(kind)}  {line}" for line in rest)
    return "\n".join(out)


def _place(span: Span, spell: Spell) -> str:
    """`file:line:column`; an option as typed is named as the caller knows it."""
    source = span.source
    return f"{spell(source.name, None).strip('`')}:{span.place.split(':', 1)[1]}" if source.argument else span.place


def render_all(diagnostics: Iterable[Diagnostic], *, color: bool = False, spell: Spell = python_name) -> str:
    """Several diagnostics, separated by blank lines."""
    return "\n\n".join(render(diagnostic, color=color, spell=spell) for diagnostic in diagnostics)


def to_json(diagnostic: Diagnostic, spell: Spell = python_name) -> dict[str, Any]:
    """A diagnostic as data, shaped like those of the Language Server Protocol.

    `code`, `severity`, `message`, `label`, `help` and `note` are always there ("" where there is nothing to say), and
    `facts` by name: arguments are named as in Python, missing facts left out (diagnostic.py says how values are
    written). Where the problem has a place there are also `file` and `range`, whose `start` and exclusive `end` have a
    0-based `line` and `character` in UTF-16 code units, as that protocol counts.
    """
    found: dict[str, Any] = {
        "code": diagnostic.code,
        "severity": diagnostic.severity,
        "message": diagnostic.text("title", spell),
        "label": diagnostic.text("label", spell),
        "help": diagnostic.text("help", spell),
        "note": diagnostic.text("note", spell),
        "facts": as_json(diagnostic.facts),
    }
    if diagnostic.span is not None:
        span = diagnostic.span
        found["file"] = spell(span.source.name, None).strip("`") if span.source.argument else span.source.name
        found["range"] = {
            name: dict(zip(("line", "character"), span.source.utf16(offset), strict=True))
            for name, offset in (("start", span.start), ("end", max(span.start, span.end)))
        }
    return found


# --------------------------------------------------------------------------------------------------------------------
# Exceptions for problems that the user can fix.


class ScenegenError(Exception):
    """A problem that the user can mend. Carries at least one diagnostic; `str()` is their rendering."""

    def __init__(self, *diagnostics: Diagnostic) -> None:
        if not diagnostics:
            raise ValueError("a ScenegenError needs a diagnostic")
        super().__init__(*diagnostics)
        self.diagnostics = diagnostics

    def __str__(self) -> str:
        return render_all(self.diagnostics)


class SpecError(ScenegenError, ValueError):
    """The spec's text is wrong."""


class RequestError(ScenegenError, ValueError):
    """The request is wrong: a range, a count, a label, an option's value."""


class DataError(ScenegenError, ValueError):
    """A scenes file, a model file or an array of poses is wrong."""


class OutputError(ScenegenError, OSError):
    """Something could not be written."""
