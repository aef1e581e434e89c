"""Questions and the processes that answer them, without the processes."""

import asyncio

import pytest

from scenegen.editors.lsp import analysis
from scenegen.editors.lsp.analysis import MOST, AnalysisEnded, AnalysisProcesses
from scenegen.editors.lsp.answers import Question

ASKED = Question("hover")


class Still:
    """A process that answers when it is told to, or at once where the text is "now"."""

    made: list["Still"]

    def __init__(self):
        self.busy, self.uri, self.ended, self.asked = False, "", False, []
        self.made.append(self)

    async def ask(self, message):
        self.asked.append(message["text"]["uri"])
        self.answer = asyncio.get_running_loop().create_future()
        return "at once" if message["text"]["text"] == "now" else await self.answer

    def end(self):
        self.ended = True


@pytest.fixture
def processes(monkeypatch):
    Still.made = []
    monkeypatch.setattr(analysis, "_AnalysisProcess", Still)
    monkeypatch.setattr(analysis, "GRACE", 0.02)
    return Still.made


def text(uri, words="now"):
    return {"uri": str(uri), "text": words}


def test_few_processes_for_many_documents(processes):
    async def session():
        asked = AnalysisProcesses()
        for number in range(MOST + 3):
            assert await asked.ask(text(number), ASKED) == "at once"
        assert len(processes) == MOST
        await asked.ask(text(MOST + 1), ASKED)  # one has it already
        assert [one.asked for one in processes if one.asked[-2:] == [str(MOST + 1)] * 2]
        await asked.ask(text(0), ASKED)  # the one that was idle for longest
        assert processes[3].asked == ["3", "0"]
        asked.close()
        assert all(one.ended for one in processes)

    asyncio.run(session())


def test_who_does_not_wait_any_more_ends_the_process(processes):
    async def session():
        asked = AnalysisProcesses()
        for answered in (True, False):
            waiting = asyncio.ensure_future(asked.ask(text("a", "later"), ASKED))
            await asyncio.sleep(0.001)
            assert await asked.ask(text("b"), ASKED) == "at once", "another process does it"
            waiting.cancel()
            await asyncio.sleep(0.001)
            if answered:  # soon enough
                processes[0].answer.set_result("late")
            with pytest.raises(asyncio.CancelledError):
                await waiting
            assert processes[0].ended is not answered and not processes[0].busy
        assert await asked.ask(text("a"), ASKED) == "at once"
        assert not processes[1].ended

    asyncio.run(session())


def test_what_takes_too_long_is_ended(processes, monkeypatch):
    monkeypatch.setattr(analysis, "LONGEST", 0.01)

    async def session():
        asked = AnalysisProcesses()
        many = [asked.ask(text(number, "later"), ASKED) for number in range(2 * MOST)]
        found = await asyncio.gather(*many, return_exceptions=True)
        assert {str(one) for one in found} == {"was ended after 0.01 s"}
        assert all(isinstance(one, AnalysisEnded) for one in found)
        assert len(processes) == 2 * MOST and all(one.ended for one in processes)

    asyncio.run(session())


def test_importers_are_checked_again(monkeypatch, tmp_path):
    """Whose text names an import is checked again when another document changes, with the open text of that one."""
    pytest.importorskip("pygls")
    from lsprotocol import types
    from pygls.workspace import Workspace

    from scenegen.editors.lsp.server import Server

    monkeypatch.setattr("scenegen.editors.lsp.server.PAUSE", 0.0)
    main, table = ((tmp_path / f"{name}.spec").as_uri() for name in ("main", "table"))
    asked = []

    async def ask(text, question):
        asked.append((text["uri"], text["open_texts"]))
        return []

    async def session():
        server = Server()
        server.protocol._workspace = Workspace(None, types.TextDocumentSyncKind.Full)
        server._analyses.ask = ask
        for uri, written in ((main, 'import "table.spec"\nt: near(a, b)'), (table, "const A = 1")):
            item = types.TextDocumentItem(uri, "scenegen", 1, written)
            server.workspace.put_text_document(item)
            server._changed(types.DidOpenTextDocumentParams(item))
            for _ in range(5):
                await asyncio.sleep(0.001)

    asyncio.run(session())
    assert [uri for uri, _ in asked] == [main, table, main]
    assert asked[1][1] == {} and asked[2][1][str(tmp_path / "table.spec")] == "const A = 1"
