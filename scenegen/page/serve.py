"""The server of the page: who may talk to it, what it answers, and how it listens and ends.

Only pages that it served itself, to people who have its link, may talk to it. Every request is looked at before any of
it is read: its host (so that no other name can be made to point here), its origin (so that no other page can use this
server), and, but for the files of the page itself, its token. How many are served at a time is limited. Each refusal is
a status of 4xx with one plain sentence.
"""

from __future__ import annotations

import asyncio
import contextlib
import hmac
import json
import os
import re
import secrets
import shutil
import signal
import socket
import tempfile
import threading
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator, MutableMapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs

import uvicorn
from pydantic import BaseModel, ConfigDict, Field, ValidationError
from starlette.applications import Starlette
from starlette.background import BackgroundTask
from starlette.concurrency import run_in_threadpool
from starlette.middleware.gzip import GZipMiddleware
from starlette.requests import ClientDisconnect, HTTPConnection, Request
from starlette.responses import FileResponse, HTMLResponse, JSONResponse, PlainTextResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.websockets import WebSocket
from uvicorn.protocols.http.h11_impl import H11Protocol

from scenegen.errors import RequestError
from scenegen.errors.catalog import CatalogEntry, catalog
from scenegen.errors.program import CANNOT_LISTEN
from scenegen.page.limits import (
    BODY_SECONDS,
    HEADER_SECONDS,
    IDLE_SECONDS,
    MAX_BODY,
    MAX_CONNECTIONS,
    MAX_MESSAGE,
    MAX_PAGE_SCENES,
    MAX_REQUESTS,
    MAX_SESSIONS,
    MAX_TEXT,
)
from scenegen.page.project import STATIC, FileRefused, OpenProject, digest, html, shipped_json, state_folder
from scenegen.page.session import Lane, PageSession, PageWorkerEnded, TooManyWorkers, Workers
from scenegen.processes.process import END_SIGNALS, exit_status
from scenegen.resources import grammar_file


@dataclass(slots=True)
class Shared:
    """`tabs` are the pages that are open, by the names that they gave themselves; `downloads` counts the files being
    made."""

    opened: OpenProject
    workers: Workers = field(default_factory=Workers)
    tabs: list[str] = field(default_factory=list)
    downloads: int = 0


Scope = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[MutableMapping[str, Any]]]
Send = Callable[[MutableMapping[str, Any]], Awaitable[None]]
App = Callable[[Scope, Receive, Send], Awaitable[None]]

POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; "
    "font-src 'self'; connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
HEADERS = (
    (b"content-security-policy", POLICY.encode()),
    (b"x-content-type-options", b"nosniff"),
    (b"referrer-policy", b"no-referrer"),
    (b"cross-origin-opener-policy", b"same-origin"),
    (b"cross-origin-resource-policy", b"same-origin"),
)
REVALIDATE = (b"cache-control", b"no-cache")  # of files of the page: kept, and asked for again by their ETag


@dataclass(slots=True)
class Gate:
    """The application behind its checks. `hosts` are the names in the Host header that mean this server, with any
    port: another one may be forwarded here, and a page from elsewhere has another name even if DNS leads it here."""

    app: App
    token: str
    hosts: frozenset[str]
    shared: Shared
    under_way: int = field(default=0, init=False)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self.app(scope, receive, send)
            return
        problem = self._problem(scope)
        # the page itself needs no token: slow readers of its files must not keep out requests that have one
        counted = scope["type"] == "http" and not _is_open(scope["path"])
        if problem is None and counted and self.under_way >= MAX_REQUESTS:
            problem = 429, "this server answers no more requests at a time; try again in a moment"
        if problem is not None:
            await refuse(scope, send, *problem)
            return
        if scope["type"] == "websocket":
            await self.app(scope, receive, send)
            return

        async def send_guarded(message: MutableMapping[str, Any]) -> None:
            if message["type"] == "http.response.start":
                message["headers"] = [*message.get("headers", ()), *HEADERS, *([] if counted else [REVALIDATE])]
            await send(message)

        self.under_way += counted
        try:
            await self.app(scope, receive, send_guarded)
        finally:
            self.under_way -= counted

    def _problem(self, scope: Scope) -> tuple[int, str] | None:
        headers = [(name.lower(), value.decode("latin-1")) for name, value in scope["headers"]]

        def all_of(name: bytes) -> list[str]:
            return [value for key, value in headers if key == name]

        host = all_of(b"host")
        if len(host) != 1 or _name_of(host[0]) not in self.hosts:
            return 403, "this server answers only under the address of its link"
        if any(origin.lower() != f"http://{host[0].lower()}" for origin in all_of(b"origin")):
            return 403, "pages of other origins may not use this server"
        if any(site not in ("same-origin", "none") for site in all_of(b"sec-fetch-site")) and scope["path"] != "/":
            return 403, "pages of other origins may not use this server"
        if _is_open(scope["path"]):
            return None
        given = parse_qs(scope["query_string"].decode("latin-1")).get("token", [])
        given += [value.removeprefix("Bearer ") for value in all_of(b"authorization")]
        if len(given) != 1 or not hmac.compare_digest(given[0].encode("latin-1", "replace"), self.token.encode()):
            return 401, "the token is wrong or missing: use the link that `scenegen view` printed"
        return None


