"""What a broken or hostile client may send to the language server: frames, messages and parameters that are damaged.

The server runs in this process, without the processes that analyse documents. Its laws: nothing raises, every request
has one answer, nothing else has one but null for what cannot be read, and whoever comes after is served.
"""

from __future__ import annotations

import asyncio
import json
import logging
import random
from collections import Counter
from io import BytesIO
from typing import Any

from scenegen.editors.lsp.answers import Page, Question, answer
from scenegen.editors.lsp.document import Document
from scenegen.editors.lsp.server import Fault, frames

from .judge import Fault as Broken

URI = "file:///x/a.spec"
TEXT = "object mug, plate\ntask: leftOf(mug, plate)\n"
METHODS = (
    "hover completion definition documentSymbol formatting prepareRename rename didOpen didChange didClose".split()
)
OTHERS = ["initialize", "initialized", "$/cancelRequest", "$/setTrace", "no/such", "", "textDocument/", "\ud800"]
STRANGE: list[Any] = [
    *(None, True, -1, 0, 1, 1.5, 2**31, 2**70, float("inf"), "", "x", "\0", "\ud800", [], {}, [[]], {"x": 1}),
    *("file:///x/%00.spec", "file://[", "file:", "untitled:1", URI, {"uri": URI}, "a" * 5000),
]
LENGTHS = [b"-5", b"0", b"1", b"99999999999", b"1e3", b"0x10", b"\xb2", b"", b" 7 ", b"7, 7"]


def attack(rng: random.Random) -> bytes:
    """A session after a good beginning: a few messages, most of them damaged."""
    return b"".join(_piece(rng, number) for number in range(rng.randint(1, 8)))


def _piece(rng: random.Random, number: int) -> bytes:
    body = json.dumps(_message(rng, number)).encode()
    way = rng.random()
    if way < 0.7:
        return framed(body)
    if way < 0.8:  # a body that is cut, or has other bytes in it
        at = rng.randrange(len(body) + 1)
        return framed(body[:at] + rng.choice([b"", b"\xff", b"\0", b"[" * 5000, b'"', b"}"]) + body[at + 1 :])
    if way < 0.9:
        return b"Content-Length: " + rng.choice(LENGTHS) + b"\r\n\r\n" + rng.choice([b"", body])
    return rng.randbytes(rng.randrange(40)) + rng.choice([b"", b"\r\n", b"\n\n", b": x\r\n"])


def _message(rng: random.Random, number: int) -> Any:
    place = {"textDocument": {"uri": URI, "version": 2}, "position": {"line": 1, "character": 7}}
    item = {"uri": URI, "languageId": "scenegen", "version": 1, "text": TEXT}
    params = place | {"newName": "cup", "contentChanges": [{"text": TEXT}], "options": {"tabSize": 4}}
    method = f"textDocument/{rng.choice(METHODS)}"
    if method.endswith("didOpen"):
        params = {"textDocument": item}
    message: Any = {"jsonrpc": "2.0", "id": f"r{number}", "method": method, "params": params}
    if "/did" in method:
        del message["id"]
    for _ in range(rng.choice([0, 1, 1, 2])):
        message = _damaged(rng, message)
    return message


def _damaged(rng: random.Random, value: Any) -> Any:
    """The value with one part of it left out or replaced."""
    if not isinstance(value, dict | list) or not value or rng.random() < 0.15:
        return rng.choice([*STRANGE, *OTHERS])
    copy: Any = value.copy()
    at = rng.choice(list(copy)) if isinstance(copy, dict) else rng.randrange(len(copy))
    if rng.random() < 0.2:
        del copy[at]
    else:
        copy[at] = _damaged(rng, copy[at])
    return copy


def framed(body: bytes) -> bytes:
    return b"Content-Length: %d\r\n\r\n" % len(body) + body


def _request(number: str, method: str, params: Any) -> bytes:
    return framed(json.dumps({"jsonrpc": "2.0", "id": number, "method": method, "params": params}).encode())


def survive(data: bytes) -> None:
    """Serve a session. Raises Fault, or whatever the server lets out."""
    first = _request("first", "initialize", {"processId": None, "rootUri": None, "capabilities": {}})
    place = {"textDocument": {"uri": URI}, "position": {"line": 1, "character": 7}}
    last = b"\n" * 200 + _request("last", "textDocument/hover", place)
    messages = list(frames(BytesIO(first + data + last)))
    answers, logged = asyncio.run(_session(messages))
    wanted: Counter[Any] = Counter(number for one in messages if (number := _number(one)) is not None)
    given = Counter(one["id"] for one in answers if one.get("id") is not None)
    if wanted != given:
        raise Broken("a request without its one answer")
    if answers[-1].get("id") != "last" or "error" in answers[-1]:
        raise Broken("a session that a message has ended")
    if logged:
        raise Broken(f"an error inside the server: {logged[0].splitlines()[-1]}")


async def _session(messages: list[bytes | Fault]) -> tuple[list[dict[str, Any]], list[str]]:
    """The answers of a server to messages, and the tracebacks that it logged."""
    from scenegen.editors.lsp.server import Server

    server, out, log = Server(), BytesIO(), _Log()
    page = Page(Document(TEXT), URI)

    async def ask(one: Any, question: Question) -> Any:
        return json.dumps(answer(page, question)).encode()

    server.desk._ask = ask  # type: ignore[method-assign]
    server.desk._revise = lambda one: None  # type: ignore[method-assign]  # starts no process
    server.protocol.set_writer(out)
    for name in ("scenegen.editors.lsp", "pygls"):
        logging.getLogger(name).addHandler(log)
    try:
        for message in messages:
            server.protocol.receive(message)
            await asyncio.sleep(0)
            await asyncio.sleep(0)
    finally:
        for name in ("scenegen.editors.lsp", "pygls"):
            logging.getLogger(name).removeHandler(log)
        server.shutdown()
    answers = [json.loads(one) for one in frames(BytesIO(out.getvalue())) if not isinstance(one, Fault)]
    return [one for one in answers if "method" not in one], log.tracebacks


class _Log(logging.Handler):
    """Keeps the tracebacks of errors that are not answers."""

    def __init__(self) -> None:
        super().__init__(logging.ERROR)
        self.tracebacks: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        from pygls.exceptions import JsonRpcException

        if record.exc_info and not isinstance(record.exc_info[1], JsonRpcException):
            self.tracebacks.append(logging.Formatter().formatException(record.exc_info))


def _number(message: bytes | Fault) -> Any:
    """The id of what is a request."""
    try:
        found = None if isinstance(message, Fault) else json.loads(message)
    except (ValueError, RecursionError):
        return None
    if not isinstance(found, dict) or isinstance(found.get("id"), bool):
        return None
    answering = "method" not in found and ("result" in found or "error" in found)
    return None if answering or not isinstance(found.get("id"), str | int) else found["id"]
