"""What the features find, as the JSON of the Language Server Protocol."""

from __future__ import annotations

import logging
import re
from bisect import bisect_right
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from itertools import accumulate
from pathlib import Path
from typing import Any

import numpy as np

from scenegen.api.feasibility import idle, infeasible
from scenegen.editors.lsp.completion import CompletionItem, completions
from scenegen.editors.lsp.document import Document, prelude_index
from scenegen.editors.lsp.hover import hover
from scenegen.editors.lsp.names import Binding, Kind, Occurrence, functions
from scenegen.errors import Diagnostic, ScenegenError, Severity, Span, SpecError
from scenegen.errors.diagnostic import as_json
from scenegen.errors.language import PHI_TOO_LARGE, UNUSED_NAME
from scenegen.errors.program import INTERNAL_ERROR
from scenegen.lang.check.scope import BUILT_IN
from scenegen.lang.formula.core import REQUIRE, gate
from scenegen.lang.spec import CheckedSpec
from scenegen.lang.syntax.printer import format_source
from scenegen.lang.syntax.tokens import KEYWORDS
from scenegen.search import label_bounds


@dataclass(frozen=True, slots=True)
class SourceLocation:
    """Characters of a file; `path` and `text` are None for the open document itself."""

    path: Path | None
    text: str | None
    start: int
    end: int


@dataclass(frozen=True, slots=True)
class Symbol:
    """A declaration: its name at start..end, all of it at opens..closes, and what its line says."""

    name: str
    kind: Kind
    detail: str
    start: int
    end: int
    opens: int
    closes: int


def definition(document: Document, offset: int) -> SourceLocation | None:
    """Where the name at an offset is declared, or the beginning of the file that an `import` names."""
    found = document.occurrence(offset)
    if found is None:
        return None
    if found.role == "import":
        try:
            path = document.project().find(found.name, Span(document.source, found.start, found.end))
        except ScenegenError:
            return None
        return SourceLocation(path, "", 0, 0) if path.is_file() else None
    binding = document.meaning(found)
    if binding is None:
        return None
    if binding.source is document.source:
        return SourceLocation(None, None, binding.start, binding.end)
    return SourceLocation(binding.path, binding.source.text, binding.start, binding.end)


def symbols(document: Document) -> list[Symbol]:
    """What the file declares, in the order of the text."""
    found = []
    for one in document.index.declarations:
        detail = " ".join(document.text[one.end : one.closes].split()).lstrip("=: ")
        found.append(Symbol(one.name, one.kind, detail[:60], one.start, one.end, one.opens, max(one.end, one.closes)))
    return found


def uses(document: Document, offset: int) -> list[Occurrence]:
    """Every place of this file where the name at an offset has the same meaning; empty if it is declared in another
    file, built in, or unknown."""
    found = document.occurrence(offset)
    binding = document.meaning(found) if found is not None else None
    if binding is None or binding.source is not document.source:
        return []
    same = [one for one in document.index.occurrences if one.name == binding.name]
    return [one for one in same if document.meaning(one) is binding]


def refusal(document: Document, offset: int, name: str) -> str:
    """Why the name at an offset cannot become `name`; "" if it can."""
    places = uses(document, offset)
    if not places:
        return "only names that this file declares can be renamed"
    if not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]*", name):
        return "names are made of the letters a-z and A-Z, digits and `_`"
    if name in KEYWORDS or name in BUILT_IN:
        return f"`{name}` is a word of the language"
    binding = document.meaning(places[0])
    assert binding is not None
    if binding.kind == "definition":
        taken = name in document.functions or name in functions()
    elif binding.kind in ("parameter", "variable"):
        taken = _is_in_reach(document, binding, name) or name in document.values
    else:
        prelude = {one.name for one in prelude_index().declarations}
        locals_ = {reach.binding.name for reach in document.index.reaches}
        taken = (name in document.values and not (binding.kind == "constant" and name in prelude)) or name in locals_
    return f"`{name}` means something else already" if taken else ""


def _is_in_reach(document: Document, binding: Binding, name: str) -> bool:
    """Whether a parameter or variable of that name can be used where this one can."""
    reaches = document.index.reaches
    own = [one for one in reaches if one.binding is binding]
    others = [one for one in reaches if one.binding.name == name]
    return any(one.start < mine.end and mine.start < one.end for one in others for mine in own)


