"""What is in a set of scenes, read shard by shard: counts, phi, places, duplicates, coverage, health."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from scenegen.api.scenes import PHI_TOLERANCE, evaluate, scene_set
from scenegen.api.stored import StoredSet
from scenegen.arrays import Array
from scenegen.errors import DataError, ScenegenError, SpecError
from scenegen.errors.files import DAMAGED_SHARD
from scenegen.lang.spec import CheckedSpec
from scenegen.pose import X, Y, as_rows, row_of
from scenegen.scenes.blocks import join_blocks, numbers_in
from scenegen.scenes.data import SceneFile
from scenegen.scenes.sets import check_bytes, read_shard

if TYPE_CHECKING:
    from scenegen.scenes.sets import Shard
    from scenegen.scenes.stores import Store

Counts = npt.NDArray[np.int64]

PHI_BINS = 32  # of the histograms of phi
PLACE_GRID = (24, 16)  # cells of the maps of places
COVERAGE_SCENES = 2000  # scenes for coverage
MAX_HASHED_SCENES = 100_000_000  # scenes among which duplicates are counted: 800 MB

MapJobs = Callable[[Callable[[Any], Any], Iterable[Any]], Generator[Any, None, None]]


@dataclass(frozen=True, slots=True)
class ShardHealth:
    """A shard, and what is wrong with it; empty if nothing is."""

    file: str
    scenes: int
    fault: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class SetReport:
    """`phi` has counts in BINS equal bins between lowest and highest, by label; `places` has counts (24, 16) of each
    object over the workspace's x and y. `repeated` is the number of scenes equal to another one, None if there are too
    many to tell. `coverage` is of fresh exact scenes, by the set's and by other fresh ones; None where the spec gives
    none in time. `drawn` says of how many scenes there are so many of an array, or an asset, where the spec draws it:
    {"block": {"2": 500, "3": 500}, "mug": {"red": 400, "blue": 600}}."""

    scenes: int
    bytes: int
    complete: bool
    phi: dict[str, Counts]
    places: dict[str, Counts]
    repeated: int | None
    coverage: tuple[float, float] | None
    shards: tuple[ShardHealth, ...]
    verified: bool
    drawn: dict[str, dict[str, int]] = field(default_factory=dict)

    @property
    def faults(self) -> tuple[ShardHealth, ...]:
        return tuple(one for one in self.shards if one.fault)


@dataclass(slots=True)
class _ShardFindings:
    """What one shard adds."""

    health: ShardHealth
    phi: dict[str, Counts] = field(default_factory=dict)
    places: dict[str, Counts] = field(default_factory=dict)
    drawn: dict[str, Counts] = field(default_factory=dict)
    hashes: npt.NDArray[np.uint64] = field(default_factory=lambda: np.empty(0, np.uint64))


@dataclass(frozen=True, slots=True)
class _ShardCheckJob:
    """The job: one shard. With `spec` its checksum is checked, too, and every scene is scored again."""

    store: Store
    header: SceneFile
    objects: tuple[str, ...]
    bounds: dict[str, tuple[float, float]]
    table: tuple[tuple[float, float], tuple[float, float]]
    sizes: dict[str, int]
    spec: CheckedSpec | None

    def __call__(self, shard: Shard) -> _ShardFindings:
        try:
            return self._look(shard)
        except DataError as error:
            return _ShardFindings(ShardHealth(shard.file, shard.scenes, _fault(error)))

    def _look(self, shard: Shard) -> _ShardFindings:
        fault = ""
        if self.sizes.get(shard.file) != shard.bytes:
            return _ShardFindings(ShardHealth(shard.file, shard.scenes, "it is missing, or has another size"))
        if self.spec is not None:
            check_bytes(self.store, shard)
        found = _ShardFindings(ShardHealth(shard.file, shard.scenes, fault))
        hashes = []
        done = 0
        for block in read_shard(self.store, self.header, tuple(self.bounds), shard).blocks:
            for (label, ends), values in zip(self.bounds.items(), block.phi, strict=True):
                counts = np.histogram(values, PHI_BINS, ends)[0]
                found.phi[label] = found.phi.get(label, 0) + counts
            for index, name in enumerate(self.objects):
                x, y = block.rows[row_of(index, X)], block.rows[row_of(index, Y)]
                x, y = x[~np.isnan(x)], y[~np.isnan(x)]
                counts = np.histogram2d(x, y, PLACE_GRID, self.table)[0].astype(np.int64)
                found.places[name] = found.places.get(name, 0) + counts
            if self.header.counts:
                there = ~np.isnan(block.rows[[row_of(index, X) for index in range(len(self.objects))]]).T
                for one, numbers in zip(
                    self.header.counts, numbers_in(self.objects, self.header.counts, there), strict=True
                ):
                    counts = np.bincount(numbers, minlength=one.most + 1)
                    found.drawn[one.name] = found.drawn.get(one.name, 0) + counts
            hashes.append(_hashes(block.rows))
            if self.spec is not None and not fault:
                again = evaluate(self.spec, scene_set(self.header, tuple(self.bounds), block))
                for label, values in zip(self.bounds, block.phi, strict=True):
                    off = np.abs(again[label] - values)
                    wrong = np.flatnonzero(~(off <= PHI_TOLERANCE))  # NaN is wrong, too
                    if len(wrong):
                        first = f"the first is scene {done + int(wrong[0]) + 1}"
                        fault = f"phi of `{label}` is off by {off.max():.2g} in {len(wrong):,} scenes; {first}"
                        break
            done += block.count
        found.health = ShardHealth(shard.file, shard.scenes, fault)
        found.hashes = np.concatenate(hashes)
        return found


def _fault(error: DataError) -> str:
    """What is wrong with a shard, without its name."""
    found = error.diagnostics[0]
    return str(found.facts["reason"]) if found.kind is DAMAGED_SHARD else found.title


def set_report(stored: StoredSet, *, map_jobs: MapJobs, verify: bool = False, timeout: float = 30.0) -> SetReport:
    """Read all shards by `map_jobs`, which may use other processes. With `verify` checksums are checked and phi of
    every scene is computed again. At most `timeout` seconds go into fresh scenes for coverage. Raises DataError,
    ScenegenError."""
    manifest = stored.manifest
    sizes = stored.files()
    spec = checked_spec(stored) if verify else None
    table = stored.header.workspace
    look = _ShardCheckJob(
        stored.store,
        stored.header,
        stored.objects,
        {label: _widen(one.lowest, one.highest) for label, one in manifest.phi().items()} if stored.shards else {},
        (table.x, table.y),
        sizes,
        spec,
    )
    phi: dict[str, Counts] = {label: np.zeros(PHI_BINS, np.int64) for label in stored.labels}
    places: dict[str, Counts] = {name: np.zeros(PLACE_GRID, np.int64) for name in stored.objects}
    drawn = {one.name: np.zeros(one.most + 1, np.int64) for one in stored.header.counts}
    hashes, shards = [], []
    for found in map_jobs(look, stored.shards):
        shards.append(found.health)
        for label, counts in found.phi.items():
            phi[label] += counts
        for name, counts in found.places.items():
            places[name] += counts
        for name, counts in found.drawn.items():
            drawn[name] += counts
        hashes.append(found.hashes)
    total = sum(map(len, hashes))
    repeated = None if total > MAX_HASHED_SCENES else total - len(np.unique(np.concatenate(hashes))) if hashes else 0
    # shards of a data set have requests of their own, of which none is that of the set
    comparable = not any(one.fault for one in shards) and all(shard.made is None for shard in stored.shards)
    comparable = comparable and not stored.header.counts  # distances are those of scenes of the same objects
    return SetReport(
        len(stored), sum(shard.bytes for shard in stored.shards), manifest.complete, phi, places, repeated,
        coverage_of(stored, timeout) if comparable and shards and timeout > 0 else None, tuple(shards), verify,
        {
            one.name: {
                one.assets[number - 1] if one.assets else str(number): int(drawn[one.name][number])
                for number in range(one.least, one.most + 1)
            }
            for one in stored.header.counts
        },
    )  # fmt: skip


def checked_spec(stored: StoredSet) -> CheckedSpec:
    """The spec that the set was made from, read from its header. Raises DataError if it is none."""
    from scenegen.api.spec import Spec
    from scenegen.errors.files import NOT_A_SET

    try:
        return Spec(stored.header.spec.checked_spec).require_scenes()
    except SpecError as error:
        reason = f"the spec in its header does not parse: {error.diagnostics[0].title}"
        remedy = "it was made by another version of scenegen"
        raise DataError(NOT_A_SET(location=stored.location, reason=reason, remedy=remedy)) from error


def coverage_of(stored: StoredSet, timeout: float) -> tuple[float, float] | None:
    """Coverage of fresh exact scenes of the same request by scenes of the set, and by other fresh ones; None where
    these cannot be made, and of scenes that were chosen far from each other, which are no sample."""
    from scenegen.api.spec import Spec
    from scenegen.scenes.coverage import coverage

    request = stored.header.request
    few = min(COVERAGE_SCENES, len(stored))
    if request.spread == "even":
        return None
    try:
        from scenegen.api.sample import sample

        spec = Spec(stored.header.spec.checked_spec)
        fresh = sample(
            spec, dict(request.phi), n=2 * few, seed=987_654_321,
            spread=request.spread, timeout=timeout, workers=1,
        )  # fmt: skip
    except ScenegenError:
        return None
    rows = np.asarray(as_rows(fresh.poses))
    own = scattered_rows(stored, few)[: len(rows)]
    return coverage(rows[:, :few], own), coverage(rows[:, :few], rows[:, few:])


def scattered_rows(stored: StoredSet, count: int) -> Array:
    """Scenes from all over the set, (3N, count): as many from each of a few row groups."""
    groups = stored.groups()
    chosen = np.unique(np.linspace(0, len(groups) - 1, min(len(groups), 8)).astype(np.intp))
    blocks = []
    for number, index in enumerate(chosen):
        block = stored.read_group(groups[index])
        share = count * (number + 1) // len(chosen) - count * number // len(chosen)
        blocks.append(block.part(0, share))
    block = join_blocks(blocks, len(blocks[0].rows), len(blocks[0].phi))
    return block.rows


def _hashes(rows: Array) -> npt.NDArray[np.uint64]:
    """A number for each scene that two different ones share by chance once in 10^19."""
    bits = np.ascontiguousarray(rows).view(np.uint64)
    found = np.zeros(rows.shape[1], np.uint64)
    with np.errstate(over="ignore"):
        for row in bits:
            found = (found ^ row) * np.uint64(0x9E3779B97F4A7C15)
            found ^= found >> np.uint64(29)
    return found


def _widen(low: float, high: float) -> tuple[float, float]:
    return (low, high) if high > low else (low - 0.5, high + 0.5)
