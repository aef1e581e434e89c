"""The server as a page uses it: a real one, on a port of its own. Who is let in: the gate alone, without a server."""

from __future__ import annotations

import asyncio
import hmac
import json
import time
from dataclasses import replace

import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from scenegen.page import session as lanes
from scenegen.page.limits import MAX_REQUESTS, MAX_SESSIONS, MAX_TEXT
from scenegen.page.project import Folder, OpenProject
from scenegen.page.serve import Gate, Shared, _listen, bind, hosts_of, keep_link, kept_link
from scenegen.page.session import PageSession

pytest.importorskip("uvicorn")


LABEL = "r{0}: forall i in 1..13: leftOf(block[i], block[i+1]) & closeTo(block[i], block[i+1], {1} cm)\n"
SLOW = "object block[14] = box(5 cm, 5 cm, 5 cm)\nrequire noOverlap()\n"
SLOW += "".join(LABEL.format(k, 6 + k) for k in range(3))
TEXT = "object mug, plate\ntask: leftOf(mug, plate)\n"


@pytest.mark.long
def test_the_page_and_its_files(running):
    status, body = running.http("GET", "/?token=the-token", headers={})
    assert status == 200 and b'id="data"' in body and b"http" not in body.split(b"<script")[0]
    assert running.http("GET", "/static/page.js", headers={})[0] == 200
    assert running.http("GET", "/static/../app.py", headers={})[0] == 404
    assert running.http("GET", "/nowhere")[0] == 404


@pytest.mark.long
def test_files_are_opened_and_saved(running):
    status, body = running.http("GET", "/api/files")
    listed = json.loads(body)
    assert status == 200 and "two.spec" in listed["specs"] and len(listed["shipped"]) >= 20
    status, body = running.http("GET", "/api/file?path=two.spec")
    sha = json.loads(body)["sha"]
    assert running.http("PUT", "/api/file", {"path": "new.spec", "text": TEXT, "was": None})[0] == 200
    assert (running.folder / "new.spec").read_text() == TEXT
    assert running.http("PUT", "/api/file", {"path": "two.spec", "text": TEXT, "was": "0" * 64})[0] == 409
    assert running.http("PUT", "/api/file", {"path": "two.spec", "text": TEXT, "was": sha})[0] == 200
    assert running.http("GET", "/api/file?path=../../etc/passwd")[0] in (400, 403)


def test_codes_are_explained_and_the_prelude_is_read(running):
    status, body = running.http("GET", "/api/explain?code=unknown-relation")
    told = json.loads(body)
    assert status == 200 and told["means"] and told["example"] and told["severity"] == "error"
    assert running.http("GET", "/api/explain?code=../../x")[0] == 404
    assert "def leftOf" in json.loads(running.http("GET", "/api/prelude")[1])["text"]
    assert running.http("GET", "/api/prelude", headers={})[0] == 401


BODIES = [b"", b"{", b"[]", b"nul", b'{"path": 3}', b'{"path": "x.spec", "text": "\\ud800", "was": null}', b"[" * 5000]


@pytest.mark.parametrize("body", BODIES)
def test_bodies_that_are_none_are_refused(running, body):
    for method, path in (("PUT", "/api/file"), ("POST", "/api/download")):
        status, told = running.http(method, path, body)
        assert 400 <= status < 500 and len(told.split()) > 3


def test_large_bodies_are_refused(running):
    status, _ = running.http("PUT", "/api/file", {"path": "new2.spec", "text": "x" * (MAX_TEXT + 1), "was": None})
    assert status == 413
    assert running.http("POST", "/api/download", b"x" * (9 << 20))[0] == 413


def test_a_page_from_text_to_phi(running, page):
    answers = page.ask("check", text=TEXT)
    assert answers[0]["part"]["spec"]["labels"][0]["name"] == "task" and answers[-1] == {"id": 1, "done": None}
    (scenes, _) = page.ask("sample", text=TEXT, request={"phi": {"task": [0, 0.1]}, "n": 3})
    poses = scenes["part"]["poses"]
    (told, _) = page.ask("evaluate", text=TEXT, poses=poses, why=True)
    assert told["part"]["phi"] == scenes["part"]["phi"]
    (refused,) = page.ask("sample", text=TEXT, request={"phi": {"task": [5, 6]}})
    assert "refused" in refused and refused["refused"]["help"]


def test_downloads_come_from_the_server(running, page):
    (scenes, _) = page.ask("sample", text=TEXT, request={"n": 2})
    body = {"format": "json", "text": TEXT, "poses": scenes["part"]["poses"], "request": {"n": 2}}
    status, data = running.http("POST", "/api/download", body)
    assert status == 200 and len(json.loads(data)["scenes"]) == 2
    assert running.http("POST", "/api/download", body | {"format": "exe"})[0] == 422
    assert running.http("POST", "/api/download", body | {"path": "../x.spec"})[0] == 403


