"""Everything that is wrong with a text, or worth a warning, as an editor shows it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from scenegen.api.hopeless import hopeless
from scenegen.bounds import label_bounds
from scenegen.errors import Diagnostic, ScenegenError, Span
from scenegen.lang.core import REQUIRE, gated
from scenegen.lang.spec import CheckedSpec
from scenegen.lsp.document import Document


@dataclass(frozen=True, slots=True)
class Problem:
    """Characters `start` to `end` of the open text, and what to say about them. `elsewhere` is the place in another
    file that the problem is really at; `unused` marks what could be removed."""

    start: int
    end: int
    message: str
    severity: Literal["error", "warning"]
    unused: bool = False
    elsewhere: Span | None = None


def problems(document: Document) -> list[Problem]:
    """The problems of a document, in no particular order."""
    checked = document.checked
    if not isinstance(checked, CheckedSpec):
        return [_problem(document, one) for one in checked]
    found = [_problem(document, one) for one in checked.warnings]
    beyond = list(_overflow(document, checked))
    return found + (beyond or [_problem(document, one) for one in hopeless(checked)])


def _problem(document: Document, one: Diagnostic) -> Problem:
    said = [one.title, one.label, f"note: {one.note}" if one.note else "", f"help: {one.help}" if one.help else ""]
    message = "\n".join(part for part in said if part)
    unused = one.severity == "warning" and one.title.endswith("is never used")
    if one.span is None:
        return Problem(0, 0, message, one.severity)
    if one.span.source.name == document.source.name:
        return Problem(one.span.start, max(one.span.start, one.span.end), message, one.severity, unused)
    start, end = _importing(document, one.span)
    return Problem(start, end, f"{one.span.place}: {message}", one.severity, unused, one.span)


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


def _overflow(document: Document, spec: CheckedSpec) -> Iterator[Problem]:
    """Labels and requirements whose phi goes beyond what computers can hold."""
    core = gated(spec.core)
    with np.errstate(over="ignore", invalid="ignore"):
        lowest, highest = label_bounds(core, *spec.box())
    for name, low, high in zip(core.labels, lowest, highest, strict=True):
        if not (np.isfinite(low) and np.isfinite(high)):
            message = f"phi of `{name}` can be larger than a computer's numbers\nhelp: use smaller constants"
            yield Problem(*_place(document, name), message, "error")


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
