"""Reading and writing files so that they appear whole or not at all, with a diagnostic for each failure."""

from __future__ import annotations

import contextlib
import ctypes
import difflib
import errno
import functools
import hashlib
import io
import os
import re
import shutil
import stat
import sys
import tempfile
import threading
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path, PurePosixPath
from typing import IO, Any, Protocol

from scenegen.errors import DataError, OutputError, ScenegenError
from scenegen.errors.files import CANNOT_READ, CANNOT_WRITE, TOO_LARGE_TO_READ
from scenegen.resources import is_input

DISK_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
_WRITE_HELP = {
    errno.ENOENT: "the folder does not exist; create it first, or name one that is there",
    errno.ENOTDIR: "a part of the path is a file, not a folder",
    errno.EISDIR: "this is a folder; name a file in it",
    errno.EACCES: "you may not write there; choose another folder",
    errno.EPERM: "you may not write there; choose another folder",
    errno.EROFS: "that file system is read-only; choose another folder",
    errno.ENOSPC: "the disk is full; nothing was left behind",
    errno.EDQUOT: "your quota on that disk is used up; nothing was left behind",
    errno.EFBIG: "that is more than one file may hold there (`ulimit -f`); nothing was left behind",
    errno.ENAMETOOLONG: "that name is too long for a file; choose a shorter one",
    errno.ELOOP: "that link leads to itself; remove it, or name another file",
}

ACCESS_LIST = "system.posix_acl_access"  # the attribute that Linux keeps it in
UNFINISHED = ".part"  # how the names of temporary files end, which begin with a dot
FROZEN = {"suite.json": b'"scenegen/suite"', "manifest.json": b'"scenegen/set"'}  # what a suite and a set begin with
STDIN = ("-", "/dev/stdin", "/dev/fd/0", "/proc/self/fd/0")
FROZEN_HEAD_BYTES = 1 << 12  # bytes within which these say so
FLUSH_BYTES = 1 << 24  # bytes of a large file after which the disk begins to work
_WRITE = 2  # SYNC_FILE_RANGE_WRITE

_ONE_AT_A_TIME = threading.Lock()

TABS = ".tsv"  # is read, and not written
OTHER_ENDINGS = {".ndjson": ".jsonl", TABS: ".csv"}  # other endings of the same formats


def ending_of(path: Path) -> str:
    """The ending of a file, by which its format is known."""
    ending = path.suffix.lower()
    return OTHER_ENDINGS.get(ending, ending)


def output_error(path: Path, error: OSError) -> OutputError:
    """The diagnostic for a path that could not be written."""
    reason = (error.strerror or str(error)).lower()
    remedy = _WRITE_HELP.get(error.errno or 0, "choose another place")
    return OutputError(CANNOT_WRITE(path=path, reason=reason, remedy=remedy))


def check_writable(path: Path, *inputs: Path) -> None:
    """Refuse, before any work is done, an output file whose folder is missing or read-only, one that is not a regular
    file, and one that is also an input. Raises OutputError."""
    with report_write_errors(path):
        _refuse_special(path)
        if any(_same(path, given) for given in inputs):
            raise _overwrites(path)
        # Opening a temporary file there is the only test that is reliable for root, in containers and on network disks.
        with tempfile.TemporaryFile(dir=target(path).parent):
            pass


def refuse_place(path: Path, inputs: Iterable[Path], *, a_set: bool = False) -> None:
    """Refuse an output, a file or a folder, that is one of the inputs (links and hard links are followed), that means
    standard input, or that lies in a frozen folder. Where it is `a_set`, what writes it looks at the folder. Raises
    OutputError."""
    if str(path) == "-":
        remedy = "name a file; data goes to standard output where no file is named"
        raise OutputError(CANNOT_WRITE(path=path, reason="it stands for standard input", remedy=remedy))
    with report_write_errors(path):
        if any(_same(path, given) for given in inputs):
            raise _overwrites(path)
        if not a_set and (found := frozen_folder(path)) is not None:
            reason = f"{found} is a suite or a set of scenes, in which nothing else may lie"
            raise OutputError(CANNOT_WRITE(path=path, reason=reason, remedy="name a place outside of it"))


def _overwrites(path: Path) -> OutputError:
    reason = "it would overwrite what it is made from"
    return OutputError(CANNOT_WRITE(path=path, reason=reason, remedy="name another output file"))


def refuse_existing(*paths: Path) -> None:
    """Raises OutputError for a file that is there already."""
    for path in paths:
        if path.exists() or path.is_symlink():
            remedy = "choose another name; nothing is overwritten"
            raise OutputError(CANNOT_WRITE(path=path, reason="it is there already", remedy=remedy))


