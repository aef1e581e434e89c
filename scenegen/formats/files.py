"""Reading and writing files so that they appear whole or not at all, with a diagnostic for whatever goes wrong."""

from __future__ import annotations

import contextlib
import difflib
import errno
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import IO

from scenegen.errors import DataError, Diagnostic, OutputError, ScenegenError

FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
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


def output_error(path: Path, error: OSError) -> OutputError:
    """The diagnostic for a path that could not be written."""
    reason = (error.strerror or str(error)).lower()
    return OutputError(
        Diagnostic(f"cannot write {path}: {reason}", help=_WRITE_HELP.get(error.errno or 0, "choose another place"))
    )


def check_writable(path: Path, *inputs: Path) -> None:
    """Refuse, before any work is done, an output file whose folder is missing or read-only, one that is not a regular
    file, and one that is also an input. Raises OutputError."""
    with reported(path):
        _refuse_special(path)
        for given in inputs:
            if _same(path, given):
                title = f"{path} would overwrite what it is made from"
                raise OutputError(Diagnostic(title, help="name another output file"))
        # Opening a temporary file there is the only test that root, containers and network disks answer honestly.
        with tempfile.TemporaryFile(dir=target(path).parent):
            pass


def _same(path: Path, given: Path) -> bool:
    """Whether both are one file. An input that cannot be looked at is left to whoever reads it."""
    if not path.exists():
        return False
    try:
        return given.exists() and path.samefile(given)
    except (OSError, ValueError):
        return False


def target(path: Path) -> Path:
    """What a link leads to, step by step; any other path as it is. Raises OSError for a link that leads to itself, and
    for names that are too long."""
    _exists(path)
    return Path(os.path.realpath(path)) if path.is_symlink() else path


def _exists(path: Path) -> bool:
    """As Path.exists, but for links that lead to themselves, which that calls missing: OSError."""
    try:
        path.stat()
    except (FileNotFoundError, NotADirectoryError):
        return False
    return True


def _refuse_special(path: Path) -> None:
    """Folders, devices, pipes and sockets are not replaced by a file."""
    _exists(path)
    if path.is_dir():
        raise output_error(path, IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR)))
    if path.exists() and not path.is_file():
        raise OutputError(Diagnostic(f"cannot write {path}: it is not a regular file", help="name a file"))


def check_folder(path: Path, file: Path | None = None) -> None:
    """Refuse, before any work is done, an output folder that can neither be written to nor made, and one that is to be
    the output `file` as well. Raises OutputError."""
    if file is not None and path.absolute() == file.absolute():
        raise OutputError(Diagnostic(f"{path} cannot be a file and a folder at once", help="name another folder"))
    with reported(path), tempfile.TemporaryFile(dir=path if _exists(path) else path.parent):
        pass


def ensure_folder(path: Path) -> None:
    """Make an output folder (its parent must be there) and check that it can be written to. Raises OutputError."""
    with reported(path):
        path.mkdir(exist_ok=True)
        with tempfile.TemporaryFile(dir=path):
            pass


@contextlib.contextmanager
def reported(path: Path) -> Iterator[None]:
    try:
        yield
    except ScenegenError:
        raise
    except OSError as error:
        raise output_error(path, error) from error


@contextlib.contextmanager
def whole_file(path: Path) -> Iterator[IO[bytes]]:
    """A file to write to that appears at `path`, on disk and whole, when the block ends without an error.

    What is written goes to a temporary file in the same folder, which is renamed. Raises OutputError and leaves nothing
    behind; OSErrors of the block count as failures to write.
    """
    with reported(path):
        _refuse_special(path)
        path = target(path)  # a link stays, what it points to is written
        # a name may be as long as names can be, so the temporary one has its beginning only
        handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name[:32]}.", suffix=".part")
        try:
            with os.fdopen(handle, "wb") as file:
                yield file
                file.flush()
                os.fsync(file.fileno())
            Path(temporary).chmod(0o666 & ~_umask())
            Path(temporary).replace(path)
        except BaseException:
            with contextlib.suppress(OSError):
                Path(temporary).unlink()
            raise


def write_whole(path: Path, data: bytes) -> None:
    """Write through a temporary file in the same folder and rename it. Raises OutputError and leaves nothing behind."""
    with whole_file(path) as file:
        file.write(data)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def read_bytes(path: Path, what: str, *, limit: int | None = None, remedy: str = "") -> bytes:
    """The bytes of a file that the user named; `what` is its role ("a spec", "a scenes file"), `remedy` what to do
    about one that is longer than the limit. Raises DataError."""
    with opened(path, what) as file:
        size = os.fstat(file.fileno()).st_size
        if limit is not None and size > limit:
            help_ = f"the limit is {limit:,}" + (f"; {remedy}" if remedy else "")
            raise DataError(Diagnostic(f"cannot read {path}: {size:,} bytes are too many", help=help_))
        return file.read()


@contextlib.contextmanager
def opened(path: Path, what: str) -> Iterator[IO[bytes]]:
    """A file that the user named, open for reading; `what` is its role. Raises DataError, also for OSErrors of the
    block."""
    try:
        if path.exists() and not path.is_file():
            kind = "a folder" if path.is_dir() else "not a regular file"
            raise DataError(Diagnostic(f"cannot read {path}: it is {kind}", help=f"name {what} instead"))
        with path.open("rb") as file:
            yield file
    except ScenegenError:
        raise
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise DataError(Diagnostic(f"cannot read {path}: {reason}", help=missing_help(path, what))) from error


def missing_help(path: Path, what: str) -> str:
    """A neighbour with a similar name, where there is one."""
    with contextlib.suppress(OSError):
        siblings = [sibling.name for sibling in path.parent.iterdir() if sibling.is_file()]
        close = difflib.get_close_matches(path.name, siblings, n=1, cutoff=0.6)
        if close and close[0] != path.name:
            return f"did you mean `{path.parent / close[0]}`?"
    return f"check the path; {what} was expected there"
