"""Files appear whole or not at all, and nothing is left behind."""

import errno
import hashlib
import io
import os
import stat

import pytest

from scenegen.errors import DataError, OutputError
from scenegen.scenes import files
from scenegen.scenes.files import (
    HashingWriter,
    Parts,
    begin_writing,
    check_folder,
    check_writable,
    ensure_folder,
    read_bytes,
    whole_files,
    write_whole,
)


def failing(code):
    def fail(*_, **__):
        raise OSError(code, os.strerror(code))

    return fail


class _Stubborn:
    def __init__(self, handle, mode):
        self._handle = handle

    def __enter__(self):
        return self

    def __exit__(self, *_):
        os.close(self._handle)

    def write(self, data):
        os.write(self._handle, data[: len(data) // 2])
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


FAILURES = {
    "open": ("tempfile.mkstemp", failing(errno.EACCES)),
    "write": ("os.fdopen", _Stubborn),
    "sync": ("os.fsync", failing(errno.EIO)),
    "mode": ("pathlib.Path.chmod", failing(errno.EPERM)),
    "rename": ("pathlib.Path.replace", failing(errno.EROFS)),
}


@pytest.mark.parametrize("there", [True, False])
@pytest.mark.parametrize("name", FAILURES)
def test_any_failure(name, there, tmp_path, monkeypatch):
    path = tmp_path / "x.json"
    if there:
        path.write_bytes(b"before")
    with monkeypatch.context() as patch:
        patch.setattr(*FAILURES[name])
        with pytest.raises(OutputError) as caught:
            write_whole(path, b"after" * 1000)
    (problem,) = caught.value.diagnostics
    assert problem.title.startswith(f"cannot write {path}: ") and problem.help
    assert [entry.name for entry in tmp_path.iterdir()] == (["x.json"] if there else [])
    assert not there or path.read_bytes() == b"before"


def test_an_interrupt_leaves_nothing_either(tmp_path, monkeypatch):
    def interrupt(_):
        raise KeyboardInterrupt

    monkeypatch.setattr(files.os, "fsync", interrupt)
    with pytest.raises(KeyboardInterrupt):
        write_whole(tmp_path / "x.json", b"data")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("mask, mode", [(0o022, 0o644), (0o077, 0o600), (0o002, 0o664)])
def test_permissions_are_those_of_any_new_file(mask, mode, tmp_path):
    before = os.umask(mask)
    try:
        write_whole(tmp_path / "x", b"")
        assert os.umask(mask) == mask
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "x").stat().st_mode) == mode


@pytest.mark.parametrize("mode", [0o600, 0o640, 0o444, 0o4755, 0o000])
def test_a_file_that_is_replaced_leaves_its_mode(mode, tmp_path):
    path = tmp_path / "x"
    path.write_bytes(b"before")
    path.chmod(mode)
    write_whole(path, b"after")
    assert stat.S_IMODE(path.stat().st_mode) == mode
    (tmp_path / "link").symlink_to(path)
    write_whole(tmp_path / "link", b"again")
    assert stat.S_IMODE(path.stat().st_mode) == mode
    with whole_files(tmp_path) as put:
        put("x", b"one of several")
    assert stat.S_IMODE(path.stat().st_mode) == mode


@pytest.mark.skipif(os.geteuid() != 0, reason="only root may give files away")
def test_a_file_that_is_replaced_leaves_its_owner(tmp_path):
    path = tmp_path / "x"
    path.write_bytes(b"before")
    os.chown(path, 12345, 23456)
    path.chmod(0o640)
    write_whole(path, b"after")
    found = path.stat()
    assert (found.st_uid, found.st_gid, stat.S_IMODE(found.st_mode)) == (12345, 23456, 0o640)


def test_another_group_may_do_no_more_than_everybody(tmp_path, monkeypatch):
    path = tmp_path / "x"
    path.write_bytes(b"before")
    path.chmod(0o664)
    monkeypatch.setattr(files.os, "chown", failing(errno.EPERM))
    real = files.Path.stat

    def of_a_group(self, **options):
        found = real(self, **options)
        return found if self != path else os.stat_result((*found[:5], found.st_gid + 1, *found[6:]))

    monkeypatch.setattr(files.Path, "stat", of_a_group)
    write_whole(path, b"after")
    assert stat.S_IMODE(path.stat().st_mode) == 0o644


def test_a_file_is_replaced(tmp_path):
    for data in (b"one", b"two"):
        write_whole(tmp_path / "x", data)
        assert (tmp_path / "x").read_bytes() == data
    assert len(list(tmp_path.iterdir())) == 1


def test_checks_write_nothing(tmp_path):
    check_writable(tmp_path / "x.json")
    check_folder(tmp_path / "new")
    check_folder(tmp_path)
    assert list(tmp_path.iterdir()) == []
    ensure_folder(tmp_path / "new")
    ensure_folder(tmp_path / "new")
    assert [entry.name for entry in tmp_path.iterdir()] == ["new"]


@pytest.mark.parametrize("check", [check_writable, check_folder, ensure_folder])
def test_checks_refuse(check, tmp_path):
    (tmp_path / "file").write_text("")
    for path in (tmp_path / "no" / "x", tmp_path / "file" / "x"):
        with pytest.raises(OutputError):
            check(path)
    with pytest.raises(OutputError):
        check(tmp_path if check is check_writable else tmp_path / "file")


def test_reading_what_cannot_be_read(tmp_path):
    (tmp_path / "scenes.json").write_text("x" * 11)
    os.mkfifo(tmp_path / "pipe")
    for name, said in (("scene.json", "did you mean `"), ("pipe", "name a spec instead"), (".", "it is a folder")):
        with pytest.raises(DataError, match=said):
            read_bytes(tmp_path / name, "a spec")
    with pytest.raises(DataError, match="the limit is 10"):
        read_bytes(tmp_path / "scenes.json", "a spec", limit=10)
    with pytest.raises(DataError, match="name too long"):
        read_bytes(tmp_path / ("x" * 300), "a spec")


def test_a_file_of_several_parts(tmp_path, monkeypatch):
    monkeypatch.setattr(files, "FLUSH_BYTES", 5)
    begun = []
    monkeypatch.setattr(files, "begin_writing", lambda file: begun.append(file.tell()))
    write_whole(tmp_path / "x", b"1234", memoryview(b"567"), b"", b"89")
    assert (tmp_path / "x").read_bytes() == b"123456789" and begun == [7]


@pytest.mark.parametrize("known", [True, False])
def test_what_begins_to_go_to_the_disk_stays_as_it_is(known, tmp_path, monkeypatch):
    """Also where the system has no such call, or the file is in memory."""
    if not known:
        monkeypatch.setattr(files, "_sync_file_range", lambda: None)
    with (tmp_path / "x").open("wb") as file:
        file.write(b"1" * 100_000)
        begin_writing(file)
        file.write(b"2")
    assert (tmp_path / "x").read_bytes() == b"1" * 100_000 + b"2"
    begin_writing(io.BytesIO())


def test_a_file_that_is_packed():
    sink = Parts()
    with HashingWriter(sink) as packed:
        assert packed.write(b"abc") == 3 and packed.write(memoryview(b"de")) == 2 and packed.tell() == packed.size == 5
        assert packed.sha256 == hashlib.sha256(b"abcde").hexdigest()
    assert sink.parts == [b"abc", b"de"]


def test_a_sink_that_fails_while_a_file_is_packed():
    class Full:
        def write(self, part):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with pytest.raises(OSError, match="No space left"), HashingWriter(Full()) as packed:
        packed.write(b"abc")
