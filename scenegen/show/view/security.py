"""Who may talk to the server: pages that it served itself, to people who have its link.

Every request is looked at before any of it is read: its host (so that no other name can be made to point here), its
origin (so that no other page can use this server), and, but for the files of the page itself, its token. How many are
served at a time is limited. Each refusal is a status of 4xx with one plain sentence.
"""

from __future__ import annotations

import asyncio
import hmac
import json
from collections.abc import Awaitable, Callable, MutableMapping
from dataclasses import dataclass, field
from typing import Any
from urllib.parse import parse_qs

from starlette.requests import ClientDisconnect, Request

from scenegen.show.view.folder import FileRefused
from scenegen.show.view.limits import BODY_SECONDS, MAX_BODY, MAX_REQUESTS
from scenegen.show.view.opened import OpenProject
from scenegen.show.view.workers import Workers

# --------------------------------------------------------------------------------------------------------------------
# What all routes of one server share.


@dataclass(slots=True)
class Shared:
    """`sessions` counts the pages that are open, `downloads` the files being made."""

    opened: OpenProject
    workers: Workers = field(default_factory=Workers)
    sessions: int = 0
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


@dataclass(slots=True)
class Gate:
    """The application behind its checks. `hosts` are the values of the Host header that mean this server."""

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
        counted = scope["type"] == "http" and not scope["path"].startswith("/static/")
        if problem is None and counted and self.under_way >= MAX_REQUESTS:
            problem = 429, "this server answers no more requests at a time; try again in a moment"
        if problem is not None:
            await refuse(scope, send, *problem)
            return
        if scope["type"] == "websocket":
            await self.app(scope, receive, send)
            return

        async def guarded(message: MutableMapping[str, Any]) -> None:
            if message["type"] == "http.response.start":
                message["headers"] = [*message.get("headers", ()), *HEADERS]
            await send(message)

        self.under_way += counted
        try:
            await self.app(scope, receive, guarded)
        finally:
            self.under_way -= counted

    def _problem(self, scope: Scope) -> tuple[int, str] | None:
        headers = [(name.lower(), value.decode("latin-1")) for name, value in scope["headers"]]

        def all_of(name: bytes) -> list[str]:
            return [value for key, value in headers if key == name]

        host = all_of(b"host")
        if len(host) != 1 or host[0].lower() not in self.hosts:
            return 403, "this server answers only under the address of its link"
        for origin in all_of(b"origin"):
            scheme, _, name = origin.lower().partition("://")
            if scheme != "http" or name not in self.hosts or name != host[0].lower():
                return 403, "pages of other origins may not use this server"
        if any(site not in ("same-origin", "none") for site in all_of(b"sec-fetch-site")) and scope["path"] != "/":
            return 403, "pages of other origins may not use this server"
        if scope["path"].startswith("/static/"):
            return None
        given = parse_qs(scope["query_string"].decode("latin-1")).get("token", [])
        given += [value.removeprefix("Bearer ") for value in all_of(b"authorization")]
        if len(given) != 1 or not hmac.compare_digest(given[0].encode("latin-1", "replace"), self.token.encode()):
            return 401, "the token is wrong or missing: use the link that `scenegen view` printed"
        return None


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


# --------------------------------------------------------------------------------------------------------------------
# The body of a request, as far as it may go.


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
