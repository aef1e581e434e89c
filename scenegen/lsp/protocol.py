"""What the features find, in the types of the Language Server Protocol."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from lsprotocol import types

from scenegen.lsp.complete import Item
from scenegen.lsp.define import Place, Symbol, uses
from scenegen.lsp.diagnose import Problem
from scenegen.lsp.document import Document
from scenegen.lsp.format import Change
from scenegen.lsp.hover import Hover
from scenegen.lsp.positions import Lines

_ITEMS: Mapping[str, types.CompletionItemKind] = {
    "keyword": types.CompletionItemKind.Keyword,
    "function": types.CompletionItemKind.Function,
    "definition": types.CompletionItemKind.Function,
    "member": types.CompletionItemKind.Property,
    "unit": types.CompletionItemKind.Unit,
    "asset": types.CompletionItemKind.EnumMember,
    "argument": types.CompletionItemKind.Field,
    "file": types.CompletionItemKind.File,
    "object": types.CompletionItemKind.Variable,
    "region": types.CompletionItemKind.Struct,
    "constant": types.CompletionItemKind.Constant,
    "label": types.CompletionItemKind.Event,
    "parameter": types.CompletionItemKind.TypeParameter,
    "variable": types.CompletionItemKind.TypeParameter,
}
_SYMBOLS: Mapping[str, types.SymbolKind] = {
    "object": types.SymbolKind.Object,
    "region": types.SymbolKind.Struct,
    "constant": types.SymbolKind.Constant,
    "definition": types.SymbolKind.Function,
    "label": types.SymbolKind.Event,
}


def span(lines: Lines, start: int, end: int) -> types.Range:
    """Characters start..end as a range."""
    return types.Range(types.Position(*lines.position(start)), types.Position(*lines.position(end)))


def diagnostic(lines: Lines, problem: Problem, encoding: str) -> types.Diagnostic:
    severity = types.DiagnosticSeverity.Error if problem.severity == "error" else types.DiagnosticSeverity.Warning
    related = None
    if problem.elsewhere is not None:
        other = problem.elsewhere
        place = span(Lines(other.source.text, encoding), other.start, other.end)
        uri = Path(other.source.name).resolve().as_uri()
        related = [types.DiagnosticRelatedInformation(types.Location(uri, place), "it is here")]
    return types.Diagnostic(
        range=span(lines, problem.start, problem.end),
        message=problem.message,
        severity=severity,
        source="scenegen",
        tags=[types.DiagnosticTag.Unnecessary] if problem.unused else None,
        related_information=related,
    )


def hover(lines: Lines, found: Hover) -> types.Hover:
    contents = types.MarkupContent(types.MarkupKind.Markdown, found.markdown)
    return types.Hover(contents, span(lines, found.start, found.end))


def completion(lines: Lines, item: Item, order: int) -> types.CompletionItem:
    return types.CompletionItem(
        label=item.word,
        kind=_ITEMS[item.group],
        detail=item.detail or None,
        documentation=item.about or None,
        sort_text=f"{order:04}",
        text_edit=types.TextEdit(span(lines, item.start, item.end), item.word),
    )


def location(uri: str, lines: Lines, place: Place, encoding: str) -> types.Location:
    if place.path is None or place.text is None:
        return types.Location(uri, span(lines, place.start, place.end))
    return types.Location(place.path.resolve().as_uri(), span(Lines(place.text, encoding), place.start, place.end))


def symbol(lines: Lines, found: Symbol) -> types.DocumentSymbol:
    return types.DocumentSymbol(
        name=found.name,
        kind=_SYMBOLS[found.kind],
        detail=found.detail or None,
        range=span(lines, found.opens, found.closes),
        selection_range=span(lines, found.start, found.end),
    )


def change(lines: Lines, found: Change) -> types.TextEdit:
    return types.TextEdit(span(lines, found.start, found.end), found.text)


def renaming(uri: str, lines: Lines, document: Document, offset: int, name: str) -> types.WorkspaceEdit:
    edits = [types.TextEdit(span(lines, one.start, one.end), name) for one in uses(document, offset)]
    return types.WorkspaceEdit(changes={uri: edits})