def _name_of(host: str) -> str:
    """The name in a Host header, without its port and the dot that ends a name that is complete."""
    return re.sub(r"\.?(:\d*)?$", "", host.lower())


def _is_open(path: str) -> bool:
    """Whether nobody needs the token for it."""
    return path.startswith("/static/") or path == "/api/proof"


async def refuse(scope: Scope, send: Send, status: int, reason: str) -> None:
    """Answer a request, or the opening of a WebSocket, with a status and a sentence."""
    body = f"{reason}\n".encode()
    kind = "websocket.http.response" if scope["type"] == "websocket" else "http.response"
    if scope["type"] == "websocket" and "websocket.http.response" not in scope.get("extensions", {}):
        await send({"type": "websocket.close", "code": 1008, "reason": reason})
        return
    headers = [(b"content-type", b"text/plain; charset=utf-8"), (b"content-length", str(len(body)).encode())]
    if status != 401:
        headers.append((b"connection", b"close"))
    await send({"type": f"{kind}.start", "status": status, "headers": [*headers, *HEADERS]})
    await send({"type": f"{kind}.body", "body": body})


async def json_body(request: Request) -> dict[str, Any]:
    """The JSON object of a request. Raises FileRefused for one that is too large, too slow or no object."""
    length = request.headers.get("content-length", "0")
    if length.isdigit() and int(length) > MAX_BODY:
        raise FileRefused(413, f"a request has at most {MAX_BODY >> 20} MB")
    data = bytearray()
    try:
        async with asyncio.timeout(BODY_SECONDS):
            async for part in request.stream():
                data += part
                if len(data) > MAX_BODY:
                    raise FileRefused(413, f"a request has at most {MAX_BODY >> 20} MB")
    except TimeoutError:
        raise FileRefused(408, "the request took too long to arrive") from None
    except ClientDisconnect:
        raise FileRefused(400, "the request did not arrive whole") from None
    try:
        found = json.loads(data)
    except (ValueError, RecursionError):
        found = None
    if not isinstance(found, dict):
        raise FileRefused(400, "the request is no JSON object")
    return found


async def page(request: Request) -> Response:
    shared = _shared_state(request)
    opened = await run_in_threadpool(shared.opened.now)
    draft = await run_in_threadpool(opened.folder.draft, opened.path or opened.name, shared.tabs)
    return HTMLResponse(html({**opened.data(), "draft": draft}), headers={"cache-control": "no-store"})


async def proof(request: Request) -> Response:
    """Proof that this server knows the token, for a page that lost its server: another program may listen there now."""
    token, nonce = request.app.state.token, request.query_params.get("nonce", "")
    return PlainTextResponse(hmac.new(token.encode(), nonce.encode(), "sha256").hexdigest())


async def files(request: Request) -> Response:
    shared = _shared_state(request)
    folder = shared.opened.folder
    found = {"specs": await run_in_threadpool(folder.specs), "shipped": await run_in_threadpool(shipped_json)}
    return JSONResponse({**found, "lost": await run_in_threadpool(folder.lost_drafts, shared.tabs)})


async def file(request: Request) -> Response:
    """A spec of the folder, read or saved."""
    folder = _shared_state(request).opened.folder
    if request.method == "GET":
        path = request.query_params.get("path", "")
        text, sha = await run_in_threadpool(folder.read, path)
        return JSONResponse({"path": path, "text": text, "sha": sha})
    body = await json_body(request)
    wanted, new, was = body.get("path"), body.get("text"), body.get("was")
    if not isinstance(wanted, str) or not isinstance(new, str) or not isinstance(was, str | None):
        raise FileRefused(400, "a file is saved with its path, its text and the hash of what was there")
    _check_whole(new)
    return JSONResponse({"path": wanted, "sha": await run_in_threadpool(folder.save, wanted, new, was)})


class DraftRequest(BaseModel):
    """What is not saved in a tab, or None for `text` where it is saved. It takes the place of the draft of the tab
    `instead`, unless that is open."""

    model_config = ConfigDict(extra="forbid")

    name: str
    text: str | None
    was: str | None
    tab: str = Field("", pattern="^[0-9a-z]{0,32}$")
    instead: str | None = Field(None, pattern="^[0-9a-z]{0,32}$")


