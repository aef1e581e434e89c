"""Everything that is wrong with a text, or worth a warning, as an editor shows it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from scenegen.api.feasibility import idle, infeasible
from scenegen.editors.lsp.document import Document
from scenegen.errors import Diagnostic, ScenegenError, Severity, Span
from scenegen.errors.diagnostic import as_json
from scenegen.errors.language import PHI_TOO_LARGE, UNUSED_NAME
from scenegen.lang.formula.core import REQUIRE, gated
from scenegen.lang.spec import CheckedSpec
from scenegen.search import label_bounds


@dataclass(frozen=True, slots=True)
class Problem:
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


def problems(document: Document) -> list[Problem]:
    """The problems of a document, in no particular order."""
    checked = document.checked
    if not isinstance(checked, CheckedSpec):
        return [_problem(document, one) for one in checked]
    found = [_problem(document, one) for one in checked.warnings]
    if checked.timed is not None:
        return found  # bounds and clashes are those of single scenes
    beyond = list(_overflow(document, checked))
    return found + (beyond or [_problem(document, one) for one in (*infeasible(checked), *idle(checked))])


def _problem(document: Document, one: Diagnostic) -> Problem:
    said = [one.title, one.label, f"note: {one.note}" if one.note else "", f"help: {one.help}" if one.help else ""]
    message = "\n".join(part for part in said if part)
    found = Problem(0, 0, message, one.code, one.severity, as_json(one.facts), one.kind == UNUSED_NAME)
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


def _overflow(document: Document, spec: CheckedSpec) -> Iterator[Problem]:
    """Labels and requirements whose phi goes beyond what computers can hold."""
    core = gated(spec.core)
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
