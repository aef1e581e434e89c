"""Worker processes: the same results as without them, in order, whatever happens to the processes."""

import errno
import itertools
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from scenegen.errors import RequestError, ScenegenError
from scenegen.processes.pool import MAX_ITEMS_PER_WORKER, MAX_SMALL_ITEMS_PER_WORKER, Pool, run_pieces

pytestmark = pytest.mark.usefixtures("interruptible")

HERE = Path(__file__).parent


@pytest.mark.long
@pytest.mark.parametrize("workers", [2, 5])
def test_the_same_results_in_the_same_order(workers, tmp_path):
    import jobs

    pieces = [*range(20), 3, 7, 7]
    job = jobs.Numbers(seed=4, slow=0.01)
    alone = [rows for rows, _ in run_pieces(job, pieces, 1)]
    shared = list(run_pieces(replace(job, meet=str(tmp_path)), pieces, workers))
    assert [rows.tobytes() for rows, _ in shared] == [rows.tobytes() for rows in alone]
    assert all(rows.flags.writeable for rows, _ in shared)
    crew = {who for _, who in shared}
    assert os.getpid() not in crew and 2 <= len(crew) <= workers


def test_no_pieces():
    import jobs

    assert list(run_pieces(jobs.Numbers(), [], 2)) == []


@pytest.mark.parametrize("size, most", [(8, MAX_SMALL_ITEMS_PER_WORKER), (16 << 20, MAX_ITEMS_PER_WORKER)])
def test_an_endless_supply_is_taken_only_as_fast_as_it_is_used(size, most):
    import jobs

    taken = []
    pieces = (taken.append(k) or k for k in itertools.count())
    results = run_pieces(jobs.Large(size), pieces, 2)
    for used in range(1, 11):
        next(results)
        assert len(taken) <= used + most * 2
    time.sleep(0.3)  # nobody takes anything, so nothing is ordered
    assert len(taken) <= 10 + most * 2
    results.close()


def test_nobody_waits_for_an_item_that_takes_long(tmp_path):
    """The first item ends when another worker has done all others."""
    import jobs

    done = tmp_path / "done"
    done.mkdir()
    assert list(run_pieces(jobs.AfterOthers(str(done), 11), range(12), 2)) == list(range(12))


def test_large_results_pass_whole():
    import jobs

    for piece, result in enumerate(run_pieces(jobs.Large(8 << 20), range(6), 2)):
        assert result.shape == (1 << 20,) and (result == piece).all()


@pytest.mark.parametrize("workers", [1, 2])
@pytest.mark.parametrize("how, kind", [("diagnostic", RequestError), ("odd", Exception)])
def test_errors_come_in_turn(how, kind, workers, tmp_path):
    import jobs

    results = run_pieces(jobs.Fails(4, how, 1, str(tmp_path)), range(100), workers)
    assert list(itertools.islice(results, 4)) == [0, 1, 4, 9]
    with pytest.raises(kind) as caught:
        next(results)
    if how == "diagnostic":
        (problem,) = caught.value.diagnostics
        assert problem.title == "no good" and problem.span.text == "ex" and problem.help == "do that"
    elif workers > 1:
        assert "_OddError" in str(caught.value) and "jobs.py" in str(caught.value)
    assert list(results) == []


@pytest.mark.long
@pytest.mark.parametrize("how", ["kill", "exit", "crash"])
def test_a_piece_whose_worker_dies_is_done_again(how, tmp_path):
    import jobs

    results = run_pieces(jobs.Fails(5, how, 1, str(tmp_path)), range(20), 2)
    assert list(results) == [k * k for k in range(20)]
    assert len(list(tmp_path.iterdir())) == 1


@pytest.mark.long
@pytest.mark.parametrize("how, said", [("kill", "was killed by signal 9"), ("exit", "ended with status 3")])
def test_a_piece_that_kills_twice(how, said, tmp_path):
    import jobs

    with pytest.raises(ScenegenError, match=f"{said} at piece 5, and so did another") as caught:
        list(run_pieces(jobs.Fails(5, how, 99, str(tmp_path)), range(20), 2))
    assert caught.value.diagnostics[0].help
    assert len(list(tmp_path.iterdir())) == 2


@pytest.mark.long
def test_killed_from_outside(tmp_path):
    """Every worker is killed once in the middle of it all."""
    import jobs
    from conftest import children

    job = jobs.Numbers(slow=0.02)
    expected = [rows.tobytes() for rows, _ in run_pieces(job, range(40))]
    results = run_pieces(job, range(40), 2)
    found = [rows.tobytes() for rows, _ in itertools.islice(results, 3)]
    for process in children():
        os.kill(process, signal.SIGKILL)
    found += [rows.tobytes() for rows, _ in results]
    assert found == expected


