"""The language server: the features of this folder, wired to pygls, which talks to the editor."""

from __future__ import annotations

import asyncio
import contextlib
import functools
import logging
import os
import re
import sys
import threading
from collections.abc import Callable, Coroutine
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO

from lsprotocol import types
from lsprotocol.converters import get_converter
from pygls.exceptions import FeatureRequestError, JsonRpcContentModified, JsonRpcException
from pygls.io_ import StdoutWriter, run_async
from pygls.lsp.server import LanguageServer
from pygls.protocol import LanguageServerProtocol
from pygls.uris import to_fs_path

from scenegen.editors.lsp.analysis import AnalysisEnded, AnalysisProcesses
from scenegen.editors.lsp.answers import Page, Question, RequestRefused, answer, failure
from scenegen.editors.lsp.document import Document
from scenegen.processes.process import exit_status

PAUSE, LONGEST_PAUSE = 0.05, 1.0  # seconds without a further change after which a text is checked
WATCH_SECONDS = 2.0  # seconds between two looks at the client's process
MAX_HEADER_BYTES = 1 << 26  # bytes of a line of a message's head
LOG = logging.getLogger("scenegen.editors.lsp")

_IMPORT = re.compile(r'\bimport\s*"')

# Requests that need no more than the names in a text are answered at once, others by another process.
_OF_NAMES: list[tuple[str, str, Any]] = [
    (types.TEXT_DOCUMENT_COMPLETION, "completion", types.CompletionOptions(trigger_characters=[".", '"'])),
    (types.TEXT_DOCUMENT_DEFINITION, "definition", None),
    (types.TEXT_DOCUMENT_DOCUMENT_SYMBOL, "symbols", None),
    (types.TEXT_DOCUMENT_FORMATTING, "formatting", None),
    (types.TEXT_DOCUMENT_PREPARE_RENAME, "prepareRename", None),
    (types.TEXT_DOCUMENT_RENAME, "rename", types.RenameOptions(prepare_provider=True)),
]


class MessageReader(asyncio.StreamReader):
    """What a client sends; pygls knows one spelling of the head of a message."""

    async def readline(self) -> bytes:
        line = await super().readline()
        name, _, value = line.partition(b":")
        if name.strip().lower() != b"content-length":
            return line
        if not value.strip().isdigit():
            LOG.warning("a message is left out: its head says %r", line.strip())
        return b"Content-Length: %s\r\n" % value.strip()


class Protocol(LanguageServerProtocol):
    """That of pygls, with an answer to every request: also to one that is malformed, too early or too late."""

    def structure_message(self, data: dict[str, Any]) -> Any:
        if "jsonrpc" in data and "method" in data:
            data.setdefault("params", None)  # may be left out
        try:
            return super().structure_message(data)
        except JsonRpcException as error:
            if "id" in data and "method" in data:
                self._send_response(data["id"], error=error.to_response_error())
            raise

    def handle_message(self, message: Any) -> None:
        method, begun = getattr(message, "method", None), self._workspace is not None
        if method in (None, types.EXIT) or (begun != (method == types.INITIALIZE) and not self._shutdown):
            super().handle_message(message)
        elif hasattr(message, "id"):
            code = types.ErrorCodes.InvalidRequest if begun else types.ErrorCodes.ServerNotInitialized
            said = f"{method} has no place {'here any more' if begun else 'before initialize'}"
            self._send_response(message.id, error=types.ResponseError(code, said))


class RequestFailed(JsonRpcException):
    """A client's request cannot be fulfilled, and the answer says why: not a failure of the server."""

    CODE = types.LSPErrorCodes.RequestFailed.value


@dataclass(eq=False, slots=True)
class OpenText:
    """One version of a document that the client has open, and the questions about it that other processes have."""

    page: Page
    version: int | None
    asking: set[asyncio.Task[Any]] = field(default_factory=set)

    @property
    def imports(self) -> bool:
        return _IMPORT.search(self.page.document.text) is not None

    def forget(self) -> None:
        """The text has changed: its answers are of no use."""
        for task in self.asking:
            task.cancel()