@dataclass(frozen=True, slots=True)
class DocumentProblem:
    """Characters `start` to `end` of the open text, what to say about them, and the diagnostic's facts as JSON.
    `elsewhere` is the place in another file that the problem is really at; `unused` marks what could be removed."""

    start: int
    end: int
    message: str
    code: str
    severity: Severity
    facts: dict[str, Any]
    unused: bool = False
    elsewhere: Span | None = None


def problems(document: Document) -> list[DocumentProblem]:
    """The problems of a document, in no particular order."""
    checked = document.checked
    if not isinstance(checked, CheckedSpec):
        return [_problem(document, one) for one in checked]
    found = [_problem(document, one) for one in checked.warnings]
    if checked.timed is not None:
        return found  # bounds and clashes are those of single scenes
    beyond = list(_overflow(document, checked))
    return found + (beyond or [_problem(document, one) for one in (*infeasible(checked), *idle(checked))])


def _problem(document: Document, one: Diagnostic) -> DocumentProblem:
    said = [one.title, one.label, f"note: {one.note}" if one.note else "", f"help: {one.help}" if one.help else ""]
    message = "\n".join(part for part in said if part)
    found = DocumentProblem(0, 0, message, one.code, one.severity, as_json(one.facts), one.kind == UNUSED_NAME)
    if one.span is None:
        return found
    if one.span.source.name == document.source.name:
        return replace(found, start=one.span.start, end=max(one.span.start, one.span.end))
    start, end = _importing(document, one.span)
    return replace(found, start=start, end=end, message=f"{one.span.place}: {message}", elsewhere=one.span)


def _importing(document: Document, span: Span) -> tuple[int, int]:
    """The text of the `import` that brings in a file, the first one where it came by another file."""
    links = document.index.imports
    project = document.project()
    for link in links:
        try:
            path = project.find(link.name, Span(document.source, link.start, link.end))
        except ScenegenError:
            continue
        if path == Path(span.source.name).resolve():
            return link.start, link.end
    return (links[0].start, links[0].end) if links else (0, 0)


def _overflow(document: Document, spec: CheckedSpec) -> Iterator[DocumentProblem]:
    """Labels and requirements whose phi goes beyond what computers can hold."""
    core = gate(spec.core)
    with np.errstate(over="ignore", invalid="ignore"):
        lowest, highest = label_bounds(core, *spec.box())
    for name, low, high in zip(core.labels, lowest, highest, strict=True):
        if not (np.isfinite(low) and np.isfinite(high)):
            start, end = _place(document, name)
            yield replace(_problem(document, PHI_TOO_LARGE(label=name)), start=start, end=end)


def _place(document: Document, name: str) -> tuple[int, int]:
    for one in document.index.declarations:
        if one.kind == "label" and one.name == name:
            return one.start, one.end
    for statement in document.index.statements:
        if statement.kind == REQUIRE == name:
            first = statement.tokens[0]
            return first.start, first.end
    formula = next((one for one in document.index.statements if one.kind == "formula"), None)
    return (formula.start, formula.end) if formula is not None else (0, 0)


# Places in a text: character offsets, and the lines and characters that editors count in.
# An editor's `character` counts UTF-16 code units unless client and server agreed on UTF-8 bytes or on UTF-32. Lines
# end at `\n`; `\r\n` and `\r` count as one break too, so a text keeps its positions when its breaks are made plain.
# encoding -> how many units one character takes
_CODE_UNITS: Mapping[str, Callable[[str], int]] = {
    "utf-8": lambda char: len(char.encode("utf-8", "surrogatepass")),
    "utf-16": lambda char: 1 + (char > "\uffff"),
    "utf-32": lambda char: 1,
}


