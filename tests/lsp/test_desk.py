"""Documents and their processes, without the processes."""

import asyncio
import threading

import pytest

pytest.importorskip("pygls")

from scenegen.editors.lsp import desk as desks
from scenegen.editors.lsp import worker as workers
from scenegen.editors.lsp.answers import Question, answer
from scenegen.editors.lsp.desk import LanguageProcessEnded
from scenegen.editors.lsp.document import once


class Still:
    """A process that answers at once."""

    def __init__(self, idle) -> None:
        self.revision, self.ended, self.under_way, self.told = -1, False, {}, []
        self.idle = idle

    def tell(self, message):
        self.revision = message["revision"]
        self.told.append(message)

    def ask(self, question):
        future = asyncio.get_running_loop().create_future()
        future.set_result(b"[]")
        return future

    def end(self):
        self.ended = True
        for future in self.under_way.values():
            future.set_exception(LanguageProcessEnded("ended"))
        self.under_way.clear()
        self.idle(self)


class Busy(Still):
    """A process that answers when it is told to."""

    def ask(self, question):
        future = asyncio.get_running_loop().create_future()
        self.under_way[len(self.under_way)] = future
        return future

    def answer(self):
        waiting = list(self.under_way.values())
        self.under_way.clear()
        self.idle(self)
        for future in waiting:
            if not future.done():
                future.set_result(b"[]")


@pytest.fixture
def desk(monkeypatch):
    monkeypatch.setattr(desks, "LanguageProcess", Still)
    monkeypatch.setattr(desks, "PAUSE", 0.0)
    said = []
    found = desks.DiagnosticsService(lambda *one: said.append(one))
    found.said = said
    return found


def test_only_so_many_processes_run(desk):
    async def session():
        for number in range(desks.MOST + 3):
            desk.opened(f"untitled:{number}", "leftOf(a, b)", 1)
            await asyncio.sleep(0.001)
            await asyncio.sleep(0.001)
        first = desk._open["untitled:0"]
        assert first.process is None and sum(one.process is not None for one in desk._open.values()) == desks.MOST
        assert len(desk._processes) == desks.MOST
        assert await desk.ask("untitled:0", Question("hover")) == b"[]"
        assert first.process is not None and desk._open["untitled:3"].process is None

    asyncio.run(session())
    assert len(desk.said) == desks.MOST + 3


def test_the_last_edited_comes_first_where_all_processes_are_at_work(desk, monkeypatch):
    monkeypatch.setattr(desks, "LanguageProcess", Busy)
    monkeypatch.setattr(desks, "GRACE", 0.02)
    checked = []
    desk._publish = lambda uri, version, found: checked.append(int(uri.rpartition(":")[2]))

    async def session():
        count = 3 * desks.MOST
        for number in range(count):
            desk.opened(f"untitled:{number}", "leftOf(a, b)", 1)
        deadline = asyncio.get_running_loop().time() + 20.0
        while len(checked) < count and asyncio.get_running_loop().time() < deadline:
            await asyncio.sleep(0.5)  # enough for those that came later to end what is older
            assert len(desk._processes) <= desks.MOST
            for process in list(desk._processes):
                process.answer()
        assert sorted(checked) == list(range(count))
        # the newest ones ended the oldest ones, and were checked first
        assert set(checked[: desks.MOST]) == set(range(count - desks.MOST, count))

    asyncio.run(session())


def test_one_text_a_version_and_importers_learn_of_changes(desk, tmp_path):
    main, table = ((tmp_path / f"{name}.spec").as_uri() for name in ("main", "table"))

    async def session():
        desk.opened(main, 'import "table.spec"\nt: near(a, b)', 1)
        desk.opened(table, "const A = 1", 1)
        for _ in range(3):
            assert await desk.ask(main, Question("hover")) == b"[]"
        told = desk._open[main].process.told
        assert len(told) == 1
        desk.opened(table, "const A = 2", 2)
        await desk.ask(main, Question("hover"))
        assert told[-1]["open"][str(tmp_path / "table.spec")] == "const A = 2"
        await desk.ask(table, Question("hover"))
        assert [one["open"] for one in desk._open[table].process.told] == [{}]

    asyncio.run(session())


def test_names_do_not_wait_for_meaning(monkeypatch):
    going, told, arrived = threading.Event(), {}, threading.Semaphore(0)

    def say(number, kind, value):
        told[number] = value
        arrived.release()

    def slowly(page, question):
        if question.feature == "diagnostics":
            assert going.wait(20.0)
        return answer(page, question)

    monkeypatch.setattr(workers, "answer", slowly)
    worker = workers.LanguageWorker(say)
    about = {"uri": "untitled:1", "path": None, "root": None, "open": {}, "encoding": "utf-16"}
    place = {"line": 0, "character": 0, "name": ""}
    worker.hear(about | {"text": "t: leftOf(a, b)", "revision": 1})
    worker.hear(place | {"ask": 1, "revision": 1, "feature": "diagnostics"})
    worker.hear(place | {"ask": 2, "revision": 1, "feature": "hover"})
    worker.hear(place | {"ask": 3, "revision": 1, "feature": "symbols"})
    assert arrived.acquire(timeout=20.0) and list(told) == [3] and told[3][0]["name"] == "t"
    worker.hear(about | {"text": "u: leftOf(a, b)", "revision": 2})
    worker.hear(place | {"ask": 4, "revision": 1, "feature": "symbols"})
    assert arrived.acquire(timeout=20.0) and told[4] is None  # about a text that is gone
    going.set()
    assert arrived.acquire(timeout=20.0) and arrived.acquire(timeout=20.0)
    assert told[1] == [] and told[2] is None


def test_two_threads_compute_once():
    count = []

    class Thing:
        @once
        def slow(self):
            count.append(1)
            threading.Event().wait(0.02)
            return object()

    thing, found = Thing(), []
    threads = [threading.Thread(target=lambda: found.append(thing.slow)) for _ in range(4)]
    for one in threads:
        one.start()
    for one in threads:
        one.join()
    assert count == [1] and len({*found}) == 1 and Thing().slow is not thing.slow