class Server(LanguageServer):
    """A server with every feature, for one client. Errors are logged, not shown in the client's windows. Nothing
    outside `root` is read (default: each file's folder)."""

    def __init__(self, root: Path | None = None) -> None:
        from scenegen.resources import __version__

        full = types.TextDocumentSyncKind.Full
        super().__init__("scenegen", __version__, text_document_sync_kind=full, protocol_cls=Protocol)
        self._root = root
        self._open: dict[str, OpenText] = {}
        self._took: dict[str, float] = {}  # seconds of the last check of a document
        self._analyses = AnalysisProcesses()
        self._converter = get_converter()
        for method, handler in (
            (types.INITIALIZE, self._on_initialize),
            (types.TEXT_DOCUMENT_DID_OPEN, self._on_change),
            (types.TEXT_DOCUMENT_DID_CHANGE, self._on_change),
            (types.TEXT_DOCUMENT_DID_SAVE, self._on_save),
            (types.TEXT_DOCUMENT_DID_CLOSE, self._on_close),
            (types.TEXT_DOCUMENT_HOVER, self._hover),
        ):
            self.feature(method)(functools.partial(handler))
        for method, feature, options in _OF_NAMES:
            self.feature(method, options)(self._names(method, feature))

    def report_server_error(self, error: Exception, source: Any) -> None:
        if source is not FeatureRequestError:  # a request has its answer
            LOG.warning("%s", error)

    def _on_change(self, params: types.DidOpenTextDocumentParams | types.DidChangeTextDocumentParams) -> None:
        self._revise(params.text_document.uri)
        self._revise_importers(params.text_document.uri)

    def _on_save(self, params: types.DidSaveTextDocumentParams) -> None:
        """Files that no editor has open may have changed as well."""
        if params.text_document.uri in self._open:
            self._revise(params.text_document.uri)

    def _on_close(self, params: types.DidCloseTextDocumentParams) -> None:
        uri = params.text_document.uri
        if (one := self._open.pop(uri, None)) is not None:
            one.forget()
            self._publish(uri, None, [])
            self._revise_importers(uri)

    def _revise_importers(self, changed: str) -> None:
        for uri, one in list(self._open.items()):
            if uri != changed and one.imports:
                self._revise(uri)

    def _revise(self, uri: str) -> None:
        """A text has changed, or one that it may import: what is under way for the old one ends, the new one is
        checked."""
        if (old := self._open.get(uri)) is not None:
            old.forget()
        current = self.workspace.get_text_document(uri)
        text = current.source
        texts: dict[Path, str] = {}
        if _IMPORT.search(text) is not None:
            others = ((path_of(one.uri), one.source) for one in self.workspace.text_documents.values())
            texts = {path: source for path, source in others if path is not None}
        encoding = self.workspace.position_encoding
        page = Page(
            Document(text, path_of(uri), uri, texts, self._root), uri, str(getattr(encoding, "value", encoding))
        )
        self._open[uri] = one = OpenText(page, current.version)
        self._begin(one, self._check(one))

    async def _check(self, one: OpenText) -> None:
        """Send the diagnostics of a text, unless it changes soon: the longer a check takes, the later it begins."""
        uri, loop = one.page.uri, asyncio.get_running_loop()
        await asyncio.sleep(min(max(PAUSE, self._took.get(uri, 0.0) / 2.0), LONGEST_PAUSE))
        began = loop.time()
        try:
            found = await self._ask(one, Question("diagnostics"))
        except AnalysisEnded as how:
            LOG.error("the process that analyses %s %s", uri, how)
            found = failure(f"the process that analyses this document {how}")
        self._took[uri] = loop.time() - began
        self._publish(uri, one.version, found)

    def _publish(self, uri: str, version: int | None, found: list[dict[str, Any]]) -> None:
        told = {"uri": uri, "diagnostics": found, "version": version}
        self.text_document_publish_diagnostics(self._converter.structure(told, types.PublishDiagnosticsParams))

    def _names(self, method: str, feature: str) -> Callable[[Any], Any]:
        def ask(params: Any) -> Any:
            one = self._open.get(params.text_document.uri)
            if one is None:
                return None
            line, character = _place(params)
            try:
                found = answer(one.page, Question(feature, line, character, getattr(params, "new_name", "")))
            except RequestRefused as reason:
                raise RequestFailed(str(reason)) from None
            return self._to_protocol(method, found)

        return ask

    async def _hover(self, params: types.HoverParams) -> Any:
        one = self._open.get(params.text_document.uri)
        if one is None:
            return None
        asking = self._begin(one, self._ask(one, Question("hover", *_place(params))))
        try:
            return self._to_protocol(types.TEXT_DOCUMENT_HOVER, await asking)
        except AnalysisEnded as how:
            raise RequestFailed(f"the process that analyses this document {how}") from None
        except asyncio.CancelledError:
            if self._open.get(params.text_document.uri) is one:
                raise  # by the client
            raise JsonRpcContentModified("the text has changed") from None

    def _begin(self, one: OpenText, work: Coroutine[Any, Any, Any]) -> asyncio.Task[Any]:
        """Work that ends when the text changes."""
        task = asyncio.ensure_future(work)
        one.asking.add(task)
        task.add_done_callback(one.asking.discard)
        return task

    async def _ask(self, one: OpenText, question: Question) -> Any:
        page, document = one.page, one.page.document
        text = {
            "uri": page.uri,
            "text": document.text,
            "path": None if document.path is None else str(document.path),
            "open_texts": {str(path): other for path, other in document.open_texts.items()},
            "root": None if self._root is None else str(self._root),
            "encoding": page.encoding,
        }
        return await self._analyses.ask(text, question)

    def _to_protocol(self, method: str, found: Any) -> Any:
        """JSON in the types of the protocol."""
        response: Any = types.METHOD_TO_TYPES[method][1]
        return self._converter.structure({"id": 0, "jsonrpc": "2.0", "result": found}, response).result

    async def converse(self, stream: BinaryIO, out: BinaryIO) -> None:
        """Answer a client until it goes away. Raises SystemExit when it says goodbye."""
        loop, self._reader = asyncio.get_running_loop(), (reader := MessageReader(MAX_HEADER_BYTES))

        def read() -> None:  # in a thread that nobody waits for: pygls's own would outlive Ctrl-C
            with contextlib.suppress(RuntimeError):  # the loop has ended before the stream
                with contextlib.suppress(OSError, ValueError):  # the stream is closed
                    while data := stream.read1(1 << 16):  # type: ignore[attr-defined]
                        loop.call_soon_threadsafe(reader.feed_data, data)
                loop.call_soon_threadsafe(reader.feed_eof)

        threading.Thread(target=read, daemon=True).start()
        self.protocol.set_writer(StdoutWriter(out))
        try:
            with contextlib.suppress(asyncio.IncompleteReadError, BrokenPipeError):
                log = logging.getLogger("pygls.server")
                await run_async(threading.Event(), reader, self.protocol, log, self.report_server_error)
        finally:
            self._analyses.close()

    def _on_initialize(self, params: types.InitializeParams) -> None:
        """The client says which process it is: the conversation ends with that, even where another one holds the stream
        open. One in another container is not seen."""
        if (pid := params.process_id) and not has_ended(pid):
            self._watching = asyncio.ensure_future(self._watch(pid))

    async def _watch(self, pid: int) -> None:
        while not has_ended(pid):
            await asyncio.sleep(WATCH_SECONDS)
        self._reader.feed_eof()