@pytest.mark.parametrize(
    "message",
    ["", "{", "[]", "3", '{"id": 1}', '{"id": -1, "job": "check"}', '{"id": 1, "job": "download"}', '{"stop": "x"}',
     '{"id": 1, "job": "check", "root": "/"}', '{"id": 1, "job": "check", "text": 3}', "[" * 100_000,
     '{"id": 1, "job": "check", "path": "../x.spec"}', '{"id": 1, "job": "check", "line": 1e99}',
     '{"id": 1, "job": "evaluate", "on": 7}', '{"id": 1, "job": "evaluate", "on": [' + "1," * 400 + "1]}"],
)  # fmt: skip
def test_messages_that_are_none_do_no_harm(page, message):
    page.socket.send(message)
    assert "failed" in json.loads(page.socket.recv(timeout=10))
    page._number = 10
    assert page.ask("check", text=TEXT)[0]["part"]["spec"]


def test_surfaces_that_are_none_are_refused(page):
    text = (
        "region board[2] = rect(0, 0, 1, 1) at 30 cm, 60 cm\nobject can on any of board, mug\ntask: leftOf(can, mug)\n"
    )
    told = {"text": text, "poses": [[[0.5, 0.5, 0.0]] * 2]}
    for on in (None, [], [7], [[0]], [[3]], [["x"]], [[None]], [[[1]]], [[1, 1]], [{"a": 1}]):
        (answer,) = page.ask("evaluate", on=on, **told)
        assert answer["refused"]["code"] == "no-message" and "surfaces" in answer["refused"]["text"]
    assert page.ask("evaluate", on=[[2]], **told)[0]["part"]["bases"] == [[0.6, 0.0]]


def test_bytes_and_large_texts_are_refused(page):
    page.socket.send(b"\x00\x01")
    assert "error" in json.loads(page.socket.recv(timeout=10))
    (answer,) = page.ask("check", text="#" * (MAX_TEXT + 1))
    assert "at most" in answer["failed"]


def test_a_newer_request_ends_the_older(page):
    began = time.perf_counter()
    wanted = {"phi": {name: [0, None] for name in ("r0", "r1", "r2")}}
    older = page.send("sample", text=SLOW, request=wanted)
    time.sleep(0.3)
    newer = page.send("sample", text=TEXT, request={"n": 1})
    ends = {}
    while len(ends) < 2:
        answer = json.loads(page.socket.recv(timeout=30))
        if "part" not in answer:
            ends[answer["id"]] = answer
    assert "ended" in ends[older] and "done" in ends[newer]
    assert time.perf_counter() - began < 60


def test_what_takes_too_long_is_ended(page, monkeypatch):
    monkeypatch.setattr(lanes, "JOB_SECONDS", {**lanes.JOB_SECONDS, "range": 0.2})
    (answer,) = page.ask("range", text=SLOW)[-1:]
    assert "as long as it may take" in answer["failed"]


def test_a_job_can_be_stopped(page):
    number = page.send("range", text=SLOW)
    time.sleep(0.2)
    page.socket.send('{"stop": "range"}')
    assert "ended" in page.until(number)[-1]


def test_closing_the_page_frees_its_work(running):
    page = running.page()
    page.send("range", text=SLOW)
    until = time.monotonic() + 10
    while not running.shared.workers.alive and time.monotonic() < until:
        time.sleep(0.02)
    alive = set(running.shared.workers.alive)
    page.close()
    while running.shared.workers.alive & alive and time.monotonic() < until:
        time.sleep(0.02)
    assert not running.shared.workers.alive & alive and running.shared.tabs == []


def test_a_worker_that_dies_is_replaced(running, page):
    page.ask("check", text=TEXT)
    for worker in list(running.shared.workers.alive):
        running.shared.workers.end(worker)
    time.sleep(0.1)
    (answer,) = page.ask("check", text=TEXT)
    assert "gone" in answer["failed"]
    assert page.ask("check", text=TEXT)[0]["part"]["spec"]


def test_pages_beyond_the_limit_are_refused(running):
    pages = [running.page() for _ in range(MAX_SESSIONS)]
    try:
        with pytest.raises(InvalidStatus) as error:
            running.page()
        assert error.value.response.status_code == 429
    finally:
        for one in pages:
            one.close()
    until = time.monotonic() + 10
    while running.shared.tabs and time.monotonic() < until:
        time.sleep(0.02)
    running.page().close()


def test_wrong_tokens_and_origins_open_no_socket(running):
    for address, headers in (
        (f"ws://127.0.0.1:{running.port}/api/socket?token=wrong", {}),
        (f"ws://127.0.0.1:{running.port}/api/socket?token=the-token", {"Origin": "http://evil.example"}),
    ):
        with pytest.raises(InvalidStatus) as error, connect(address, additional_headers=headers):
            pass
        assert error.value.response.status_code in (401, 403) and len(error.value.response.body.split()) > 5


