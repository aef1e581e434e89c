"""A folder of files on a disk or in an object store, by path or URL: s3://bucket/set/, gs://..., hdfs://...

Needs pyarrow, whose file systems these are. Files are written as a whole: by renaming on a disk, as one object in a
store. A store that fails is asked again for a minute, unless its answer is final (no permission, no such bucket, a full
disk).
"""

from __future__ import annotations

import contextlib
import re
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import pyarrow.fs

from scenegen.errors import DataError, OutputError
from scenegen.errors.stores import CANNOT_READ_STORE, CANNOT_WRITE_STORE, UNKNOWN_STORE
from scenegen.formats.files import FULL, write_whole
from scenegen.formats.locations import is_url

T = TypeVar("T")

PATIENCE = 60.0  # seconds for which a store that fails is asked again
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
    "NETWORK_CONNECTION": "the store does not answer",
    "INTERNAL_FAILURE": "the store failed",
}


@dataclass(frozen=True, slots=True)
class Store:
    """A folder at `location`, as its user names it. It can be pickled, and sent to another machine."""

    location: str
    system: Any  # a pyarrow.fs.FileSystem
    root: str  # the folder in the file system, without a slash at its end
    local: bool

    def read(self, name: str) -> bytes:
        """The bytes of a file. Raises DataError."""

        def work() -> bytes:
            with self.system.open_input_stream(self._path(name)) as stream:
                data: bytes = stream.read()
                return data

        return self._reading(name, work)

    def open(self, name: str) -> Any:
        """A file, open for reading at any place of it. Raises DataError."""
        return self._reading(name, lambda: self.system.open_input_file(self._path(name)))

    def write(self, name: str, data: bytes | memoryview) -> None:
        """Write a file, which appears whole or not at all. Raises OutputError."""

        def work() -> None:
            if self.local:
                path = Path(self.root) / name
                path.parent.mkdir(parents=True, exist_ok=True)
                write_whole(path, bytes(data))
                return
            with self.system.open_output_stream(self._path(name)) as stream:
                stream.write(data)

        self._writing(name, work)

    def sizes(self) -> dict[str, int]:
        """The files of the folder and its subfolders, with their sizes; none if it does not exist. Raises DataError."""
        selector = pyarrow.fs.FileSelector(self.root, recursive=True, allow_not_found=True)
        found = self._reading(".", lambda: self.system.get_file_info(selector))
        start = len(self.root) + 1
        return {one.path[start:]: one.size for one in found if one.type == pyarrow.fs.FileType.File}

    def delete(self, *names: str) -> None:
        """Remove files; those that are not there are left alone. Raises OutputError."""
        for name in names:

            def work(name: str = name) -> None:
                with contextlib.suppress(FileNotFoundError):
                    self.system.delete_file(self._path(name))

            self._writing(name, work)

    def delete_folder(self, name: str) -> None:
        """Remove a folder that may be there. Raises OutputError."""

        def work() -> None:
            with contextlib.suppress(FileNotFoundError):
                self.system.delete_dir(self._path(name))

        self._writing(name, work)

    def make(self) -> None:
        """Make the folder, and check that it can be written to. Raises OutputError."""
        if self.local:
            self._writing(".", lambda: Path(self.root).mkdir(parents=True, exist_ok=True))
        self.write(".writable", b"")
        self.delete(".writable")

    def _path(self, name: str) -> str:
        return f"{self.root}/{name}"

    def _reading(self, name: str, work: Callable[[], T]) -> T:
        try:
            return self._tried(work)[0]
        except (OSError, pyarrow.ArrowException) as error:
            remedy = "check the location" + ("" if self.local else " and your credentials")
            raise DataError(
                CANNOT_READ_STORE(file=name, location=self.location, reason=_reason(error), remedy=remedy)
            ) from error

    def _writing(self, name: str, work: Callable[[], object]) -> None:
        started = time.monotonic()
        tries = [0]
        try:
            self._tried(work, tries)
        except (OSError, pyarrow.ArrowException) as error:
            full = isinstance(error, OSError) and error.errno in FULL
            known = ((full, "make room"), (tries[0] > 1, "see whether the store is up"))
            remedy = next((words for holds, words in known if holds), "see whether you may write there")
            facts = {"tries": tries[0], "seconds": time.monotonic() - started} if tries[0] > 1 else {}
            raise OutputError(
                CANNOT_WRITE_STORE(file=name, location=self.location, reason=_reason(error), remedy=remedy, **facts)
            ) from error

    def _tried(self, work: Callable[[], T], tries: list[int] | None = None) -> tuple[T]:
        """The result of work, which is tried again while that can help."""
        started, wait = time.monotonic(), FIRST_WAIT
        while True:
            if tries is not None:
                tries[0] += 1
            try:
                return (work(),)
            except (OSError, pyarrow.ArrowException) as error:
                final = (
                    self.local or isinstance(error, FileNotFoundError | PermissionError) or _FINAL.search(str(error))
                )
                if final or time.monotonic() - started + wait > PATIENCE:
                    raise
            time.sleep(wait)
            wait = min(2.0 * wait, LONGEST_WAIT)


def store_at(location: str) -> Store:
    """The store at a URL or path. Nothing is read or written. Raises DataError for a URL that no file system knows."""
    if not is_url(location):
        root = str(Path(location).expanduser().absolute())
        return Store(location, pyarrow.fs.LocalFileSystem(), root.rstrip("/") or "/", True)
    try:
        system, root = pyarrow.fs.FileSystem.from_uri(location)
    except (OSError, ValueError, pyarrow.ArrowException) as error:
        raise DataError(UNKNOWN_STORE(location=shown(location), reason=_reason(error))) from error
    local = isinstance(system, pyarrow.fs.LocalFileSystem)
    return Store(shown(location), system, root.rstrip("/"), local)


def shown(location: str) -> str:
    """A URL without user names, passwords and keys, for messages and files."""
    return re.sub(r"\?.*$", "", re.sub(r"//[^/@]*@", "//", location))


def _reason(error: Exception) -> str:
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
