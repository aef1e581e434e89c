"""New sets from old ones: merged, split at random, filtered by phi. Where the scenes came from is kept."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from typing import Any

import numpy as np

from scenegen.api.set_card import write_card
from scenegen.api.stored import StoredSet
from scenegen.errors import DataError, RequestError, ScenegenError
from scenegen.errors.files import NOTHING_LEFT, SETS_DIFFER, SHARES
from scenegen.pose import row_count
from scenegen.sampling.request import Range
from scenegen.sampling.streams import SET_SPLIT_STREAM
from scenegen.scenes import sets
from scenegen.scenes.blocks import BLOCK, Block
from scenegen.scenes.locations import inside
from scenegen.scenes.lock import acquire
from scenegen.scenes.stores import Store, open_store

SPLIT_BYTES = 1 << 29  # bytes of the scenes that wait for the shards of all parts of a split


def merge_sets(stored: Sequence[StoredSet], out: str) -> sets.Manifest:
    """All scenes of several sets of one spec, one set after another. Raises DataError if their specs or labels differ,
    and what `write_blocks` raises."""
    first = stored[0]
    for other in stored[1:]:
        for what, mine, theirs in (
            ("spec", first.header.spec.sha256, other.header.spec.sha256),
            ("objects", first.header.objects, other.header.objects),
            ("labels", first.labels, other.labels),
            ("measured rarity", first.manifest.rarity, other.manifest.rarity),
        ):
            if mine != theirs:
                raise DataError(SETS_DIFFER(one=first.location, other=other.location, what=what))
    blocks = (block for one in stored for block in _blocks(one))
    return write_blocks(out, first, blocks, {"merged": [_source(one) for one in stored]})


def filter_set(stored: StoredSet, ranges: Mapping[str, Range], out: str) -> sets.Manifest:
    """The scenes whose phi is in the ranges, in their order. Raises DataError if there are none."""

    def fitting() -> Iterator[Block]:
        for block in _blocks(stored):
            fits = np.ones(block.count, dtype=bool)
            for label, values in zip(stored.labels, block.phi, strict=True):
                low, high = ranges.get(label, Range()).ends
                fits &= (values >= low) & (values <= high)
            yield _part(block, fits)

    wanted = {label: [one.low, one.high] for label, one in ranges.items()}
    return write_blocks(out, stored, fitting(), {"filtered": _source(stored), "phi": wanted})


def split_set(stored: StoredSet, shares: Mapping[str, float], seed: int, out: str) -> dict[str, sets.Manifest]:
    """Sets DIR/NAME/ of disjoint random parts: each scene goes into one, by its number and the seed. `shares` are of
    all scenes, and at most 1 together; what is left over is left out. The set is read once; with many parts their
    shards are smaller, so that one of each fits into memory. Raises RequestError for other shares."""
    values = list(shares.values())
    if not values or min(values) <= 0.0 or sum(values) > 1.0 + 1e-12:
        raise RequestError(SHARES(shares=", ".join(f"{name}={share:g}" for name, share in shares.items())))
    ends = np.cumsum([0.0, *values])
    size = _fitting(stored.manifest.shard_size, len(stored.header.objects), len(stored.labels), len(shares))
    parts: list[_NewSet] = []
    with ExitStack() as stack:
        for name, share in shares.items():
            facts = {"split": _source(stored), "part": name, "share": share, "seed": seed}
            parts.append(stack.enter_context(_new_set(inside(out, name), stored, facts, size)))
        for index, block in enumerate(_blocks(stored)):
            draw = np.random.default_rng(np.random.SeedSequence([seed, SET_SPLIT_STREAM, index])).random(block.count)
            for number, part in enumerate(parts):
                part.add(_part(block, (draw >= ends[number]) & (draw < ends[number + 1])))
        return {name: part.finish() for name, part in zip(shares, parts, strict=True)}


def _fitting(size: int, objects: int, labels: int, parts: int) -> int:
    """The shard size of `size` or below with which a shard of each part fits into memory."""
    most = SPLIT_BYTES // (8 * (row_count(objects) + labels) * parts) // BLOCK * BLOCK
    return max(BLOCK, min(size, most))


def write_blocks(out: str, like: StoredSet, blocks: Iterable[Block], provenance: Mapping[str, Any]) -> sets.Manifest:
    """A complete set of some scenes, with the header and shard size of another set. Raises DataError if there is no
    scene, OutputError, and RequestError for a folder that has a set already."""
    with _new_set(out, like, provenance, like.manifest.shard_size) as made:
        for block in blocks:
            made.add(block)
        return made.finish()


@contextmanager
def _new_set(out: str, like: StoredSet, provenance: Mapping[str, Any], size: int) -> Iterator[_NewSet]:
    """A new set, for this process alone until the end of the block. Where that fails, nothing is left of it."""
    store = open_store(out)
    with acquire(store):
        made = _NewSet(store, like, provenance, size)
        try:
            yield made
        except BaseException:
            made.drop()
            raise


class _NewSet:
    """A set that grows block by block; the scenes of at most one shard are in memory. Raises what `write_blocks`
    raises."""

    def __init__(self, store: Store, like: StoredSet, provenance: Mapping[str, Any], size: int) -> None:
        self._store, self._like = store, like
        before = like.manifest
        manifest = sets.Manifest(
            request={**before.request, "from": dict(provenance)},
            labels=list(like.labels),
            shard_size=size,
            header=before.header,
            rarity=before.rarity,
        )
        self._manifest = sets.begin(self._store, manifest, resume=False)
        self._shards: list[sets.Shard] = []
        self._waiting: list[Block] = []
        self._count = 0

    def add(self, block: Block) -> None:
        """More scenes; every full shard is written."""
        size, start = self._manifest.shard_size, 0
        while self._count + block.count - start >= size:
            stop = start + size - self._count
            self._waiting.append(block.part(start, stop))
            self._write()
            start = stop
        if start < block.count:
            self._waiting.append(block.part(start, block.count))
            self._count += block.count - start

    def finish(self) -> sets.Manifest:
        """The manifest of the complete set."""
        if self._waiting:
            self._write()
        if not self._shards:
            raise DataError(NOTHING_LEFT(location=self._like.location))
        count = sum(shard.scenes for shard in self._shards)
        update = {"shards": self._shards, "complete": True, "request": {**self._manifest.request, "n": count}}
        self._manifest = self._manifest.model_copy(update=update)
        sets.write_manifest(self._store, self._manifest)
        write_card(self._store, self._manifest)
        return self._manifest

    def drop(self) -> None:
        """Delete what has been written, as far as the store allows; the caller reports why it failed."""
        with suppress(ScenegenError):
            self._store.delete(sets.SET_MANIFEST, *(shard.file for shard in self._shards))

    def _write(self) -> None:
        like, waiting, rarity = self._like, self._waiting, self._manifest.rarity
        number = len(self._shards)
        with self._store.whole(sets.shard_name(number)) as sink:
            shard = sets.pack_shard(sink, number, like.header, like.labels, waiting, pieces=0, rarity=rarity)
        self._shards.append(shard)
        self._waiting, self._count = [], 0


def _source(stored: StoredSet) -> dict[str, Any]:
    """Where scenes come from: the set, its request, and the checksums of its shards."""
    return {
        "location": stored.location,
        "scenes": len(stored),
        "request": stored.manifest.request,
        "sha256": [shard.sha256 for shard in stored.shards],
    }


def _blocks(stored: StoredSet) -> Iterator[Block]:
    """All scenes in their order; each shard has the checksum that the new set names as its source's."""
    for group in stored.groups():
        if group.index == 0:
            sets.check_bytes(stored.store, stored.shards[group.shard])
        yield stored.read_group(group)


def _part(block: Block, which: Any) -> Block:
    return Block(block.rows[:, which], block.phi[:, which])
