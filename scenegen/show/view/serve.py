"""The server: its socket, its link, and how it ends."""

from __future__ import annotations

import asyncio
import contextlib
import secrets
import signal
import socket
import threading
from collections.abc import Awaitable, Callable, Iterator
from typing import Any

import uvicorn
from uvicorn.protocols.http.h11_impl import H11Protocol

from scenegen.errors import RequestError
from scenegen.errors.program import CANNOT_LISTEN
from scenegen.processes.process import ENDING, exit_status
from scenegen.show.view.app import make_app
from scenegen.show.view.limits import HEADER_SECONDS, IDLE_SECONDS, MAX_CONNECTIONS, MAX_MESSAGE
from scenegen.show.view.opened import Opened
from scenegen.show.view.security import Gate

LOOPBACK = ("127.0.0.1", "localhost", "::1")
HEAD = 32 * 1024  # bytes of the head of a request


class Patient(H11Protocol):
    """HTTP that waits for the head of a request only so long, and serves so many connections."""

    def connection_made(self, transport: Any) -> None:
        super().connection_made(transport)
        if len(self.connections) > MAX_CONNECTIONS:
            self._give_up(429, "this server has as many connections as it takes")
            return
        self._waiting: asyncio.TimerHandle = self.loop.call_later(HEADER_SECONDS, self._too_slow)

    def _too_slow(self) -> None:
        of_mine = self.transport.get_protocol() is self  # not that of a WebSocket by now
        if of_mine and self.cycle is None and not self.transport.is_closing():
            self._give_up(408, "the request took too long to arrive")

    def _give_up(self, status: int, reason: str) -> None:
        body = f"{reason}\n".encode()
        head = f"HTTP/1.1 {status} -\r\ncontent-type: text/plain; charset=utf-8\r\nconnection: close\r\n"
        self.transport.write(f"{head}content-length: {len(body)}\r\n\r\n".encode() + body)
        self.transport.close()


def bind(host: str, port: int | None) -> socket.socket:
    """A socket that listens: on `port`, or on any that is free. Raises RequestError."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    listener = socket.socket(family, socket.SOCK_STREAM)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((host, port or 0))
    except (OSError, OverflowError) as error:
        listener.close()
        reason = getattr(error, "strerror", None) or str(error)
        raise RequestError(CANNOT_LISTEN(host=host, port=port or 0, reason=reason.lower())) from None
    listener.listen(MAX_CONNECTIONS)
    return listener


def hosts_of(listener: socket.socket, host: str) -> frozenset[str]:
    """The addresses under which a page may call the server."""
    port = listener.getsockname()[1]
    names = {*LOOPBACK, host} if host in LOOPBACK else {*LOOPBACK, host, socket.gethostname().lower()}
    if host in ("0.0.0.0", "::"):
        names |= {str(entry[4][0]) for entry in socket.getaddrinfo(socket.gethostname(), None)}
    return frozenset(f"[{name}]:{port}" if ":" in name else f"{name}:{port}" for name in names)


def config_of(app: Gate) -> uvicorn.Config:
    """How the application is served."""
    return uvicorn.Config(
        app,
        http=Patient,
        ws="websockets-sansio",
        ws_max_size=MAX_MESSAGE,
        ws_per_message_deflate=False,
        h11_max_incomplete_event_size=HEAD,
        timeout_keep_alive=int(IDLE_SECONDS),
        timeout_graceful_shutdown=1,
        log_level="critical",
        access_log=False,
        server_header=False,
        lifespan="on",
    )


def serve(opened: Opened, host: str, port: int | None, told: Callable[[str], None], token: str | None = None) -> int:
    """Serve the page until an interrupt; `told` is given the link once it works. Returns the exit status. Raises
    ScenegenError if its processes cannot start."""
    token = token or secrets.token_urlsafe(24)
    listener = bind(host, port)
    shown = "localhost" if host in ("0.0.0.0", "::") else f"[{host}]" if ":" in host else host
    link = f"http://{shown}:{listener.getsockname()[1]}/?token={token}"
    app = make_app(opened, token, hosts_of(listener, host))
    server = _Server(config_of(app), app.shared.workers.start, lambda: told(link))
    try:
        server.run(sockets=[listener])
    except KeyboardInterrupt as error:
        return exit_status(error)
    finally:
        listener.close()
    return 0 if server.began else 1


class _Server(uvicorn.Server):
    def __init__(
        self, config: uvicorn.Config, before: Callable[[], Awaitable[None]], ready: Callable[[], None]
    ) -> None:
        super().__init__(config)
        self._before, self._ready = before, ready
        self.began = False

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        """SIGHUP ends the server, too, as the others do: they are raised again when it has ended."""
        with super().capture_signals():
            number = ENDING[-1]
            before = signal.getsignal(number)
            if threading.current_thread() is not threading.main_thread() or before is signal.SIG_IGN:
                yield
                return
            signal.signal(number, self.handle_exit)
            try:
                yield
            finally:
                signal.signal(number, before)  # uvicorn raises it again

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        await self._before()
        await super().startup(sockets)
        if self.started:
            self.began = True
            self._ready()
