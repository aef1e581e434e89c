"""The body of a request, as far as it may go."""

from __future__ import annotations

import asyncio
import json
from typing import Any

from starlette.requests import ClientDisconnect, Request

from scenegen.view.folder import Refused
from scenegen.view.limits import BODY_SECONDS, MAX_BODY


async def json_body(request: Request) -> dict[str, Any]:
    """The JSON object of a request. Raises Refused for one that is too large, too slow or no object."""
    length = request.headers.get("content-length", "0")
    if length.isdigit() and int(length) > MAX_BODY:
        raise Refused(413, f"a request has at most {MAX_BODY >> 20} MB")
    data = bytearray()
    try:
        async with asyncio.timeout(BODY_SECONDS):
            async for part in request.stream():
                data += part
                if len(data) > MAX_BODY:
                    raise Refused(413, f"a request has at most {MAX_BODY >> 20} MB")
    except TimeoutError:
        raise Refused(408, "the request took too long to arrive") from None
    except ClientDisconnect:
        raise Refused(400, "the request did not arrive whole") from None
    try:
        found = json.loads(data)
    except (ValueError, RecursionError):
        found = None
    if not isinstance(found, dict):
        raise Refused(400, "the request is no JSON object")
    return found
