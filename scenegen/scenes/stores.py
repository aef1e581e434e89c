"""A folder of files on a disk or in an object store, by path or URL: s3://bucket/set/, gs://..., hdfs://...

Files are written as a whole: by renaming on a disk, as one object in a store. A store that fails is asked again for a
minute, unless its answer is final (no permission, no such bucket); a disk that fails is not. Object stores are file
systems of pyarrow, which is loaded for them alone.
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import shutil
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeVar

from scenegen.errors import DataError, OutputError, RequestError
from scenegen.errors.files import CANNOT_READ, CANNOT_WRITE, UNKNOWN_STORE
from scenegen.errors.requests import NOT_INSTALLED
from scenegen.scenes.files import DISK_FULL, FlushingWriter, Parts, Sink, below, inside, sync_folder, whole_file
from scenegen.scenes.locations import is_url

T = TypeVar("T")

RETRY_SECONDS = 60.0  # seconds for which a store that fails is asked again
FIRST_WAIT, LONGEST_WAIT = 0.25, 8.0  # seconds between tries, doubled each time
# Of the answers of object stores, those that another try cannot change. pyarrow has no types for them.
_FINAL = re.compile(r"ACCESS_DENIED|NO_SUCH_BUCKET|INVALID_ACCESS_KEY|SIGNATURE_DOES_NOT|NoSuchBucket|AccessDenied")

_SAID = {
    "NO_SUCH_BUCKET": "there is no such bucket",
    "ACCESS_DENIED": "access denied",
    "INVALID_ACCESS_KEY": "the access key is not known there",
    "SIGNATURE_DOES_NOT": "the secret key is wrong",
    "SLOW_DOWN": "the store is too busy",
    "SERVICE_UNAVAILABLE": "the store is unavailable",
    "HTTP status 503": "the store is unavailable",
    "NETWORK_CONNECTION": "the store does not answer",
    "INTERNAL_FAILURE": "the store failed",
}


@dataclass(slots=True)
class RetriedWork:
    """One piece of work and its tries, within `patience` seconds. `tell` is called once, with the first error that
    another try may mend."""

    patience: float
    tell: Callable[[Exception], None]
    tries: int = 0
    started: float = field(default_factory=lambda: time.monotonic())

    @property
    def seconds(self) -> float:
        """Since the first try."""
        return time.monotonic() - self.started

    def run(self, work: Callable[[], T]) -> T:
        """The result of the work. Raises its last error."""
        wait = FIRST_WAIT
        while True:
            self.tries += 1
            try:
                return work()
            except failures() as error:
                if final(error) or self.seconds + wait > self.patience:
                    raise
                if self.tries == 1:
                    self.tell(error)
            time.sleep(wait)
            wait = min(2.0 * wait, LONGEST_WAIT)


def failures() -> tuple[type[Exception], ...]:
    """What a disk or an object store raises."""
    pyarrow = sys.modules.get("pyarrow")
    return (OSError,) if pyarrow is None else (OSError, pyarrow.ArrowException)


def final(error: Exception) -> bool:
    """Whether another try cannot change an answer."""
    return isinstance(error, FileNotFoundError | PermissionError) or _FINAL.search(str(error)) is not None


def reason_of(error: Exception) -> str:
    """An error in few words. Those of pyarrow are for programmers, and long; AWS's names in capitals are in them."""
    said = next((words for name, words in _SAID.items() if name in str(error)), None)
    if said is not None:
        return said
    if isinstance(error, OSError) and error.strerror:
        return error.strerror.lower()
    line = (str(error).splitlines() or [type(error).__name__])[0].rstrip(".")
    with contextlib.suppress(ValueError):
        line = line[: line.index(" Detail: ")]
    return line if len(line) <= 160 else f"{line[:157]}..."


REPLACED = 5  # times that a file is read again, because it was replaced meanwhile

