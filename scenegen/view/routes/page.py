"""The page itself, with what it shows first."""

from __future__ import annotations

from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import HTMLResponse, Response
from starlette.routing import Route

from scenegen.view.document import html
from scenegen.view.shared import Shared


def route(shared: Shared) -> Route:
    async def page(request: Request) -> Response:
        opened = shared.opened
        draft = await run_in_threadpool(opened.folder.draft, opened.path or opened.name)
        return HTMLResponse(html({**opened.data(), "draft": draft}), headers={"cache-control": "no-store"})

    return Route("/", page, methods=["GET"])