def frozen_folder(path: Path) -> Path | None:
    """The suite or set of scenes that a path is or lies in."""
    place = Path(os.path.realpath(path))
    for folder in (place, *place.parents):
        for name, mark in FROZEN.items():
            with contextlib.suppress(OSError):  # nobody may look there
                if (folder / name).is_file() and mark in (folder / name).read_bytes()[:FROZEN_HEAD_BYTES]:
                    return folder
    return None


def _same(path: Path, given: Path) -> bool:
    """Whether both are one file. Errors of the input are left to the code that reads it."""
    if not path.exists():
        return False
    try:
        return given.exists() and path.samefile(given)
    except (OSError, ValueError):
        return False


def target(path: Path) -> Path:
    """The target of a link, step by step; any other path as it is. Raises OSError for a link that leads to itself, and
    for names that are too long."""
    _exists(path)
    return Path(os.path.realpath(path)) if path.is_symlink() else path


def _exists(path: Path) -> bool:
    """Like Path.exists, but raises OSError for links that lead to themselves."""
    try:
        path.stat()
    except (FileNotFoundError, NotADirectoryError):
        return False
    return True


def _refuse_special(path: Path) -> None:
    """Refuse to replace folders, devices, pipes and sockets by a file, and inputs."""
    if not _exists(path):
        return
    if path.is_dir():
        raise output_error(path, IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR)))
    if not path.is_file():
        raise OutputError(CANNOT_WRITE(path=path, reason="it is not a regular file", remedy="name a file"))
    if is_input(path):
        raise _overwrites(path)


def check_folder(path: Path, file: Path | None = None) -> None:
    """Refuse, before any work is done, an output folder that can neither be written to nor made, and one that is also
    the output `file`. Raises OutputError."""
    if file is not None and path.absolute() == file.absolute():
        reason = "it cannot be a file and a folder at once"
        raise OutputError(CANNOT_WRITE(path=path, reason=reason, remedy="name another folder"))
    with report_write_errors(path), tempfile.TemporaryFile(dir=path if _exists(path) else path.parent):
        pass


def ensure_folder(path: Path) -> None:
    """Make an output folder (its parent must exist) and check that it can be written to. Raises OutputError."""
    with report_write_errors(path):
        path.mkdir(exist_ok=True)
        with tempfile.TemporaryFile(dir=path):
            pass


@contextlib.contextmanager
def report_write_errors(path: Path) -> Iterator[None]:
    try:
        yield
    except ScenegenError:
        raise
    except OSError as error:
        raise output_error(path, error) from error


@contextlib.contextmanager
def whole_file(path: Path) -> Iterator[IO[bytes]]:
    """A file to write to that appears at `path`, on disk and whole, when the block ends without an error.

    Data goes to a temporary file in the same folder, which is renamed at the end. On failure raises OutputError and
    leaves nothing behind; OSErrors of the block count as failures to write.
    """
    with report_write_errors(path):
        _refuse_special(path)
        path = target(path)  # a link stays, its target is written
        # the name may have the maximum length, so the temporary name uses only its beginning
        handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name[:32]}.", suffix=UNFINISHED)
        try:
            with os.fdopen(handle, "wb") as file:
                yield file
                file.flush()
                os.fsync(file.fileno())
            put_in_place(Path(temporary), path)
        except BaseException:
            with contextlib.suppress(OSError):
                Path(temporary).unlink()
            raise


def inside(name: str) -> str:
    """A path that another file has, which may have come from anywhere: it stays in that file's folder. Raises
    ValueError for an absolute one, and one with `..`."""
    path = PurePosixPath(name.replace("\\", "/"))
    if path.is_absolute() or ".." in path.parts:
        raise ValueError("it is not in the folder")
    return name


def below(folder: Path, name: str) -> Path:
    """The path of such a file. Raises ValueError also where a link leads out of the folder."""
    path = folder / inside(name)
    if not Path(os.path.realpath(path)).is_relative_to(os.path.realpath(folder)):
        raise ValueError("it is a link that leads out of the folder")
    return path


