"""A set of scenes: a folder with Parquet files of equal size, `part-000000.parquet`, ..., and `manifest.json`.

Every shard is a scene file of its own. The manifest has the request, a line for each shard (scenes, bytes, SHA-256, the
range of phi) and, as long as the run goes on, where it stands. It replaces the one before in one step, after the shards
that it names are complete; so it is valid whatever happens, and a run goes on from it with the same bytes. Files whose
names begin with `_` or a dot belong to an unfinished run; readers of Parquet folders skip them.

A large file in progress, `x.jsonl`, is a set, too, in the folder `x.jsonl.part/`. Its shards are of any size, and hold
bare arrays (`part-000000.npy`), since the header, which some formats write first, is known last.
"""

from __future__ import annotations

import functools
import hashlib
import io
import json
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, FiniteFloat, ValidationError, model_validator

from scenegen.arrays import Array
from scenegen.errors import DataError, OutputError, RequestError
from scenegen.errors.files import (
    DAMAGED_SHARD,
    FINISHED_SET,
    FOLDER_NOT_EMPTY,
    NOT_A_SET,
    NOT_MOTIONS,
    OTHER_REQUEST,
    SHARD_SIZE,
    TOO_MANY_TO_READ,
    UNFINISHED_RUN,
)
from scenegen.scenes.blocks import BLOCK, MAX_NUMBERS, Block, SceneFileReading, join_blocks
from scenegen.scenes.data import EndsData, SceneFile
from scenegen.scenes.files import UNFINISHED, HashingWriter, Sink, inside, refuse_place
from scenegen.scenes.formats.header import load_header
from scenegen.scenes.formats.registry import MOTIONS, format_of
from scenegen.scenes.motions import AnyFile, MotionFile
from scenegen.scenes.stores import Store

if TYPE_CHECKING:
    from scenegen.scenes.formats import parquet  # loaded where it is used: a file in progress needs no pyarrow
    from scenegen.scenes.formats.motions import MotionArrays

Sha256 = Annotated[str, Field(pattern="^[0-9a-f]{64}$")]
Count = Annotated[int, Field(ge=1)]
Seed = Annotated[int, Field(ge=0)]


class StratumData(BaseModel):
    """A range of phi of one label, the others free, of which a data set has as many scenes as of the others."""

    model_config = ConfigDict(strict=True, defer_build=True)

    label: str
    phi: tuple[FiniteFloat, FiniteFloat]


class StoredRequest(BaseModel):
    """What of a set's request is read again: by those that go on with it, and by cards and reports. The rest of it is
    only compared."""

    model_config = ConfigDict(strict=True, defer_build=True)

    spec: Sha256
    phi: dict[str, EndsData]
    n: Count
    seed: Seed
    spread: Literal["flat", "base", "even"]
    scenegen: str
    numpy: str
    parts: list[StratumData] = []


class Rareness(BaseModel):
    """How rare phi of one label is: log10 of the smaller of P(phi' <= phi) and P(phi' >= phi) for the base
    distribution, at rising values of phi; linear between them, constant beyond."""

    model_config = ConfigDict(extra="forbid", strict=True, defer_build=True)

    phi: Annotated[list[FiniteFloat], Field(min_length=1)]
    log10p: list[FiniteFloat]

    @model_validator(mode="after")
    def _a_curve(self) -> Self:
        if len(self.phi) != len(self.log10p) or any(low > high for low, high in pairwise(self.phi)):
            raise ValueError("the values of phi do not rise, or are not as many as those of log10p")
        return self

    def __call__(self, phi: Array) -> Array:
        """log10 p of some values of phi."""
        found: Array = np.interp(phi, self.phi, self.log10p)
        return found


class ShardRequest(BaseModel):
    """The request that gives a shard: of a data set, whose shards are runs of their own."""

    model_config = ConfigDict(extra="forbid", strict=True, defer_build=True)

    phi: dict[str, tuple[FiniteFloat, FiniteFloat]]
    n: Count
    seed: Seed


