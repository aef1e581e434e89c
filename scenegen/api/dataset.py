"""A data set from many specs: for each a set whose shards are runs of their own, with seeds of their own.

So every shard is an independent job, on any engine, and one shard can be made again without the others.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from scenegen.api.dataset_plan import SpecPlan, plan_data, plan_from, plan_spec, requests, shares
from scenegen.api.scene_arrays import make_header
from scenegen.api.spec import Spec, load, parse
from scenegen.engine.many import Ended, each, here
from scenegen.errors import RequestError
from scenegen.errors.stores import FINISHED_SET, NO_PART
from scenegen.formats.blocks import BLOCK
from scenegen.formats.holding import held
from scenegen.formats.locations import inside
from scenegen.formats.opening import open_store
from scenegen.sampling.request import Range, SampleRequest
from scenegen.scene.data import RequestData
from scenegen.validation import as_int

if TYPE_CHECKING:
    from scenegen.api.scenes import SceneSet
    from scenegen.formats.made import Made, Rareness
    from scenegen.formats.packed import Sink
    from scenegen.formats.sets import Manifest, Shard
    from scenegen.formats.stores import Store

TIMEOUT = 600.0  # seconds of a shard
Told = Callable[[str, Ended, int, int], None]  # what is done; a job of it that is over, and how many of how many are
MEASURING, DRAWING = "measuring", "drawing shards"


@dataclass(frozen=True, slots=True)
class Draw:
    """The job of one shard: draw its scenes and pack them. Raises what `sample` raises."""

    timeout: float

    def __call__(self, item: ShardJob) -> Shard:
        from scenegen.formats.sets import shard_name

        scenes = self._drawn(item)
        with item.store.whole(shard_name(item.number)) as sink:
            return _pack(item, scenes, sink)

    def packed(self, item: ShardJob) -> tuple[Shard, list[bytes | memoryview]]:
        """The shard and its bytes, not written."""
        from scenegen.formats.packed import Parts

        sink = Parts()
        return _pack(item, self._drawn(item), sink), sink.parts

    def _drawn(self, item: ShardJob) -> SceneSet:
        from scenegen.api.sample import draw_scenes

        made = item.made
        phi = {label: Range(*ends) for label, ends in made.phi.items()}
        # any one worker: the scenes do not depend on it, and jobs share the cores
        request = SampleRequest(phi, made.n, seed=made.seed, timeout=self.timeout, workers=1)
        return draw_scenes(parse(item.source), request)


def _pack(item: ShardJob, scenes: SceneSet, sink: Sink) -> Shard:
    from scenegen.formats.sets import pack_shard

    labels = tuple(scenes.phi)
    return pack_shard(
        sink, item.number, scenes.header, labels, scenes.blocks(), pieces=0, rarity=item.rarity, made=item.made
    )


@dataclass(frozen=True, slots=True)
class ShardJob:
    """What a shard follows from, and where it is written to."""

    source: str
    store: Store
    number: int
    made: Made
    rarity: dict[str, Rareness] | None


@dataclass(frozen=True, slots=True)
class _Planning:
    """The job of one spec: its text, and the plan that its set was begun with, if it was."""

    seed: int

    def __call__(self, item: tuple[str, SpecPlan | None]) -> SpecPlan:
        source, begun = item
        plan = plan_spec(parse(source), self.seed) if begun is None else begun
        if not plan.parts:
            raise RequestError(NO_PART(missing=plan.missing))
        return plan


@dataclass(slots=True)
class _Growing:
    """A set of one spec, as its shards come in."""

    name: str
    store: Store
    manifest: Manifest
    wanted: int  # shards

    def add(self, shard: Shard) -> None:
        from scenegen.formats import sets

        shards = sorted([*self.manifest.shards, shard], key=lambda one: one.file)
        done = len(shards) == self.wanted
        self.manifest = self.manifest.model_copy(update={"shards": shards, "complete": done})
        sets.write_manifest(self.store, self.manifest)
        if done:
            self.finish()

    def finish(self) -> None:
        from scenegen.api.sets import write_card
        from scenegen.formats import sets

        write_card(self.store, self.manifest)
        sets.finish(self.store, self.manifest)


def make_dataset(
    location: str,
    specs: Iterable[tuple[str, Path]],
    n: int,
    *,
    seed: int = 0,
    shard_size: int = BLOCK,
    timeout: float = TIMEOUT,
    resume: bool = False,
    license: str = "unknown",
    engine: str = "local",
    workers: int | None = None,
    address: str | None = None,
    root: Path | None = None,
    told: Told = lambda what, ended, done, count: None,
) -> dict[str, Manifest]:
    """n scenes of named specs, in equal shares, as a folder of sets with a card; returns their manifests by name.

    Of each spec there are as many scenes of each label that are satisfied as of those that are not, evenly over phi on
    both sides, with phi of all labels and how rare it is. Jobs that fail are reported to `told`, and leave their set
    unfinished; `resume` goes on. The bytes follow from the specs, n, `seed` and `shard_size` alone. Raises RequestError
    and OutputError for a place that cannot be written to, and what `engine.many.each` raises.
    """
    from scenegen.api.dataset_card import write_dataset_card
    from scenegen.formats import sets

    listed = list(specs)
    size = sets.shard_size(as_int("shard_size", shard_size), 1, 1)
    stores = {name: open_store(inside(location, name)) for name, _ in listed}
    begun = {name: sets.refuse_taken(store, resume=resume) for name, store in stores.items()}
    known = {name: None if one is None or "parts" not in one.request else plan_from(one) for name, one in begun.items()}
    if not resume and sets.CARD in open_store(location).sizes():
        raise RequestError(FINISHED_SET(location=location))
    loaded: dict[str, Spec] = {}
    for ended in here(lambda path: load(path, root), listed):
        if ended.errors:
            told(MEASURING, ended, 0, len(listed))
        else:
            loaded[ended.name] = ended.value
    plans: dict[str, SpecPlan] = {}
    named = [(name, (spec.checked.source, known[name])) for name, spec in loaded.items()]
    for count, ended in enumerate(each(_Planning(seed), named, engine, workers, address), 1):
        told(MEASURING, ended, count, len(named))
        if not ended.errors:
            plans[ended.name] = ended.value
    growing: dict[str, _Growing] = {}
    jobs: list[tuple[str, ShardJob]] = []
    places: dict[str, _Growing] = {}
    with ExitStack() as stack:
        for (name, _), share in zip(listed, shares(as_int("n", n), len(listed)), strict=True):
            if name not in plans or not share:
                continue
            spec, plan, store = loaded[name], plans[name], stores[name]
            wanted = requests(spec, plan.parts, share, size, seed)
            wanted = [one for one in wanted if one.n]
            stack.enter_context(held(store))
            manifest = sets.begin(store, _manifest(spec, plan, share, seed, size, license), resume=resume)
            one = growing[name] = _Growing(name, store, manifest, len(wanted))
            there = {shard.file for shard in manifest.shards}
            for number, made in enumerate(wanted):
                if sets.shard_name(number) not in there:
                    wish = ", ".join(f"{label}={low:g}:{high:g}" for label, (low, high) in made.phi.items())
                    job = f"{name} {sets.shard_name(number)} ({wish})"
                    places[job] = one
                    jobs.append((job, ShardJob(spec.checked.source, store, number, made, plan.rarity)))
        for count, ended in enumerate(each(Draw(timeout), jobs, engine, workers, address), 1):
            if not ended.errors:
                places[ended.name].add(ended.value)
            told(DRAWING, ended, count, len(jobs))
    manifests = {name: one.manifest for name, one in growing.items()}
    failed = tuple(name for name, _ in listed if name not in growing)
    write_dataset_card(open_store(location), manifests, failed, license)
    return manifests


def _manifest(spec: Spec, plan: SpecPlan, n: int, seed: int, size: int, license: str) -> Manifest:
    """Of a set before its first shard."""
    import numpy as np

    from scenegen.formats import sets
    from scenegen.version import __version__

    checked = spec.checked
    request: dict[str, Any] = {
        "spec": checked.sha256,
        "phi": {},
        "spread": "flat",
        "fix": {},
        "numpy": np.__version__,
        "scenegen": __version__,
        "method": "auto",
        "n": n,
        "seed": seed,
        "license": license,
        "parts": plan_data(plan),
    }
    header = make_header(checked, {"method": "data set"}, RequestData(phi={}, n=n))
    return sets.Manifest(
        request=request, labels=list(checked.labels), shard_size=size, header=sets.header_data(header),
        rarity=plan.rarity, missing=list(plan.missing) or None, sampler={"method": "data set"},
    )  # fmt: skip


def remake(location: str, number: int, timeout: float = TIMEOUT) -> tuple[Shard, bool]:
    """Make shard `number` of a data set again, from its request alone, and write it where its bytes are those of the
    manifest. Returns it, and whether the file there was missing or had other bytes. Raises RequestError for a number
    that no shard has and for sets whose shards have no requests of their own, DataError for other bytes, as other
    versions of numpy and pyarrow can give, and what sampling raises."""
    import hashlib

    from scenegen.api.set_report import checked_spec
    from scenegen.api.stored import open_set
    from scenegen.errors import DataError
    from scenegen.errors.requests import OUT_OF_RANGE
    from scenegen.errors.stores import NO_SEED, REMADE_DIFFERS
    from scenegen.formats.sets import shard_name

    stored = open_set(location)
    shard = next((one for one in stored.shards if one.file == shard_name(number)), None)
    if shard is None:
        raise RequestError(OUT_OF_RANGE(argument="shard", value=number, wanted=f"from 0 to {len(stored.shards) - 1}"))
    if shard.made is None:
        raise RequestError(NO_SEED(location=stored.location))
    checked_spec(stored)
    job = ShardJob(stored.header.spec.source, stored.store, number, shard.made, stored.manifest.rarity)
    again, parts = Draw(timeout).packed(job)
    if again.sha256 != shard.sha256:
        facts = {"scenegen": stored.manifest.request.get("scenegen"), "numpy": stored.manifest.request.get("numpy")}
        raise DataError(REMADE_DIFFERS(file=shard.file, location=stored.location, **facts))
    there = stored.files().get(shard.file) == shard.bytes
    whole = there and hashlib.sha256(stored.store.read(shard.file)).hexdigest() == shard.sha256
    if not whole:
        stored.store.write(shard.file, *parts)
    return again, not whole