def test_a_page_that_does_not_read_is_left(running):
    """Answers wait up to a limit; then the socket is closed, once."""
    closed = []

    class Deaf:
        async def close(self, code, reason):
            closed.append(code)

    async def flood():
        session = PageSession(Deaf(), running.shared.workers, running.shared.opened.folder, None)
        for _ in range(1000):
            session._say("{}")
        await asyncio.sleep(0)
        await asyncio.sleep(0)

    asyncio.run(flood())
    assert closed == [1013]


pytest.importorskip("starlette")


HOST = "127.0.0.1:8000"


async def nothing(scope, receive, send):
    await send({"type": "http.response.start", "status": 200, "headers": []})
    await send({"type": "http.response.body", "body": b"in"})


def gate(tmp_path):
    return Gate(nothing, "right", hosts_of("127.0.0.1"), Shared(OpenProject(Folder(tmp_path), "", "x")))


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


@pytest.mark.parametrize("host", ["127.0.0.1", "LocalHost", "localhost.:8000", "[::1]", "[::1]:8000", "localhost:9999"])
def test_the_port_of_a_forwarded_link_does_not_count(tmp_path, host):
    """Browsers leave out port 80, `ssh -L 9999:127.0.0.1:8000` has another one. The page is still its own origin."""
    assert knock(gate(tmp_path), host=host, origin=f"http://{host.lower()}", sec_fetch_site="same-origin")[0] == 200
    assert knock(gate(tmp_path), host=host, origin="http://localhost:1234")[0] == 403


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
        (403, {"host": "localhost.evil.example:8000"}),
        (403, {"host": "127.0.0.1@evil.example"}),
        (403, {"host": "127.0.0.1:80:80"}),
        (403, {"host": "::1"}),
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


def test_a_link_is_kept_for_the_user_alone(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    one = OpenProject(Folder(tmp_path), "", "x", "x.spec")
    assert kept_link(one) is None
    keep_link(one, 4321, "t" * 32)
    assert kept_link(one) == (4321, "t" * 32) and kept_link(replace(one, path="y.spec")) is None
    (file,) = (tmp_path / "state/scenegen/links").iterdir()
    assert file.stat().st_mode & 0o077 == 0 == file.parent.stat().st_mode & 0o077
    file.chmod(0o644)
    assert kept_link(one) is None  # others may have read it
    keep_link(one, 4321, "t" * 32)
    assert file.stat().st_mode & 0o077 == 0
    for damaged in (
        "{",
        "[]",
        '{"port": 4321}',
        '{"port": 4321, "token": ""}',
        '{"port": "x", "token": "%s"}' % ("t" * 32),
    ):
        file.write_text(damaged)
        assert kept_link(one) is None


def test_a_kept_token_is_used_only_where_nobody_took_its_port():
    with bind("127.0.0.1", None) as taken:
        port = taken.getsockname()[1]
        listener, token = _listen("127.0.0.1", None, (port, "kept"))
        assert token is None and listener.getsockname()[1] != port
        listener.close()
    listener, token = _listen("127.0.0.1", None, (port, "kept"))
    assert token == "kept" and listener.getsockname()[1] == port
    listener.close()
    listener, token = _listen("127.0.0.1", 0, (port, "kept"))
    assert token == "kept"
    listener.close()


def test_a_server_proves_that_it_knows_the_token(running):
    status, told = running.http("GET", "/api/proof?nonce=abc", headers={})
    assert (status, told.decode()) == (200, hmac.new(b"the-token", b"abc", "sha256").hexdigest())
    assert running.http("GET", "/api/proof?nonce=abc", headers={"Origin": "http://evil.example"})[0] == 403


def test_drafts_belong_to_tabs(running, monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    draft = {"name": "d.spec", "text": "# mine", "was": None}
    assert running.http("PUT", "/api/draft", {**draft, "tab": "old"})[0] == 200
    assert json.loads(running.http("GET", "/api/draft?name=d.spec")[1])["tab"] == "old"
    assert running.http("PUT", "/api/draft", {**draft, "tab": "new", "instead": "old"})[0] == 200
    (kept,) = (tmp_path / "scenegen/drafts").iterdir()
    assert kept.name.endswith("-new.json")
    for wrong in ({"tab": "../../x"}, {"tab": "new", "instead": "../x"}, {"tab": 3}, {"text": 3}, {"more": ""}):
        assert running.http("PUT", "/api/draft", {**draft, **wrong})[0] == 400
    assert [each.name for each in (tmp_path / "scenegen").iterdir()] == ["drafts"]


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