SET_MANIFEST = "manifest.json"
LOCK = ".lock"  # says who writes: see `lock`
CARD = "README.md"
SHARD_PREFIX = "part-"  # how the names of shards begin
PARQUET, RAW = ".parquet", ".npy"  # endings of shards: of a set, of a file in progress
JOINED = "joined"  # a file in progress, once its shards are joined
RUN = "_run"  # the folder of what only an unfinished run needs
SHARD_BYTES = 1 << 28  # of a shard's numbers, as long as --shard-size does not say otherwise
SHARD_SCENES = 1 << 20
HASHED_BYTES = 1 << 22  # bytes of a shard that are read at a time to be hashed


class _StrictSetModel(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, defer_build=True)


Name = Annotated[str, AfterValidator(inside)]  # of a file of the set


class PhiOf(_StrictSetModel):
    """phi of one label over some scenes."""

    lowest: FiniteFloat
    mean: FiniteFloat
    highest: FiniteFloat

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        slack = 1e-9 * (abs(self.lowest) + abs(self.highest))  # a mean is rounded
        if not (self.lowest <= self.highest and self.lowest - slack <= self.mean <= self.highest + slack):
            raise ValueError("lowest, mean and highest are not in this order")
        return self


class Shard(_StrictSetModel):
    """A file of a set. `pieces` are all that were drawn for it and the shards before it; `made` is its own request,
    if it has one."""

    file: Name
    scenes: Count
    bytes: Count
    sha256: Sha256
    pieces: Annotated[int, Field(ge=0)]
    phi: dict[str, PhiOf]
    made: ShardRequest | None = None


class Checkpoint(_StrictSetModel):
    """Where a run stands, and the file with the scenes of its unfinished blocks; `crc32` is of both."""

    state: dict[str, Any]
    waiting: Name | None = None
    crc32: int = 0

    def with_checksum(self, waiting: bytes | memoryview) -> Checkpoint:
        """The same with its checksum, `waiting` being the bytes of that file."""
        rest = self.model_copy(update={"crc32": 0})
        said = zlib.crc32(rest.model_dump_json(exclude_none=True).encode())
        return rest.model_copy(update={"crc32": zlib.crc32(waiting, said)})


class Manifest(_StrictSetModel):
    """All about a set but its scenes. `header` is that of every shard, `sampler` the account of the whole run.

    Of data sets, `rarity` is how rare phi is, by label, and `missing` says what was left out, and why."""

    format: Literal["scenegen/set"] = "scenegen/set"
    version: Literal[1] = 1
    complete: bool = False
    request: dict[str, Any]
    labels: list[str]
    shard_size: Count
    shards: list[Shard] = []
    sampler: dict[str, Any] = {}
    header: dict[str, Any]
    checkpoint: Checkpoint | None = None
    rarity: dict[str, Rareness] | None = None
    missing: list[str] | None = None

    @model_validator(mode="after")
    def _agree(self) -> Self:
        if len(set(self.labels)) < len(self.labels):
            raise ValueError("two labels are the same")
        if self.rarity is not None and set(self.rarity) != set(self.labels):
            raise ValueError("`rarity` is not that of the labels")
        if len({shard.file for shard in self.shards}) < len(self.shards):
            raise ValueError("two shards have the same `file`")
        for shard in self.shards:
            if not shard.file.endswith((PARQUET, RAW)):
                raise ValueError(f"`file` of a shard is `{shard.file}`, which does not end in .parquet")
            if list(shard.phi) != self.labels:
                raise ValueError(f"phi of {shard.file} is not that of the labels")
            if shard.scenes > self.shard_size:
                raise ValueError(f"{shard.file} has more `scenes` than the `shard_size` {self.shard_size}")
            made = shard.made
            if made is not None and (made.n != shard.scenes or not made.phi.keys() <= set(self.labels)):
                raise ValueError(f"`made` of {shard.file} is not what it was made for")
        return self

    @property
    def has_begun(self) -> bool:
        """Whether there is something to go on with."""
        return bool(self.shards) or self.checkpoint is not None

    @property
    def scenes(self) -> int:
        """The number of scenes in complete shards."""
        return sum(shard.scenes for shard in self.shards)

    def phi(self) -> dict[str, PhiOf]:
        """phi over all shards."""
        return {label: _merge_phi([(shard.scenes, shard.phi[label]) for shard in self.shards]) for label in self.labels}