class EncodedLines:
    """The lines of a text with plain line breaks, in one of the encodings that language servers know."""

    def __init__(self, text: str, encoding: str = "utf-16") -> None:
        self.text, self.encoding = text, encoding
        self._units = _CODE_UNITS[encoding]
        self._starts = [0, *accumulate(len(line) + 1 for line in text.split("\n")[:-1])]

    def position(self, offset: int) -> tuple[int, int]:
        """0-based line and character of an offset; beyond the text it is the text's end."""
        offset = min(max(offset, 0), len(self.text))
        line = bisect_right(self._starts, offset) - 1
        before = self.text[self._starts[line] : offset]
        return line, len(before) if before.isascii() else sum(map(self._units, before))

    def offset(self, line: int, character: int) -> int:
        """The offset of a position. Beyond a line's end it is that end, inside a character that character's start."""
        if line >= len(self._starts):
            return len(self.text)
        start = self._starts[max(line, 0)]
        end = self.text.find("\n", start)
        words = self.text[start : len(self.text) if end < 0 else end]
        if words.isascii():
            return start + min(max(character, 0), len(words))
        for place, char in enumerate(words):
            character -= self._units(char)
            if character < 0:
                return start + place
        return start + len(words)


@dataclass(frozen=True, slots=True)
class Change:
    """`text` takes the place of characters `start` to `end`."""

    start: int
    end: int
    text: str


def formatting_change(document: Document) -> Change | None:
    """The change that turns the document into its canonical layout; None if it has that already, or does not parse."""
    try:
        wanted = format_source(document.source)
    except SpecError:
        return None
    if wanted == document.text:
        return None
    old, new = document.text.splitlines(keepends=True), wanted.splitlines(keepends=True)
    head = 0
    while head < min(len(old), len(new)) and old[head] == new[head]:
        head += 1
    tail = 0
    while tail < min(len(old), len(new)) - head and old[-1 - tail] == new[-1 - tail]:
        tail += 1
    start = sum(map(len, old[:head]))
    end = len(document.text) - sum(map(len, old[len(old) - tail :]))
    return Change(start, end, "".join(new[head : len(new) - tail]))


Json = dict[str, Any]

ERROR, WARNING, UNNECESSARY = 1, 2, 1  # DiagnosticSeverity, DiagnosticTag
LSP_LOG = logging.getLogger("scenegen.editors.lsp")

# CompletionItemKind
_ITEMS: Mapping[str, int] = {
    "keyword": 14,
    "function": 3,
    "definition": 3,
    "member": 10,  # a property
    "unit": 11,
    "asset": 20,  # an enum member
    "argument": 5,  # a field
    "file": 17,
    "object": 6,  # a variable
    "region": 22,  # a struct
    "camera": 22,
    "constant": 21,
    "label": 23,  # an event
    "parameter": 25,
    "variable": 25,
}
# SymbolKind: object, struct, constant, function, event
_SYMBOLS: Mapping[str, int] = {"object": 19, "region": 23, "camera": 23, "constant": 14, "definition": 12, "label": 24}


class RequestRefused(Exception):  # noqa: N818 - what was wanted cannot be done, and the client learns why: no failure
    """A request that cannot be answered, with the reason."""


@dataclass(frozen=True, slots=True)
class Page:
    """One version of an open document, and how its client counts characters."""

    document: Document
    uri: str
    encoding: str = "utf-16"
    lines: EncodedLines = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "lines", EncodedLines(self.document.text, self.encoding))

    def span(self, start: int, end: int) -> Json:
        return _span(self.lines, start, end)


@dataclass(frozen=True, slots=True)
class Question:
    """A feature, the position that it is about (0-based), and the new name of a rename."""

    feature: str
    line: int = 0
    character: int = 0
    name: str = ""


def answer(page: Page, question: Question) -> Any:
    """The result of a request as JSON. An exception in a feature is logged, and the answer is empty. Raises
    RequestRefused."""
    try:
        return ANSWERS[question.feature](page, page.lines.offset(question.line, question.character), question)
    except RequestRefused:
        raise
    except Exception as error:  # no text may end the server
        LSP_LOG.exception("%s of %s failed", question.feature, page.uri)
        return failure(f"{type(error).__name__}: {error}") if question.feature == "diagnostics" else None


def failure(error: str) -> list[Json]:
    """The diagnostics of a text that could not be analysed, because of a bug or for lack of memory."""
    failed = INTERNAL_ERROR(error=error)
    problem = DocumentProblem(0, 0, failed.title, failed.code, failed.severity, as_json(failed.facts))
    return [_diagnostic(EncodedLines("", "utf-16"), problem)]


