"""Hundreds of requests at a time that no page would send: each is answered with 4xx and a sentence."""

from __future__ import annotations

import asyncio
import gc
import json
import re
from pathlib import Path

import pytest

pytest.importorskip("uvicorn")

from scenegen.page import serve
from scenegen.page import serve as security
from scenegen.page.limits import MAX_TEXT

from ..laws import FULL, in_full_again

COUNT = 300 if FULL else 120  # eight of each kind
TEXT = "object mug, plate\ntask: leftOf(mug, plate)\n"
HUGE = json.dumps({"path": "x.spec", "text": "#" * (MAX_TEXT + 1), "was": None}).encode()
SHELVES = (
    "region board[2] = rect(0, 0, 1, 1) at 30 cm, 60 cm\nobject can on any of board, mug\ntask: leftOf(can, mug)\n"
)
SURFACES = [
    json.dumps({"format": "json", "text": SHELVES, "poses": [[[0.5, 0.5, 0]] * 2], "on": on}).encode()
    for on in (7, "x", [[0]], [[3]], [[1e999]], [[[1]]], [[1]] * 401, [{"a": [1]}], [None])
]


def request(
    method: str, path: str, data: bytes = b"", token: str = "the-token", host: str = "", more: str = ""
) -> bytes:
    head = f"{method} {path} HTTP/1.1\r\nHost: {host}\r\nAuthorization: Bearer {token}\r\n{more}"
    return f"{head}Content-Length: {len(data)}\r\n\r\n".encode() + data


async def talk(port: int, data: bytes, *, drop: bool = False, wait: float = 0.0) -> bytes:
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    try:
        writer.write(data)
        await writer.drain()
        if drop:
            return b"dropped"
        await asyncio.sleep(wait)
        head = await asyncio.wait_for(reader.readuntil(b"\r\n\r\n"), 30)
        length = re.search(rb"content-length: (\d+)", head.lower())
        return head + (await reader.readexactly(int(length[1])) if length else await reader.read())
    except (ConnectionError, asyncio.IncompleteReadError) as error:
        return repr(error).encode()
    finally:
        writer.close()


def attack(port: int, number: int):
    host = f"127.0.0.1:{port}"
    upgrade = (
        "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: "
        + "A" * 22
        + "==\r\n"
    )
    kinds = [
        lambda: talk(port, request("PUT", "/api/file", b'{"path": ', host=host)),
        lambda: talk(port, request("POST", "/api/download", b"[" * 9000, host=host)),
        lambda: talk(port, request("POST", "/api/download", SURFACES[number % len(SURFACES)], host=host)),
        lambda: talk(port, request("PUT", "/api/file", HUGE, host=host)),
        lambda: talk(port, request("GET", f"/api/file?path={'../' * (number % 9 + 1)}etc/passwd", host=host)),
        lambda: talk(port, request("GET", "/static/%2e%2e/%2e%2e/app.py", host=host)),
        lambda: talk(port, request("GET", "/api/files", token="wrong", host=host)),
        lambda: talk(port, request("GET", "/api/files", host="evil.example")),
        lambda: talk(port, request("GET", "/api/socket?token=wrong", host=host, more=upgrade)),
        lambda: talk(port, request("GET", "/api/files", host=host, more="Origin: http://evil.example\r\n")),
        lambda: talk(port, b"GET / HTTP/1.1\r\nHost: 127"),  # and then nothing
        lambda: talk(port, request("PUT", "/api/file", b"x" * 50, host=host)[:-40]),  # a body that never arrives
        lambda: talk(port, request("PUT", "/api/file", HUGE, host=host)[:-1000], drop=True),
        lambda: talk(port, b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03" * 20),  # another protocol
        lambda: talk(port, b"GET /" + b"a" * 70_000 + b" HTTP/1.1\r\n\r\n"),
    ]
    return kinds[number % len(kinds)]()


def resident() -> int:
    return int(re.search(r"VmRSS:\s+(\d+)", Path("/proc/self/status").read_text())[1])


@pytest.mark.long
@in_full_again
@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="reads its memory from /proc")
def test_hundreds_at_a_time(running, monkeypatch):
    monkeypatch.setattr(serve, "HEADER_SECONDS", 0.5)
    monkeypatch.setattr(security, "BODY_SECONDS", 0.5)

    async def all_at_once() -> list[bytes]:
        return await asyncio.gather(*(attack(running.port, number) for number in range(COUNT)))

    asyncio.run(all_at_once())
    gc.collect()
    before = resident()
    for _ in range(2):
        answers = asyncio.run(all_at_once())
    gc.collect()
    assert resident() - before < 30_000  # kB
    told = [one for one in answers if one != b"dropped"]
    statuses = [re.match(rb"HTTP/1.1 (\d+)", one) for one in told]
    strange = [one[:200] for one, status in zip(told, statuses, strict=True) if status is None or status[1][:1] != b"4"]
    assert not strange
    assert all(len(one.split(b"\r\n\r\n", 1)[1].split()) >= 3 for one in told)
    page = running.page()
    assert page.ask("sample", text=TEXT, request={"n": 2})[0]["part"]["poses"]
    page.close()
    assert running.server.config.app.under_way == 0