def _merge_phi(parts: Sequence[tuple[int, PhiOf]]) -> PhiOf:
    return PhiOf(
        lowest=min(phi.lowest for _, phi in parts),
        mean=sum(count * phi.mean for count, phi in parts) / sum(count for count, _ in parts),
        highest=max(phi.highest for _, phi in parts),
    )


def motion_block(numbers: int) -> int:
    """How many motions of so many numbers a block of a set has: shards of large ones have fewer than BLOCK."""
    return max(1, min(BLOCK, 1 << (MAX_NUMBERS // numbers).bit_length() - 1))


def shard_size(size: int | None, numbers: int, objects: int = 1, block: int = BLOCK) -> int:
    """How many scenes of so many numbers each a shard has. Raises RequestError for a size that is no multiple of a
    block, or too large."""
    most = MAX_NUMBERS // numbers // block * block
    if size is None:
        return max(block, min(SHARD_SCENES, SHARD_BYTES // (8 * numbers) // block * block, most))
    if size < block or size % block or size > most:
        large = {"objects": objects, "most": most} if size > most else {}
        raise RequestError(SHARD_SIZE(size=size, block=block, **large))
    return size


def pack_shard(
    sink: Sink,
    number: int,
    header: AnyFile,
    labels: Sequence[str],
    blocks: Iterable[Block],
    *,
    pieces: int,
    rarity: Mapping[str, Rareness] | None = None,
    made: ShardRequest | None = None,
    ending: str = PARQUET,
) -> Shard:
    """Pass the bytes of a shard of one block or more to a sink; the same scenes give the same bytes. With `rarity` it
    says of each scene how rare its phi is. Raises what the sink raises."""
    parts: list[Array] = []  # phi of the blocks

    def counted_blocks() -> Iterator[Block]:
        for block in blocks:
            parts.append(block.phi)
            yield block

    def rare(phi: Array) -> Array:
        assert rarity is not None
        return np.array([rarity[label](row) for label, row in zip(labels, phi, strict=True)])

    with HashingWriter(sink) as packed:
        if ending == RAW:
            for block in counted_blocks():
                np.lib.format.write_array(packed, np.concatenate([block.rows, block.phi]), allow_pickle=False)
        else:
            more = () if rarity is None else (rare,)
            format_of(Path(shard_name(number)), header.format).write(packed, header, labels, counted_blocks(), *more)
        size, digest = packed.size, packed.sha256
    rows = (np.concatenate([part[index] for part in parts]) for index in range(len(labels)))
    phi = {
        label: PhiOf(lowest=float(row.min()), mean=float(row.mean()), highest=float(row.max()))
        for label, row in zip(labels, rows, strict=True)
    }
    name, count = shard_name(number, ending), sum(part.shape[1] for part in parts)
    return Shard(file=name, scenes=count, bytes=size, sha256=digest, pieces=pieces, phi=phi, made=made)


def shard_name(number: int, ending: str = PARQUET) -> str:
    """The file of a shard, counted from 0."""
    return f"{SHARD_PREFIX}{number:06d}{ending}"


def raw_blocks(store: Store, manifest: Manifest) -> Iterator[Block]:
    """The scenes of a file in progress, as its blocks were added. The iterator raises DataError for damage."""
    labels = len(manifest.labels)
    for shard in manifest.shards:
        data = store.read(shard.file)
        if hashlib.sha256(data).hexdigest() != shard.sha256:
            raise _other_checksum(store, shard)
        file = io.BytesIO(data)
        while file.tell() < len(data):
            table: Array = np.lib.format.read_array(file, allow_pickle=False)
            yield Block(table[:-labels], table[-labels:])


def save_checkpoint(store: Store, shards: int, state: Mapping[str, Any], waiting: Array | None) -> Checkpoint:
    """Where a run stands after so many shards; scenes that wait for the next go to a file, which is never one that an
    earlier checkpoint names. Raises OutputError."""
    if waiting is None:
        return Checkpoint(state=dict(state)).with_checksum(b"")
    sink = io.BytesIO()
    np.save(sink, waiting, allow_pickle=False)
    name = f"{RUN}/waiting-{shards:06d}-{state['pieces']:06d}.npy"
    store.write(name, sink.getbuffer())
    return Checkpoint(state=dict(state), waiting=name).with_checksum(sink.getbuffer())


def read_waiting(store: Store, checkpoint: Checkpoint) -> Array:
    """The scenes that wait; (0, 0) if there are none. Raises DataError where file or state are not what was written."""
    data = b"" if checkpoint.waiting is None else store.read(checkpoint.waiting)
    if checkpoint.with_checksum(data).crc32 != checkpoint.crc32:
        file, reason = (
            checkpoint.waiting or SET_MANIFEST,
            "what an unfinished run has to go on from has another checksum",
        )
        raise DataError(DAMAGED_SHARD(file=file, location=store.location, reason=reason))
    return np.load(io.BytesIO(data), allow_pickle=False) if data else np.empty((0, 0))


def write_manifest(store: Store, manifest: Manifest) -> None:
    """Replace the manifest. Raises OutputError."""
    store.write(SET_MANIFEST, manifest.model_dump_json(indent=1, exclude_none=True).encode() + b"\n")


def read_manifest(store: Store) -> Manifest:
    """The manifest of a set, complete or not. Raises DataError, also for one that contradicts itself."""
    if SET_MANIFEST not in store.sizes():
        remedy = "name a folder that `scenegen sample` has written"
        raise DataError(NOT_A_SET(location=store.location, reason=f"it has no {SET_MANIFEST}", remedy=remedy))
    try:
        manifest = Manifest.model_validate_json(store.read(SET_MANIFEST))
    except ValidationError as error:
        raise _edit_error(store, error, "") from None
    try:
        asked = StoredRequest.model_validate_json(json.dumps(manifest.request))
    except ValidationError as error:
        raise _edit_error(store, error, "request.") from None
    header = any_header(store, manifest)
    facts = (
        ("spec", asked.spec, header.spec.sha256),
        ("phi", asked.phi, header.request.phi),
        ("spread", asked.spread, asked.spread if isinstance(header, MotionFile) else header.request.spread),
        # of a set that is made of others the header is theirs
        ("n", asked.n, asked.n if "from" in manifest.request else header.request.n),
    )
    for name, mine, theirs in facts:
        if mine != theirs:
            raise _contradicts(store, f"`request.{name}` is {shorten(mine)}, and in `header` it is {shorten(theirs)}")
    if asked.n < manifest.scenes:
        raise _contradicts(store, f"`request.n` is {asked.n}, and its shards have {manifest.scenes} scenes")
    odd = next((label for label in asked.phi if label not in manifest.labels), None)
    if odd is not None:
        raise _contradicts(store, f"`request.phi` has the label `{odd}`, and `labels` does not")
    return manifest


def shorten(value: object) -> str:
    """A value in JSON, for a message."""
    text = json.dumps(value, ensure_ascii=False)
    return text if len(text) <= 60 else f"{text[:57]}..."


def _edit_error(store: Store, error: ValidationError, field: str) -> DataError:
    problem = error.errors(include_url=False)[0]
    where = field + ".".join(map(str, problem["loc"]))
    said = problem["msg"].lower().removeprefix("value error, ")
    reason = f"`{where}` in {SET_MANIFEST}: {said}" if where else f"{SET_MANIFEST}: {said}"
    reason = f"{SET_MANIFEST} is no JSON" if problem["type"] == "json_invalid" else reason
    return DataError(NOT_A_SET(location=store.location, reason=reason, remedy="was it edited?"))


def _contradicts(store: Store, reason: str) -> DataError:
    return DataError(NOT_A_SET(location=store.location, reason=f"{SET_MANIFEST}: {reason}", remedy="was it edited?"))


def refuse_taken(store: Store, *, resume: bool) -> Manifest | None:
    """The manifest of a set that is there, None if there is none. Before any work: raises RequestError for a set that
    would be written over, OutputError for a folder with other files, DataError for a manifest that cannot be read."""
    if store.local:
        refuse_place(Path(store.root).parent, ())
    there = store.sizes()
    if SET_MANIFEST not in there:
        odd = sorted(name for name in there if not name.startswith("."))
        if odd:
            raise OutputError(FOLDER_NOT_EMPTY(location=store.location, odd=odd[0]))
        return None
    found = read_manifest(store)
    if found.complete and not resume:
        raise RequestError(FINISHED_SET(location=store.location))
    if found.has_begun and not resume:
        raise RequestError(UNFINISHED_RUN(folder=store.location, scenes=found.scenes))
    return found


def begin(store: Store, manifest: Manifest, *, resume: bool) -> Manifest:
    """The manifest of a new set, or that of the same request as the run before left it. A run without a
    checkpoint is begun again, whatever its request was.

    Raises what `refuse_taken` raises, RequestError for a set of another request, DataError for shards that are missing
    or are other files, OutputError for a folder that cannot be written to.
    """
    found = refuse_taken(store, resume=resume)
    if found is None or not (found.has_begun or found.complete):
        store.make()
        _remove_others(store, manifest)
        write_manifest(store, manifest)
        return manifest
    same_request(store, found, manifest)
    there = store.sizes()
    for shard in found.shards:
        if there.get(shard.file) != shard.bytes:
            reason = "it is missing" if shard.file not in there else "its size is not that of the manifest"
            raise DataError(DAMAGED_SHARD(file=shard.file, location=store.location, reason=reason))
        if store.local and shard.file.endswith(PARQUET):  # elsewhere all of the set would be fetched
            check_bytes(store, shard)
    store.delete(*filter(_is_unfinished, there))
    return found


def same_request(store: Store, found: Manifest, wanted: Manifest) -> None:
    """Raises RequestError for an unfinished run of another request."""
    before = {**found.request, "shard size": found.shard_size}
    now = {**json.loads(json.dumps(wanted.request)), "shard size": wanted.shard_size}
    # any other difference also changes the plan, so other differences are named first
    for key in sorted({*before, *now}, key=lambda key: (key == "plan", key)):
        if before.get(key) != now.get(key):
            said = {"before": shorten(before.get(key)), "now": shorten(now.get(key))}
            raise RequestError(OTHER_REQUEST(folder=store.location, key=key, **said))


def finish(store: Store, manifest: Manifest) -> None:
    """Remove what only a running run needs, after its manifest says that it is complete; and shards that are not part
    of the set: readers of the folder would take them for scenes of it. Raises OutputError."""
    _remove_others(store, manifest)


def _remove_others(store: Store, manifest: Manifest) -> None:
    known = {shard.file for shard in manifest.shards}
    ours = (name for name in store.sizes() if name.startswith((RUN, SHARD_PREFIX)) or _is_unfinished(name))
    store.delete(*(name for name in ours if name not in known))
    store.delete_folder(RUN)


def _is_unfinished(name: str) -> bool:
    """Whether a file is a temporary one of this set, left by a run that was killed."""
    return name.endswith(UNFINISHED) and name.startswith(
        tuple(f".{one}" for one in (SHARD_PREFIX, SET_MANIFEST, CARD, JOINED))
    )


def is_ours(name: str) -> bool:
    """Whether a file in the folder of a file in progress is of its run; its manifest left out."""
    return name.startswith((SHARD_PREFIX, f"{RUN}/", JOINED, "."))


def discard(store: Store, *, complete: bool = False) -> None:
    """Remove what there is of a file in progress: the manifest first, because it must not name missing files, but last
    if it says that the run is complete. Raises OutputError."""
    if not complete:
        store.delete(SET_MANIFEST)
    store.delete(*(name for name in store.sizes() if is_ours(name) and name != LOCK))
    store.delete_folder(RUN)
    store.delete(SET_MANIFEST)


def read_set(store: Store) -> SceneFileReading:
    """All scenes of a set, shard after shard; of motions their moments, without phi. Raises DataError."""
    manifest = _with_shards(store)
    header = any_header(store, manifest)
    if isinstance(header, MotionFile):
        from scenegen.scenes.formats.motions import moments, scenes_header

        states = (moments(_motions(store, header, manifest.labels, shard)) for shard in manifest.shards)
        count = manifest.scenes * (header.time.steps + 1)
        return SceneFileReading(scenes_header(header), (), states, count, store.location)
    scenes = header

    def blocks() -> Iterator[Block]:
        for shard in manifest.shards:
            yield from read_shard(store, scenes, manifest.labels, shard).blocks

    return SceneFileReading(header, tuple(manifest.labels), blocks(), manifest.scenes, store.location)


def read_motion_set(store: Store) -> MotionArrays:
    """All motions of a set. Raises DataError, also for a set of scenes, and for more motions than go into memory."""
    from scenegen.scenes.formats.motions import motions_of

    manifest = _with_shards(store)
    header = any_header(store, manifest)
    if not isinstance(header, MotionFile):
        raise DataError(NOT_MOTIONS(file=store.location, reason="it is a set of scenes"))
    most = MAX_NUMBERS // header.coordinates
    if manifest.scenes > most:
        counts = {"count": f"{manifest.scenes:,}", "objects": len(header.objects), "most": most}
        raise DataError(TOO_MANY_TO_READ(file=store.location, **counts))
    parts = [_motions(store, header, manifest.labels, shard) for shard in manifest.shards]
    blocks = [part.block() for part in parts]
    block = join_blocks(blocks, len(blocks[0].rows), len(manifest.labels))
    whole = header.model_copy(update={"sampler": manifest.sampler or header.sampler})
    return motions_of(whole, manifest.labels, tuple(parts[0].facts), block)


def _motions(store: Store, header: MotionFile, labels: Sequence[str], shard: Shard) -> MotionArrays:
    """The motions of a shard. Raises DataError for a file that is not the one of the manifest."""
    from scenegen.scenes.formats import motions_parquet

    found = motions_parquet.read(Path(store.path(shard.file)), _open(store, shard))
    phi = {label: (float(values.min()), float(values.max())) for label, values in found.phi.items()}
    facts = (
        ("its number of motions is not that", len(found), shard.scenes),
        ("its header is not that", found.header, header),
        ("its range of phi is not that", phi, {label: (one.lowest, one.highest) for label, one in shard.phi.items()}),
    )
    for what, has, wanted in facts:
        if has != wanted:
            raise _damage_error(store, shard, f"{what} of the manifest")
    return found


def _with_shards(store: Store) -> Manifest:
    manifest = read_manifest(store)
    if not manifest.shards:
        reason = "none of its shards is complete yet"
        raise DataError(NOT_A_SET(location=store.location, reason=reason, remedy="go on with the run that makes it"))
    return manifest


def any_header(store: Store, manifest: Manifest) -> AnyFile:
    """The file of scenes, or of motions, without these. Raises DataError."""
    name = f"the header of {store.location}"
    if manifest.header.get("format") == MOTIONS:
        from scenegen.scenes.formats.motions import motion_file

        return motion_file({**manifest.header, "motions": []}, name)
    return load_header(json.dumps(manifest.header).encode(), name).without_scenes()


def set_header(store: Store, manifest: Manifest) -> SceneFile:
    """The scene file without scenes. Raises DataError, also for a set of motions."""
    header = any_header(store, manifest)
    if isinstance(header, MotionFile):
        reason, remedy = "its shards hold motions", "in Python, scenegen.read_motions reads it"
        raise DataError(NOT_A_SET(location=store.location, reason=reason, remedy=remedy))
    return header


def read_shard(store: Store, header: SceneFile, labels: Sequence[str], shard: Shard) -> SceneFileReading:
    """One shard of a set with this header and these labels. Raises DataError for a file that is not the one of the
    manifest, as far as its end tells."""
    from scenegen.scenes.formats import parquet

    path = Path(store.path(shard.file))
    return parquet.read(path, _open(store, shard), functools.partial(_check, store, header, labels, shard))


def read_shard_group(store: Store, header: SceneFile, labels: Sequence[str], shard: Shard, index: int) -> Block:
    """The scenes of one row group of a shard. Raises DataError as `read_shard` does."""
    from scenegen.scenes.formats import parquet

    path = Path(store.path(shard.file))
    check = functools.partial(_check, store, header, labels, shard)
    return next(parquet.read_groups(path, [index], _open(store, shard), check))


def check_bytes(store: Store, shard: Shard) -> None:
    """Raises DataError for a shard whose bytes, which are all read, are not those of the manifest."""
    digest = hashlib.sha256()
    with store.open(shard.file) as file:
        while part := file.read(HASHED_BYTES):
            digest.update(part)
    if digest.hexdigest() != shard.sha256:
        raise _other_checksum(store, shard)


def _other_checksum(store: Store, shard: Shard) -> DataError:
    return _damage_error(store, shard, "its checksum is not that of the manifest")


def _open(store: Store, shard: Shard) -> Any:
    return None if store.local else store.open(shard.file)


def _check(store: Store, header: SceneFile, labels: Sequence[str], shard: Shard, found: parquet.Footer) -> None:
    """Compare a file with its line of the manifest, by what costs nothing: the values of phi at its ends, which its
    footer has, tell two files of one size apart."""
    phi = {label: (one.lowest, one.highest) for label, one in shard.phi.items()}
    known = {label: ends for label, ends in found.phi.items() if ends is not None}
    facts = (
        ("its size is not that", found.bytes, shard.bytes),
        ("its number of scenes is not that", found.scenes, shard.scenes),
        ("its row groups are not those", found.groups, group_sizes(shard.scenes)),
        ("its spec is not that", found.header.spec.sha256, header.spec.sha256),
        ("its workspace is not that", found.header.workspace, header.workspace),
        ("its regions are not those", found.header.regions, header.regions),
        ("its objects are not those", found.header.objects, header.objects),
        ("its numbers of things are not those", found.header.counts, header.counts),
        ("its labels are not those", found.labels, tuple(labels)),
        ("its range of phi is not that", known, {label: phi.get(label) for label in known}),
    )
    for what, has, wanted in facts:
        if has != wanted:
            raise _damage_error(store, shard, f"{what} of the manifest")


def _damage_error(store: Store, shard: Shard, reason: str) -> DataError:
    return DataError(DAMAGED_SHARD(file=shard.file, location=store.location, reason=reason))


def group_sizes(scenes: int) -> tuple[int, ...]:
    """How many scenes the row groups of a shard have."""
    return tuple(min(BLOCK, scenes - start) for start in range(0, scenes, BLOCK))


def header_data(header: AnyFile) -> dict[str, Any]:
    """A header as the manifest has it."""
    data: Mapping[str, Any] = header.model_dump(mode="json", exclude={"scenes", "motions"})
    return dict(data)
