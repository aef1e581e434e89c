"""One run at a time in a set: the second is refused, and what a killed one left behind is not. Folders by path and
URL: written whole, tried again where that can help, and every failure in plain words.
"""

import errno
import os
import pickle
import signal
import subprocess
import sys

import pyarrow.fs
import pytest

from scenegen.errors import DataError, OutputError
from scenegen.scenes import stores
from scenegen.scenes import stores as trying
from scenegen.scenes.locations import as_location, is_set, names_set
from scenegen.scenes.lock import LOCK, acquire, refuse_in_use
from scenegen.scenes.stores import Store, store_at

HOLD = """
import sys, time
from scenegen.scenes.lock import acquire
from scenegen.scenes.stores import store_at
with acquire(store_at(sys.argv[1])):
    print("held", flush=True)
    time.sleep(60)
"""


def test_two_runs_on_a_disk(tmp_path):
    store = store_at(f"{tmp_path}/set/")
    with acquire(store):
        for refused in (refuse_in_use, lambda store: acquire(store).__enter__()):
            with pytest.raises(OutputError, match=rf"another run is writing .*set/: process {os.getpid()} on "):
                refused(store)
    refuse_in_use(store)
    assert store.sizes() == {}
    with acquire(store):
        pass


def test_a_place_that_cannot_be_locked(tmp_path):
    (tmp_path / "file").write_text("")
    refuse_in_use(store_at(f"{tmp_path}/file/"))
    (tmp_path / LOCK).mkdir()
    refuse_in_use(store_at(str(tmp_path)))
    for place in (f"{tmp_path}/file/", str(tmp_path)):
        with pytest.raises(OutputError, match=r"cannot write \.(lock)? in "):
            acquire(store_at(place)).__enter__()


@pytest.mark.long
def test_a_hold_ends_with_kill_9(tmp_path):
    store = store_at(f"{tmp_path}/set/")
    other = subprocess.Popen([sys.executable, "-c", HOLD, store.location], stdout=subprocess.PIPE)
    try:
        assert other.stdout.readline() == b"held\n"
        with pytest.raises(OutputError, match=f"process {other.pid} on "):
            refuse_in_use(store)
    finally:
        other.send_signal(signal.SIGKILL)
        other.wait()
    assert LOCK in store.sizes()
    with acquire(store):
        pass


def test_two_runs_in_an_object_store_are_not_noticed(tmp_path):
    store = Store("s3://bucket/set/", pyarrow.fs.LocalFileSystem(), str(tmp_path), False)
    with acquire(store), acquire(store):
        refuse_in_use(store)
        assert store.sizes() == {}


class Flaky:
    """A file system whose first calls fail."""

    def __init__(self, folder, *errors):
        self.inner, self.folder, self.errors, self.calls = pyarrow.fs.LocalFileSystem(), folder, list(errors), 0

    def __getattr__(self, name):
        def call(*words, **options):
            self.calls += 1
            if self.errors:
                raise self.errors.pop(0)
            return getattr(self.inner, name)(*words, **options)

        return call


@pytest.fixture
def waits(monkeypatch):
    """The clock stands still but for the waits between tries."""
    found, now = [], [0.0]

    def sleep(seconds):
        found.append(seconds)
        now[0] += seconds

    monkeypatch.setattr(trying.time, "sleep", sleep)
    monkeypatch.setattr(trying.time, "monotonic", lambda: now[0])
    return found


def flaky(folder, *errors):
    return Store("s3://bucket/set/", Flaky(folder, *errors), str(folder), False)


def test_a_folder(tmp_path):
    store = store_at(f"{tmp_path}/set/")
    assert store.local and store.sizes() == {}
    store.make()
    store.write("_run/a.npy", b"12345")
    store.write("b", b"1")
    assert store.sizes() == {"_run/a.npy": 5, "b": 1}
    assert store.read("_run/a.npy") == b"12345" and store.open("b").read() == b"1"
    store.delete("b", "never there")
    assert store.sizes() == {"_run/a.npy": 5}
    assert pickle.loads(pickle.dumps(store)).read("_run/a.npy") == b"12345"  # noqa: S301 - our own
    assert store_at(f"file://{tmp_path}/set").local
    with pytest.raises(DataError, match=r"cannot read gone in .*no such file"):
        store.read("gone")


