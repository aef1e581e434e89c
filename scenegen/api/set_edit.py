"""New sets from old ones: merged, split at random, filtered by phi. Where the scenes came from is kept."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from scenegen.api.sets import write_card
from scenegen.api.stored import StoredSet
from scenegen.errors import DataError, RequestError
from scenegen.errors.stores import NOTHING_LEFT, SETS_DIFFER, SHARES
from scenegen.formats import sets
from scenegen.formats.blocks import Block, regrouped
from scenegen.formats.holding import held
from scenegen.formats.locations import inside
from scenegen.formats.opening import open_store
from scenegen.sampling.request import Range

SPLIT = 12  # the stream of random numbers of splits


def merge_sets(stored: Sequence[StoredSet], out: str) -> sets.Manifest:
    """All scenes of several sets of one spec, one set after another. Raises DataError if their specs or labels differ,
    and what `write_blocks` raises."""
    first = stored[0]
    for other in stored[1:]:
        for what, mine, theirs in (
            ("spec", first.header.spec.sha256, other.header.spec.sha256),
            ("labels", first.labels, other.labels),
        ):
            if mine != theirs:
                raise DataError(SETS_DIFFER(one=first.location, other=other.location, what=what))
    blocks = (block for one in stored for block in _blocks(one))
    return write_blocks(out, first, blocks, {"merged": [_source(one) for one in stored]})


def filter_set(stored: StoredSet, ranges: Mapping[str, Range], out: str) -> sets.Manifest:
    """The scenes whose phi is in the ranges, in their order. Raises DataError if there are none."""

    def kept() -> Iterator[Block]:
        for block in _blocks(stored):
            inside = np.ones(block.count, dtype=bool)
            for label, values in zip(stored.labels, block.phi, strict=True):
                one = ranges.get(label, Range())
                inside &= (values >= (-np.inf if one.low is None else one.low)) & (
                    values <= (np.inf if one.high is None else one.high)
                )
            yield _part(block, inside)

    wanted = {label: [one.low, one.high] for label, one in ranges.items()}
    return write_blocks(out, stored, kept(), {"filtered": _source(stored), "phi": wanted})


def split_set(stored: StoredSet, shares: Mapping[str, float], seed: int, out: str) -> dict[str, sets.Manifest]:
    """Sets DIR/NAME/ of disjoint random parts: each scene goes into one, by its number and the seed. `shares` are of
    all scenes, and at most 1 together; what is left over is left out. Raises RequestError for other shares."""
    values = list(shares.values())
    if not values or min(values) <= 0.0 or sum(values) > 1.0 + 1e-12:
        raise RequestError(SHARES(shares=", ".join(f"{name}={share:g}" for name, share in shares.items())))
    ends = np.cumsum([0.0, *values])
    made = {}
    for number, name in enumerate(shares):

        def part(low: float = ends[number], high: float = ends[number + 1]) -> Iterator[Block]:
            for index, block in enumerate(_blocks(stored)):
                draw = np.random.default_rng(np.random.SeedSequence([seed, SPLIT, index])).random(block.count)
                yield _part(block, (draw >= low) & (draw < high))

        facts = {"split": _source(stored), "part": name, "share": shares[name], "seed": seed}
        made[name] = write_blocks(inside(out, name), stored, part(), facts)
    return made


def write_blocks(out: str, like: StoredSet, blocks: Iterable[Block], provenance: Mapping[str, Any]) -> sets.Manifest:
    """A complete set of some scenes, with the header and shard size of another set. Raises DataError if there is no
    scene, OutputError, and RequestError for a folder that has a set already."""
    store = open_store(out)
    manifest = sets.Manifest(
        request={**like.manifest.request, "from": dict(provenance)},
        labels=list(like.labels),
        shard_size=like.manifest.shard_size,
        header=like.manifest.header,
    )
    with held(store):
        manifest = sets.begin(store, manifest, resume=False)
        shards: list[sets.Shard] = []
        for block in regrouped((block for block in blocks if block.count), manifest.shard_size):
            shards.append(sets.make_shard(store, len(shards), like.header, like.labels, block, pieces=0))
        if not shards:
            store.delete(sets.MANIFEST)
            raise DataError(NOTHING_LEFT(location=like.location))
        count = sum(shard.scenes for shard in shards)
        manifest = manifest.model_copy(
            update={"shards": shards, "complete": True, "request": {**manifest.request, "n": count}}
        )
        sets.write_manifest(store, manifest)
        write_card(store, manifest)
    return manifest


def _source(stored: StoredSet) -> dict[str, Any]:
    """Where scenes come from: the set, its request, and the checksums of its shards."""
    return {
        "location": stored.location,
        "scenes": len(stored),
        "request": stored.manifest.request,
        "sha256": [shard.sha256 for shard in stored.shards],
    }


def _blocks(stored: StoredSet) -> Iterator[Block]:
    return (stored.read_group(group) for group in stored.groups())


def _part(block: Block, which: Any) -> Block:
    return Block(block.rows[:, which], block.phi[:, which])