Tell = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class Store:
    """A folder at `location`, as its user names it. It can be pickled, and sent to another machine."""

    location: str
    system: Any  # a pyarrow.fs.FileSystem; None for a disk
    root: str  # the folder in the file system, without a slash at its end
    local: bool
    patience: float = RETRY_SECONDS  # seconds for which an object store that fails is asked again
    tell: Tell | None = field(default=None, compare=False)  # called with failures that are tried again

    def with_progress(self, tell: Tell | None) -> Store:
        """The same store with another listener. One that is sent to other processes has none."""
        return replace(self, tell=tell)

    def read(self, name: str) -> bytes:
        """The bytes of a file. Raises DataError."""

        def work() -> bytes:
            if self.local:
                return Path(self.path(name)).read_bytes()
            for _ in range(REPLACED):
                before = self._version(name)
                with self.system.open_input_stream(self.path(name)) as stream:
                    data: bytes = stream.read()
                if self._version(name) == before:
                    return data
            raise OSError("it changes while it is read")

        return self._reading(name, work)

    def open(self, name: str) -> Any:
        """A file, open for reading at any place of it. Raises DataError, and so does reading from it."""
        if self.local:
            return self._reading(name, lambda: Path(self.path(name)).open("rb"))
        from pyarrow import PythonFile

        file = self._reading(name, lambda: self.system.open_input_file(self.path(name)))
        return PythonFile(_RetriedFile(self, name, file), mode="r")

    def write(self, name: str, *parts: bytes | memoryview) -> None:
        """Write a file, which appears whole or not at all. Raises OutputError."""

        if self.local:
            with self.whole(name) as file:
                for part in parts:
                    file.write(part)
            return

        def work() -> None:
            with self.system.open_output_stream(self.path(name)) as stream:
                for part in parts:
                    stream.write(part)

        self._writing(name, work)

    @contextlib.contextmanager
    def whole(self, name: str) -> Iterator[Sink]:
        """A file to write to, part by part, which appears whole when the block ends, or not at all if it raises. Parts
        go to a disk at once; for an object store they are kept until the end, since that may be asked again. OSErrors
        of the block count as failures to write. Raises OutputError."""
        if not self.local:
            kept = Parts()
            yield kept
            self.write(name, *kept.parts)
            return
        path = Path(self.path(name))
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            with whole_file(path) as file:
                yield FlushingWriter(file)
            sync_folder(path.parent)
        except OutputError as error:
            if isinstance(error.__cause__, OSError):  # a set's own words say what is kept
                raise self._not_written(name, error.__cause__) from error.__cause__
            raise
        except OSError as error:
            raise self._not_written(name, error) from error

    def sizes(self) -> dict[str, int]:
        """The files of the folder and its subfolders, with their sizes; none if it does not exist. Raises DataError."""
        if self.local:
            return self._reading(".", lambda: _sizes(self.root))
        from pyarrow import fs

        selector = fs.FileSelector(self.root, recursive=True, allow_not_found=True)
        found = self._reading(".", lambda: self.system.get_file_info(selector))
        start = len(self.root) + 1
        return {one.path[start:]: one.size for one in found if one.type == fs.FileType.File}

    def delete(self, *names: str) -> None:
        """Remove files; those that are not there are left alone. Raises OutputError."""
        for name in names:

            def work(name: str = name) -> None:
                with contextlib.suppress(FileNotFoundError):
                    if self.local:
                        Path(self.path(name)).unlink(missing_ok=True)
                    else:
                        self.system.delete_file(self.path(name))

            self._writing(name, work)

    def delete_folder(self, name: str) -> None:
        """Remove a folder that may be there. Raises OutputError."""

        def work() -> None:
            with contextlib.suppress(FileNotFoundError):
                if self.local:
                    shutil.rmtree(self.path(name))
                else:
                    self.system.delete_dir(self.path(name))

        self._writing(name, work)

    def make(self) -> None:
        """Make the folder, and check that it can be written to. Raises OutputError."""
        if self.local:
            self._writing(".", lambda: Path(self.root).mkdir(parents=True, exist_ok=True))
        self.write(".writable", b"")
        self.delete(".writable")

    def _version(self, name: str) -> tuple[int, int] | None:
        """What tells whether an object was replaced while it was read: pyarrow asks for its size, then for so many
        bytes, which may be a part of the new one. On a disk an open file stays what it is."""
        if self.local:
            return None
        found = self.system.get_file_info(self.path(name))
        return found.size, found.mtime_ns

    def path(self, name: str) -> str:
        """The path of a file in the file system. Raises DataError for a name that leads out of the folder."""
        try:
            return str(below(Path(self.root), name)) if self.local else f"{self.root}/{inside(name)}"
        except ValueError as error:
            remedy = "was a manifest edited? it names files of its own folder alone"
            raise DataError(CANNOT_READ(file=name, location=self.location, reason=str(error), remedy=remedy)) from None

    def _reading(self, name: str, work: Callable[[], T]) -> T:
        try:
            return self._attempts(name).run(work)
        except failures() as error:
            remedy = "check the location" + ("" if self.local else " and your credentials")
            raise DataError(
                CANNOT_READ(file=name, location=self.location, reason=reason_of(error), remedy=remedy)
            ) from error

    def _writing(self, name: str, work: Callable[[], object]) -> None:
        attempts = self._attempts(name)
        try:
            attempts.run(work)
        except OutputError:
            raise
        except failures() as error:
            facts = {"tries": attempts.tries, "seconds": attempts.seconds} if attempts.tries > 1 else {}
            raise self._not_written(name, error, **facts) from error

    def _not_written(self, name: str, error: Exception, **facts: float) -> OutputError:
        full = isinstance(error, OSError) and error.errno in DISK_FULL
        known = ((full, "make room"), (not self.local and not final(error), "see whether the store is up"))
        remedy = next((words for holds, words in known if holds), "see whether you may write there")
        return OutputError(
            CANNOT_WRITE(file=name, location=self.location, reason=reason_of(error), remedy=remedy, **facts)
        )

    def _attempts(self, name: str) -> RetriedWork:
        def tell(error: Exception) -> None:
            if self.tell is not None:
                again = f"trying again for up to {self.patience:.0f} s"
                self.tell(f"{name} in {self.location}: {reason_of(error)}; {again}")

        return RetriedWork(0.0 if self.local else self.patience, tell)


