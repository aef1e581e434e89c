"""One run at a time in a folder: the system's own lock of a file, which ends with its process, whatever ends it.

Object stores have no locks, nor have disks of some systems: there two runs at a time are not noticed. docs/scale.md
says what comes of them.
"""

from __future__ import annotations

import contextlib
import os
import socket
from collections.abc import Iterator
from pathlib import Path
from typing import IO

from scenegen.errors import OutputError
from scenegen.errors.files import CANNOT_WRITE, SET_IN_USE
from scenegen.scenes.sets import LOCK
from scenegen.scenes.stores import Store, reason_of


@contextlib.contextmanager
def acquire(store: Store) -> Iterator[None]:
    """The set, for this process alone until the end of the block, if it is on a disk. Raises OutputError if another run
    has it, and if the place cannot be written to."""
    if not store.local:
        yield
        return
    store.make()
    with lock_file(Path(store.path(LOCK)), store.location):
        yield


def refuse_in_use(store: Store) -> None:
    """Before any work: raises OutputError if another run has the set."""
    if not store.local:
        return
    try:
        file = Path(store.root, LOCK).open("r+b")  # noqa: SIM115
    except OSError:  # what cannot be opened is nobody's; whether the place will do is found out later
        return
    with file:
        _lock(file, store.location)


@contextlib.contextmanager
def lock_file(path: Path, location: str) -> Iterator[None]:
    """What is at `location` is locked by the file `path` until the end of the block, if the disk has locks. Raises
    OutputError if another process has it."""
    while True:
        try:
            file = path.open("a+b")
        except OSError as error:
            facts = {"location": location, "reason": reason_of(error), "remedy": "see whether you may write there"}
            raise OutputError(CANNOT_WRITE(file=path.name, **facts)) from error
        with file:
            _lock(file, location)
            if not path.exists() or not os.path.samestat(os.fstat(file.fileno()), path.stat()):
                continue  # its holder has removed it meanwhile
            file.truncate(0)
            with contextlib.suppress(OSError):  # a full disk: the lock holds without words
                file.write(f"{os.getpid()} {socket.gethostname()}".encode())
                file.flush()
            try:
                yield
            finally:
                path.unlink(missing_ok=True)
            return


def _lock(file: IO[bytes], location: str) -> None:
    """Raises OutputError if another process has the file."""
    try:
        import fcntl
    except ImportError:  # on Windows
        return
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        file.seek(0)
        process, _, host = file.read().decode(errors="replace").partition(" ")
        facts = {"pid": int(process), "host": host} if process.isdecimal() else {}  # it had no time to say who it is
        raise OutputError(SET_IN_USE(location=location, **facts)) from None
    except OSError:  # a disk without locks
        return
