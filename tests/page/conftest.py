"""A server of the page, in a thread of this process, and clients for it."""

from __future__ import annotations

import asyncio
import contextlib
import http.client
import json
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("uvicorn")

import uvicorn
from websockets.sync.client import connect

from scenegen.page import serve
from scenegen.page.project import Folder, OpenProject
from scenegen.page.serve import make_app

TOKEN = "the-token"
TEXT = "object mug, plate\ntask: leftOf(mug, plate) & closeTo(mug, plate, 30 cm)\n"


@dataclass
class Running:
    port: int
    folder: Path
    server: uvicorn.Server
    token: str = TOKEN
    _answers: dict[int, list[Any]] = field(default_factory=dict)

    @property
    def shared(self) -> Any:
        """What the routes share: counts of sessions, workers."""
        return self.server.config.app.shared

    def http(self, method: str, path: str, body: Any = None, headers: dict[str, str] | None = None) -> tuple[int, Any]:
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=20)
        data = json.dumps(body).encode() if isinstance(body, dict) else body
        sent = {"Authorization": f"Bearer {self.token}"} if headers is None else headers
        connection.request(method, path, data, sent)
        answer = connection.getresponse()
        found = answer.status, answer.read()
        connection.close()
        return found

    def page(self) -> Page:
        return Page(self)


class Page:
    """A WebSocket as the page uses it."""

    def __init__(self, running: Running) -> None:
        address = f"ws://127.0.0.1:{running.port}/api/socket?token={running.token}"
        self._open = contextlib.ExitStack()
        self.socket = self._open.enter_context(connect(address, max_size=None))
        self._number = 0

    def send(self, job: str, **fields: Any) -> int:
        self._number += 1
        self.socket.send(json.dumps({"id": self._number, "job": job, **fields}))
        return self._number

    def until(self, number: int) -> list[dict[str, Any]]:
        """All answers to a message, up to its last one."""
        found = []
        while True:
            answer = json.loads(self.socket.recv(timeout=30))
            if answer["id"] == number:
                found.append(answer)
                if "part" not in answer:
                    return found

    def ask(self, job: str, **fields: Any) -> list[dict[str, Any]]:
        return self.until(self.send(job, **fields))

    def close(self) -> None:
        self._open.close()


def start(folder: Path) -> Running:
    listener = serve.bind("127.0.0.1", None)
    opened = OpenProject(Folder(folder.resolve()), TEXT, "two")
    app = make_app(opened, TOKEN, serve.hosts_of("127.0.0.1"))
    config = serve.config_of(app)
    server = uvicorn.Server(config)
    threading.Thread(target=lambda: asyncio.run(server.serve(sockets=[listener])), daemon=True).start()
    until = time.monotonic() + 120  # a busy machine takes its time
    while not server.started and time.monotonic() < until:
        time.sleep(0.01)
    assert server.started
    return Running(listener.getsockname()[1], folder, server)


@pytest.fixture(scope="session")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Running]:
    folder = tmp_path_factory.mktemp("opened")
    (folder / "two.spec").write_text(TEXT)
    found = start(folder)
    yield found
    found.server.should_exit = True
    time.sleep(0.2)


@pytest.fixture
def page(running: Running) -> Iterator[Page]:
    found = running.page()
    yield found
    found.close()
