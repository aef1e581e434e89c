"""Processes that are started ahead and kept: for one job after another, and never for two at a time."""

import errno
import itertools
import os
import pickle
import queue
import signal
import time
from pathlib import Path

import pytest

from scenegen.errors import ScenegenError
from scenegen.processes.ahead import BackgroundTask, IdleWorkers
from scenegen.processes.pool import PendingItem, Pool, run_pieces
from scenegen.processes.process import WorkerProcess
from scenegen.sampling.engine.run import start_processes

pytestmark = pytest.mark.usefixtures("interruptible")


def who(item):
    time.sleep(0.05)  # so that each gets some
    return item, os.getpid()


def fails(item):
    raise ValueError(f"no good: {item}")


def waits(item):
    time.sleep(600.0 * item)
    return os.getpid()


def gone(process):
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return True
    return False


def idle(reserve):
    return [process.process.pid for process in reserve._idle]


def begins(place):
    """Tells that it has begun, then goes on for ten minutes; with .deaf in the name it hears no signal."""
    if place.endswith(".deaf"):
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGUSR1})
    Path(place).touch()
    time.sleep(600.0)


@pytest.mark.parametrize("name, same", [("begun", True), ("begun.deaf", False)])
def test_who_gives_up_its_work_is_used_again(name, same, tmp_path):
    with IdleWorkers(1) as reserve:
        (mine,) = idle(reserve)
        with BackgroundTask(begins, str(tmp_path / name), reserve):
            while not (tmp_path / name).exists():
                time.sleep(0.01)
            start = time.monotonic()
        assert time.monotonic() - start < 60.0
        assert idle(reserve) == ([mine] if same else [])
        with BackgroundTask(who, 7, reserve) as beside:
            assert (beside.result() == (7, mine)) == same


def test_some_start_when_the_first_has_loaded():
    with IdleWorkers(1, ("numpy",), later=1) as reserve:
        first = idle(reserve)[0]
        deadline = time.monotonic() + 60.0
        while len(idle(reserve)) < 2 and time.monotonic() < deadline:
            time.sleep(0.01)
        one, other = idle(reserve)
        assert one == first != other
        reserve.fill()
        assert idle(reserve) == [one, other]


@pytest.mark.parametrize(
    "error", [OSError(errno.EMFILE, "too many open files"), RuntimeError("can't start new thread")]
)
def test_one_that_cannot_start_takes_no_other_with_it(error, monkeypatch):
    """The thread of the first process starts the second one."""
    asked = []
    module = "tempfile.TemporaryFile" if isinstance(error, OSError) else "subprocess.Popen"

    def fails(*args, **more):
        asked.append(1)
        raise error

    with IdleWorkers(1, ("numpy",), later=1) as reserve:
        mine = idle(reserve)
        monkeypatch.setattr(f"scenegen.processes.process.{module}", fails)
        deadline = time.monotonic() + 60.0
        while not asked and time.monotonic() < deadline:
            time.sleep(0.01)
        with pytest.raises(ScenegenError, match=r"too many open files|can't start new thread"):
            WorkerProcess("a worker process")
        with BackgroundTask(who, 7, reserve) as beside:
            assert beside.result() == (7, *mine)


class Fake:
    """A process that is said when it has loaded."""

    def __init__(self, what, load, loaded=None):
        self.loaded, self.process, self.idle, self.ended = loaded, self, True, False

    def kill(self):
        self.ended = True

    end = kill


def test_no_more_start_than_were_asked_for(monkeypatch):
    made = []
    monkeypatch.setattr("scenegen.processes.ahead.WorkerProcess", lambda *args: made.append(Fake(*args)) or made[-1])
    with IdleWorkers(2, later=2) as reserve:
        assert len(made) == 2
        for _ in range(2):
            reserve.take("a worker process")
        assert reserve.take("a worker process") is made[2]  # one of those that were to start later
        made[1].loaded()
        assert len(made) == 4
        made[0].loaded()
        reserve.fill()
        assert len(made) == 4 and made[2].loaded is None is made[3].loaded
        assert reserve.take("a worker process") is made[3]
        reserve.take("a worker process")
        assert len(made) == 5  # more are asked for than were announced
    with IdleWorkers(1, later=1) as reserve:
        late = made[-1]
    late.loaded()
    assert len(made) == 6 and late.ended


@pytest.mark.parametrize("workers, there, now, later", [(2, 2, 1, 1), (2, 16, 2, 0), (8, 4, 3, 1), (4, 1, 1, 0)])
def test_the_command_has_a_core_of_its_own_while_it_loads(workers, there, now, later, monkeypatch):
    made = []
    monkeypatch.setattr("scenegen.sampling.engine.run.cores", lambda: there)
    monkeypatch.setattr("scenegen.processes.ahead.WorkerProcess", lambda *args: made.append(Fake(*args)) or made[-1])
    with start_processes(workers, load=()) as reserve:
        assert len(made) == now
        reserve.fill()
        assert len(made) == now + later


@pytest.mark.parametrize("words", [{"workers": 1}, {"workers": None}, {"workers": 2, "engine": "ray"}])
def test_none_start_where_none_are_needed(words):
    with start_processes(**words) as reserve:
        reserve.fill()
        assert not idle(reserve)