class Growing(Flaky):
    """A file system whose file grows between the question for its size and the read, so many times."""

    def __init__(self, folder, times):
        super().__init__(folder)
        self.times = times

    def open_input_stream(self, path):
        data = self.inner.open_input_stream(path).read()
        if self.times:
            self.times -= 1
            (self.folder / "a").write_bytes(data + b"more")
        return pyarrow.BufferReader(data)


def test_an_object_that_is_replaced_while_it_is_read(tmp_path, waits):
    (tmp_path / "a").write_bytes(b"1")
    assert Store("s3://bucket/", Growing(tmp_path, 2), str(tmp_path), False).read("a") == b"1moremore"
    with pytest.raises(DataError, match=r"it changes while it is read"):
        Store("s3://bucket/", Growing(tmp_path, 100), str(tmp_path), False, patience=0.0).read("a")


def test_a_store_that_fails_for_ten_seconds(tmp_path, waits):
    busy = OSError("When completing multiple part upload: AWS Error SLOW_DOWN during CompleteMultipartUpload")
    store = flaky(tmp_path, *[busy] * 6)
    store.write("part", b"x")
    assert (tmp_path / "part").read_bytes() == b"x" and store.system.calls == 7
    assert sum(waits) > 10 and waits == sorted(waits)


def test_a_store_that_died(tmp_path, waits):
    store = flaky(tmp_path, *[OSError("AWS Error NETWORK_CONNECTION during PutObject operation")] * 99)
    with pytest.raises(
        OutputError, match=r"cannot write part-3 in s3://bucket/set/: the store does not answer, tried 1\d"
    ):
        store.write("part-3", b"x")
    assert 30 < sum(waits) < 60


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (OSError("AWS Error ACCESS_DENIED during PutObject operation"), "access denied"),
        (OSError("AWS Error NO_SUCH_BUCKET during HeadBucket"), "there is no such bucket"),
        (PermissionError(errno.EACCES, "Permission denied"), "permission denied"),
    ],
)
def test_final_answers_are_not_asked_for_again(error, said, tmp_path, waits):
    store = flaky(tmp_path, error)
    with pytest.raises(OutputError, match=f"cannot write x in s3://bucket/set/: {said}\n"):
        store.write("x", b"x")
    assert store.system.calls == 1 and not waits


@pytest.mark.parametrize("parts", [[b"x"], [b"1", memoryview(b"23"), b""]])
def test_a_full_disk(parts, tmp_path, monkeypatch):
    def full(handle):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    store = store_at(str(tmp_path))
    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", full)
        with pytest.raises(OutputError, match=r"cannot write x in .*: no space left on device\n(.|\n)*make room"):
            store.write("x", *parts)
    assert not list(tmp_path.iterdir())
    store.write("x", *parts)
    assert store.read("x") == b"".join(parts)


@pytest.mark.parametrize("local", [True, False])
def test_a_file_that_is_written_in_parts(local, tmp_path, waits):
    """The object store fails twice at the end."""
    busy = OSError("AWS Error UNKNOWN (HTTP status 503) during PutObject operation")
    store = store_at(str(tmp_path)) if local else flaky(tmp_path, busy, busy)
    with store.whole("x") as file:
        file.write(b"12")
        file.write(b"3")
        assert not (tmp_path / "x").exists()
    assert (tmp_path / "x").read_bytes() == b"123" and len(waits) == (0 if local else 2)
    with pytest.raises(ValueError, match="mine"), store.whole("y") as file:
        file.write(b"12")
        raise ValueError("mine")
    assert [path.name for path in tmp_path.iterdir()] == ["x"]


def test_urls(tmp_path):
    from pathlib import Path

    assert is_set("s3://bucket/set") and is_set("new/") and is_set(str(tmp_path)) and not is_set("x.parquet")
    assert names_set("new/") and names_set("s3://bucket/set") and not names_set(str(tmp_path))
    assert as_location(Path("s3://bucket/set/")) == "s3://bucket/set"
    assert as_location(Path("data/x")) == "data/x"
    assert stores.without_secrets("s3://key:secret@bucket/set/?endpoint_override=localhost") == "s3://bucket/set/"
    with pytest.raises(DataError, match="cannot open s4://bucket/set/"):
        store_at("s4://bucket/set/")