def put_in_place(new: Path, path: Path) -> None:
    """Rename a file that is complete. It gets the mode, and where the system allows it the owner, the group and the
    access list of the file that it replaces; a new file gets the mode of any new file. Raises OSError."""
    try:
        before = path.stat()
    except FileNotFoundError:
        new.chmod(0o666 & ~_umask())
    else:
        mode = stat.S_IMODE(before.st_mode)
        for owner in (before.st_uid, -1):  # who may not give it away may still give it to a group
            with contextlib.suppress(OSError, AttributeError):  # Windows has no owners
                os.chown(new, owner, before.st_gid)
        if new.stat().st_gid != before.st_gid:  # another group may do no more than everybody
            mode = mode & ~0o070 | (mode & 0o007) << 3
        new.chmod(mode)
        with contextlib.suppress(OSError, AttributeError):
            os.setxattr(new, ACCESS_LIST, os.getxattr(path, ACCESS_LIST))
    new.replace(path)


def write_whole(path: Path, *parts: bytes | memoryview) -> None:
    """Write through a temporary file in the same folder and rename it. Raises OutputError and leaves nothing behind."""
    with whole_file(path) as file:
        steady = FlushingWriter(file)
        for part in parts:
            steady.write(part)


class FlushingWriter:
    """Writes to a large file so that the disk begins to work while there is more to come."""

    def __init__(self, file: IO[bytes]) -> None:
        self._file, self._ahead = file, 0

    def write(self, part: bytes | memoryview) -> None:
        self._file.write(part)
        self._ahead += len(part)
        if self._ahead > FLUSH_BYTES:
            begin_writing(self._file)
            self._ahead = 0


def begin_writing(file: IO[bytes]) -> None:
    """What was written to a file so far begins to go to the disk, where the system can be asked to (Linux): `fsync`
    then waits for less."""
    ask = _sync_file_range()
    if ask is not None:
        with contextlib.suppress(OSError):  # a file in memory
            ask(file.fileno(), 0, 0, _WRITE)  # the whole file; an error will be that of `fsync`


@functools.cache
def _sync_file_range() -> Callable[[int, int, int, int], int] | None:
    """The system's call, which Python's `os` lacks."""
    found = getattr(ctypes.CDLL(None), "sync_file_range", None) if os.name == "posix" else None
    if found is not None:
        found.argtypes = [ctypes.c_int, ctypes.c_int64, ctypes.c_int64, ctypes.c_uint]
    call: Callable[[int, int, int, int], int] | None = found
    return call


def sync_folder(folder: Path) -> None:
    """Make new names in a folder durable, if folders can be synchronised."""
    with contextlib.suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def _umask() -> int:
    with _ONE_AT_A_TIME:  # it can only be read by changing it, for all threads
        mask = os.umask(0)
        os.umask(mask)
    return mask


def read_bytes(path: Path, what: str, *, limit: int | None = None, remedy: str = "") -> bytes:
    """The bytes of a file that the user named; `what` is its role ("a spec", "a scenes file"), `remedy` what to do
    about one that is longer than the limit. Raises DataError."""
    with open_input(path, what) as file:
        size = os.fstat(file.fileno()).st_size
        if limit is not None and size > limit:
            raise DataError(TOO_LARGE_TO_READ(path=path, size=size, limit=limit, remedy=remedy))
        return file.read()


def is_stream(path: Path) -> bool:
    """Whether a path means standard input, or a pipe that is open already, as `<(...)` of a shell makes it."""
    return str(path) in STDIN or re.fullmatch(r"/(dev|proc/self)/fd/\d+", str(path)) is not None


def read_stream(path: Path, what: str, *, limit: int) -> bytes:
    """All bytes of such a stream. Raises DataError."""
    try:
        if str(path) in STDIN:
            data = sys.stdin.buffer.read(limit + 1)
        else:
            with path.open("rb") as file:
                data = file.read(limit + 1)
    except (OSError, ValueError) as error:
        reason = str(getattr(error, "strerror", None) or error).lower()
        if getattr(error, "errno", errno.EBADF) == errno.EBADF:  # a ValueError has none
            reason = "standard input is closed"
        raise DataError(CANNOT_READ(path=path, reason=reason, remedy=f"{what} was expected there")) from error
    if len(data) > limit:
        raise DataError(TOO_LARGE_TO_READ(path=path, size=len(data), limit=limit, remedy=""))
    return data


@contextlib.contextmanager
def open_input(path: Path, what: str) -> Iterator[IO[bytes]]:
    """A file that the user named, open for reading; `what` is its role. Raises DataError, also for OSErrors of the
    block."""
    try:
        if path.exists() and not path.is_file():
            kind = "a folder" if path.is_dir() else "not a regular file"
            raise DataError(CANNOT_READ(path=path, reason=f"it is {kind}", remedy=f"name {what} instead"))
        with path.open("rb") as file:
            yield file
    except ScenegenError:
        raise
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise DataError(CANNOT_READ(path=path, reason=reason, remedy=missing_help(path, what))) from error


