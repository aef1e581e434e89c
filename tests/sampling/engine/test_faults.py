"""Stores that fail while a set is written: one diagnostic with the file's name, the rest intact; `resume` goes on."""

import errno
import hashlib
import os
import signal
import sys
import tempfile
from pathlib import Path

import pyarrow.fs
import pytest

from scenegen.errors import OutputError
from scenegen.errors.files import CANNOT_WRITE
from scenegen.sampling.engine import writer
from scenegen.sampling.engine.engines import Local
from scenegen.scenes import files, stores
from scenegen.scenes import stores as trying
from scenegen.scenes.sets import read_manifest
from scenegen.scenes.stores import Store, store_at

sys.path.insert(0, str(Path(__file__).parent))
from made_sets import digest, run

SHARD = "part-000001.parquet"


class Bucket:
    """A folder as an object store; `fails(call, path)` raises what it answers."""

    def __init__(self, fails):
        self.inner, self.fails = pyarrow.fs.LocalFileSystem(), fails

    def __getattr__(self, name):
        def call(first, *words):
            path = first if isinstance(first, str) else first.base_dir
            self.fails(name, path)
            if name == "open_output_stream":
                Path(path).parent.mkdir(parents=True, exist_ok=True)
            return getattr(self.inner, name)(first, *words)

        return call


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    folder = tmp_path_factory.mktemp("plain") / "set"
    run(folder)
    return digest(folder)


@pytest.fixture
def clock(monkeypatch):
    """Stands still but for the waits between tries."""
    now = [0.0]
    monkeypatch.setattr(trying.time, "monotonic", lambda: now[0])
    monkeypatch.setattr(trying.time, "sleep", lambda seconds: now.append(now.pop() + seconds))
    return now


def bucket(folder, fails, said=None):
    return Store("s3://bucket/set/", Bucket(fails), str(folder), False, tell=None if said is None else said.append)


def one_diagnostic(caught, *words):
    (found,) = caught.value.diagnostics
    assert found.code == "cannot-write"
    for word in words:
        assert word in f"{found.title}\n{found.help}"


@pytest.mark.parametrize(
    ("number", "reason", "remedy"),
    [(errno.ENOSPC, "no space left on device", "make room"), (errno.EACCES, "permission denied", "may write there")],
)
@pytest.mark.parametrize("moment", ["opening", "writing", "ending"])
@pytest.mark.parametrize("workers", [1, 2])
def test_a_disk_that_fails(workers, moment, number, reason, remedy, plain, tmp_path, monkeypatch):
    folder, open_file, write, sync = tmp_path / "set", tempfile.mkstemp, stores.FlushingWriter.write, os.fsync

    def fail(now, name):
        if now == moment and f".{SHARD}." in name:
            raise OSError(number, os.strerror(number))

    def opened(**options):
        fail("opening", options["prefix"])
        return open_file(**options)

    def written(steady, part):
        fail("writing", str(Path(f"/proc/self/fd/{steady._file.fileno()}").readlink()))
        write(steady, part)

    def synced(handle):
        fail("ending", str(Path(f"/proc/self/fd/{handle}").readlink()))
        sync(handle)

    monkeypatch.setattr(files.tempfile, "mkstemp", opened)
    monkeypatch.setattr(stores.FlushingWriter, "write", written)
    monkeypatch.setattr(files.os, "fsync", synced)
    with Local(workers) as engine, pytest.raises(OutputError) as caught:
        run(folder, engine)
    monkeypatch.undo()
    one_diagnostic(caught, f"cannot write {SHARD} in {folder}/: {reason}", remedy, "what is complete stays there")
    assert [shard.file for shard in read_manifest(store_at(str(folder))).shards] == ["part-000000.parquet"]
    assert not [path.name for path in folder.iterdir() if path.name.startswith(".")]
    run(folder, resume=True)
    assert digest(folder) == plain


