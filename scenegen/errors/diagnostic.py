"""Kinds of problems, problems, the exceptions that carry them; and problems as text and as data, for terminals, pipes,
notebooks, editors and scripts alike."""

from __future__ import annotations

import difflib
import heapq
import math
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal, TypeAlias

MOST_ALIKE = 500  # maximum number of known names with which a misspelt one is compared


def quote_names(names: Iterable[str]) -> str:
    """`a`, `b` and `c`, in the order given."""
    items = [f"`{name}`" for name in names]
    return items[0] if len(items) == 1 else ", ".join(items[:-1]) + f" and {items[-1]}" if items else "none"


def nearest(name: str, known: Iterable[str]) -> str | None:
    """The known name that `name` most likely means: the same except for case, else a close match, else None."""
    name, names = str(name), sorted(set(known))  # Python callers may pass anything
    folded = {candidate.casefold().replace("_", ""): candidate for candidate in reversed(names)}
    exact = folded.get(name.casefold().replace("_", ""))
    if exact is not None:
        return exact
    wanted, candidates = name.casefold(), list(folded)
    if len(candidates) > MOST_ALIKE:  # difflib is slow: of very many names compare those with the same beginning
        candidates = heapq.nlargest(MOST_ALIKE, candidates, key=lambda one: _alike(one, wanted))
    close = difflib.get_close_matches(wanted, candidates, n=1, cutoff=0.6)
    return folded[close[0]] if close and _is_near(wanted, close[0]) else None