async def draft(request: Request) -> Response:
    """What was written and not saved."""
    shared = _shared_state(request)
    folder = shared.opened.folder
    if request.method == "GET":
        name = request.query_params.get("name", "")
        return JSONResponse(await run_in_threadpool(folder.draft, name, shared.tabs))
    try:
        found = DraftRequest.model_validate(await json_body(request))
    except ValidationError:
        reason = "a draft is kept with its name, its tab, its text and the hash of what was there"
        raise FileRefused(400, reason) from None
    _check_whole(found.name + (found.text or ""))
    await run_in_threadpool(folder.keep_draft, found.name, found.text, found.was, found.tab)
    if found.instead is not None and found.instead not in (found.tab, *shared.tabs):
        await run_in_threadpool(folder.keep_draft, found.name, None, None, found.instead)
    return JSONResponse({})


def _check_whole(text: str) -> None:
    try:
        text.encode()
    except UnicodeEncodeError:
        raise FileRefused(400, "the text holds half of a character") from None


def _shared_state(request: HTTPConnection) -> Shared:
    shared: Shared = request.app.state.shared
    return shared


_entries = cache(catalog)


async def explain(request: Request) -> Response:
    entries: dict[str, CatalogEntry] = await run_in_threadpool(_entries)
    entry = entries.get(request.query_params.get("code", ""))
    if entry is None:
        raise FileRefused(404, "there is no such code: `scenegen explain` lists all")
    texts = {"means": entry.means, "example": entry.example, "mended": entry.mended}
    return JSONResponse({"code": entry.kind.code, "severity": entry.kind.severity, **texts})


async def prelude(request: Request) -> Response:
    return JSONResponse({"text": grammar_file("prelude.spec").read_text(encoding="utf-8")})


MAX_DOWNLOADS = 4  # downloads that are made at a time


class DownloadRequest(BaseModel):
    """The scenes, and the format of the file."""

    model_config = ConfigDict(extra="forbid")

    format: str = Field(max_length=20)
    text: str
    path: str | None = None
    poses: list[Any] = Field(max_length=MAX_PAGE_SCENES)
    on: list[Any] | None = Field(None, max_length=MAX_PAGE_SCENES)
    request: dict[str, Any] = Field(default={}, max_length=20)
    sampler: dict[str, Any] = Field(default={}, max_length=40)
    counts: dict[str, int] = Field(default={}, max_length=64)


async def download(request: Request) -> Response:
    shared = _shared_state(request)
    try:
        wanted = DownloadRequest.model_validate(await json_body(request))
    except ValidationError:
        raise FileRefused(400, "this is no request for a file of scenes") from None
    if len(wanted.text.encode("utf-8", "replace")) > MAX_TEXT:
        raise FileRefused(413, f"a spec on the page has at most {MAX_TEXT // 1024} kB")
    if wanted.path is not None:
        shared.opened.folder.inside(wanted.path)
    if shared.downloads >= MAX_DOWNLOADS:
        raise FileRefused(429, "some files are being made already; try again in a moment")
    shared.downloads += 1
    try:
        return await _make_download(shared, wanted)
    finally:
        shared.downloads -= 1


async def _make_download(shared: Shared, wanted: DownloadRequest) -> Response:
    into = Path(tempfile.mkdtemp(prefix="scenegen-view-"))
    lane = Lane(shared.workers)
    found: dict[str, bytes] = {}
    message = {**wanted.model_dump(), "job": "download", "root": str(shared.opened.folder.root), "into": str(into)}
    response: Response | None = None
    try:
        await lane.run(message, found.__setitem__)
        if "refused" in found:
            return JSONResponse(json.loads(found["refused"]), status_code=422)
        if "part" not in found:
            raise FileRefused(422, json.loads(found.get("failed", b'"the file could not be made"')))
        made = into / str(json.loads(found["part"]))
        task = BackgroundTask(shutil.rmtree, into, ignore_errors=True)
        response = FileResponse(made, filename=made.name, background=task)
        return response
    except (PageWorkerEnded, TooManyWorkers) as how:
        raise FileRefused(429, f"the file could not be made: {how}") from None
    finally:
        lane.close()
        if response is None:
            shutil.rmtree(into, ignore_errors=True)


async def socket_of_page(websocket: WebSocket) -> None:
    shared = _shared_state(websocket)
    if len(shared.tabs) >= MAX_SESSIONS:
        reason = "as many pages are open as this server takes; close one of them"
        await refuse(websocket.scope, websocket._send, 429, reason)
        return
    tab = websocket.query_params.get("tab", "")
    shared.tabs.append(tab)
    try:
        await websocket.accept()
        opened = shared.opened
        await PageSession(websocket, shared.workers, opened.folder, opened.model).converse()
    finally:
        shared.tabs.remove(tab)


