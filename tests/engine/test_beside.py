"""Work in a process beside this one: its result, its errors, its death, its early end."""

import os
import signal
import time

import pytest

from scenegen.processes.ahead import BackgroundTask
from scenegen.search.effort import StoppedError


def where(item):
    return item, os.getpid()


def fails(item):
    raise StoppedError(f"it got to {item}")


def dies_elsewhere(parent):
    if os.getpid() != parent:
        os.kill(os.getpid(), signal.SIGKILL)
    return "here"


def sleeps(seconds):
    time.sleep(seconds)


@pytest.mark.long
def test_the_work_is_done_in_another_process():
    with BackgroundTask(where, 7) as beside:
        item, process = beside.result()
        assert item == 7 and process != os.getpid() and beside.result() == (item, process)
    with pytest.raises(ProcessLookupError):
        os.kill(process, 0)


@pytest.mark.long
def test_an_error_is_raised_when_the_result_is_asked_for():
    with BackgroundTask(fails, 3) as beside, pytest.raises(StoppedError) as caught:
        beside.result()
    assert caught.value.how_far == "it got to 3"


@pytest.mark.long
def test_where_the_process_dies_the_work_is_done_here():
    with BackgroundTask(dies_elsewhere, os.getpid()) as beside:
        assert beside.result() == "here"


def test_where_none_can_start_the_work_is_done_here(monkeypatch):
    def none(*_, **__):
        raise OSError(11, "Resource temporarily unavailable")

    monkeypatch.setattr("scenegen.processes.process.subprocess.Popen", none)
    with BackgroundTask(where, 7) as beside:
        assert beside.result() == (7, os.getpid())


@pytest.mark.long
def test_it_ends_with_its_block():
    begun = time.monotonic()
    with BackgroundTask(sleeps, 600.0):
        pass
    assert time.monotonic() - begun < 60.0
