"""One run at a time in a set: the second is refused, and what a killed one left behind is not."""

import os
import signal
import subprocess
import sys
import time

import pyarrow.fs
import pytest

from scenegen.errors import OutputError
from scenegen.scenes import lease
from scenegen.scenes.lease import LOCK, LeaseHolder, held, refuse_held
from scenegen.scenes.stores import Store, store_at

HOLD = """
import sys, time
from scenegen.scenes.lease import held
from scenegen.scenes.stores import store_at
with held(store_at(sys.argv[1])):
    print("held", flush=True)
    time.sleep(60)
"""


@pytest.fixture
def remote(tmp_path, monkeypatch):
    """A folder that is used as an object store."""
    monkeypatch.setattr(lease, "SETTLE", 0.0)
    return Store("s3://bucket/set/", pyarrow.fs.LocalFileSystem(), str(tmp_path), False, patience=0.0)


def write(store, *, born="1", machine="elsewhere", token="theirs"):
    holder = LeaseHolder(host="other", machine=machine, pid=os.getpid(), born=born, token=token)
    store.write(LOCK, holder.model_dump_json().encode())


def test_two_runs_on_a_disk(tmp_path):
    store = store_at(f"{tmp_path}/set/")
    with held(store) as hold:
        hold.check()
        for refused in (refuse_held, lambda store: held(store).__enter__()):
            with pytest.raises(OutputError, match=rf"another run is writing .*set/: process {os.getpid()} on "):
                refused(store)
    refuse_held(store)
    assert store.sizes() == {}
    with held(store):
        pass


def test_a_place_that_cannot_be_locked(tmp_path):
    (tmp_path / "file").write_text("")
    refuse_held(store_at(f"{tmp_path}/file/"))
    (tmp_path / LOCK).mkdir()
    refuse_held(store_at(str(tmp_path)))
    for place in (f"{tmp_path}/file/", str(tmp_path)):
        with pytest.raises(OutputError, match=r"cannot write \.(lock)? in "):
            held(store_at(place)).__enter__()


@pytest.mark.long
def test_a_hold_ends_with_kill_9(tmp_path):
    store = store_at(f"{tmp_path}/set/")
    other = subprocess.Popen([sys.executable, "-c", HOLD, store.location], stdout=subprocess.PIPE)
    try:
        assert other.stdout.readline() == b"held\n"
        with pytest.raises(OutputError, match=f"process {other.pid} on "):
            refuse_held(store)
    finally:
        other.send_signal(signal.SIGKILL)
        other.wait()
    assert LOCK in store.sizes()
    with held(store):
        pass


def test_two_runs_in_an_object_store(remote):
    with held(remote):
        with pytest.raises(OutputError, match=rf"another run is writing s3://bucket/set/: process {os.getpid()} on "):
            refuse_held(remote)
        with pytest.raises(OutputError):
            held(remote).__enter__()
    assert remote.sizes() == {}


def test_what_is_left_behind_in_an_object_store(remote, tmp_path):
    """By a process that is gone, also if another one has its number now; by another machine, when it is old."""
    write(remote, machine=lease._machine())
    refuse_held(remote)
    write(remote, machine=lease._machine(), born=lease._born(os.getpid()))
    with pytest.raises(OutputError, match="another run is writing"):
        refuse_held(remote)
    write(remote)
    with pytest.raises(OutputError, match=r"process \d+ on other\n.*its hold ends in 1[12]\d s"):
        refuse_held(remote)
    long_ago = time.time() - lease.LEASE - 1
    os.utime(tmp_path / LOCK, (long_ago, long_ago))
    with held(remote):
        pass
    (tmp_path / LOCK).write_bytes(b'{"host"')
    refuse_held(remote)


def test_of_two_at_once_the_later_one_goes_on(remote, monkeypatch):
    monkeypatch.setattr(lease.time, "sleep", lambda seconds: write(remote))
    with pytest.raises(OutputError, match="on other"):
        held(remote).__enter__()
    assert LOCK in remote.sizes()


def test_a_hold_is_renewed_and_its_loss_noticed(remote, tmp_path, monkeypatch):
    monkeypatch.setattr(lease, "RENEWED", 0.01)

    def until(condition):
        end = time.monotonic() + 20
        while not condition():
            assert time.monotonic() < end
            time.sleep(0.01)

    with held(remote) as hold:
        os.utime(tmp_path / LOCK, (1.0, 1.0))
        until(lambda: remote.changed(LOCK) > 2.0)
        hold.check()

        def taken():
            write(remote)  # again, if it came between a look and a renewal
            return hold._other is not None

        until(taken)
        with pytest.raises(OutputError, match=r"another run has taken s3://bucket/set/ over: process .* on other"):
            hold.check()
    assert b"theirs" in remote.read(LOCK)
