"""Whatever a client sends, the session goes on."""

from pathlib import Path

import pytest


@pytest.mark.long
def test_what_cannot_be_read_leaves_the_session_alone(client):
    """pygls answers what is a request, as far as it can be read, and says in a line what is not."""
    editor = client()
    editor.initialize()
    place = {"textDocument": {"uri": "file:///x/a.spec"}, "position": {"line": 0, "character": 1}}
    unknown = editor.answer("no/such", {})
    assert unknown["error"]["code"] == -32601
    for body in (b"{", b"\xff\xfe", b"[" * 100_000, b"[]", b"7", b'{"id": 1}', b'{"jsonrpc": "2.0"}'):
        editor.raw(b"Content-Length: %d\r\n\r\n" % len(body) + body)
    editor.raw(b"Content-Length: -5\r\n\r\n")
    for params in ({"x": 1}, [], 7, None, place | {"position": {"line": -1, "character": 0}}):
        editor.send({"id": "r", "method": "textDocument/hover", "params": params})
        editor.notify("textDocument/didChange", params)
    editor.send({"id": 99, "result": None})
    assert "error" not in editor.answer("textDocument/hover", place)  # not open: nothing to say
    assert editor.close() == 0
    assert "Traceback" not in editor.errors and "Invalid Params" in editor.errors


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
    from scenegen.editors.lsp.server import path_of

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
        found = path_of(uri)
        assert found is None or found.is_absolute(), uri
    assert path_of("file:///x/%20a/../b.spec") == Path("/x/b.spec")