ROUTES = [
    Route("/", page, methods=["GET"]),
    Route("/api/proof", proof, methods=["GET"]),
    Route("/api/files", files, methods=["GET"]),
    Route("/api/file", file, methods=["GET", "PUT"]),
    Route("/api/draft", draft, methods=["GET", "PUT"]),
    Route("/api/explain", explain, methods=["GET"]),
    Route("/api/prelude", prelude, methods=["GET"]),
    Route("/api/download", download, methods=["POST"]),
    WebSocketRoute("/api/socket", socket_of_page),
    Mount("/static", GZipMiddleware(StaticFiles(directory=STATIC))),
]


def make_app(opened: OpenProject, token: str, hosts: frozenset[str]) -> Gate:
    """The application for what was opened. `hosts` are the names under which it may be called."""
    shared = Shared(opened)

    @contextlib.asynccontextmanager
    async def lifespan(app: Starlette) -> AsyncIterator[None]:
        await shared.workers.start()
        try:
            yield
        finally:
            await shared.workers.close()

    handlers: Any = {FileRefused: _answer_refusal, 404: _answer_missing, 405: _answer_missing, 500: _answer_failure}
    app = Starlette(routes=ROUTES, lifespan=lifespan, exception_handlers=handlers)
    app.state.shared = shared
    app.state.token = token
    return Gate(app, token, hosts, shared)


async def _answer_refusal(request: Request, error: FileRefused) -> Response:
    return PlainTextResponse(f"{error}\n", error.status)


async def _answer_missing(request: Request, error: Exception) -> Response:
    return PlainTextResponse("there is nothing under this address\n", getattr(error, "status_code", 404))


async def _answer_failure(request: Request, error: Exception) -> Response:
    return PlainTextResponse(f"scenegen itself failed: {type(error).__name__}\n", 500)


LOOPBACK = ("127.0.0.1", "localhost", "::1")
MAX_HEAD_BYTES = 32 * 1024  # bytes of the head of a request


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


def kept_link(opened: OpenProject) -> tuple[int, str] | None:
    """Port and token of the first server of what was opened, so that its pages go on with a later one; None where
    nothing is kept that the user alone can read."""
    with contextlib.suppress(OSError, RuntimeError, ValueError, KeyError, TypeError):
        file = _link_file(opened)
        found = json.loads(file.read_bytes())
        if not file.stat().st_mode & 0o077 and re.fullmatch(r"[\w-]{32}", found["token"], re.ASCII):
            return int(found["port"]), found["token"]
    return None


def _listen(host: str, port: int | None, kept: tuple[int, str] | None) -> tuple[socket.socket, str | None]:
    """A socket, and the kept token where it may be used: not where another program has the port, which may have learned
    the token from a page that is still open. Raises RequestError."""
    if kept is None or port is not None:
        return bind(host, port), kept and kept[1]
    try:
        return bind(host, kept[0]), kept[1]
    except RequestError:
        return bind(host, None), None


def keep_link(opened: OpenProject, port: int, token: str) -> None:
    """Keep them, where that can be done."""
    with contextlib.suppress(OSError, RuntimeError):
        file = _link_file(opened)
        file.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        file.unlink(missing_ok=True)
        with os.fdopen(os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w") as link:
            json.dump({"port": port, "token": token}, link)


def _link_file(opened: OpenProject) -> Path:
    name = opened.folder.root / (opened.path or opened.name)
    return state_folder() / "links" / f"{digest(os.fsencode(name))}.json"


def hosts_of(host: str) -> frozenset[str]:
    """The names under which a page may call the server."""
    names = {*LOOPBACK, host} if host in LOOPBACK else {*LOOPBACK, host, socket.gethostname().lower()}
    if host in ("0.0.0.0", "::"):
        names |= {str(entry[4][0]) for entry in socket.getaddrinfo(socket.gethostname(), None)}
    return frozenset(f"[{name}]" if ":" in name else name.lower() for name in names)


def config_of(app: Gate) -> uvicorn.Config:
    """How the application is served."""
    return uvicorn.Config(
        app,
        http=BoundedHttpProtocol,
        ws="websockets-sansio",
        ws_max_size=MAX_MESSAGE,
        ws_per_message_deflate=False,
        h11_max_incomplete_event_size=MAX_HEAD_BYTES,
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
    kept = kept_link(opened) if host in LOOPBACK else None
    listener, known = _listen(host, port, kept)
    token = token or known or secrets.token_urlsafe(24)
    if kept is None and host in LOOPBACK:
        keep_link(opened, listener.getsockname()[1], token)
    shown = "localhost" if host in ("0.0.0.0", "::") else f"[{host}]" if ":" in host else host
    link = f"http://{shown}:{listener.getsockname()[1]}/?token={token}"
    app = make_app(opened, token, hosts_of(host))
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
            number = END_SIGNALS[-1]
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
