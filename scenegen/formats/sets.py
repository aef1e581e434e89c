"""A set of scenes: a folder with Parquet files of equal size, `part-000000.parquet`, ..., and `manifest.json`.

Every shard is a scene file of its own. The manifest has the request, a line for each shard (scenes, bytes, SHA-256, the
range of phi) and, as long as the run goes on, where it stands. It replaces the one before in one step, after the shards
that it names are complete; so it is valid whatever happens, and a run goes on from it with the same bytes. Files whose
names begin with `_` or a dot belong to an unfinished run; readers of Parquet folders skip them.
"""

from __future__ import annotations

import io
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, ValidationError

from scenegen.errors import DataError, OutputError, RequestError
from scenegen.errors.files import OTHER_REQUEST, UNFINISHED_RUN
from scenegen.errors.stores import (
    DAMAGED_SHARD,
    FINISHED_SET,
    FOLDER_NOT_EMPTY,
    NOT_A_SET,
    SHARD_SIZE,
)
from scenegen.formats import parquet
from scenegen.formats.blocks import BLOCK, MOST, Array, Block, Reading
from scenegen.formats.files import UNFINISHED, inside
from scenegen.formats.header import load_header
from scenegen.formats.made import Made, Rareness
from scenegen.formats.packed import Packed, Sink
from scenegen.formats.stores import Store
from scenegen.pose import row_count
from scenegen.scene.data import SceneFile

MANIFEST = "manifest.json"
CARD = "README.md"
SHARDS = "part-"  # how the names of shards begin
RUN = "_run"  # the folder of what only an unfinished run needs
SHARD_BYTES = 1 << 28  # of a shard's numbers, as long as --shard-size does not say otherwise
SHARD_SCENES = 1 << 20


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, defer_build=True)


Name = Annotated[str, AfterValidator(inside)]  # of a file of the set


class PhiOf(_Strict):
    """phi of one label over some scenes."""

    lowest: float
    mean: float
    highest: float


class Shard(_Strict):
    """A file of a set. `pieces` are all that were drawn for it and the shards before it; `made` is its own request,
    if it has one."""

    file: Name
    scenes: int
    bytes: int
    sha256: str
    pieces: int
    phi: dict[str, PhiOf]
    made: Made | None = None


class Checkpoint(_Strict):
    """Where a run stands, and the file with the scenes of its unfinished blocks."""

    state: dict[str, Any]
    waiting: Name | None = None


class Manifest(_Strict):
    """All about a set but its scenes. `header` is that of every shard, `sampler` the account of the whole run.

    Of data sets, `rarity` is how rare phi is, by label, and `missing` says what was left out, and why."""

    format: Literal["scenegen/set"] = "scenegen/set"
    version: Literal[1] = 1
    complete: bool = False
    request: dict[str, Any]
    labels: list[str]
    shard_size: int
    shards: list[Shard] = []
    sampler: dict[str, Any] = {}
    header: dict[str, Any]
    checkpoint: Checkpoint | None = None
    rarity: dict[str, Rareness] | None = None
    missing: list[str] | None = None

    @property
    def scenes(self) -> int:
        """The number of scenes in complete shards."""
        return sum(shard.scenes for shard in self.shards)

    def phi(self) -> dict[str, PhiOf]:
        """phi over all shards."""
        return {label: _over([(shard.scenes, shard.phi[label]) for shard in self.shards]) for label in self.labels}


def _over(parts: Sequence[tuple[int, PhiOf]]) -> PhiOf:
    return PhiOf(
        lowest=min(phi.lowest for _, phi in parts),
        mean=sum(count * phi.mean for count, phi in parts) / sum(count for count, _ in parts),
        highest=max(phi.highest for _, phi in parts),
    )