def _place(params: Any) -> tuple[int, int]:
    position = getattr(params, "position", None)
    return (0, 0) if position is None else (position.line, position.character)


def has_ended(pid: int) -> bool:
    """Whether there is no such process (any more); False where the system cannot say."""
    with contextlib.suppress(OSError):
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] in "ZX"
    try:
        if os.name == "posix":
            os.kill(pid, 0)
    except OSError as error:
        return isinstance(error, ProcessLookupError)
    return False


def path_of(uri: str) -> Path | None:
    """The file of a URI, None if there is none: for unsaved texts and invalid file names."""
    try:
        found = to_fs_path(uri) if uri.startswith("file:") else None
        return Path(found).resolve() if found else None
    except (OSError, RuntimeError, ValueError):  # a NUL, a circle of links, half of a character
        return None


def serve(root: Path | None = None) -> int:
    """Answer one client over standard input and output; messages go to standard error. Returns the exit status."""
    messages = logging.StreamHandler(sys.stderr)
    messages.addFilter(_is_news)
    logging.basicConfig(handlers=[messages], level=logging.WARNING, format="%(name)s: %(message)s")
    sys.stdout.flush()
    out = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # other output on standard output would break the protocol
    # Read by a thread that may still wait when the program ends: not through sys.stdin, which Python closes then.
    stream = os.fdopen(os.dup(0), "rb")
    try:
        asyncio.run(Server(root).converse(stream, out))
    except SystemExit as goodbye:
        return goodbye.code if isinstance(goodbye.code, int) else 0
    except KeyboardInterrupt as error:
        return exit_status(error)
    return 0


def _is_news(record: logging.LogRecord) -> bool:
    """Whether to log a line: refused requests have their answer; any other wrong message of a client has none."""
    refused = record.exc_info is not None and isinstance(record.exc_info[1], JsonRpcException)
    if record.name.startswith("pygls"):
        record.msg, record.args, record.exc_info = record.getMessage().partition("\n")[0], (), None
    return not refused
