"""The specs that the page opens and saves."""

from __future__ import annotations

from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from scenegen.view.body import json_body
from scenegen.view.folder import Refused, shipped
from scenegen.view.shared import Shared


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
            raise Refused(400, "a file is saved with its path, its text and the hash of what was there")
        if not _whole(new):
            raise Refused(400, "the text holds half of a character")
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
            raise Refused(400, "a draft is kept with its name, its text and the hash of what was there")
        if not _whole(name + (text or "")):
            raise Refused(400, "the text holds half of a character")
        await run_in_threadpool(folder.keep_draft, name, text, was)
        return JSONResponse({})

    return Route("/api/draft", draft, methods=["GET", "PUT"])


def _whole(text: str) -> bool:
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True
