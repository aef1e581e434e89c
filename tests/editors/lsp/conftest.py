"""A language client that speaks to `scenegen lsp` as an editor does: framed JSON over the pipes of a process."""

from __future__ import annotations

import json
import os
import queue
import subprocess
import sys
import threading
from typing import Any

import pytest

PATIENCE = 30.0  # seconds for one answer


class Client:
    """One session. Notifications of the server are kept in the order of their arrival."""

    def __init__(self, *options: str) -> None:
        command = [sys.executable, "-m", "scenegen", "lsp", *options]
        self.process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=os.environ
        )
        self._number = 0
        self._arrived: queue.Queue[dict[str, Any] | None] = queue.Queue()
        self.notices: list[dict[str, Any]] = []
        self.noise = b""
        self._errors: list[bytes] = []
        for work in (self._listen, self._drain):
            threading.Thread(target=work, daemon=True).start()

    def _listen(self) -> None:
        out = self.process.stdout
        while True:
            length = 0
            while (line := out.readline()) not in (b"\r\n", b""):
                if line.lower().startswith(b"content-length:"):
                    length = int(line.split(b":")[1])
                elif not line.lower().startswith(b"content-type:"):
                    self.noise += line
            if not line:
                self._arrived.put(None)
                return
            self._arrived.put(json.loads(out.read(length)))

    def _drain(self) -> None:
        self._errors.extend(self.process.stderr)

    def send(self, message: dict[str, Any]) -> None:
        body = json.dumps({"jsonrpc": "2.0", **message}).encode()
        self.process.stdin.write(b"Content-Length: %d\r\n\r\n" % len(body) + body)
        self.process.stdin.flush()

    def raw(self, data: bytes) -> None:
        """Send bytes as they are."""
        self.process.stdin.write(data)
        self.process.stdin.flush()

    def unasked(self) -> dict[str, Any]:
        """The next message that is an answer, whatever it answers."""
        while "id" not in (message := self._next()):
            pass
        return message

    def notify(self, method: str, params: Any = None) -> None:
        self.send({"method": method, "params": params})

    def answer(self, method: str, params: Any = None) -> dict[str, Any]:
        """The whole answer to a request, result or error."""
        self._number += 1
        self.send({"id": self._number, "method": method, "params": params})
        while True:
            message = self._next()
            if message.get("id") == self._number and "method" not in message:
                return message

    def ask(self, method: str, params: Any = None) -> Any:
        message = self.answer(method, params)
        assert "error" not in message, message
        return message["result"]

    def _next(self) -> dict[str, Any]:
        message = self._arrived.get(timeout=PATIENCE)
        assert message is not None, self.errors
        if "id" not in message:
            self.notices.append(message)
        return message

    def diagnostics(self, uri: str, version: int) -> list[dict[str, Any]]:
        """What the server says of a version of a text; waits for it."""
        while True:
            for notice in self.notices:
                params = notice["params"]
                is_told = notice["method"] == "textDocument/publishDiagnostics" and params["uri"] == uri
                if is_told and params.get("version") == version:
                    return params["diagnostics"]
            self._next()

    def problem(self, uri: str, words: str) -> dict[str, Any]:
        """The diagnostic of a text with these words in its message; waits for it."""
        while True:
            for notice in self.notices:
                params = notice["params"]
                if notice["method"] == "textDocument/publishDiagnostics" and params["uri"] == uri:
                    for one in params["diagnostics"]:
                        if words in one["message"]:
                            return one
            self._next()

    # ---- what editors do

    def initialize(self, **general: Any) -> dict[str, Any]:
        capabilities = {"general": general, "textDocument": {"publishDiagnostics": {"versionSupport": True}}}
        result = self.ask("initialize", {"processId": None, "rootUri": None, "capabilities": capabilities})
        self.notify("initialized", {})
        return result

    def open(self, uri: str, text: str) -> None:
        item = {"uri": uri, "languageId": "scenegen", "version": 1, "text": text}
        self.notify("textDocument/didOpen", {"textDocument": item})

    def change(self, uri: str, version: int, text: str) -> None:
        document = {"uri": uri, "version": version}
        self.notify("textDocument/didChange", {"textDocument": document, "contentChanges": [{"text": text}]})

    def at(self, method: str, uri: str, line: int, character: int, **more: Any) -> Any:
        place = {"textDocument": {"uri": uri}, "position": {"line": line, "character": character}}
        return self.ask(f"textDocument/{method}", place | more)

    def close(self) -> int:
        """Shut down as editors do; returns the exit status."""
        self.ask("shutdown")
        self.notify("exit")
        self.process.stdin.close()
        return self.process.wait(PATIENCE)

    @property
    def errors(self) -> str:
        return b"".join(self._errors).decode()


@pytest.fixture
def client():
    """client("--root", "x") starts a session; whatever is still running at the end is killed."""
    pytest.importorskip("pygls")
    started: list[Client] = []

    def start(*options: str) -> Client:
        started.append(Client(*options))
        return started[-1]

    yield start
    for one in started:
        one.process.kill()
        one.process.wait()