def test_a_job_that_cannot_be_loaded():
    import jobs

    with pytest.raises(RuntimeError, match="not today"):
        next(run_pieces(jobs.Unloadable(), range(3), 2))


@pytest.mark.parametrize("workers", [0, -1, 257])
def test_a_wrong_number_of_workers(workers):
    with pytest.raises(RequestError, match="must be from 1 to 256"):
        run_pieces(len, [], workers)


def test_alone_is_one_thread():
    import torch

    before = torch.get_num_threads()
    try:
        torch.set_num_threads(3)
        assert list(run_pieces(lambda _: torch.get_num_threads(), range(2))) == [1, 1]
        assert torch.get_num_threads() == 3
    finally:
        torch.set_num_threads(before)


# a script without `if __name__ == "__main__"`, as people write them
SCRIPT = f"""
import itertools, sys
sys.path.insert(0, {str(HERE)!r})
import jobs
from scenegen.processes.pool import run_pieces
for rows, who in run_pieces(jobs.Numbers(slow=float(sys.argv[1])), itertools.count(), 2):
    print(who, flush=True)
"""


@pytest.mark.long
@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGKILL])
@pytest.mark.parametrize("slow", ["0.01", "1000"])
def test_no_process_survives_its_parent(how, slow, tmp_path):
    """Ctrl-C, which reaches the whole group, and kill -9, which reaches the parent only; idle, and in a long piece."""
    script = tmp_path / "script.py"
    script.write_text(SCRIPT)
    command = [sys.executable, str(script), slow]
    parent = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True)
    try:
        deadline = time.monotonic() + 20
        crew = []
        while len(crew) < 2 and time.monotonic() < deadline:
            crew = Path(f"/proc/{parent.pid}/task/{parent.pid}/children").read_text().split()
            time.sleep(0.05)
        if slow == "0.01":
            parent.stdout.readline()
        else:
            time.sleep(0.5)
        if how == signal.SIGINT:
            os.killpg(parent.pid, how)
        else:
            parent.kill()
        parent.communicate(timeout=60)
        assert len(crew) == 2
        while any(map(alive, crew)) and time.monotonic() < deadline:
            time.sleep(0.02)
        assert not any(map(alive, crew))
    finally:
        parent.kill()
        parent.communicate()


def alive(process):
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def test_values_of_any_kind():
    from jobs import Any_

    for piece, value in enumerate(run_pieces(Any_(), range(4), 2)):
        np.testing.assert_equal(value, Any_()(piece))


@pytest.mark.parametrize("ready, deaths", [(True, {0: 1}), (False, {})])
def test_an_item_kills_only_whom_it_was_begun_by(ready, deaths, monkeypatch):
    """A worker has its first item before it is ready."""

    class Worker:
        orders, process = [(0, "an item")], SimpleNamespace(returncode=-signal.SIGKILL)

        def end(self):
            return ""

    worker, pool = Worker(), Pool(None, 2)
    pool._begin([])
    worker.ready = ready
    pool._workers = [worker]
    monkeypatch.setattr(pool, "_start", lambda: None)
    pool._replace(worker)
    assert pool._deaths == deaths and pool._again == worker.orders


def test_second_orders_wait_until_every_worker_has_begun():
    """Else the first that is ready takes what a later one could begin with at once."""

    class Worker:
        def __init__(self, *, ready):
            self.ready, self.orders, self.brief = ready, [], True

        def order(self, turn, item):
            self.orders.append(item)

    pool = Pool(None, 2)
    early, late = Worker(ready=True), Worker(ready=False)
    pool._workers = [early, late]
    pool._begin(itertools.count())
    pool._give_orders()
    assert (early.orders, late.orders) == ([0], [])
    late.ready = True
    pool._give_orders()
    assert (early.orders, late.orders) == ([0, 2], [1, 3])
    pool._workers = []


@pytest.mark.parametrize("what", ["tempfile.TemporaryFile", "subprocess.Popen", "threading.Thread.start"])
def test_where_no_process_can_start(what, monkeypatch):
    def none(*_, **__):
        raise (
            RuntimeError("can't start new thread") if "thread" in what else OSError(errno.EMFILE, "too many open files")
        )

    monkeypatch.setattr(f"scenegen.processes.process.{what}", none)
    with pytest.raises(ScenegenError, match=r"too many open files|can't start new thread"):
        list(run_pieces(abs, range(3), 2))


@pytest.mark.long
def test_a_large_job_reaches_a_process_that_is_still_starting():
    large = bytes(range(256)) * (1 << 14)  # more than a pipe holds
    found = list(itertools.islice(run_pieces(large.__getitem__, itertools.count(), 2), 300))
    assert found == [k % 256 for k in range(300)]
