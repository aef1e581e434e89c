"""JSON-RPC according to its specification: every request gets an answer, malformed ones included.

pygls drops messages that it cannot read; here they get an answer with an error code and the reason. Results of the
features are JSON bytes and are sent unchanged.
"""

from __future__ import annotations

import json
import logging
from typing import Any

from cattrs import transform_error
from lsprotocol import types
from pygls.exceptions import (
    JsonRpcException,
    JsonRpcInvalidParams,
    JsonRpcInvalidRequest,
    JsonRpcParseError,
    JsonRpcServerNotInitialized,
)
from pygls.protocol import LanguageServerProtocol
from pygls.protocol.json_rpc import JsonRPCNotification, JsonRPCRequestMessage, JsonRPCResponseMessage

from scenegen.lsp.stream import Fault

LONGEST = 400  # characters of an error's message
LOG = logging.getLogger("scenegen.lsp")


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
