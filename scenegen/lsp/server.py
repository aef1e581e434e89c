"""The language server: the features of this folder, wired to the protocol over standard input and output."""

from __future__ import annotations

import asyncio
import contextlib
import functools
import logging
import os
import sys
import threading
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any, BinaryIO

from lsprotocol import types
from pygls.exceptions import FeatureRequestError, JsonRpcException
from pygls.lsp.server import LanguageServer

from scenegen.lsp.answers import Question
from scenegen.lsp.desk import Desk
from scenegen.lsp.rpc import Protocol
from scenegen.lsp.stream import Fault, frames
from scenegen.processes.interrupt import exit_status

LOG = logging.getLogger("scenegen.lsp")

_REQUESTS: list[tuple[str, str, Any]] = [
    (types.TEXT_DOCUMENT_HOVER, "hover", None),
    (types.TEXT_DOCUMENT_COMPLETION, "completion", types.CompletionOptions(trigger_characters=[".", '"'])),
    (types.TEXT_DOCUMENT_DEFINITION, "definition", None),
    (types.TEXT_DOCUMENT_DOCUMENT_SYMBOL, "symbols", None),
    (types.TEXT_DOCUMENT_FORMATTING, "formatting", None),
    (types.TEXT_DOCUMENT_PREPARE_RENAME, "prepareRename", None),
    (types.TEXT_DOCUMENT_RENAME, "rename", types.RenameOptions(prepare_provider=True)),
]


class Server(LanguageServer):
    """A server with every feature, for one client. Errors are logged, not shown in the client's windows."""

    protocol: Protocol

    def __init__(self, root: Path | None = None) -> None:
        from scenegen.version import __version__

        sync = types.TextDocumentSyncKind.Full
        super().__init__("scenegen", __version__, text_document_sync_kind=sync, protocol_cls=Protocol)
        self.desk = Desk(self.protocol.publish, root)
        for method, handler in (
            (types.INITIALIZE, self._initialize),
            (types.TEXT_DOCUMENT_DID_OPEN, self._opened),
            (types.TEXT_DOCUMENT_DID_CHANGE, self._changed),
            (types.TEXT_DOCUMENT_DID_SAVE, self._saved),
            (types.TEXT_DOCUMENT_DID_CLOSE, self._closed),
        ):
            self.feature(method)(functools.partial(handler))  # pygls marks what it is given; a method takes no marks
        for method, feature, options in _REQUESTS:
            self.feature(method, options)(self._asking(feature))

    def report_server_error(self, error: Exception, source: Any) -> None:
        if source is not FeatureRequestError:  # a request has its answer
            LOG.warning("%s", error)

    # ---- the conversation

    async def converse(self, stream: BinaryIO, out: BinaryIO) -> int:
        """Answer a client until it says goodbye or goes away. Returns the exit status: 1 for a goodbye out of turn."""
        loop = asyncio.get_running_loop()
        ended: asyncio.Future[int] = loop.create_future()

        def end(status: int) -> None:
            if not ended.done():
                ended.set_result(status)

        def hear(message: bytes | Fault) -> None:
            try:
                self.protocol.receive(message)
            except SystemExit as goodbye:
                end(goodbye.code if isinstance(goodbye.code, int) else 0)
            except Exception:  # no message of a client may end the server
                LOG.exception("a message could not be handled")

        def listen() -> None:  # in a thread of its own, so that the loop never waits for the client
            with contextlib.suppress(RuntimeError, OSError, ValueError):  # the loop has ended before the stream
                for message in frames(stream):
                    loop.call_soon_threadsafe(hear, message)
                loop.call_soon_threadsafe(end, 0)

        self.protocol.set_writer(_Writer(out, lambda: end(1)))
        threading.Thread(target=listen, daemon=True).start()
        try:
            return await ended
        finally:
            self.desk.close()

    # ---- documents

    def _initialize(self, params: types.InitializeParams) -> None:
        encoding = self.workspace.position_encoding
        self.desk.encoding = str(getattr(encoding, "value", encoding))

    def _opened(self, params: types.DidOpenTextDocumentParams) -> None:
        one = params.text_document
        self.desk.opened(one.uri, one.text, one.version)

    def _changed(self, params: types.DidChangeTextDocumentParams) -> None:
        one = params.text_document
        if params.content_changes:  # each is the whole text, as agreed
            self.desk.opened(one.uri, params.content_changes[-1].text, one.version)

    def _saved(self, params: types.DidSaveTextDocumentParams) -> None:
        self.desk.saved(params.text_document.uri)

    def _closed(self, params: types.DidCloseTextDocumentParams) -> None:
        self.desk.closed(params.text_document.uri)

    def _asking(self, feature: str) -> Callable[[Any], Awaitable[Any]]:
        async def ask(params: Any) -> Any:
            position = getattr(params, "position", None)
            line, character = (position.line, position.character) if position is not None else (0, 0)
            question = Question(feature, line, character, getattr(params, "new_name", ""))
            return await self.desk.ask(params.text_document.uri, question)

        return ask


class _Writer:
    """Standard output. A client that has gone ends the conversation, with no error at every further answer."""

    def __init__(self, out: BinaryIO, lost: Callable[[], None]) -> None:
        self._out = out
        self._lost = lost

    def write(self, data: bytes) -> None:
        try:
            self._out.write(data)
            self._out.flush()
        except (OSError, ValueError):
            self._lost()

    def close(self) -> None:
        with contextlib.suppress(OSError):
            self._out.close()


def serve(root: Path | None = None) -> int:
    """Answer one client over standard input and output; messages go to standard error. Returns the exit status."""
    messages = logging.StreamHandler(sys.stderr)
    messages.addFilter(lambda record: record.exc_info is None or not isinstance(record.exc_info[1], JsonRpcException))
    logging.basicConfig(handlers=[messages], level=logging.WARNING, format="%(name)s: %(message)s")
    sys.stdout.flush()
    out = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # other output on standard output would break the protocol
    # Read by a thread that may still wait when the program ends: not through sys.stdin, which Python closes then.
    stream = os.fdopen(os.dup(0), "rb")
    try:
        return asyncio.run(Server(root).converse(stream, out))
    except KeyboardInterrupt as error:
        return exit_status(error)
