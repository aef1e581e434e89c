"""The language server: the features of this folder, wired to the protocol over standard input and output."""

from __future__ import annotations

import asyncio
import contextlib
import functools
import json
import logging
import os
import re
import sys
import threading
from collections.abc import Awaitable, Callable, Iterator
from pathlib import Path
from typing import Any, BinaryIO

from cattrs import transform_error
from lsprotocol import types
from pygls.exceptions import (
    FeatureRequestError,
    JsonRpcException,
    JsonRpcInvalidParams,
    JsonRpcInvalidRequest,
    JsonRpcParseError,
    JsonRpcServerNotInitialized,
)
from pygls.lsp.server import LanguageServer
from pygls.protocol import LanguageServerProtocol
from pygls.protocol.json_rpc import JsonRPCNotification, JsonRPCRequestMessage, JsonRPCResponseMessage

from scenegen.editors.lsp.answers import Question
from scenegen.editors.lsp.desk import DiagnosticsService
from scenegen.processes.process import exit_status

# --------------------------------------------------------------------------------------------------------------------
# The frames of a stream: headers with a `Content-Length`, an empty line, and a body of so many bytes.
#
# If a header is wrong, the end of its body is unknown. The reader reports this once and continues at the next valid
# header: the message is lost, the session is not.


MOST = 1 << 28  # bytes of one body
LINE = 1 << 26  # bytes of one line of a header, or of what is skipped

_LENGTH = re.compile(rb"Content-Length:[ \t]*(\d{1,9})[ \t]*\r?\n", re.IGNORECASE)
_HEADER = re.compile(rb"[A-Za-z][A-Za-z-]*:[^\r\n]*\r?\n")


class Fault(ValueError):  # noqa: N818 - is not raised but stands among the frames
    """Bytes that are not a frame, and the reason."""


def frames(stream: BinaryIO) -> Iterator[bytes | Fault]:
    """The bodies of a stream in order, and a Fault in place of unreadable ones; ends with the stream."""
    lost = False  # looking for a header, after a fault
    length = -1
    while line := stream.readline(LINE):
        wanted = (_LENGTH.search if lost else _LENGTH.fullmatch)(line)
        if wanted is not None and wanted.end() == len(line) and int(wanted[1]) <= MOST:
            length, lost = int(wanted[1]), False
        elif line in (b"\r\n", b"\n"):
            if length < 0:
                continue  # blank lines between messages do no harm
            body = stream.read(length)
            if len(body) < length:
                return
            length = -1
            yield body
        elif not lost and (_HEADER.fullmatch(line) is None or b"content-length:" in line.lower()):
            tail = _LENGTH.search(line)
            length = int(tail[1]) if tail is not None and int(tail[1]) <= MOST else -1
            lost = length < 0
            yield Fault(f"this is no header of a message: {line[:60].decode(errors='replace').strip()!r}")


# --------------------------------------------------------------------------------------------------------------------
# JSON-RPC according to its specification: every request gets an answer, malformed ones included.
#
# pygls drops messages that it cannot read; here they get an answer with an error code and the reason. Results of the
# features are JSON bytes and are sent unchanged.


LONGEST = 400  # characters of an error's message
LOG = logging.getLogger("scenegen.editors.lsp")


