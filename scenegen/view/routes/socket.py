"""The WebSocket of a page."""

from __future__ import annotations

from starlette.routing import WebSocketRoute
from starlette.websockets import WebSocket

from scenegen.view.limits import MAX_SESSIONS
from scenegen.view.security import refuse
from scenegen.view.session import Session
from scenegen.view.shared import Shared


def route(shared: Shared) -> WebSocketRoute:
    async def socket(websocket: WebSocket) -> None:
        if shared.sessions >= MAX_SESSIONS:
            reason = "as many pages are open as this server takes; close one of them"
            await refuse(websocket.scope, websocket._send, 429, reason)
            return
        shared.sessions += 1
        try:
            await websocket.accept()
            opened = shared.opened
            await Session(websocket, shared.workers, opened.folder, opened.model).converse()
        finally:
            shared.sessions -= 1

    return WebSocketRoute("/api/socket", socket)
