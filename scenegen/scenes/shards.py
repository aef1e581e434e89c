"""A large scene file in progress: finished blocks in `x.parquet.part/`, joined into `x.parquet` at the end.

The folder has `shard-000000.npy`, ... (blocks, one array after the other), `pool-000001.npy` with scenes for later
blocks, and `manifest.json` with their names and checksums, the request, and the progress of the run. Shards and pool
are on disk before the manifest that names them, and the manifest replaces the previous one in one step. So the manifest
is always valid, even if the process dies: the run continues from its last checkpoint, and newer data is made again,
with the same bytes. The scenes in the shards have no file format yet, because the header, which some formats write
first, is known last.

A block with another checksum is damage. It cannot be drawn again alone, since where the run stood before it is not
kept: the run is refused. All blocks are looked at before a run goes on, and each once more when it is joined.

A folder with a checkpoint is never deleted unless the user asks for it: without `resume` it is refused. A folder
without one comes from a run that had just begun, and is replaced.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import os
import re
import zlib
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import IO, Any, Literal, Protocol

import numpy as np
from pydantic import BaseModel, ConfigDict, ValidationError

from scenegen.arrays import Array
from scenegen.errors import DataError, OutputError, RequestError
from scenegen.errors.files import DAMAGED_SHARD, FOLDER_NOT_EMPTY, OTHER_REQUEST, SET_IN_USE, UNFINISHED_RUN
from scenegen.scenes.blocks import Block
from scenegen.scenes.files import (
    FULL,
    begin_writing,
    output_error,
    put_in_place,
    reported,
    target,
    whole_file,
    write_whole,
)

MANIFEST = "manifest.json"
LOCK = "lock"
_OURS = re.compile(r"manifest\.json|lock|joined|(shard|pool)-\d{6,}\.npy(\.new)?|\..*\.part")


class _BlockFile(BaseModel):
    """An array in a file, as long as it is."""

    model_config = ConfigDict(extra="forbid", strict=True)
    bytes: int
    crc32: int


class _Shard(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True)
    file: str
    blocks: list[_BlockFile]
    scenes: int
    bytes: int


class _Manifest(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True)
    format: Literal["scenegen/shards"] = "scenegen/shards"
    version: Literal[2] = 2
    request: dict[str, Any]
    coordinates: int
    shards: list[_Shard] = []
    checkpoint: int = 0
    pool: _BlockFile | None = None
    state: dict[str, Any] = {}
    joined: bool = False
    crc32: int = 0  # of all the rest

    def checked(self) -> _Manifest:
        """The same with its checksum."""
        rest = self.model_copy(update={"crc32": 0})
        return rest.model_copy(update={"crc32": zlib.crc32(rest.model_dump_json().encode())})


class Shards:
    """The folder, locked by this process. `state` and `pool` are those of the last checkpoint; `state` is empty if
    there is none yet."""

    def __init__(self, path: Path, manifest: _Manifest) -> None:
        self.path = path
        self.folder = folder_of(path)
        self._manifest = manifest
        self._shard: IO[bytes] | None = None
        self._joined = self.folder / "joined"
        self._blocks: list[_BlockFile] = []
        self._scenes = 0

    @property
    def state(self) -> dict[str, Any]:
        return self._manifest.state

    @property
    def joined(self) -> bool:
        """Whether the scene file exists already, and only the folder has to be removed."""
        return self._manifest.joined

    def pool(self) -> Array:
        """The state that was passed to `checkpoint`. Raises DataError."""
        assert self._manifest.pool is not None
        with self._reported(), self._pool_path(self._manifest.checkpoint).open("rb") as file:
            return _load(file, self._manifest.pool)

    def append(self, block: Block) -> None:
        """Add a block; it counts from the next checkpoint on."""
        with self._reported():
            if self._shard is None:
                self._shard = self._shard_path(new=True).open("wb")
            self._blocks.append(_save(self._shard, block.rows, block.phi))
            begin_writing(self._shard)
        self._scenes += block.count

    def checkpoint(self, state: Mapping[str, object], pool: Array) -> None:
        """Make everything so far durable: after this, `kill -9` loses nothing of it. `state` is JSON."""
        with self._reported():
            shards = [*self._manifest.shards]
            if self._shard is not None:
                path, new = self._shard_path(), self._shard_path(new=True)
                _sync(self._shard)
                self._shard.close()
                self._shard = None
                new.replace(path)
                size = path.stat().st_size
                shards.append(_Shard(file=path.name, blocks=self._blocks, scenes=self._scenes, bytes=size))
                self._blocks, self._scenes = [], 0
            number = self._manifest.checkpoint + 1
            with self._pool_path(number).open("wb") as file:
                stored = _save(file, pool)
                _sync(file)
            self._publish(shards=shards, checkpoint=number, pool=stored, state=dict(state))
            self._pool_path(number - 1).unlink(missing_ok=True)

    def join(self, write: Callable[[IO[bytes]], None]) -> None:
        """Let `write` make the scene file, in the folder still. Raises OutputError."""
        with self._reported(), whole_file(self._joined) as file:
            write(file)

    def finish(self, *, whole: bool = True) -> None:
        """Move the scene file that was joined to its final path, and remove the folder. `whole` says that the run is
        complete, even if the process dies before all of the folder is removed. Raises OutputError."""
        with self._reported():
            put_in_place(self._joined, self.path)
            _sync_folder(self.path.parent)
            if whole:
                self._publish(joined=True)
        self.discard()

    def blocks(self) -> Iterator[Block]:
        """The blocks up to the last checkpoint before this call, in order. The iterator raises DataError for damage."""
        return self._blocks_of(self._manifest)

    def _blocks_of(self, manifest: _Manifest) -> Iterator[Block]:
        coordinates = manifest.coordinates
        for shard in manifest.shards:
            with (self.folder / shard.file).open("rb") as file:
                for stored in shard.blocks:
                    table = _load(file, stored)
                    yield Block(table[:coordinates], table[coordinates:])

    def discard(self) -> None:
        """Remove the folder: the manifest first, because it must not name missing files, but last if it says that the
        run is complete."""
        self.close()
        with self._reported():
            if not self.joined:
                (self.folder / MANIFEST).unlink(missing_ok=True)
            for entry in self.folder.iterdir():
                if entry.name != MANIFEST:
                    entry.unlink()
            (self.folder / MANIFEST).unlink(missing_ok=True)
            self.folder.rmdir()

    def leave(self) -> None:
        """Close open files, and remove a folder without a checkpoint."""
        self.close()
        if not self.state and self.folder.exists():
            self.discard()

    def close(self) -> None:
        """Close open files. Data that a full disk refused is not part of any checkpoint, and is made again."""
        if self._shard is not None:
            with contextlib.suppress(OSError):
                self._shard.close()
            self._shard = None

    def _publish(self, **changes: object) -> None:
        _sync_folder(self.folder)
        self._manifest = self._manifest.model_copy(update=changes).checked()
        write_whole(self.folder / MANIFEST, self._manifest.model_dump_json(indent=1).encode() + b"\n")
        _sync_folder(self.folder)

    def _shard_path(self, *, new: bool = False) -> Path:
        return self.folder / f"shard-{len(self._manifest.shards):06d}.npy{'.new' if new else ''}"

    def _pool_path(self, number: int) -> Path:
        return self.folder / _pool_name(number)

    @contextlib.contextmanager
    def _reported(self) -> Iterator[None]:
        try:
            yield
        except (OutputError, OSError) as error:
            cause = error.__cause__ if isinstance(error, OutputError) else error
            if not isinstance(cause, OSError):
                raise
            found = output_error(self.path, cause)
            if self.state:  # else `leave` removes the folder
                full = cause.errno in FULL or None
                found = OutputError(found.diagnostics[0].but(folder=self.folder, scenes=self._kept, full=full))
            raise found from error

    @property
    def _kept(self) -> int:
        """The number of scenes of the last checkpoint that will be in the file."""
        return sum(shard.scenes for shard in self._manifest.shards)


def _pool_name(number: int) -> str:
    return f"pool-{number:06d}.npy"


def folder_of(path: Path) -> Path:
    """The folder of a scene file's shards."""
    return path.with_name(f"{path.name}.part")