class Protocol(LanguageServerProtocol):
    """The protocol of pygls with strict answers. Open documents are handled by the server: see desk.py."""

    lsp_text_document__did_open = None  # type: ignore[assignment]
    lsp_text_document__did_change = None  # type: ignore[assignment]
    lsp_text_document__did_close = None  # type: ignore[assignment]

    def receive(self, body: bytes | Fault) -> None:
        """Handle a message, or answer with its error."""
        message: dict[str, Any] = {}
        try:
            message = _parsed(body)
            _check(message)
            self._dispatch(message)
        except JsonRpcException as error:
            number = message.get("id")
            if "method" not in message and ("result" in message or "error" in message):
                LOG.warning("an answer to request %s: %s", number, error)
            elif message and "id" not in message and isinstance(message.get("method"), str):
                LOG.warning("%s: %s", message["method"], error)  # notifications get no answer
            else:
                known = isinstance(number, str | int) and not isinstance(number, bool)
                self._send_response(number if known else None, error=error.to_response_error())

    def _dispatch(self, message: dict[str, Any]) -> None:
        """Hand a message to its handler. Raises JsonRpcException."""
        method = message.get("method")
        if method is not None:
            if self._workspace is None and method not in (types.INITIALIZE, types.EXIT):
                raise JsonRpcServerNotInitialized("the first request must be `initialize`")
            if self._workspace is not None and method == types.INITIALIZE:
                raise JsonRpcInvalidRequest("`initialize` comes once")
            if self._shutdown and method != types.EXIT:
                raise JsonRpcInvalidRequest("the server is shutting down")
        self.handle_message(self._structured(message))

    def _structured(self, message: dict[str, Any]) -> Any:
        """A message in the types of the protocol. Raises JsonRpcException."""
        kind: Any
        if "method" in message:
            other = JsonRPCRequestMessage if "id" in message else JsonRPCNotification
            kind = self.get_message_type(message["method"]) or other
            if "id" in message and not hasattr(kind, "id"):
                raise JsonRpcInvalidRequest(f"`{message['method']}` is a notification: it has no id")
        elif "error" in message:
            kind = types.ResponseErrorMessage
        else:
            kind = self._result_types.pop(message["id"], None) or JsonRPCResponseMessage
        try:
            return self._converter.structure({"params": None, **message}, kind)
        except Exception as error:
            reasons = "; ".join(transform_error(error, path="message"))
            raise JsonRpcInvalidParams(f"Invalid Params: {reasons}"[:LONGEST]) from error

    def publish(self, uri: str, version: int | None, diagnostics: bytes) -> None:
        """Send the diagnostics of a document, the bytes of JSON."""
        of = "" if version is None else f', "version": {version}'
        opening = f'{{"jsonrpc": "2.0", "method": "{types.TEXT_DOCUMENT_PUBLISH_DIAGNOSTICS}", "params": {{"uri": '
        self._write(opening.encode() + json.dumps(uri).encode() + of.encode(), b'"diagnostics": ' + diagnostics + b"}}")

    def _send_response(self, msg_id: Any, result: Any = None, error: types.ResponseError | None = None) -> None:
        """Send the answer to a request; an `error` comes before a `result`. Bytes are JSON already."""
        self._result_types.pop(msg_id, None)
        value = result if error is None else error
        told = value if isinstance(value, bytes) else json.dumps(value, default=self._serialize_message).encode()
        kind = b'"result": ' if error is None else b'"error": '
        self._write(b'{"jsonrpc": "2.0", "id": ' + json.dumps(msg_id).encode(), kind + told + b"}")

    def _write(self, opening: bytes, rest: bytes) -> None:
        """Send an object whose members are in two parts."""
        if self.writer is not None:
            length = len(opening) + 2 + len(rest)
            self.writer.write(b"Content-Length: %d\r\n\r\n%b, %b" % (length, opening, rest))


def _parsed(body: bytes | Fault) -> dict[str, Any]:
    """A message as JSON. Raises JsonRpcException."""
    if isinstance(body, Fault):
        raise JsonRpcParseError(str(body))
    try:
        message = json.loads(body)
    except (ValueError, RecursionError) as error:
        raise JsonRpcParseError(f"Parse Error: {error}"[:LONGEST]) from error
    if not isinstance(message, dict):
        raise JsonRpcInvalidRequest("a message is an object; batches are not known to this protocol")
    return message


def _check(message: dict[str, Any]) -> None:
    """Raises JsonRpcException for anything that is not a JSON-RPC message."""
    if message.get("jsonrpc") != Protocol.VERSION:
        raise JsonRpcInvalidRequest('a message has "jsonrpc": "2.0"')
    if "id" in message and (not isinstance(message["id"], str | int) or isinstance(message["id"], bool)):
        raise JsonRpcInvalidRequest("the id of a message is a number or a text")
    if "method" in message and not isinstance(message["method"], str):
        raise JsonRpcInvalidRequest("the method of a message is a text")
    if "method" not in message and not ("id" in message and ("result" in message or "error" in message)):
        raise JsonRpcInvalidRequest("a message has a method, or answers a request")


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
        self.desk = DiagnosticsService(self.protocol.publish, root)
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

        self.protocol.set_writer(_StdoutWriter(out, lambda: end(1)))
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


class _StdoutWriter:
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
