"""What scenegen tells people when something is wrong.

Every problem a user can cause is a `Diagnostic`: a title, optionally a place in a text (a spec file, or an option as it
was typed), a label under the caret and a line of help. Problems travel in `ScenegenError`; `render` is the only code
that turns them into text, for terminals, pipes and notebooks alike, and `to_json` into data for editors and scripts.
"""

from __future__ import annotations

import difflib
import heapq
import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Literal

TAB = 4  # columns a tab takes in a printed source line
WIDTH = 100  # columns of a source line that are shown around the caret
LONGEST_NAME = 80  # characters of a `quoted` name; the middle of a longer one is left out
MOST_ALIKE = 500  # known names that a misspelt one is held against
LONGEST = 1000  # characters of a title, label, note or help


@dataclass(frozen=True, slots=True)
class Source:
    """A text that diagnostics can point into: a file, or an option as typed (`name` is then `--phi`)."""

    name: str
    text: str

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


@dataclass(frozen=True, slots=True)
class Diagnostic:
    """One problem: what (title), where (span and the label under it), what to do (help)."""

    title: str
    span: Span | None = None
    label: str = ""
    help: str = ""
    severity: Literal["error", "warning"] = "error"
    note: str = ""


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
    """The spec's text is at fault."""


class RequestError(ScenegenError, ValueError):
    """What was asked for is at fault: a range, a count, a label, an option's value."""


class DataError(ScenegenError, ValueError):
    """A scenes file, a model file or an array of poses is at fault."""


class OutputError(ScenegenError, OSError):
    """Something could not be written."""


def quoted(names: Iterable[str]) -> str:
    """`a`, `b` and `c`, in the order given."""
    items = [f"`{name}`" for name in names]
    return items[0] if len(items) == 1 else ", ".join(items[:-1]) + f" and {items[-1]}" if items else "none"


def nearest(name: str, known: Iterable[str]) -> str | None:
    """The known name that `name` most likely stands for: the same but for case, else a close match, else None."""
    name, names = str(name), sorted(set(known))  # whoever calls from Python may have given anything
    folded = {candidate.casefold().replace("_", ""): candidate for candidate in reversed(names)}
    exact = folded.get(name.casefold().replace("_", ""))
    if exact is not None:
        return exact
    wanted, candidates = name.casefold(), list(folded)
    if len(candidates) > MOST_ALIKE:  # difflib takes its time: of very many look at those that begin alike
        candidates = heapq.nlargest(MOST_ALIKE, candidates, key=lambda one: _alike(one, wanted))
    close = difflib.get_close_matches(wanted, candidates, n=1, cutoff=0.6)
    return folded[close[0]] if close and _near(wanted, close[0]) else None


def _near(one: str, other: str) -> bool:
    """Whether one of two words can be a slip for the other: `usd` is none for `sdf`, though most letters are the same.

    A third of the letters may be wrong, missing or too many, and at least one; neighbours that changed places count
    once. Longer words may also differ in what stands at one end (`block` and `block_tower`).
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


def suggest(name: str, known: Iterable[str], otherwise: str = "") -> str:
    """A help line that names the nearest known name, or `otherwise`."""
    match = nearest(name, known)
    return f"did you mean `{match}`?" if match is not None and match != name else otherwise


_STYLES = {
    "error": "\x1b[1;31m",
    "warning": "\x1b[1;33m",
    "frame": "\x1b[1;34m",
    "help": "\x1b[1;36m",
    "bold": "\x1b[1m",
}


def _paint(text: str, style: str, color: bool) -> str:
    return f"{_STYLES[style]}{text}\x1b[0m" if color else text


def _printable(text: str) -> str:
    """The text with tabs widened and control characters shown as a dot, so that a caret stays under its character."""
    return "".join(" " * TAB if char == "\t" else char if char.isprintable() else "\u00b7" for char in text)


def _cut(text: str) -> str:
    """The text without the middle of names that would flood a terminal, and with an end."""
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


def render(diagnostic: Diagnostic, *, color: bool = False) -> str:
    """The text of one diagnostic, several lines, without a final line break.

    Of a place that reaches over several lines the first is shown, with the number of the last. Very long names are cut
    in the middle: `Diagnostic` and `to_json` have them whole.
    """
    out = [
        _paint(diagnostic.severity, diagnostic.severity, color) + _paint(f": {_cut(diagnostic.title)}", "bold", color),
    ]
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
        label = " ".join(["", *filter(None, [_cut(diagnostic.label), f"(to line {last})" if last > number else ""])])
        out.append(f"{gutter}{_paint('-->', 'frame', color)} {span.place}")
        out.append(f"{gutter} {bar}")
        out.append(f"{_paint(str(number), 'frame', color)} {bar} {_printable(shown)}".rstrip())
        out.append(f"{gutter} {bar} {pad}{_paint(carets + label, diagnostic.severity, color)}")
    for kind, text in (("note", diagnostic.note), ("help", diagnostic.help)):
        if text:
            first, *rest = _cut(text).splitlines()
            out.append(f"{gutter} {_paint(f'= {kind}:', 'help', color)} {first}")
            out.extend(f"{gutter}   {' ' * len(kind)}  {line}" for line in rest)
    return "\n".join(out)


def render_all(diagnostics: Iterable[Diagnostic], *, color: bool = False) -> str:
    """Several diagnostics, parted by blank lines."""
    return "\n\n".join(render(diagnostic, color=color) for diagnostic in diagnostics)


def to_json(diagnostic: Diagnostic) -> dict[str, Any]:
    """A diagnostic as data, shaped like those of the Language Server Protocol.

    `severity`, `message`, `label`, `help` and `note` are always there ("" where there is nothing to say). Where the
    problem has a place there are also `file` and `range`, whose `start` and exclusive `end` have a 0-based `line` and
    `character` in UTF-16 code units, as that protocol counts.
    """
    found: dict[str, Any] = {
        "severity": diagnostic.severity,
        "message": diagnostic.title,
        "label": diagnostic.label,
        "help": diagnostic.help,
        "note": diagnostic.note,
    }
    if diagnostic.span is not None:
        span = diagnostic.span
        found["file"] = span.source.name
        found["range"] = {
            name: dict(zip(("line", "character"), span.source.utf16(offset), strict=True))
            for name, offset in (("start", span.start), ("end", max(span.start, span.end)))
        }
    return found
