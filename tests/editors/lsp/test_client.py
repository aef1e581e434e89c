"""The server with the client of pygls, while the process of one document is at work and does not answer."""

import asyncio
import os
import signal
import sys
import time
from pathlib import Path

import pytest

pytest.importorskip("pygls")
pytestmark = pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="finds the processes of a server in /proc")

from lsprotocol import types  # noqa: E402
from pygls.exceptions import JsonRpcException  # noqa: E402
from pygls.lsp.client import LanguageClient  # noqa: E402

PATIENCE = 60.0
TEXT = "object mug, plate\ndef near(a, b) = closeTo(a, b, 10 cm)\ntask: near(mug, plate)\n"


class Editor(LanguageClient):
    """An editor with a few documents open."""

    def __init__(self) -> None:
        super().__init__("test", "1")
        self.told: asyncio.Queue[types.PublishDiagnosticsParams] = asyncio.Queue()
        self.feature(types.TEXT_DOCUMENT_PUBLISH_DIAGNOSTICS)(lambda params: self.told.put_nowait(params))

    async def begin(self) -> None:
        await self.start_io(sys.executable, "-m", "scenegen", "lsp")
        await self.initialize_async(types.InitializeParams(capabilities=types.ClientCapabilities()))
        self.initialized(types.InitializedParams())

    def open(self, uri, text=TEXT):
        item = types.TextDocumentItem(uri, "scenegen", 1, text)
        self.text_document_did_open(types.DidOpenTextDocumentParams(item))

    def change(self, uri, version, text):
        document = types.VersionedTextDocumentIdentifier(version, uri)
        whole = [types.TextDocumentContentChangeWholeDocument(text)]
        self.text_document_did_change(types.DidChangeTextDocumentParams(document, whole))

    async def diagnostics(self, uri, version):
        while True:
            one = await asyncio.wait_for(self.told.get(), PATIENCE)
            if (one.uri, one.version) == (uri, version):
                return list(one.diagnostics)

    def hover(self, uri, line=2, character=7):
        place = types.TextDocumentIdentifier(uri), types.Position(line, character)
        return self.text_document_hover_async(types.HoverParams(*place))

    async def end(self) -> None:
        await self.shutdown_async(None)
        self.exit(None)
        await self.stop()
        assert self._server is not None and self._server.returncode == 0

    def workers(self) -> set[int]:
        """The processes of the server, one for each document that was asked about."""
        own = self._server.pid
        return {int(one) for one in Path(f"/proc/{own}/task/{own}/children").read_text().split()}


@pytest.mark.long
def test_one_document_does_not_wait_for_another():
    async def session():
        editor = Editor()
        await editor.begin()
        slow, other = "file:///x/slow.spec", "file:///x/other.spec"
        editor.open(slow)
        assert await editor.diagnostics(slow, 1) == []
        (busy,) = editor.workers()
        editor.open(other)
        assert await editor.diagnostics(other, 1) == []
        os.kill(busy, signal.SIGSTOP)  # as good as a check that takes for ever, and cheaper

        waiting = asyncio.ensure_future(editor.hover(slow))
        given_up = asyncio.ensure_future(editor.hover(slow))
        told = await asyncio.wait_for(editor.hover(other), PATIENCE)
        assert "near(a, b)" in told.contents.value and "phi of `near(mug, plate)`" in told.contents.value
        assert not waiting.done()
        number = next(iter(reversed(editor.protocol._request_futures)))
        editor.cancel_request(types.CancelParams(number))
        with pytest.raises(JsonRpcException) as cancelled:
            await asyncio.wait_for(given_up, PATIENCE)
        assert cancelled.value.code == types.LSPErrorCodes.RequestCancelled

        editor.change(slow, 2, TEXT.replace("10 cm", "20 cm"))  # what is under way is for nothing now
        with pytest.raises(JsonRpcException) as modified:
            await asyncio.wait_for(waiting, PATIENCE)
        assert modified.value.code == types.LSPErrorCodes.ContentModified
        told = await asyncio.wait_for(editor.hover(slow, 1, 5), PATIENCE)
        assert "20 cm" in told.contents.value
        assert await editor.diagnostics(slow, 2) == []
        ends = time.monotonic() + PATIENCE
        while busy in editor.workers() and time.monotonic() < ends:  # it is ended, and then waited for
            await asyncio.sleep(0.02)
        assert busy not in editor.workers(), "a process that is at work for an old text is ended"
        await editor.end()

    asyncio.run(session())


@pytest.mark.long
def test_a_process_that_dies_is_replaced():
    async def session():
        editor = Editor()
        await editor.begin()
        uri = "untitled:1"
        editor.open(uri)
        assert await editor.diagnostics(uri, 1) == []
        (worker,) = editor.workers()
        os.kill(worker, signal.SIGSTOP)
        waiting = asyncio.ensure_future(editor.hover(uri))
        await asyncio.sleep(0.05)
        os.kill(worker, signal.SIGKILL)
        with pytest.raises(JsonRpcException, match="killed by signal 9"):
            await asyncio.wait_for(waiting, PATIENCE)
        assert "phi" in (await asyncio.wait_for(editor.hover(uri), PATIENCE)).contents.value
        editor.text_document_did_close(types.DidCloseTextDocumentParams(types.TextDocumentIdentifier(uri)))
        assert await editor.diagnostics(uri, None) == []
        await editor.end()

    asyncio.run(session())
