"""Whatever a client sends: requests get an answer that says what is wrong, and the session goes on."""

import json
from pathlib import Path

import pytest

PLACE = {"textDocument": {"uri": "file:///x/a.spec"}, "position": {"line": 0, "character": 1}}
PARSE, INVALID, NO_METHOD, PARAMS, NOT_YET = -32700, -32600, -32601, -32602, -32002


def place(line, character):
    return PLACE | {"position": {"line": line, "character": character}}


@pytest.mark.long
def test_every_request_gets_an_answer(client):
    editor = client()

    def code(message):
        """The error of the next answer, which must carry the id of the message."""
        body = message if isinstance(message, bytes) else json.dumps(message).encode()
        editor.raw(b"Content-Length: %d\r\n\r\n" % len(body) + body)
        answer = editor.unasked()
        wanted = message.get("id") if isinstance(message, dict) else None
        assert answer["id"] == (wanted if type(wanted) in (str, int) else None)
        return answer["error"]["code"]

    def request(method, params, **more):
        return {"jsonrpc": "2.0", "id": "r1", "method": method, "params": params} | more

    assert code(request("textDocument/hover", PLACE)) == NOT_YET
    assert code(request("initialize", {"x": 1})) == PARAMS
    editor.initialize()
    assert code(request("initialize", {"processId": None, "rootUri": None, "capabilities": {}})) == INVALID
    for params in ({"x": 1}, [], [1], 7, "x", None, place(-1, 0), place(0, -7), place(0, 2**40), place("x", None)):
        assert code(request("textDocument/hover", params)) == PARAMS, params
    assert code(request("textDocument/rename", PLACE)) == PARAMS
    assert code(request("no/such", {})) == NO_METHOD
    for body in (b"{", b"\xff\xfe", b"", b"[" * 100_000, b'{"jsonrpc": "2.0", "id": ' + b"9" * 5000 + b"}"):
        assert code(body) == PARSE, body[:40]
    for body in (b"[]", b"7", b"null", b'{"id": 1, "method": "textDocument/hover"}', b'{"jsonrpc": "2.0"}'):
        editor.raw(b"Content-Length: %d\r\n\r\n" % len(body) + body)
        assert editor.unasked()["error"]["code"] == INVALID, body
    for wrong in (True, None, [1], {"x": 1}, 1.5):
        assert code(request("textDocument/hover", PLACE, id=wrong)) == INVALID, wrong
    assert code(request(7, {})) == INVALID
    editor.raw(b"Content-Length: -5\r\n\r\n")
    answer = editor.unasked()
    assert answer["id"] is None and answer["error"]["code"] == PARSE and "-5" in answer["error"]["message"]

    # notifications and answers to nothing get none, and change nothing
    for method in ("textDocument/didOpen", "textDocument/didChange", "textDocument/didClose", "$/cancelRequest"):
        editor.notify(method, {"x": 1})
    editor.send({"id": 99, "result": None})
    editor.send({"id": 99, "error": {"code": 1, "message": "no"}})
    assert "error" not in editor.answer("textDocument/hover", PLACE)  # not open: nothing to say
    assert editor.ask("shutdown") is None
    assert code(request("textDocument/hover", PLACE)) == INVALID
    editor.notify("exit")
    assert editor.process.wait(30) == 0
    assert "Traceback" not in editor.errors


@pytest.mark.long
def test_a_path_that_cannot_be_leaves_other_documents_alone(client, tmp_path):
    editor = client()
    editor.initialize()
    good = (tmp_path / "it is good.spec").as_uri()  # with %20 in its URI
    for uri in ("file:///x/%00.spec", "file://["):
        editor.open(uri, "leftOf(a, ")
    assert editor.diagnostics("file:///x/%00.spec", 1)
    editor.open(good, "leftOf(a, plate)")
    assert editor.diagnostics(good, 1) == []
    assert "phi" in editor.at("hover", good, 0, 2)["contents"]["value"]
    editor.notify("exit")  # without `shutdown`
    assert editor.process.wait(30) == 1
    assert "Traceback" not in editor.errors


def test_uris_without_a_file():
    pytest.importorskip("pygls")
    from scenegen.editors.lsp.desk import _path

    for uri in (
        "file:///x/%00",
        "file:///x/\ud800",
        "file://[",
        "file:",
        "untitled:1",
        "",
        "\0",
        "//",
        "file:////",
        f"file:///{'a' * 5000}",
    ):
        found = _path(uri)
        assert found is None or found.is_absolute(), uri
    assert _path("file:///x/%20a/../b.spec") == Path("/x/b.spec")