class InPairs(Local):
    """Names shards two at a time."""

    def finished_shards(self, *, wait):
        return super().finished_shards(wait=True) if wait or len(self._packed) >= 2 else iter(())


@pytest.mark.parametrize("what", ["save_checkpoint", "write_manifest"])
def test_no_shard_is_left_out_when_the_manifest_cannot_be_written(what, plain, tmp_path, monkeypatch):
    """Neither does the one after it take its place."""
    folder, write, calls = tmp_path / "set", getattr(writer, what), []

    def full(store, *args):
        calls.append(1)
        if len(calls) == 1:
            raise OutputError(CANNOT_WRITE(file="x", location="y", reason="full", remedy="make room"))
        return write(store, *args)

    monkeypatch.setattr(writer, what, full)
    with InPairs(2) as engine, pytest.raises(OutputError, match="full"):
        run(folder, engine)
    monkeypatch.undo()
    shards = [shard.file for shard in read_manifest(store_at(str(folder))).shards]
    assert shards == ["part-000000.parquet", "part-000001.parquet"][: len(shards)]
    run(folder, resume=True)
    assert digest(folder) == plain


def test_what_a_run_leaves_that_is_killed_again_is_removed_at_once(tmp_path, plain):
    folder = tmp_path / "set"
    with pytest.raises(KeyboardInterrupt):
        run(folder, progress=lambda found, wanted, candidates: found >= 1300 and os.kill(os.getpid(), signal.SIGINT))
    assert read_manifest(store_at(str(folder))).shards
    (folder / ".part-000002.parquet.abc123.part").write_bytes(b"half a shard")
    seen = []
    run(folder, resume=True, progress=lambda *_: seen.append(sorted(path.name for path in folder.glob(".*.part"))))
    assert seen and not seen[0] and digest(folder) == plain


def test_what_a_killed_run_leaves_unfinished_is_removed(plain, tmp_path):
    (tmp_path / ".part-000002.parquet.abc123.part").write_bytes(b"half a shard")
    (tmp_path / ".manifest.json.abc123.part").write_bytes(b"{")
    (tmp_path / ".mine.part").write_bytes(b"of somebody else")
    run(tmp_path)
    assert digest(tmp_path).items() - plain.items() == {(".mine.part", hashlib.sha256(b"of somebody else").hexdigest())}


def test_a_store_that_is_away_for_ten_seconds(plain, tmp_path, clock):
    since, said = [], []

    def fails(call, path):
        if path.endswith(SHARD) and not since:
            since.append(clock[0])
        if since and clock[0] < since[0] + 10:
            raise OSError("AWS Error UNKNOWN (HTTP status 503) during PutObject operation: Unable to parse")

    run(tmp_path, store=bucket(tmp_path, fails, said))
    assert digest(tmp_path) == plain and 10 <= clock[0] < 20
    assert said == [f"{SHARD} in s3://bucket/set/: the store is unavailable; trying again for up to 60 s"]


@pytest.mark.parametrize("file", [SHARD, "manifest.json", "waiting"])
def test_a_store_that_dies(file, plain, tmp_path, clock):
    calls = []

    def fails(call, path):
        calls.append(call == "open_output_stream" and Path(path).name.startswith(file))
        if sum(calls) > (2 if file == "manifest.json" else 0):
            raise OSError("When completing: AWS Error NETWORK_CONNECTION during PutObject operation: curlCode: 7")

    with pytest.raises(OutputError) as caught:
        run(tmp_path, Local(1), bucket(tmp_path, fails))
    one_diagnostic(caught, file, "s3://bucket/set/: the store does not answer, tried", "see whether the store is up")
    before = read_manifest(store_at(str(tmp_path)))
    for shard in before.shards:
        assert digest(tmp_path)[shard.file] == plain[shard.file]
    run(tmp_path, store=bucket(tmp_path, lambda call, path: None), resume=True)
    assert digest(tmp_path) == plain
