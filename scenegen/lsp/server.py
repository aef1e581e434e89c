"""The language server: the features of this folder, wired to the protocol over standard input and output."""

from __future__ import annotations

import asyncio
import functools
import inspect
import logging
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from lsprotocol import types
from pygls.exceptions import JsonRpcException
from pygls.lsp.server import LanguageServer
from pygls.uris import to_fs_path

from scenegen.lsp import protocol
from scenegen.lsp.complete import complete
from scenegen.lsp.define import definition, refusal, symbols, uses
from scenegen.lsp.diagnose import Problem, problems
from scenegen.lsp.document import Document
from scenegen.lsp.format import formatted
from scenegen.lsp.hover import hover
from scenegen.lsp.positions import Lines

PAUSE = 0.05  # seconds without a further change after which a text is checked
LOG = logging.getLogger("scenegen.lsp")


class Refusal(JsonRpcException):
    """What a client asked for cannot be done, and it is told why: no failure of the server."""

    CODE = types.LSPErrorCodes.RequestFailed.value


class Desk:
    """The open documents of one client. Every handler works on the text as the client has it now."""

    def __init__(self, server: LanguageServer, root: Path | None) -> None:
        self.server = server
        self.root = root
        self._documents: dict[str, Document] = {}
        self._waiting: dict[str, object] = {}  # texts to be checked, each with a mark of its last change

    # ---- documents

    @property
    def encoding(self) -> str:
        return str(getattr(self.server.workspace.position_encoding, "value", self.server.workspace.position_encoding))

    def document(self, uri: str) -> Document:
        """The document at a URI, its work done so far included; without text where the client has not opened it."""
        if uri not in self._documents:
            open_ = self.server.workspace.text_documents
            texts = {path.resolve(): one.source for key, one in open_.items() if (path := _path(key)) is not None}
            text = open_[uri].source if uri in open_ else ""
            self._documents[uri] = Document(text, _path(uri), uri, texts, self.root)
        return self._documents[uri]

    def _at(self, params: Any) -> tuple[str, Document, Lines, int]:
        """The URI, document, lines and offset that a request is about; the offset is 0 where it names none."""
        uri = params.text_document.uri
        document = self.document(uri)
        lines = Lines(document.text, self.encoding)
        position = getattr(params, "position", None)
        return uri, document, lines, lines.offset(position.line, position.character) if position is not None else 0

    def _forget(self, uri: str) -> list[str]:
        """Drop what is known of a changed document and of those that import something; returns the latter."""
        self._documents.pop(uri, None)
        others = [key for key, one in self._documents.items() if one.index.imports]
        for other in others:
            del self._documents[other]
        return others

    # ---- notifications

    async def changed(self, params: Any) -> None:
        """A text was opened, changed or saved: say what is wrong with it, unless it changes again at once."""
        uri = params.text_document.uri
        mark = object()
        self._waiting |= dict.fromkeys((uri, *self._forget(uri)), mark)
        await asyncio.sleep(PAUSE)
        for one in [key for key, last in self._waiting.items() if last is mark]:
            del self._waiting[one]
            if one in self.server.workspace.text_documents:
                self._publish(one)

    def closed(self, params: types.DidCloseTextDocumentParams) -> None:
        self._forget(params.text_document.uri)
        empty = types.PublishDiagnosticsParams(params.text_document.uri, [])
        self.server.text_document_publish_diagnostics(empty)

    def _publish(self, uri: str) -> None:
        document = self.document(uri)
        lines = Lines(document.text, self.encoding)
        try:
            found = problems(document)
        except Exception as error:  # nothing that a text holds may end the server
            LOG.exception("checking %s failed", uri)
            found = [Problem(0, 0, f"scenegen itself failed: {type(error).__name__}: {error}", "error")]
        version = self.server.workspace.text_documents[uri].version
        told = types.PublishDiagnosticsParams(
            uri, [protocol.diagnostic(lines, one, self.encoding) for one in found], version
        )
        self.server.text_document_publish_diagnostics(told)

    # ---- requests

    def hover(self, params: types.HoverParams) -> types.Hover | None:
        _, document, lines, offset = self._at(params)
        found = hover(document, offset)
        return protocol.hover(lines, found) if found is not None else None

    def completion(self, params: types.CompletionParams) -> types.CompletionList:
        _, document, lines, offset = self._at(params)
        items = [protocol.completion(lines, one, order) for order, one in enumerate(complete(document, offset))]
        return types.CompletionList(is_incomplete=False, items=items)

    def definition(self, params: types.DefinitionParams) -> types.Location | None:
        uri, document, lines, offset = self._at(params)
        found = definition(document, offset)
        return protocol.location(uri, lines, found, self.encoding) if found is not None else None

    def symbols(self, params: types.DocumentSymbolParams) -> list[types.DocumentSymbol]:
        _, document, lines, _ = self._at(params)
        return [protocol.symbol(lines, one) for one in symbols(document)]

    def formatting(self, params: types.DocumentFormattingParams) -> list[types.TextEdit]:
        _, document, lines, _ = self._at(params)
        found = formatted(document)
        return [protocol.change(lines, found)] if found is not None else []

    def prepare_rename(self, params: types.PrepareRenameParams) -> types.Range | None:
        _, document, lines, offset = self._at(params)
        found = document.occurrence(offset)
        return protocol.span(lines, found.start, found.end) if found is not None and uses(document, offset) else None

    def rename(self, params: types.RenameParams) -> types.WorkspaceEdit:
        uri, document, lines, offset = self._at(params)
        reason = refusal(document, offset, params.new_name)
        if reason:
            raise Refusal(reason)
        return protocol.renaming(uri, lines, document, offset, params.new_name)


