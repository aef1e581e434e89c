"""Problems as editors show them. Questions and the processes that answer them, without the processes."""

import asyncio

import pytest

from scenegen.editors.lsp import analysis
from scenegen.editors.lsp.analysis import PROCESSES, AnalysisEnded, AnalysisProcesses
from scenegen.editors.lsp.answers import Question, problems
from scenegen.editors.lsp.document import Document
from scenegen.resources import shipped_specs


def said(text, **options):
    """(severity, marked text, first line of the message) of every problem."""
    found = problems(Document(text, **options))
    return [(one.severity, text[one.start : one.end], one.message.split("\n")[0]) for one in found]


@pytest.mark.long
@pytest.mark.parametrize("name", sorted(shipped_specs()))
def test_the_shipped_specs_have_none(name):
    path = shipped_specs()[name]
    found = [one.message.partition(":")[0] for one in problems(Document(path.read_text(), path))]
    # what the published code does, which does not wrap its angle, is kept on purpose
    assert found == (["a heading is compared as a number"] if name == "table_setting_published" else [])


def test_several_syntax_errors():
    found = said("object mug plate\nconst A = = 3\ntask: leftOf(mug, plate)\n")
    assert [one[0] for one in found] == ["error", "error"]


def test_several_mistakes_of_meaning():
    found = said("object mug, plate\na: leftOf(mug, plat)\nb: besid(mug, plate)\n")
    assert [(severity, where) for severity, where, _ in found] == [("error", "plat"), ("error", "besid")]


def test_a_message_has_its_help():
    (problem,) = problems(Document("object mug, plate\na: leftOf(mug, plat)\n"))
    assert problem.message.endswith("help: did you mean `plate`?")


def test_warnings():
    text = (
        "object mug, plate\nconst UNUSED = 3\ndef f(a, b) = leftOf(a, plate)\n"
        "task: f(mug, plate) & leftOf(mug, (0.5, 0))\n"
    )
    found = problems(Document(text))
    assert {(one.severity, text[one.start : one.end], one.unused) for one in found} == {
        ("warning", "UNUSED", True),
        ("warning", "b", True),
    }


def test_what_can_never_be():
    text = "object a, b at (0.2, 0.2)\nfar: dist(a, b) >= 2 m\nfine: leftOf(a, b)\n"
    (found,) = said(text)
    assert found == ("warning", "dist(a, b) >= 2 m", "`far` can never be satisfied: phi is at most -0.8686")
    assert said("dist(a, b) >= 2 m") == [
        ("warning", "dist(a, b) >= 2 m", "`task` can never be satisfied: phi is at most -0.5858")
    ]
    (found,) = said("object a, b at (0.2, 0.2)\nrequire x(a) >= 2 m\nfar: dist(a, b) >= 2 m\n")
    assert found[:2] == ("warning", "x(a) >= 2 m") and found[2].startswith("what the spec requires can never be met")


def test_phi_beyond_all_numbers():
    (one,) = said("x(a) * 1e200 * 1e200 <= 1")
    assert one[0] == "error" and "larger than a computer's numbers" in one[2]


def test_mistakes_in_other_files_show_at_the_import(tmp_path):
    (tmp_path / "one.spec").write_text("const A = 1\n")
    (tmp_path / "two.spec").write_text("# two\nconst B = unknown\n")
    text = 'import "one.spec"\nimport "two.spec"\nt: leftOf(a, b)\n'
    (problem,) = problems(Document(text, tmp_path / "main.spec"))
    assert text[problem.start : problem.end] == '"two.spec"'
    assert "two.spec:2:11: unknown constant `unknown`" in problem.message
    assert problem.elsewhere.text == "unknown"


def test_imports_are_refused_as_the_checker_refuses_them(tmp_path):
    for written in ("none.spec", "../main.spec", "/dev/null", "main.spec"):
        (one,) = said(f'import "{written}"\nt: leftOf(a, b)\n', path=tmp_path / "main.spec")
        assert one[:2] == ("error", f'"{written}"')
    (one,) = said('import "one.spec"\nt: leftOf(a, b)\n')
    assert "a spec without a file cannot read files" in one[2]


def test_a_wider_root(tmp_path):
    (tmp_path / "sub").mkdir()
    (tmp_path / "one.spec").write_text("const A = 0.5\n")
    text = 'import "../one.spec"\nt: x(a) <= A\n'
    assert said(text, path=tmp_path / "sub" / "main.spec")[0][0] == "error"
    assert said(text, path=tmp_path / "sub" / "main.spec", root=tmp_path) == []


def test_windows_line_breaks():
    """Lines stay lines: what is marked is found by line and character."""
    (problem,) = problems(Document("object mug, plate\r\n# x\r\na: leftOf(mug, plat)\r\n"))
    document = Document("object mug, plate\r\n# x\r\na: leftOf(mug, plat)\r\n")
    assert document.text[problem.start : problem.end] == "plat"


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
    monkeypatch.setattr(analysis, "LATE_ANSWER_SECONDS", 0.02)
    return Still.made


def text(uri, words="now"):
    return {"uri": str(uri), "text": words}


def test_few_processes_for_many_documents(processes):
    async def session():
        asked = AnalysisProcesses()
        for number in range(PROCESSES + 3):
            assert await asked.ask(text(number), ASKED) == "at once"
        assert len(processes) == PROCESSES
        await asked.ask(text(PROCESSES + 1), ASKED)  # one has it already
        assert [one.asked for one in processes if one.asked[-2:] == [str(PROCESSES + 1)] * 2]
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
    monkeypatch.setattr(analysis, "MAX_QUESTION_SECONDS", 0.01)

    async def session():
        asked = AnalysisProcesses()
        many = [asked.ask(text(number, "later"), ASKED) for number in range(2 * PROCESSES)]
        found = await asyncio.gather(*many, return_exceptions=True)
        assert {str(one) for one in found} == {"was ended after 0.01 s"}
        assert all(isinstance(one, AnalysisEnded) for one in found)
        assert len(processes) == 2 * PROCESSES and all(one.ended for one in processes)

    asyncio.run(session())


def test_importers_are_checked_again(monkeypatch, tmp_path):
    """Whose text names an import is checked again when another document changes, with the open text of that one."""
    pytest.importorskip("pygls")
    from lsprotocol import types
    from pygls.workspace import Workspace

    from scenegen.editors.lsp import server as program

    monkeypatch.setattr(program, "PAUSE", 0.0)
    main, table = ((tmp_path / f"{name}.spec").as_uri() for name in ("main", "table"))
    asked = []

    async def ask(text, question):
        asked.append((text["uri"], text["open_texts"]))
        return []

    async def session():
        server = program.Server()
        server.protocol._workspace = Workspace(None, types.TextDocumentSyncKind.Full)
        server._analyses.ask = ask
        for uri, written in ((main, 'import "table.spec"\nt: near(a, b)'), (table, "const A = 1")):
            item = types.TextDocumentItem(uri, "scenegen", 1, written)
            server.workspace.put_text_document(item)
            server._on_change(types.DidOpenTextDocumentParams(item))
            for _ in range(5):
                await asyncio.sleep(0.001)

    asyncio.run(session())
    assert [uri for uri, _ in asked] == [main, table, main]
    assert asked[1][1] == {} and asked[2][1][str(tmp_path / "table.spec")] == "const A = 1"