class _RetriedFile(io.RawIOBase):
    """A file of an object store. What fails is read again: else a store that is busy would look like damage."""

    def __init__(self, store: Store, name: str, file: Any) -> None:
        self._store, self._name, self._file, self._size = store, name, file, file.size()
        self._place = 0

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def seek(self, offset: int, whence: int = 0) -> int:
        self._place = offset + (0, self._place, self._size)[whence]
        return self._place

    def tell(self) -> int:
        return self._place

    def size(self) -> int:
        return int(self._size)

    def read(self, size: int = -1) -> bytes:
        """Raises DataError."""
        start, count = self._place, self._size - self._place if size is None or size < 0 else size
        data: bytes = self._store._reading(self._name, lambda: self._file.read_at(count, start))
        self._place += len(data)
        return data

    def close(self) -> None:
        if not self.closed:
            self._file.close()
        super().close()


def _sizes(root: str) -> dict[str, int]:
    """The files below a folder, with their sizes. Raises OSError for what is no folder."""

    def refuse(error: OSError) -> None:
        if not isinstance(error, FileNotFoundError):
            raise error

    paths = (Path(folder, name) for folder, _, names in os.walk(root, onerror=refuse) for name in names)
    return {str(path.relative_to(root)): path.stat().st_size for path in paths if path.is_file()}


def open_store(location: str, tell: Tell | None = None) -> Store:
    """The store of a set at a path or URL: see `store_at`. Raises RequestError without pyarrow, which sets need."""
    try:
        import pyarrow  # noqa: F401 - loaded here for the first time
    except ModuleNotFoundError as error:
        command = 'pip install "scenegen-dsl[parquet]"'
        raise RequestError(NOT_INSTALLED(package="pyarrow", purpose="for sets of scenes", command=command)) from error
    return store_at(location, tell)


def store_at(location: str, tell: Tell | None = None) -> Store:
    """The store at a URL or path; nothing is read or written. `tell` hears of failures that are tried again. Raises
    DataError for a URL that no file system knows."""
    if not is_url(location):
        root = str(Path(location).expanduser().absolute())
        return Store(location, None, root.rstrip("/") or "/", True, tell=tell)
    import pyarrow
    from pyarrow import fs

    try:
        system, root = fs.FileSystem.from_uri(location)
    except (OSError, ValueError, pyarrow.ArrowException) as error:
        raise DataError(UNKNOWN_STORE(location=without_secrets(location), reason=reason_of(error))) from error
    local = isinstance(system, fs.LocalFileSystem)
    return Store(without_secrets(location), system, root.rstrip("/"), local, tell=tell)


def without_secrets(location: str) -> str:
    """A URL without user names, passwords and keys, for messages and files."""
    return re.sub(r"\?.*$", "", re.sub(r"//[^/@]*@", "//", location))
