"""Steps that another process does as soon as they are known: the states are those of doing them in order."""

import sys
import time
from pathlib import Path

import pytest

from scenegen.processes.ahead import IdleWorkers, Lookahead

sys.path.insert(0, str(Path(__file__).parent))
import jobs

pytestmark = pytest.mark.usefixtures("interruptible")


def until(condition):
    end = time.monotonic() + 60.0
    while not condition() and time.monotonic() < end:
        time.sleep(0.01)
    assert condition()


@pytest.mark.long
def test_all_items_go_through_all_steps_in_order():
    with IdleWorkers(1) as reserve:
        (mine,) = [process.process.pid for process in reserve._idle]
        with Lookahead(jobs.Sums(), 3, reserve) as ahead:
            for step in range(5):
                ahead.add(step)
            until(lambda: ahead._done == [5, 5, 5])
            assert ahead.states() == dict.fromkeys(range(3), (mine, (0, 1, 2, 3, 4)))
        assert [process.process.pid for process in reserve._idle] == [mine]


@pytest.mark.long
def test_items_are_kept_equally_far_and_nobody_waits_for_the_rest():
    with Lookahead(jobs.Sums(slow=0.05), 3, None) as ahead:
        for step in range(1000):
            ahead.add(step)
        until(lambda: ahead._done[0] > 2)
        begun = time.monotonic()
        states = ahead.states()
        assert time.monotonic() - begun < 30.0
    done = [len(steps) for _, steps in states.values()]
    assert sorted(states) == [0, 1, 2] and min(done) >= 2 and max(done) - min(done) <= 1
    assert all(steps == tuple(range(len(steps))) for _, steps in states.values())


@pytest.mark.long
@pytest.mark.parametrize("how", ["error", "kill"])
def test_where_it_fails_there_are_no_states(how):
    with Lookahead(jobs.Sums(how), 2, None) as ahead:
        for step in range(6):
            ahead.add(step)
        until(lambda: not ahead._thread.is_alive())
        ahead.add(6)
        assert ahead.states() == {}


@pytest.mark.long
def test_it_ends_with_its_block_whatever_it_does():
    begun = time.monotonic()
    with Lookahead(jobs.Sums(slow=600.0), 2, None) as ahead:
        ahead.add(0)
        until(lambda: ahead._process.ready)
    with Lookahead(jobs.Sums(), 2, None):
        pass
    assert time.monotonic() - begun < 60.0


def test_where_no_process_can_start_there_are_no_states(monkeypatch):
    def none(*_, **__):
        raise OSError(11, "Resource temporarily unavailable")

    monkeypatch.setattr("scenegen.processes.process.subprocess.Popen", none)
    with Lookahead(jobs.Sums(), 2, None) as ahead:
        ahead.add(0)
        assert ahead.states() == {}
