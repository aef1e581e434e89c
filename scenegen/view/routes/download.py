"""The scenes on the page as a file."""

from __future__ import annotations

import json
import shutil
import tempfile
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError
from starlette.background import BackgroundTask
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response
from starlette.routing import Route

from scenegen.view.body import json_body
from scenegen.view.folder import Refused
from scenegen.view.lanes import Lane
from scenegen.view.limits import MAX_SCENES, MAX_TEXT
from scenegen.view.shared import Shared
from scenegen.view.workers import Crowded, Gone

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


def route(shared: Shared) -> Route:
    async def download(request: Request) -> Response:
        try:
            wanted = DownloadRequest.model_validate(await json_body(request))
        except ValidationError:
            raise Refused(400, "this is no request for a file of scenes") from None
        if len(wanted.text.encode("utf-8", "replace")) > MAX_TEXT:
            raise Refused(413, f"a spec on the page has at most {MAX_TEXT // 1024} kB")
        if wanted.path is not None:
            shared.opened.folder.inside(wanted.path)
        if shared.downloads >= MOST:
            raise Refused(429, "some files are being made already; try again in a moment")
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
            raise Refused(422, json.loads(found.get("failed", b'"the file could not be made"')))
        file = into / str(json.loads(found["part"]))
        task = BackgroundTask(shutil.rmtree, into, ignore_errors=True)
        return FileResponse(file, filename=file.name, background=task)
    except (Gone, Crowded) as how:
        shutil.rmtree(into, ignore_errors=True)
        raise Refused(429, f"the file could not be made: {how}") from None
    except BaseException:
        shutil.rmtree(into, ignore_errors=True)
        raise
    finally:
        lane.close()