@contextlib.contextmanager
def open_shards(path: Path, request: Mapping[str, object], coordinates: int, *, resume: bool) -> Iterator[Shards]:
    """The folder of a scene file, new or resumed; `coordinates` is 3N.

    `request` is JSON that determines the scenes: a folder of another request is refused. At the end the folder stays if
    it has a checkpoint. Raises RequestError, DataError (damage), OutputError.
    """
    with reported(path):
        path = target(path)
    folder = folder_of(path)
    wanted = json.loads(json.dumps(dict(request)))
    shards = Shards(path, _Manifest(request=wanted, coordinates=coordinates))
    with contextlib.ExitStack() as held:
        with shards._reported():
            folder.mkdir(0o700, exist_ok=True)  # the file may replace one that is nobody else's business
            _refuse_foreign(folder)
            held.enter_context(_locked(folder))
            found = _load_manifest(folder)
            goes_on = found is not None and (path.exists() or not found.joined)
            if found is not None and goes_on:
                _check(folder, found, wanted, resume)
                shards = Shards(path, found)
            for entry in folder.iterdir():  # of a run that goes on: what was being written when it died
                if entry.name.startswith(".") if goes_on else entry.name != LOCK:
                    entry.unlink()
        held.callback(shards.leave)
        if not shards.joined:
            with shards._reported():
                for _ in shards.blocks():  # of an earlier run: damage is found now, not when all else is drawn
                    pass
        yield shards


