"""The server: its socket, its link, and how it ends."""

from __future__ import annotations

import asyncio
import contextlib
import json
import secrets
import shutil
import signal
import socket
import tempfile
import threading
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import uvicorn
from pydantic import BaseModel, ConfigDict, Field, ValidationError
from starlette.applications import Starlette
from starlette.background import BackgroundTask
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import FileResponse, HTMLResponse, JSONResponse, PlainTextResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.websockets import WebSocket
from uvicorn.protocols.http.h11_impl import H11Protocol

from scenegen.errors import RequestError
from scenegen.errors.catalog import CatalogEntry, catalog
from scenegen.errors.program import CANNOT_LISTEN
from scenegen.processes.process import ENDING, exit_status
from scenegen.resources import grammar_file
from scenegen.show.view.export import html
from scenegen.show.view.folder import FileRefused, shipped
from scenegen.show.view.limits import (
    HEADER_SECONDS,
    IDLE_SECONDS,
    MAX_CONNECTIONS,
    MAX_MESSAGE,
    MAX_SCENES,
    MAX_SESSIONS,
    MAX_TEXT,
)
from scenegen.show.view.opened import OpenProject
from scenegen.show.view.security import Gate, Shared, json_body, refuse
from scenegen.show.view.session import Lane, PageSession
from scenegen.show.view.workers import PageWorkerEnded, TooManyWorkers

# --------------------------------------------------------------------------------------------------------------------
# The application: its routes behind the gate.


# --------------------------------------------------------------------------------------------------------------------
# The scenes on the page as a file.


MOST = 4  # downloads that are made at a time


class DownloadRequest(BaseModel):
    """The scenes, and the format of the file."""

    model_config = ConfigDict(extra="forbid")

    format: str = Field(max_length=20)
    text: str
    path: str | None = None
    poses: list[Any] = Field(max_length=MAX_SCENES)
    on: list[Any] | None = Field(None, max_length=MAX_SCENES)
    request: dict[str, Any] = Field(default={}, max_length=20)
    sampler: dict[str, Any] = Field(default={}, max_length=40)
    counts: dict[str, int] = Field(default={}, max_length=64)


def download_route(shared: Shared) -> Route:
    async def download(request: Request) -> Response:
        try:
            wanted = DownloadRequest.model_validate(await json_body(request))
        except ValidationError:
            raise FileRefused(400, "this is no request for a file of scenes") from None
        if len(wanted.text.encode("utf-8", "replace")) > MAX_TEXT:
            raise FileRefused(413, f"a spec on the page has at most {MAX_TEXT // 1024} kB")
        if wanted.path is not None:
            shared.opened.folder.inside(wanted.path)
        if shared.downloads >= MOST:
            raise FileRefused(429, "some files are being made already; try again in a moment")
        shared.downloads += 1
        try:
            return await _made(shared, wanted)
        finally:
            shared.downloads -= 1

    return Route("/api/download", download, methods=["POST"])


async def _made(shared: Shared, wanted: DownloadRequest) -> Response:
    into = Path(tempfile.mkdtemp(prefix="scenegen-view-"))
    lane = Lane(shared.workers)
    heard: list[tuple[str, bytes]] = []
    message = {**wanted.model_dump(), "job": "download", "root": str(shared.opened.folder.root), "into": str(into)}
    try:
        await lane.run(message, lambda kind, value: heard.append((kind, value)))
        found = dict(heard)
        if "refused" in found:
            shutil.rmtree(into, ignore_errors=True)
            return JSONResponse(json.loads(found["refused"]), status_code=422)
        if "part" not in found:
            raise FileRefused(422, json.loads(found.get("failed", b'"the file could not be made"')))
        file = into / str(json.loads(found["part"]))
        task = BackgroundTask(shutil.rmtree, into, ignore_errors=True)
        return FileResponse(file, filename=file.name, background=task)
    except (PageWorkerEnded, TooManyWorkers) as how:
        shutil.rmtree(into, ignore_errors=True)
        raise FileRefused(429, f"the file could not be made: {how}") from None
    except BaseException:
        shutil.rmtree(into, ignore_errors=True)
        raise
    finally:
        lane.close()


# --------------------------------------------------------------------------------------------------------------------
# The specs that the page opens and saves.


def list_route(shared: Shared) -> Route:
    async def files(request: Request) -> Response:
        specs = await run_in_threadpool(shared.opened.folder.specs)
        return JSONResponse({"specs": specs, "shipped": await run_in_threadpool(shipped)})

    return Route("/api/files", files, methods=["GET"])


def file_route(shared: Shared) -> Route:
    folder = shared.opened.folder

    async def file(request: Request) -> Response:
        if request.method == "GET":
            path = request.query_params.get("path", "")
            text, sha = await run_in_threadpool(folder.read, path)
            return JSONResponse({"path": path, "text": text, "sha": sha})
        body = await json_body(request)
        wanted, new, was = body.get("path"), body.get("text"), body.get("was")
        if not isinstance(wanted, str) or not isinstance(new, str) or not isinstance(was, str | None):
            raise FileRefused(400, "a file is saved with its path, its text and the hash of what was there")
        if not _whole(new):
            raise FileRefused(400, "the text holds half of a character")
        sha = await run_in_threadpool(folder.save, wanted, new, was)
        return JSONResponse({"path": wanted, "sha": sha})

    return Route("/api/file", file, methods=["GET", "PUT"])