@pytest.mark.long
def test_one_job_after_another_by_the_same_processes():
    with IdleWorkers(2) as reserve:
        mine = set(idle(reserve))
        assert len(mine) == 2
        with Pool(who, 2, reserve=reserve) as pool:
            first = {process for _, process in pool.map(range(60))}
        assert set(idle(reserve)) == mine
        with BackgroundTask(who, 7, reserve) as beside:
            assert beside.result()[1] in mine
        second = {process for _, process in run_pieces(who, range(20), 2, reserve)}
        assert first <= mine and second <= mine and set(idle(reserve)) == mine
    assert all(map(gone, mine))


@pytest.mark.long
def test_a_process_at_work_is_not_used_again():
    with IdleWorkers(2) as reserve:
        mine = set(idle(reserve))
        with run_pieces_until_the_first(waits, [0, 1, 1], reserve) as (process, rest):
            assert process in mine
            rest.close()
        assert set(idle(reserve)) <= mine and all(gone(one) for one in mine.difference(idle(reserve)))
        with BackgroundTask(waits, 1, reserve):
            pass
        assert list(run_pieces(abs, range(3), 2, reserve)) == [0, 1, 2]


class run_pieces_until_the_first:  # noqa: N801 - it reads as a function
    def __init__(self, job, items, reserve):
        self.results = run_pieces(job, items, 2, reserve)

    def __enter__(self):
        return next(self.results), self.results

    def __exit__(self, *_):
        self.results.close()


@pytest.mark.long
def test_one_that_died_while_it_waited_is_replaced():
    with IdleWorkers(1) as reserve:
        (process,) = idle(reserve)
        os.kill(process, signal.SIGKILL)
        assert list(run_pieces(abs, range(5), 2, reserve)) == [0, 1, 2, 3, 4]
        assert process not in idle(reserve)


@pytest.mark.long
def test_after_an_error_it_takes_the_next_job():
    with IdleWorkers(1) as reserve:
        mine = idle(reserve)
        with BackgroundTask(fails, 3, reserve) as beside, pytest.raises(ValueError, match="no good: 3"):
            beside.result()
        with BackgroundTask(who, 4, reserve) as beside:
            assert beside.result() == (4, mine[0])


def test_a_job_that_cannot_be_loaded_is_an_error_and_the_last_one_is_gone():
    inbox = queue.SimpleQueue()
    process = WorkerProcess("a worker process")
    try:
        for job, ready in ((pickle.dumps(abs), 0), (b"no pickle", 1)):
            process.take_up(job, inbox)
            message = inbox.get(timeout=60)
            assert message.ready and message.status == ready
        process.order(0, -3)
        assert inbox.get(timeout=60).status == 1
    finally:
        process.end()


def test_where_none_can_start_the_reserve_is_empty(monkeypatch):
    def none(*_, **__):
        raise OSError(11, "Resource temporarily unavailable")

    monkeypatch.setattr("scenegen.processes.process.subprocess.Popen", none)
    with IdleWorkers(3) as reserve:
        assert idle(reserve) == []


@pytest.mark.long
def test_a_large_job_reaches_a_process_that_is_still_starting():
    large = bytes(range(256)) * (1 << 14)  # more than a pipe holds
    with IdleWorkers(2) as reserve:
        found = list(itertools.islice(run_pieces(large.__getitem__, itertools.count(), 2, reserve), 300))
    assert found == [k % 256 for k in range(300)]


def early(item):
    time.sleep(0.3)
    return item, "early"


@pytest.mark.parametrize("first", [0, 1])
def test_an_item_under_way_is_left_to_its_process_which_then_joins_the_others(first):
    """Even if nobody asks for it, as in a run that is resumed."""
    with IdleWorkers(2) as reserve:
        mine = set(idle(reserve))
        beside = BackgroundTask(early, 0, reserve)
        underway = {0: PendingItem(beside, beside.result)}
        results = run_pieces(who, itertools.count(first), 2, reserve, underway)
        found = list(itertools.islice(results, 30))
        results.close()
        assert [item for item, _ in found] == list(range(first, first + 30))
        assert [item for item, process in found if process == "early"] == [0][first:]
        assert {process for _, process in found} - {"early"} == mine


def test_an_error_of_an_item_under_way_comes_in_its_turn():
    with IdleWorkers(2) as reserve:
        beside = BackgroundTask(fails, 2, reserve)
        results = run_pieces(who, itertools.count(), 2, reserve, {2: PendingItem(beside, beside.result)})
        assert [next(results)[0], next(results)[0]] == [0, 1]
        with pytest.raises(ValueError, match="no good: 2"):
            next(results)


def test_an_item_under_way_whose_process_dies_is_done_here():
    with IdleWorkers(2) as reserve:
        beside = BackgroundTask(early, 1, reserve)
        os.kill(beside._process.process.pid, signal.SIGKILL)
        results = run_pieces(who, itertools.count(), 2, reserve, {1: PendingItem(beside, beside.result)})
        assert list(itertools.islice(results, 3))[1] == (1, "early")
        results.close()
