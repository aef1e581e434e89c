"""The application: its routes behind the gate."""

from __future__ import annotations

import contextlib
from collections.abc import AsyncIterator
from pathlib import Path

from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response
from starlette.routing import Mount
from starlette.staticfiles import StaticFiles

from scenegen.view.folder import Refused
from scenegen.view.opened import Opened
from scenegen.view.routes import download, files, page, socket, texts
from scenegen.view.security import Gate
from scenegen.view.shared import Shared

STATIC = Path(__file__).resolve().parent / "static"


def make_app(opened: Opened, token: str, hosts: frozenset[str]) -> Gate:
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
            page.route(shared),
            files.list_route(shared),
            files.file_route(shared),
            files.draft_route(shared),
            texts.explain_route(),
            texts.prelude_route(),
            download.route(shared),
            socket.route(shared),
            Mount("/static", StaticFiles(directory=STATIC)),
        ],
        lifespan=lifespan,
        exception_handlers={Refused: _refused, 404: _missing, 405: _missing, 500: _broken},
    )
    return Gate(app, token, hosts, shared)


async def _refused(request: Request, error: Exception) -> Response:
    status = error.status if isinstance(error, Refused) else 400
    return PlainTextResponse(f"{error}\n", status)


async def _missing(request: Request, error: Exception) -> Response:
    return PlainTextResponse("there is nothing under this address\n", getattr(error, "status_code", 404))


async def _broken(request: Request, error: Exception) -> Response:
    return PlainTextResponse(f"scenegen itself failed: {type(error).__name__}\n", 500)
