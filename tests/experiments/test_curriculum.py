"""The experiment `curriculum`: what is run, how it is kept, its tables. The learners have tests of their own."""

import dataclasses
import json
import threading
import time
from itertools import chain

import pytest

from experiments.cache import Cache
from experiments.curricula import runs as module
from experiments.curricula import tables
from experiments.curricula.bars import bars
from experiments.curricula.cases import MODEL, beyond, figure5, sensitivity, strategies
from experiments.curricula.runs import Record, Runner
from experiments.curriculum import _panels
from experiments.figures.episodes import episodes
from scenegen.errors import RequestError

SEEDS = (0, 1)


def cases(size=10):
    return list(
        chain(figure5((5, size), SEEDS), sensitivity(5, SEEDS), strategies(size, 15, SEEDS), beyond(size, SEEDS))
    )


def record(case):
    """Figures that differ with all that a case is; the first seed of one row never converges."""
    base = {"uniform": 9000, "linear": 5000}.get(case.name, 400) * case.size
    count = base + 100 * case.seed
    if case.name == "backward replay, uniform" and case.seed == 0:
        count = -1
    return Record(
        episodes=count, steps=40 * count, resets=count // 7, any_episodes=2 * count if case.both else -1,
        any_steps=80 * count, any_resets=count // 5, any_share=0.5, level=3, cpu=0.25,
    )  # fmt: skip


def found(size=10):
    return [(case, record(case)) for case in cases(size)]


@pytest.fixture
def cache(tmp_path):
    return Cache.beside(tmp_path)


@pytest.fixture(scope="module")
def every():
    return found()


def test_a_request_holds_all_that_a_run_follows_from(cache):
    runner, by_key = Runner(cache, True), {}
    for case in cases():
        by_key.setdefault(runner.key(case), []).append(case)
    for same in by_key.values():
        plain = {dataclasses.replace(case, group="", name="") for case in same}
        assert len(plain) == 1
    assert len(by_key) < len(cases())  # beyond repeats rows of Fig. 5, sensitivity the unchanged setting
    [case] = [case for case in cases() if case.name == "map, uniform" and case.seed == 0]
    assert runner.request(case)["learner"][0] == "Explorer"
    [drawn] = [case for case in cases() if case.source == MODEL and case.task == "A" and case.size == 5
               and case.seed == 0 and case.both]  # fmt: skip
    assert runner.request(drawn) != Runner(cache, False).request(drawn)  # another model


def test_what_was_found_is_kept_and_used_again(cache, monkeypatch):
    done = []
    monkeypatch.setattr(Runner, "draw", lambda self, case: None)
    monkeypatch.setattr(Runner, "perform", lambda self, case: done.append(case) or record(case))
    few = [case for case in cases() if case.source != MODEL][:40]
    first = Runner(cache, True)
    first.all(few[:30], 2, lambda text: None)
    assert {first.key(case) for case in few[:30]} <= {first.key(case) for case in done}
    done.clear()
    second, told = Runner(cache, True), []
    second.all(few, 2, told.append)
    kinds = {(type(case.learner), case.relations) for case in few}
    assert len(done) <= len({second.key(case) for case in few[30:]}) + len(kinds)  # one of each is run to compile it
    assert told and "from an earlier run" in told[0]
    assert all(second.of(case) == record(case) for case in few)


def test_what_fails_on_a_thread_is_raised(cache, monkeypatch):
    def fail(self, case):
        if case.most > 1:
            raise RequestError(module.__name__)

    monkeypatch.setattr(Runner, "draw", lambda self, case: None)
    monkeypatch.setattr(Runner, "perform", fail)
    with pytest.raises(RequestError):
        Runner(cache, True).all(cases()[:9], 2, lambda text: None)


def test_what_was_done_before_a_failure_is_kept(cache, monkeypatch):
    few = [case for case in cases() if case.source != MODEL][:12]
    drawn = []

    def draw(self, case):
        drawn.append(case)
        if len(drawn) > 8:
            deadline = time.monotonic() + 30.0
            while len(self.found) < 5 and time.monotonic() < deadline:
                time.sleep(0.01)
            raise RequestError(module.__name__)

    before = threading.active_count()
    monkeypatch.setattr(Runner, "draw", draw)
    monkeypatch.setattr(Runner, "perform", lambda self, case: record(case))
    with pytest.raises(RequestError):
        Runner(cache, True).all(few, 2, lambda text: None)
    assert len(drawn) == 9 and len(list(cache.folder.glob("*.json"))) >= 5
    deadline = time.monotonic() + 30.0
    while threading.active_count() > before and time.monotonic() < deadline:
        time.sleep(0.01)
    assert threading.active_count() == before


def test_tables(golden, every):
    made = tables.tables(every, (5, 10), 96) | {"bars": bars(every, 10)}
    golden("experiments/curriculum.md", "\n\n".join(f"## {name}\n\n{text}" for name, text in made.items()) + "\n")


def test_data_has_every_run(every):
    rows = tables.data(every)
    assert sum(len(row["seeds"]) for row in rows) == len(every)
    row = next(row for row in rows if row["name"] == "corridors" and row["M"] == 10)
    assert row["episodes"] == [4000, 4100] and row["any_episodes"] == [8000, 8200]
    assert row["learner"]["epsilon"] == 0.1 and row["scenes"] == "exact sampler"
    json.dumps(rows)


@pytest.mark.long
def test_the_figure_leaves_out_what_did_not_converge(every):
    panels = _panels(every)
    assert [panel.words.partition(":")[0] for panel in panels] == [
        "paper-like, task A", "fair, task A", "paper-like, task B", "fair, task B",
    ]  # fmt: skip
    assert set(panels[1].curves) == {"uniform", "linear", "self-paced", "self-paced, model", "corridors"}
    never = [(case, one.model_copy(update={"episodes": -1}) if case.name == "linear" else one) for case, one in every]
    assert _panels(never)[0].curves["linear"] == {5: [], 10: []}
    assert episodes(_panels(never), 2).startswith(b"\x89PNG")
