"""Texts that ship with scenegen and that the page shows beside a spec: explanations of codes, and the prelude."""

from __future__ import annotations

from functools import cache

from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from scenegen.errors.catalog import Entry, catalog
from scenegen.resources import grammar_file
from scenegen.view.folder import Refused

_entries = cache(catalog)


def explain_route() -> Route:
    async def explain(request: Request) -> Response:
        entries: dict[str, Entry] = await run_in_threadpool(_entries)
        entry = entries.get(request.query_params.get("code", ""))
        if entry is None:
            raise Refused(404, "there is no such code: `scenegen explain` lists all")
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