def missing_help(path: Path, what: str) -> str:
    """A file in the same folder with a similar name, if there is one."""
    with contextlib.suppress(OSError):
        siblings = [sibling.name for sibling in path.parent.iterdir() if sibling.is_file()]
        close = difflib.get_close_matches(path.name, siblings, n=1, cutoff=0.6)
        if close and close[0] != path.name:
            return f"did you mean `{path.parent / close[0]}`?"
    return f"check the path; {what} was expected there"


MANY_FILES = 100  # for more files, flushing all buffers of the machine is faster than flushing them one by one


@contextlib.contextmanager
def whole_files(folder: Path) -> Iterator[Callable[[str, bytes], None]]:
    """put(name, data): files below `folder` (made if its parent exists) that appear, in the order of the calls, when
    the block ends without an error. A name may contain a folder, as in `meshes/mug.obj`.

    Raises OutputError and leaves nothing behind.
    """
    with report_write_errors(folder):
        made = not folder.exists()
    ensure_folder(folder)
    names: list[str] = []
    below: set[Path] = set()  # folders that this call made
    with report_write_errors(folder):
        waiting = Path(tempfile.mkdtemp(dir=folder, prefix=".export.", suffix=".part"))

    def put(name: str, data: bytes) -> None:
        with report_write_errors(folder / name):
            (waiting / name).parent.mkdir(exist_ok=True)
            _write(waiting / name, data)
        names.append(name)

    try:
        yield put
        _flush([waiting / name for name in names])
        for name in names:
            with report_write_errors(folder / name):
                if not (folder / name).parent.exists():
                    (folder / name).parent.mkdir()
                    below.add((folder / name).parent)
                _refuse_special(folder / name)
        for name in names:
            with report_write_errors(folder / name):
                _move(waiting / name, folder / name)
    except BaseException:
        shutil.rmtree(waiting, ignore_errors=True)
        for new in (*below, *([folder] if made else [])):
            with contextlib.suppress(OSError):
                new.rmdir()
        raise
    shutil.rmtree(waiting, ignore_errors=True)


def _write(path: Path, data: bytes) -> None:
    with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o666), "wb") as file:
        file.write(data)


def _flush(paths: list[Path]) -> None:
    """Wait until files are on disk: one by one, or if there are many, all buffers of the machine at once."""
    if len(paths) > MANY_FILES and hasattr(os, "sync"):
        os.sync()
        return
    for path in paths:
        with report_write_errors(path), path.open("rb") as file:
            os.fsync(file.fileno())


def _move(source: Path, target: Path) -> None:
    """Move a file to its final path. If that is a link, the link stays and its target is replaced."""
    if target.is_symlink():
        write_whole(target, source.read_bytes())
    else:
        put_in_place(source, target)


def scene_name(number: int, total: int) -> str:
    """`scene_0001`: the beginning of the names of a scene's files; the first of `total` has the number 1."""
    return f"scene_{number:0{max(4, len(str(total)))}d}"


def count_leftovers(folder: Path, total: int, ending: str) -> int:
    """How many scenes' files with that ending a folder has in addition to those of `total` scenes, from an earlier
    run."""
    found = (re.match(r"(scene_(\d{4,}))[_.]", path.name) for path in folder.glob(f"scene_*{ending}"))
    return sum(
        match[1] != scene_name(int(match[2]), total) or not 1 <= int(match[2]) <= total for match in found if match
    )


class Sink(Protocol):
    """Takes the parts of a file."""

    def write(self, part: bytes | memoryview, /) -> object: ...


class Parts:
    """Keeps the parts of a file as they are: nothing is moved when it grows."""

    def __init__(self) -> None:
        self.parts: list[bytes | memoryview] = []

    def write(self, part: bytes | memoryview) -> None:
        self.parts.append(part)


class HashingWriter(io.RawIOBase):
    """A file to write to that passes its parts on to a sink; its hash is known with its last byte. `write` raises what
    the sink raises."""

    def __init__(self, sink: Sink) -> None:
        self.size = 0
        self._sink, self._hash = sink, hashlib.sha256()

    @property
    def sha256(self) -> str:
        """Of all parts so far."""
        return self._hash.hexdigest()

    def writable(self) -> bool:
        return True

    def tell(self) -> int:
        return self.size

    def write(self, data: Any) -> int:
        part = bytes(data)  # no copy of bytes
        self._sink.write(part)
        self._hash.update(part)
        self.size += len(part)
        return len(part)