def _span(lines: EncodedLines, start: int, end: int) -> Json:
    """Characters start..end as a range."""
    places = [dict(zip(("line", "character"), lines.position(at), strict=True)) for at in (start, end)]
    return {"start": places[0], "end": places[1]}


def _diagnostic(lines: EncodedLines, problem: DocumentProblem) -> Json:
    found: Json = {
        "range": _span(lines, problem.start, problem.end),
        "message": problem.message,
        "code": problem.code,
        "severity": ERROR if problem.severity == "error" else WARNING,
        "source": "scenegen",
        "data": {"facts": problem.facts},
    }
    if problem.unused:
        found["tags"] = [UNNECESSARY]
    if problem.elsewhere is not None:
        other = problem.elsewhere
        place = _span(EncodedLines(other.source.text, lines.encoding), other.start, other.end)
        location = {"uri": Path(other.source.name).resolve().as_uri(), "range": place}
        found["relatedInformation"] = [{"location": location, "message": "it is here"}]
    return found


def _diagnostics(page: Page, offset: int, question: Question) -> list[Json]:
    return [_diagnostic(page.lines, one) for one in problems(page.document)]


def _hover(page: Page, offset: int, question: Question) -> Json | None:
    found = hover(page.document, offset)
    if found is None:
        return None
    return {"contents": {"kind": "markdown", "value": found.markdown}, "range": page.span(found.start, found.end)}


def _completion(page: Page, offset: int, question: Question) -> Json:
    spans: dict[tuple[int, int], Json] = {}  # there are thousands of items, most of them with the same place
    items = []
    for order, one in enumerate(completions(page.document, offset)):
        place = (one.start, one.end)
        if place not in spans:
            spans[place] = page.span(*place)
        items.append(_item(one, order, spans[place]))
    return {"isIncomplete": False, "items": items}


def _item(item: CompletionItem, order: int, place: Json) -> Json:
    found: Json = {
        "label": item.word,
        "kind": _ITEMS[item.group],
        "sortText": f"{order:06}",
        "textEdit": {"range": place, "newText": item.word},
    }
    if item.detail:
        found["detail"] = item.detail
    if item.about:
        found["documentation"] = item.about
    return found


def _definition(page: Page, offset: int, question: Question) -> Json | None:
    place = definition(page.document, offset)
    if place is None:
        return None
    if place.path is None or place.text is None:
        return {"uri": page.uri, "range": page.span(place.start, place.end)}
    return {
        "uri": place.path.resolve().as_uri(),
        "range": _span(EncodedLines(place.text, page.encoding), place.start, place.end),
    }


def _symbols(page: Page, offset: int, question: Question) -> list[Json]:
    return [_symbol(page, one) for one in symbols(page.document)]


def _symbol(page: Page, found: Symbol) -> Json:
    return {
        "name": found.name,
        "kind": _SYMBOLS[found.kind],
        **({"detail": found.detail} if found.detail else {}),
        "range": page.span(found.opens, found.closes),
        "selectionRange": page.span(found.start, found.end),
    }


def _formatting(page: Page, offset: int, question: Question) -> list[Json]:
    found = formatting_change(page.document)
    return [] if found is None else [{"range": page.span(found.start, found.end), "newText": found.text}]


def _prepare_rename(page: Page, offset: int, question: Question) -> Json | None:
    found = page.document.occurrence(offset)
    return page.span(found.start, found.end) if found is not None and uses(page.document, offset) else None


def _rename(page: Page, offset: int, question: Question) -> Json:
    reason = refusal(page.document, offset, question.name)
    if reason:
        raise RequestRefused(reason)
    places = uses(page.document, offset)
    return {
        "changes": {page.uri: [{"range": page.span(one.start, one.end), "newText": question.name} for one in places]}
    }


ANSWERS: Mapping[str, Callable[[Page, int, Question], Any]] = {
    "diagnostics": _diagnostics,
    "hover": _hover,
    "completion": _completion,
    "definition": _definition,
    "symbols": _symbols,
    "formatting": _formatting,
    "prepareRename": _prepare_rename,
    "rename": _rename,
}
