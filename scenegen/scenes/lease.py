"""One run at a time in a set. The hold of a run ends with its process, whatever ends it.

On a disk it is the system's own lock of the file `.lock`. Object stores have no locks: there `.lock` names the process
that writes and its machine, and is written again every half minute. It counts as left behind when its process is gone,
or, seen from another machine, when it is older than `LEASE`. Two runs that begin within the same second both write it,
look again after `SETTLE`, and only the later one goes on. That is the best that can be had without conditional writes,
which pyarrow does not offer: a machine that sleeps for longer than `LEASE` loses its hold, and its run ends when it
finds out.
"""

from __future__ import annotations

import contextlib
import os
import secrets
import socket
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import IO

from pydantic import BaseModel, ConfigDict, ValidationError

from scenegen.errors import DataError, OutputError
from scenegen.errors.files import CANNOT_WRITE, SET_IN_USE, SET_LOST
from scenegen.scenes.sets import LOCK
from scenegen.scenes.stores import Store, reason_of

LEASE = 120.0  # seconds; the clocks of machines and stores may differ by less
RENEWED = 30.0  # seconds between two writes of a hold
SETTLE = 1.0  # seconds


class LeaseHolder(BaseModel):
    """Who writes a set. `machine` is one of a kind for a machine since it was started and, in containers, for each."""

    model_config = ConfigDict(extra="forbid", strict=True, defer_build=True)
    host: str
    machine: str
    pid: int
    born: str
    token: str


class SetLease:
    """What a run has of its set. `check` raises OutputError when another run has taken it over."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self._other: LeaseHolder | None = None

    def check(self) -> None:
        if self._other is not None:
            raise OutputError(SET_LOST(location=self._store.location, host=self._other.host, pid=self._other.pid))


@contextlib.contextmanager
def held(store: Store) -> Iterator[SetLease]:
    """The set, for this process alone until the end of the block. Raises OutputError if another run has it, and if the
    place cannot be written to."""
    with contextlib.ExitStack() as stack:
        if store.local:
            store.make()
        if store.local and stack.enter_context(locked(Path(store.path(LOCK)), store.location)):
            yield SetLease(store)
        else:
            yield stack.enter_context(_leased(store))


def refuse_held(store: Store) -> None:
    """Before any work: raises OutputError if another run has the set."""
    if not store.local:
        _refuse(store, _holder(store))
        return
    try:
        file = Path(store.root, LOCK).open("r+b")  # noqa: SIM115
    except OSError:  # what cannot be opened is nobody's; whether the place will do is found out later
        return
    with file:
        _lock(file, store.location)


@contextlib.contextmanager
def locked(path: Path, location: str) -> Iterator[bool]:
    """Whether the disk has locks; then what is at `location` is locked by the file `path` until the end of the block.
    Raises OutputError if another process has it."""
    while True:
        try:
            file = path.open("a+b")
        except OSError as error:
            facts = {"location": location, "reason": reason_of(error), "remedy": "see whether you may write there"}
            raise OutputError(CANNOT_WRITE(file=path.name, **facts)) from error
        with file:
            if not _lock(file, location):
                yield False
                return
            if not path.exists() or not os.path.samestat(os.fstat(file.fileno()), path.stat()):
                continue  # its holder has removed it meanwhile
            file.truncate(0)
            with contextlib.suppress(OSError):  # a full disk: the lock holds without words
                file.write(_me().model_dump_json().encode())
                file.flush()
            try:
                yield True
            finally:
                path.unlink(missing_ok=True)
            return


def _lock(file: IO[bytes], location: str) -> bool:
    """Whether a file could be locked; not, if the disk has no locks. Raises OutputError if another process has it."""
    try:
        import fcntl
    except ImportError:  # on Windows
        return False
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        file.seek(0)
        raise _in_use(location, _read(file.read()), None) from None
    except OSError:
        return False
    return True


@contextlib.contextmanager
def _leased(store: Store) -> Iterator[SetLease]:
    _refuse(store, _holder(store))
    me = _me()
    data = me.model_dump_json().encode()
    store.write(LOCK, data)
    time.sleep(SETTLE)
    other = _holder(store)
    if other is not None and other.token != me.token:
        raise _in_use(store.location, other, None)
    hold, over = SetLease(store), threading.Event()

    def renew() -> None:
        while not over.wait(RENEWED):
            with contextlib.suppress(DataError, OutputError):  # the run itself says what is wrong with the store
                other = _holder(store)
                if other is not None and other.token != me.token:
                    hold._other = other
                    return
                if not over.is_set():
                    store.write(LOCK, data)

    store = store.told_to(None, patience=0.0)
    renewing = threading.Thread(target=renew, daemon=True)
    renewing.start()
    try:
        yield hold
    finally:
        over.set()
        renewing.join(timeout=10.0)
        with contextlib.suppress(DataError, OutputError):
            if hold._other is None:
                store.delete(LOCK)


def _refuse(store: Store, holder: LeaseHolder | None) -> None:
    """Raises OutputError for a holder that may be at work."""
    if holder is None:
        return
    if holder.machine == _machine():
        if _born(holder.pid) == holder.born:
            raise _in_use(store.location, holder, None)
        return
    age = time.time() - store.changed(LOCK)
    if age < LEASE:
        raise _in_use(store.location, holder, LEASE - age)


def _in_use(location: str, holder: LeaseHolder | None, left: float | None) -> OutputError:
    facts = {} if holder is None else {"pid": holder.pid, "host": holder.host}
    return OutputError(SET_IN_USE(location=location, **facts, **({} if left is None else {"seconds": left})))


def _holder(store: Store) -> LeaseHolder | None:
    return _read(store.read(LOCK)) if store.changed(LOCK) else None


def _read(data: bytes) -> LeaseHolder | None:
    """None for the file of a process that had no time to fill it."""
    try:
        return LeaseHolder.model_validate_json(data)
    except ValidationError:
        return None


def _me() -> LeaseHolder:
    pid = os.getpid()
    token = secrets.token_hex(8)
    return LeaseHolder(host=socket.gethostname(), machine=_machine(), pid=pid, born=_born(pid), token=token)


def _machine() -> str:
    """Of Linux, its start and the container's processes; else the host's name."""
    with contextlib.suppress(OSError):
        boot = Path("/proc/sys/kernel/random/boot_id").read_text().strip()
        return f"{boot} {Path('/proc/self/ns/pid').readlink()}"
    return socket.gethostname()


def _born(pid: int) -> str:
    """When a process began, in words of the system, so that another one with its number is not taken for it; empty if
    there is no such process."""
    with contextlib.suppress(OSError):
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[19]
    if not Path("/proc/self/stat").exists():
        with contextlib.suppress(OSError):
            os.kill(pid, 0)
            return "unknown"
    return ""