def _refuse_foreign(folder: Path) -> None:
    odd = [entry.name for entry in folder.iterdir() if entry.is_symlink() or not _OURS.fullmatch(entry.name)]
    if odd:
        raise OutputError(FOLDER_NOT_EMPTY(folder=folder, odd=odd[0]))


def _load_manifest(folder: Path) -> _Manifest | None:
    """The last checkpoint, or None. Raises DataError if a file that it names is missing."""
    path = folder / MANIFEST
    if not path.exists():
        return None
    damage = DAMAGED_SHARD(path=folder, folder="it")
    try:
        manifest = _Manifest.model_validate_json(path.read_bytes())
    except ValidationError:
        raise DataError(damage) from None
    if manifest.crc32 != manifest.checked().crc32:
        raise DataError(damage)
    sizes = {entry.name: entry.stat().st_size for entry in folder.iterdir()}
    there = all(sizes.get(shard.file) == shard.bytes for shard in manifest.shards)
    if not manifest.joined and not (there and _pool_name(manifest.checkpoint) in sizes):
        raise DataError(damage)
    return manifest


def _check(folder: Path, found: _Manifest, wanted: Mapping[str, Any], resume: bool) -> None:
    """Refuse to start over an existing run without `resume`, or to resume one of another request."""
    scenes = sum(shard.scenes for shard in found.shards)
    if not resume:
        raise RequestError(UNFINISHED_RUN(folder=folder, scenes=scenes))
    # any other difference also changes the plan, so other differences are named first
    for key in sorted({*found.request, *wanted}, key=lambda key: (key == "plan", key)):
        before, now = found.request.get(key), wanted.get(key)
        if before != now:
            facts = {"key": key, "before": shortened(before), "now": shortened(now)}
            raise RequestError(OTHER_REQUEST(folder=folder, **facts))


def shortened(value: object) -> str:
    text = json.dumps(value, ensure_ascii=False)
    return text if len(text) <= 60 else f"{text[:57]}..."


@contextlib.contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """Lock the folder for this process; the lock ends with the process in any case."""
    with (folder / LOCK).open("wb") as file:
        with contextlib.suppress(ImportError):  # not available on Windows
            import fcntl

            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise OutputError(SET_IN_USE(location=folder, file=True)) from None
            except OSError:
                pass  # some network disks have no locks
        yield


def _save(file: IO[bytes], *tables: Array) -> _BlockFile:
    """Writes arrays of as many columns as one, for `_load`, with no copy in memory of those that are contiguous."""
    shape = sum(len(table) for table in tables), tables[0].shape[1]
    descr = np.lib.format.dtype_to_descr(tables[0].dtype)
    head = io.BytesIO()
    np.lib.format.write_array_header_1_0(head, {"descr": descr, "fortran_order": False, "shape": shape})
    size = checksum = 0
    # numpy's own error for a full disk does not say the reason
    for part in (head.getbuffer(), *(np.ascontiguousarray(table).data for table in tables)):
        file.write(part)
        size, checksum = size + part.nbytes, zlib.crc32(part, checksum)
    return _BlockFile(bytes=size, crc32=checksum)


def _load(file: IO[bytes], stored: _BlockFile) -> Array:
    data = file.read(stored.bytes)
    if len(data) != stored.bytes or zlib.crc32(data) != stored.crc32:
        raise DataError(DAMAGED_SHARD(path=file.name, folder="the folder it is in"))
    table: Array = np.load(io.BytesIO(data), allow_pickle=False)
    return table


def _sync(file: IO[bytes]) -> None:
    file.flush()
    os.fsync(file.fileno())


def _sync_folder(folder: Path) -> None:
    """Make new names in a folder durable, if folders can be synchronised."""
    with contextlib.suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


# --------------------------------------------------------------------------------------------------------------------
# The bytes of a file that is packed in parts, and their hash.


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