def _is_near(one: str, other: str) -> bool:
    """Whether one of two words can be a typo of the other: `usd` is not one of `sdf`, although most letters are the
    same.

    A third of the letters, but at least one, may be wrong, missing or additional; two swapped neighbours count as one.
    Longer words may also differ by an addition at one end (`block` and `block_tower`).
    """
    most = max(1, (max(len(one), len(other)) + 1) // 3)
    if min(len(one), len(other)) >= 3 and (one.startswith(other) or other.startswith(one)):
        return True
    before: list[int] = []
    row = list(range(len(other) + 1))
    for at, letter in enumerate(one, 1):
        older, before, row = before, row, [at]
        for place, char in enumerate(other, 1):
            cost = min(before[place] + 1, row[place - 1] + 1, before[place - 1] + (letter != char))
            if place > 1 and at > 1 and letter == other[place - 2] and one[at - 2] == char:
                cost = min(cost, older[place - 2] + 1)
            row.append(cost)
    return row[-1] <= most


def _alike(one: str, other: str) -> tuple[int, int]:
    """How many characters two words have in common from the start, then how close they are in length."""
    common = next((at for at, (a, b) in enumerate(zip(one, other, strict=False)) if a != b), min(len(one), len(other)))
    return common, -abs(len(one) - len(other))


# Templates of prose: the one place that turns the facts of a diagnostic into sentences.
#
#     {name}, {count:,}      a fact, formatted as by str.format
#     {names:quoted}         names in a sentence: `a`, `b` and `c`; {names:quoted8} shows the first eight
#     {names:list}           names as they are: a, b, c
#     {names:members}        the parts of a list or region: .first, .last
#     {name:argument}        a fact that names an argument, spelt as the caller knows it: `timeout` or --timeout
#     {kept:?}               nothing; the template is for those that have this fact
#     <timeout>              an argument by name: `timeout` or --timeout
#     <device=cpu>           an argument with a value: device="cpu" or --device cpu
#     [[; {more}]]           left out where one of its facts is missing
#
# A fact is missing if it was not given, is None, or is empty.


Spell: TypeAlias = Callable[[str, "str | None"], str]
Text: TypeAlias = "str | tuple[str, ...]"  # of several templates, the first whose facts are all given

_PART = r"(?s)\[\[(.*?)\]\]|\{(\w+)(?::([^{}]*))?\}|<(\w+)(?:=([^<>]*))?>"  # compiled when a text is first needed


def python_name(name: str, value: str | None = None) -> str:
    """An argument as Python callers write it: `timeout`, or `device="cpu"` with a value."""
    if value is None:
        return f"`{name}`"
    label, equals, ends = value.partition("=")
    if name == "phi" and equals:
        low, _, high = ends.partition(":")
        return f'phi={{"{label}": ({low or None}, {high or None})}}'
    return f"{name}={value}" if re.fullmatch(r"True|[\d.]+", value) else f'{name}="{value}"'


def fill(text: Text, facts: Mapping[str, object], spell: Spell = python_name) -> str:
    """The sentence that a template makes of facts; "" if some are missing."""
    for template in (text,) if isinstance(text, str) else text:
        try:
            return _fill(template, facts, spell).removeprefix("; ").removeprefix(", ")
        except KeyError:
            continue
    return ""


def fill_title(text: Text, facts: Mapping[str, object], spell: Spell = python_name) -> str:
    """The same for a title, which is never empty, even for a file without a name."""
    templates = (text,) if isinstance(text, str) else text
    for template in templates if not (said := fill(text, facts, spell)) else ():
        try:
            return _fill(template, facts, spell, empty=True)
        except KeyError:
            continue
    return said


def missing(fact: object) -> bool:
    """Whether a fact that was given counts as missing: None, "" and empty lists."""
    return fact is None or (isinstance(fact, str | tuple | list) and not fact)


def fields(template: str) -> tuple[set[str], set[str]]:
    """The facts that a template needs, and those that it can do without."""
    needed, spare = set(), set()
    for optional, name, _, _, value in re.findall(_PART, template):
        if optional:
            spare |= set.union(*fields(optional))
        elif name:
            needed.add(name)
        elif value:
            needed |= fields(value)[0]
    return needed, spare


def _fill(template: str, facts: Mapping[str, object], spell: Spell, empty: bool = False) -> str:
    def part(found: re.Match[str]) -> str:
        optional, name, how, argument, value = found.groups()
        if optional is not None:
            try:
                return _fill(optional, facts, spell)
            except KeyError:
                return ""
        if argument is not None:
            return spell(argument, None if value is None else _fill(value, facts, spell))
        fact = facts[name]
        if fact is None or (missing(fact) and not empty):
            raise KeyError(name)
        return _fact_text(fact, how or "", spell)

    return re.sub(_PART, part, template)


def _fact_text(fact: Any, how: str, spell: Spell) -> str:
    if how == "?":
        return ""
    if how == "argument":
        return spell(str(fact), None)
    if how == "members":
        return ", ".join(f".{one}" for one in fact)
    if how.startswith(("quoted", "list")):
        names = [str(one) for one in fact]
        limit = int(re.sub(r"\D", "", how) or len(names))
        shown, more = names[:limit], len(names) > limit
        if how.startswith("list"):
            return ", ".join(shown) + (", ..." if more else "")
        return ", ".join(f"`{one}`" for one in shown) + ", ..." if more else quote_names(shown)
    return format(fact, how) if how else str(fact)


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
    """A kind of problem: its stable code, and templates of its texts.

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


TAB = 4  # columns a tab takes in a printed source line
WIDTH = 100  # columns of a source line that are shown around the caret
MAX_NAME_LENGTH = 80  # characters of a `quoted` name; the middle of a longer one is left out
MAX_MESSAGE_LENGTH = 1000  # characters of a title, label, note or help

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
    shorter = re.sub(r"`([^`\n]+)`", lambda found: f"`{_shorten(found[1])}`", text)
    return shorter if len(shorter) <= MAX_MESSAGE_LENGTH else shorter[:MAX_MESSAGE_LENGTH] + "..."


def _shorten(name: str) -> str:
    half = (MAX_NAME_LENGTH - 3) // 2
    return name if len(name) <= MAX_NAME_LENGTH else f"{name[:half]}...{name[-half:]}"


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
