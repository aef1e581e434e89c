"""A set of scenes where it lies: read in parts, streamed to learners, never loaded as a whole."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from scenegen.api.batches import RowGroup, SceneBatches
from scenegen.api.scenes import SceneSet, scene_set
from scenegen.arrays import Array
from scenegen.errors import DataError, RequestError
from scenegen.errors.files import NOT_A_SET
from scenegen.errors.requests import OUT_OF_RANGE
from scenegen.geometry.workspace import wrap_headings
from scenegen.needs import need
from scenegen.pose import as_poses, row_count
from scenegen.scenes.blocks import Block, join_blocks
from scenegen.scenes.data import SceneFile
from scenegen.scenes.locations import as_location, inside
from scenegen.scenes.sets import Manifest, Shard
from scenegen.scenes.stores import Store, open_store
from scenegen.validation import as_int

JOIN = "(cat a.jsonl; tail -n +2 b.jsonl) > both.jsonl"


@dataclass(frozen=True, slots=True, eq=False)
class StoredSet:
    """A set of shards; `len` is the number of its scenes. It can be pickled, and opened in other processes."""

    location: str
    manifest: Manifest
    header: SceneFile
    store: Store

    def __len__(self) -> int:
        return self.manifest.scenes

    def __repr__(self) -> str:
        return f"<StoredSet: {len(self)} scenes of {', '.join(self.objects)} in {self.location}>"

    @property
    def objects(self) -> tuple[str, ...]:
        return tuple(one.name for one in self.header.objects)

    @property
    def labels(self) -> tuple[str, ...]:
        return tuple(self.manifest.labels)

    @property
    def shards(self) -> tuple[Shard, ...]:
        return tuple(self.manifest.shards)

    def read(self, start: int = 0, stop: int | None = None) -> SceneSet:
        """The scenes from `start` up to, not including, `stop`, counted from 0; only their row groups are read. Raises
        DataError for damage, and for more scenes than go into memory; RequestError for numbers that are none."""
        stop = len(self) if stop is None else as_int("stop", stop)
        for name, value in (("start", as_int("start", start)), ("stop", stop)):
            if not 0 <= value <= len(self):
                raise RequestError(OUT_OF_RANGE(argument=name, value=value, wanted=f"from 0 to {len(self)}"))
        found = []
        for group in self.groups():
            part = slice(max(0, start - group.first), max(0, min(group.count, stop - group.first)))
            if part.start < part.stop:
                found.append(self.read_group(group).part(part.start, part.stop))
        coordinates = row_count(len(self.objects)) + len(self.header.choosers)
        block = join_blocks(found, coordinates, len(self.labels))
        return scene_set(self.header, self.labels, block)

    def stream(
        self,
        batch: int = 4096,
        *,
        shuffle: bool = True,
        seed: int = 0,
        rank: int | None = None,
        ranks: int | None = None,
        even: bool = False,
        dtype: Any = None,
    ) -> Any:
        """A torch IterableDataset of (poses (batch, N, 3), phi (batch, L)), for a DataLoader with `batch_size=None`.

        Workers of the loader and ranks of torch.distributed (or `rank` of `ranks`) each get a part of their own; with
        `even` all parts have the same size, and fewer scenes than there are processes are left out. With `shuffle` the
        order is another in each epoch, and follows from `seed` and the epoch: row groups in random order, the scenes
        of several of them mixed. `dtype` is float32 unless it says otherwise. Raises RequestError, also without torch.
        """
        need("torch", "for streams of tensors")
        from scenegen.learn.torch_stream import SceneStream

        return SceneStream(self.batches(batch, shuffle=shuffle, seed=seed, even=even), rank, ranks, dtype)

    def batches(self, batch: int = 4096, *, shuffle: bool = True, seed: int = 0, even: bool = False) -> SceneBatches:
        """The same as numpy arrays, without torch: `for poses, phi in stored.batches()`. Raises RequestError."""

        if as_int("batch", batch) < 1:
            raise RequestError(OUT_OF_RANGE(argument="batch", value=batch, wanted="1 or more"))
        return SceneBatches(self, batch, shuffle, as_int("seed", seed), even)

    def groups(self) -> list[RowGroup]:
        """The row groups of all shards, in order: those that scenegen writes have 65,536 scenes."""
        from scenegen.scenes.sets import group_sizes

        found, first = [], 0
        for number, shard in enumerate(self.shards):
            for index, count in enumerate(group_sizes(shard.scenes)):
                found.append(RowGroup(number, index, first, count))
                first += count
        return found

    def read_group(self, group: RowGroup) -> Block:
        """The scenes of a row group. Raises DataError, also where the shard is not the one of the manifest."""
        from scenegen.scenes.sets import read_shard_group

        return read_shard_group(self.store, self.header, self.labels, self.shards[group.shard], group.index)

    def files(self) -> dict[str, int]:
        """The sizes of all files of the folder. Raises DataError."""
        return self.store.sizes()

    def poses(self, block: Block) -> Array:
        """(m, N, 3), headings between -pi and pi."""
        return as_poses(wrap_headings(block.rows[: row_count(len(self.objects))]))


def open_set(location: str | Path) -> StoredSet:
    """A set of scenes in a folder or at a URL (s3://bucket/set/). Only its manifest is read; every shard is compared
    with it when it is opened. Raises DataError."""
    from scenegen.scenes.sets import read_manifest, set_header

    store = _there(location)
    manifest = read_manifest(store)
    return StoredSet(store.location, manifest, set_header(store, manifest), store)


def _there(location: str | Path) -> Store:
    """The store of a place to read from. Raises DataError for a file."""
    store = open_store(as_location(location))
    if store.local and Path(store.root).is_file():
        remedy = "`scenegen sample` writes sets into DIR/; to join .jsonl files of one spec: " + JOIN
        raise DataError(NOT_A_SET(location=store.location, reason="it is a file", remedy=remedy))
    return store


def sets_in(location: str | Path) -> list[str]:
    """Where the sets of a place are: the place itself if it is a set, else the sets in the folders below it, by name.
    Raises DataError for a place that cannot be read, and RequestError without pyarrow."""
    from scenegen.scenes.sets import SET_MANIFEST

    place = as_location(location)
    files = _there(place).sizes()
    below = sorted(name.removesuffix(f"/{SET_MANIFEST}") for name in files if name.endswith(f"/{SET_MANIFEST}"))
    return [place] if SET_MANIFEST in files or not below else [inside(place, name) for name in below]