def draft_route(shared: Shared) -> Route:
    folder = shared.opened.folder

    async def draft(request: Request) -> Response:
        if request.method == "GET":
            return JSONResponse(await run_in_threadpool(folder.draft, request.query_params.get("name", "")))
        body = await json_body(request)
        name, text, was = body.get("name"), body.get("text"), body.get("was")
        if not isinstance(name, str) or not isinstance(text, str | None) or not isinstance(was, str | None):
            raise FileRefused(400, "a draft is kept with its name, its text and the hash of what was there")
        if not _whole(name + (text or "")):
            raise FileRefused(400, "the text holds half of a character")
        await run_in_threadpool(folder.keep_draft, name, text, was)
        return JSONResponse({})

    return Route("/api/draft", draft, methods=["GET", "PUT"])


def _whole(text: str) -> bool:
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True


# --------------------------------------------------------------------------------------------------------------------
# The page itself, with what it shows first.


def page_route(shared: Shared) -> Route:
    async def page(request: Request) -> Response:
        opened = shared.opened
        draft = await run_in_threadpool(opened.folder.draft, opened.path or opened.name)
        return HTMLResponse(html({**opened.data(), "draft": draft}), headers={"cache-control": "no-store"})

    return Route("/", page, methods=["GET"])


# --------------------------------------------------------------------------------------------------------------------
# The WebSocket of a page.


def socket_route(shared: Shared) -> WebSocketRoute:
    async def socket(websocket: WebSocket) -> None:
        if shared.sessions >= MAX_SESSIONS:
            reason = "as many pages are open as this server takes; close one of them"
            await refuse(websocket.scope, websocket._send, 429, reason)
            return
        shared.sessions += 1
        try:
            await websocket.accept()
            opened = shared.opened
            await PageSession(websocket, shared.workers, opened.folder, opened.model).converse()
        finally:
            shared.sessions -= 1

    return WebSocketRoute("/api/socket", socket)


# --------------------------------------------------------------------------------------------------------------------
# Texts that ship with scenegen and that the page shows beside a spec: explanations of codes, and the prelude.


_entries = cache(catalog)


def explain_route() -> Route:
    async def explain(request: Request) -> Response:
        entries: dict[str, CatalogEntry] = await run_in_threadpool(_entries)
        entry = entries.get(request.query_params.get("code", ""))
        if entry is None:
            raise FileRefused(404, "there is no such code: `scenegen explain` lists all")
        return JSONResponse(
            {
                "code": entry.kind.code,
                "severity": entry.kind.severity,
                "means": entry.means,
                "example": entry.example,
                "mended": entry.mended,
            }
        )

    return Route("/api/explain", explain, methods=["GET"])


def prelude_route() -> Route:
    async def prelude(request: Request) -> Response:
        return JSONResponse({"text": grammar_file("prelude.spec").read_text(encoding="utf-8")})

    return Route("/api/prelude", prelude, methods=["GET"])


STATIC = Path(__file__).resolve().parent / "static"


def make_app(opened: OpenProject, token: str, hosts: frozenset[str]) -> Gate:
    """The application for what was opened. `hosts` are the addresses, with port, under which it may be called."""
    shared = Shared(opened)

    @contextlib.asynccontextmanager
    async def lifespan(app: Starlette) -> AsyncIterator[None]:
        await shared.workers.start()
        try:
            yield
        finally:
            await shared.workers.close()

    app = Starlette(
        routes=[
            page_route(shared),
            list_route(shared),
            file_route(shared),
            draft_route(shared),
            explain_route(),
            prelude_route(),
            download_route(shared),
            socket_route(shared),
            Mount("/static", StaticFiles(directory=STATIC)),
        ],
        lifespan=lifespan,
        exception_handlers={FileRefused: _refused, 404: _missing, 405: _missing, 500: _broken},
    )
    return Gate(app, token, hosts, shared)


async def _refused(request: Request, error: Exception) -> Response:
    status = error.status if isinstance(error, FileRefused) else 400
    return PlainTextResponse(f"{error}\n", status)


async def _missing(request: Request, error: Exception) -> Response:
    return PlainTextResponse("there is nothing under this address\n", getattr(error, "status_code", 404))


async def _broken(request: Request, error: Exception) -> Response:
    return PlainTextResponse(f"scenegen itself failed: {type(error).__name__}\n", 500)


LOOPBACK = ("127.0.0.1", "localhost", "::1")
HEAD = 32 * 1024  # bytes of the head of a request


class BoundedHttpProtocol(H11Protocol):
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
        http=BoundedHttpProtocol,
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


def serve(
    opened: OpenProject, host: str, port: int | None, told: Callable[[str], None], token: str | None = None
) -> int:
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
