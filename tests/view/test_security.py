"""Who is let in: the gate alone, without a server."""

from __future__ import annotations

import asyncio

import pytest

pytest.importorskip("starlette")

from scenegen.show.view.limits import MAX_REQUESTS
from scenegen.show.view.project import Folder, OpenProject
from scenegen.show.view.serve import Gate, Shared

HOST = "127.0.0.1:8000"


async def nothing(scope, receive, send):
    await send({"type": "http.response.start", "status": 200, "headers": []})
    await send({"type": "http.response.body", "body": b"in"})


def gate(tmp_path):
    return Gate(nothing, "right", frozenset({HOST, "localhost:8000"}), Shared(OpenProject(Folder(tmp_path), "", "x")))


def knock(gate, path="/api/files", query="token=right", kind="http", **headers):
    found = []

    async def send(message):
        found.append(message)

    sent = [(name.replace("_", "-").encode(), value.encode()) for name, value in ({"host": HOST} | headers).items()]
    scope = {"type": kind, "path": path, "query_string": query.encode(), "headers": [one for one in sent if one[1]]}
    if kind == "websocket":
        scope["extensions"] = {"websocket.http.response": {}}
    asyncio.run(gate(scope, None, send))
    return found[0].get("status"), b"".join(one.get("body", b"") for one in found).decode()


def test_the_link_lets_in(tmp_path):
    assert knock(gate(tmp_path)) == (200, "in")
    assert knock(gate(tmp_path), query="", authorization="Bearer right") == (200, "in")
    assert knock(gate(tmp_path), origin=f"http://{HOST}", sec_fetch_site="same-origin")[0] == 200


@pytest.mark.parametrize("kind", ["http", "websocket"])
@pytest.mark.parametrize(
    ("status", "changes"),
    [
        (401, {"query": ""}),
        (401, {"query": "token="}),
        (401, {"query": "token=wrong"}),
        (401, {"query": "token=right&token=right"}),
        (401, {"query": "token=r%C3%AFght"}),
        (401, {"query": "", "authorization": "Bearer wrong"}),
        (403, {"host": "evil.example:8000"}),
        (403, {"host": "127.0.0.1"}),
        (403, {"host": ""}),
        (403, {"origin": "http://evil.example"}),
        (403, {"origin": "https://127.0.0.1:8000"}),
        (403, {"origin": "http://localhost:8000"}),
        (403, {"origin": "null"}),
        (403, {"sec_fetch_site": "cross-site"}),
    ],
)
def test_others_are_refused_with_a_sentence(tmp_path, kind, status, changes):
    found, body = knock(gate(tmp_path), kind=kind, **changes)
    assert found == status and len(body.split()) > 5 and "right" not in body.split()


def test_files_of_the_page_need_no_token(tmp_path):
    assert knock(gate(tmp_path), path="/static/page.js", query="")[0] == 200
    assert knock(gate(tmp_path), path="/", query="")[0] == 401


def test_answers_forbid_everything_from_elsewhere(tmp_path):
    found = []

    async def send(message):
        found.append(message)

    scope = {"type": "http", "path": "/", "query_string": b"token=right", "headers": [(b"host", HOST.encode())]}
    asyncio.run(gate(tmp_path)(scope, None, send))
    headers = dict(found[0]["headers"])
    policy = headers[b"content-security-policy"].decode()
    assert "default-src 'none'" in policy and "script-src 'self';" in policy and "frame-ancestors 'none'" in policy
    assert headers[b"x-content-type-options"] == b"nosniff" and headers[b"referrer-policy"] == b"no-referrer"


def test_too_many_requests_at_a_time_are_refused(tmp_path):
    crowded = gate(tmp_path)
    crowded.under_way = MAX_REQUESTS
    assert knock(crowded)[0] == 429
    assert knock(crowded, path="/static/page.js", query="")[0] == 200  # it is not counted: see below


def test_those_without_a_token_keep_nobody_out(tmp_path):
    """Files of the page are sent to everybody, and somebody may read them as slowly as he likes."""
    inside = []

    async def app(scope, receive, send):
        inside.append(found.under_way)
        await nothing(scope, receive, send)

    found = gate(tmp_path)
    found.app = app
    knock(found, path="/static/page.js", query="")
    knock(found)
    assert inside == [0, 1] and found.under_way == 0