def _path(uri: str) -> Path | None:
    """The file of a URI, None where it names none: an unsaved text."""
    found = to_fs_path(uri) if uri.startswith("file:") else None
    return Path(found) if found else None


def build(root: Path | None = None) -> LanguageServer:
    """A server with every feature, not yet started."""
    from scenegen.version import __version__

    server = LanguageServer("scenegen", __version__, text_document_sync_kind=types.TextDocumentSyncKind.Full)
    desk = Desk(server, root)
    triggers = types.CompletionOptions(trigger_characters=[".", '"'])
    features: list[tuple[str, Callable[..., Any], Any]] = [
        (types.TEXT_DOCUMENT_DID_OPEN, desk.changed, None),
        (types.TEXT_DOCUMENT_DID_CHANGE, desk.changed, None),
        (types.TEXT_DOCUMENT_DID_SAVE, desk.changed, None),
        (types.TEXT_DOCUMENT_DID_CLOSE, desk.closed, None),
        (types.TEXT_DOCUMENT_HOVER, desk.hover, None),
        (types.TEXT_DOCUMENT_COMPLETION, desk.completion, triggers),
        (types.TEXT_DOCUMENT_DEFINITION, desk.definition, None),
        (types.TEXT_DOCUMENT_DOCUMENT_SYMBOL, desk.symbols, None),
        (types.TEXT_DOCUMENT_FORMATTING, desk.formatting, None),
        (types.TEXT_DOCUMENT_PREPARE_RENAME, desk.prepare_rename, None),
        (types.TEXT_DOCUMENT_RENAME, desk.rename, types.RenameOptions(prepare_provider=True)),
    ]
    for name, handler, options in features:
        server.feature(name, options)(guarded(handler))
    return server


def guarded(handler: Callable[..., Any]) -> Callable[..., Any]:
    """A handler whose failures are logged and answered with nothing, refusals of a request excepted."""
    if inspect.iscoroutinefunction(handler):

        @functools.wraps(handler)
        async def wait(params: Any) -> Any:
            try:
                return await handler(params)
            except Exception:
                LOG.exception("%s failed", handler.__name__)

        return wait

    @functools.wraps(handler)
    def answer(params: Any) -> Any:
        try:
            return handler(params)
        except Refusal:
            raise
        except Exception:
            LOG.exception("%s failed", handler.__name__)
            return None

    return answer


def serve(root: Path | None = None) -> None:
    """Answer one client over standard input and output until it says goodbye; messages go to standard error."""
    messages = logging.StreamHandler(sys.stderr)
    messages.addFilter(lambda record: record.exc_info is None or not isinstance(record.exc_info[1], Refusal))
    logging.basicConfig(handlers=[messages], level=logging.WARNING, format="%(name)s: %(message)s")
    sys.stdout.flush()
    with os.fdopen(os.dup(1), "wb") as out:
        os.dup2(2, 1)  # whatever else writes to standard output would break the protocol
        build(root).start_io(sys.stdin.buffer, out)