def shard_size(size: int | None, objects: int, labels: int) -> int:
    """How many scenes a shard has. Raises RequestError for a size that is no multiple of a block, or too large."""
    numbers = row_count(objects) + labels
    most = MOST // numbers // BLOCK * BLOCK
    if size is None:
        return max(BLOCK, min(SHARD_SCENES, SHARD_BYTES // (8 * numbers) // BLOCK * BLOCK, most))
    if size < BLOCK or size % BLOCK or size > most:
        large = {"objects": objects, "most": most} if size > most else {}
        raise RequestError(SHARD_SIZE(size=size, block=BLOCK, **large))
    return size


def make_shard(
    store: Store,
    number: int,
    header: SceneFile,
    labels: Sequence[str],
    blocks: Iterable[Block],
    *,
    pieces: int,
    rarity: Mapping[str, Rareness] | None = None,
    made: Made | None = None,
    beside: bool = False,
) -> Shard:
    """Write a shard of one block or more; the same scenes give the same bytes. With `rarity` it says of each scene how
    rare its phi is. Raises OutputError."""
    with store.whole(shard_name(number)) as sink:
        return pack_shard(sink, number, header, labels, blocks, pieces=pieces, rarity=rarity, made=made, beside=beside)


def pack_shard(
    sink: Sink,
    number: int,
    header: SceneFile,
    labels: Sequence[str],
    blocks: Iterable[Block],
    *,
    pieces: int,
    rarity: Mapping[str, Rareness] | None = None,
    made: Made | None = None,
    beside: bool = False,
) -> Shard:
    """Pass the bytes of a shard to a sink. `beside`: a thread of its own does that and computes the hash. Raises what
    the sink raises."""
    parts: list[Array] = []  # phi of the blocks

    def seen() -> Iterator[Block]:
        for block in blocks:
            parts.append(block.phi)
            yield block

    def rare(phi: Array) -> Array:
        assert rarity is not None
        return np.array([rarity[label](row) for label, row in zip(labels, phi, strict=True)])

    with Packed(sink, beside=beside) as packed:
        parquet.write(packed, header, labels, seen(), None if rarity is None else rare)
        size, digest = packed.size, packed.sha256
    rows = (np.concatenate([part[index] for part in parts]) for index in range(len(labels)))
    phi = {
        label: PhiOf(lowest=float(row.min()), mean=float(row.mean()), highest=float(row.max()))
        for label, row in zip(labels, rows, strict=True)
    }
    name, count = shard_name(number), sum(part.shape[1] for part in parts)
    return Shard(file=name, scenes=count, bytes=size, sha256=digest, pieces=pieces, phi=phi, made=made)


def shard_name(number: int) -> str:
    """The file of a shard, counted from 0."""
    return f"{SHARDS}{number:06d}.parquet"


def waiting_name(number: int) -> str:
    """The file of the scenes that wait after so many shards."""
    return f"{RUN}/waiting-{number:06d}.npy"


def write_array(store: Store, name: str, table: Array) -> None:
    """Write an array for `read_array`. Raises OutputError."""
    sink = io.BytesIO()
    np.save(sink, table, allow_pickle=False)
    store.write(name, sink.getbuffer())


def read_array(store: Store, name: str) -> Array:
    """Raises DataError."""
    try:
        table: Array = np.load(io.BytesIO(store.read(name)), allow_pickle=False)
    except (ValueError, EOFError) as error:
        raise DataError(DAMAGED_SHARD(file=name, location=store.location, reason="it is no array")) from error
    return table


def write_manifest(store: Store, manifest: Manifest) -> None:
    """Replace the manifest. Raises OutputError."""
    store.write(MANIFEST, manifest.model_dump_json(indent=1, exclude_none=True).encode() + b"\n")


def read_manifest(store: Store) -> Manifest:
    """The manifest of a set, complete or not. Raises DataError."""
    if MANIFEST not in store.sizes():
        remedy = "name a folder that `scenegen sample` has written"
        raise DataError(NOT_A_SET(location=store.location, reason=f"it has no {MANIFEST}", remedy=remedy))
    try:
        return Manifest.model_validate_json(store.read(MANIFEST))
    except ValidationError as error:
        problem = error.errors(include_url=False)[0]
        where = ".".join(map(str, problem["loc"]))
        reason = (
            f"`{where}` in {MANIFEST}: {problem['msg'].removeprefix('Value error, ').lower()}"
            if where
            else f"{MANIFEST} is no JSON"
        )
        raise DataError(NOT_A_SET(location=store.location, reason=reason, remedy="was it edited?")) from None


def refuse_taken(store: Store, *, resume: bool) -> Manifest | None:
    """The manifest of a set that is there, None if there is none. Before any work: raises RequestError for a set that
    would be written over, OutputError for a folder with other files, DataError for a manifest that cannot be read."""
    there = store.sizes()
    if MANIFEST not in there:
        odd = sorted(name for name in there if not name.startswith("."))
        if odd:
            raise OutputError(FOLDER_NOT_EMPTY(location=store.location, odd=odd[0]))
        return None
    found = read_manifest(store)
    if found.complete and not resume:
        raise RequestError(FINISHED_SET(location=store.location))
    if found.shards and not resume:
        raise RequestError(UNFINISHED_RUN(folder=store.location, scenes=found.scenes))
    return found


def begin(store: Store, manifest: Manifest, *, resume: bool) -> Manifest:
    """The manifest of a new set, or that of the same request as the run before left it. A run that had completed no
    shard is begun again, whatever its request was.

    Raises what `refuse_taken` raises, RequestError for a set of another request, DataError for shards that are missing,
    OutputError for a folder that cannot be written to.
    """
    found = refuse_taken(store, resume=resume)
    if found is None or not (found.shards or found.complete):
        store.make()
        _remove_others(store, manifest)
        write_manifest(store, manifest)
        return manifest
    _same_request(store, found, manifest)
    there = store.sizes()
    for shard in found.shards:
        if there.get(shard.file) != shard.bytes:
            reason = "it is missing" if shard.file not in there else "its size is not that of the manifest"
            raise DataError(DAMAGED_SHARD(file=shard.file, location=store.location, reason=reason))
    store.delete(*filter(_is_unfinished, there))
    return found


def _same_request(store: Store, found: Manifest, wanted: Manifest) -> None:
    before = {**found.request, "shard size": found.shard_size}
    now = {**json.loads(json.dumps(wanted.request)), "shard size": wanted.shard_size}
    # any other difference also changes the plan, so other differences are named first
    for key in sorted({*before, *now}, key=lambda key: (key == "plan", key)):
        if before.get(key) != now.get(key):
            said = {"before": _short(before.get(key)), "now": _short(now.get(key))}
            raise RequestError(OTHER_REQUEST(folder=store.location, key=key, **said))


def _short(value: object) -> str:
    text = json.dumps(value, ensure_ascii=False)
    return text if len(text) <= 60 else f"{text[:57]}..."


def finish(store: Store, manifest: Manifest) -> None:
    """Remove what only a running run needs, after its manifest says that it is complete; and shards that are not part
    of the set: readers of the folder would take them for scenes of it. Raises OutputError."""
    _remove_others(store, manifest)


def _remove_others(store: Store, manifest: Manifest) -> None:
    known = {shard.file for shard in manifest.shards}
    ours = (name for name in store.sizes() if name.startswith((RUN, SHARDS)) or _is_unfinished(name))
    store.delete(*(name for name in ours if name not in known))
    store.delete_folder(RUN)


def _is_unfinished(name: str) -> bool:
    """Whether a file is a temporary one of this set, left by a run that was killed."""
    return name.endswith(UNFINISHED) and name.startswith(tuple(f".{one}" for one in (SHARDS, MANIFEST, CARD)))


def read_set(store: Store, shards: Iterable[Shard] | None = None) -> Reading:
    """All scenes of a set, shard after shard, or those of some shards. Raises DataError."""
    manifest = read_manifest(store)
    chosen = list(manifest.shards if shards is None else shards)
    if not chosen:
        reason = "none of its shards is complete yet"
        raise DataError(NOT_A_SET(location=store.location, reason=reason, remedy="go on with the run that makes it"))

    def blocks() -> Iterator[Block]:
        for shard in chosen:
            yield from read_shard(store, shard).blocks

    count = sum(shard.scenes for shard in chosen)
    return Reading(set_header(store, manifest), tuple(manifest.labels), blocks(), count, store.location)


def set_header(store: Store, manifest: Manifest) -> SceneFile:
    """The scene file without scenes. Raises DataError."""
    return load_header(json.dumps(manifest.header).encode(), f"the header of {store.location}").without_scenes()


def read_shard(store: Store, shard: Shard) -> Reading:
    """One shard. Raises DataError, also if it has another number of scenes than the manifest says."""
    path = Path(store.path(shard.file))
    reading = parquet.read(path) if store.local else parquet.read(path, store.open(shard.file))
    if reading.count != shard.scenes:
        reason = f"it has {reading.count} scenes, and {shard.scenes} in the manifest"
        raise DataError(DAMAGED_SHARD(file=shard.file, location=store.location, reason=reason))
    return reading


def read_shard_group(store: Store, shard: Shard, index: int) -> Block:
    """The scenes of one row group of a shard. Raises DataError."""
    path = Path(store.path(shard.file))
    return next(parquet.read_groups(path, [index], None if store.local else store.open(shard.file)))


def header_data(header: SceneFile) -> dict[str, Any]:
    """A header as the manifest has it."""
    data: Mapping[str, Any] = header.model_dump(mode="json", exclude={"scenes"})
    return dict(data)
