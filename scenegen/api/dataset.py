"""A data set from many specs: for each a set whose shards are runs of their own, with seeds of their own.

So every shard is an independent job, on any engine, and one shard can be made again without the others.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from scenegen.api.rarity import SATISFIED_SHARE, LabelRarity, rarity
from scenegen.api.scene_arrays import make_header
from scenegen.api.set_card import front_matter
from scenegen.api.spec import Spec, load, parse
from scenegen.errors import RequestError
from scenegen.errors.files import FINISHED_SET, NO_PART
from scenegen.sampling.engine.engines import JobResult, run_each, run_here
from scenegen.sampling.request import Range, SampleRequest
from scenegen.sampling.streams import SHARD_SEEDS_STREAM
from scenegen.scenes.blocks import BLOCK
from scenegen.scenes.data import RequestData
from scenegen.scenes.locations import inside
from scenegen.scenes.lock import acquire
from scenegen.scenes.sets import Manifest, Rareness, ShardRequest, StratumData
from scenegen.scenes.stores import open_store
from scenegen.validation import as_int

if TYPE_CHECKING:
    from scenegen.api.scenes import SceneSet
    from scenegen.scenes.files import Sink
    from scenegen.scenes.sets import Shard
    from scenegen.scenes.stores import Store


RAREST = 2.0  # satisfied scenes up to the phi that is a hundred times as rare as phi >= 0
LOWEST_LOG10P = -3.0  # and scenes that are not, down to the phi that one scene in a thousand is below
END_DIGITS = 4  # of the ends of parts


@dataclass(frozen=True, slots=True)
class SpecPlan:
    """The parts of a spec's scenes, which get equal shares; `missing` names those that there are not."""

    parts: tuple[StratumData, ...]
    missing: tuple[str, ...]
    rarity: dict[str, Rareness]


def plan_spec(spec: Spec, seed: int) -> SpecPlan:
    """For each label the scenes with phi >= 0 and those with phi <= 0, as far as `scenegen range` finds any. Raises
    what `rarity` raises."""
    found = rarity(spec, seed=seed)
    parts: list[StratumData] = []
    missing: list[str] = []
    for one in found.labels:
        for side, name in ((_satisfied_part(one), "phi > 0"), (_violated_part(one), "phi < 0")):
            if side is None:
                missing.append(f"{one.label}: no scene with {name} was found")
            else:
                parts.append(side)
    return SpecPlan(tuple(parts), tuple(missing), {one.label: rareness(one) for one in found.labels})


def rareness(one: LabelRarity) -> Rareness:
    """The smaller tail of phi at the places of the curve of `scenegen range`. Where too few scenes tell, the last
    value that can be told stands: there, the share is at most that."""
    if not one.curve:  # phi is the same in every scene
        return Rareness(phi=[one.reached[0]], log10p=[0.0])
    smaller = np.minimum(*_tails(one))
    places = [level.phi for level in one.curve]
    return Rareness(phi=[float(phi) for phi in places], log10p=[round(float(value), 4) + 0.0 for value in smaller])


def _tails(one: LabelRarity) -> tuple[Any, Any]:
    """log10 P(>= phi), falling, and log10 P(<= phi), rising, at the curve's places."""
    above = [np.inf if level.above is None else level.above.log10 for level in one.curve]
    below = [np.inf if level.below is None else level.below.log10 for level in one.curve]
    falling = np.minimum.accumulate(np.minimum(above, 0.0))
    rising = np.minimum.accumulate(np.minimum(below, 0.0)[::-1])[::-1]
    return falling, rising


def _satisfied_part(one: LabelRarity) -> StratumData | None:
    low, high = max(0.0, one.reached[0]), SATISFIED_SHARE * one.reached[1]
    if not one.reached[1] > 0.0 or not low < high:
        return None
    if one.curve:
        places = [level.phi for level in one.curve]
        above = _tails(one)[0]
        least = float(np.interp(low, places, above)) - RAREST
        beyond = [phi for phi, value in zip(places, above, strict=True) if value < least and phi > low]
        high = min([high, *beyond[:1]])
        if one.curve[-1].above is not None and not beyond:  # many scenes have the highest phi, as where a body rests
            return StratumData(label=one.label, phi=(_round_end(low), one.reached[1]))
    return StratumData(label=one.label, phi=(_round_end(low), _round_end(high)))


def _violated_part(one: LabelRarity) -> StratumData | None:
    low, high = one.reached[0], min(0.0, one.reached[1])
    if not low < high:
        return None
    places = [level.phi for level in one.curve]
    below = _tails(one)[1]
    within = [phi for phi, value in zip(places, below, strict=True) if value >= LOWEST_LOG10P and phi < high]
    low = max([low, *within[:1]])
    return StratumData(label=one.label, phi=(_round_end(low), _round_end(high)))


def _round_end(value: float) -> float:
    return float(f"{value:.{END_DIGITS}g}") + 0.0


def requests(spec: Spec, parts: Sequence[StratumData], n: int, size: int, seed: int) -> list[ShardRequest]:
    """The requests of the shards, at most `size` scenes each: n scenes, as many of each part as of the others. Each
    has a seed of its own, which follows from `seed`, the spec and the shard's number alone."""
    found: list[ShardRequest] = []
    for which, part in enumerate(parts):
        count = _share(n, which, len(parts))
        files = -(-count // size)
        for number in range(files):
            words = np.random.SeedSequence([seed, SHARD_SEEDS_STREAM, int(spec.checked.sha256[:12], 16), len(found)])
            drawn = int(words.generate_state(1, np.uint64)[0]) >> 11  # any program reads 53 bits exactly
            found.append(ShardRequest(phi={part.label: part.phi}, n=_share(count, number, files), seed=drawn))
    return found


def _share(n: int, which: int, count: int) -> int:
    return n * (which + 1) // count - n * which // count


def shares(n: int, count: int) -> list[int]:
    """n in `count` numbers that differ by 1 at most."""
    return [_share(n, which, count) for which in range(count)]


def plan_data(plan: SpecPlan) -> list[dict[str, Any]]:
    """The parts as a manifest has them."""
    return [{"label": part.label, "phi": list(part.phi)} for part in plan.parts]


def plan_from(manifest: Manifest) -> SpecPlan:
    """The plan that a manifest was begun with."""
    parts: list[Mapping[str, Any]] = manifest.request["parts"]
    return SpecPlan(
        tuple(StratumData(label=part["label"], phi=tuple(part["phi"])) for part in parts),
        tuple(manifest.missing or ()),
        manifest.rarity or {},
    )


SHARD_SECONDS = 600.0  # seconds of a shard
OnJob = Callable[
    [str, JobResult, int, int], None
]  # what is done; a job of it that is over, and how many of how many are
MEASURING, DRAWING = "measuring", "drawing shards"


@dataclass(frozen=True, slots=True)
class ShardDrawJob:
    """The job of one shard: draw its scenes and pack them. Raises what `sample` raises."""

    timeout: float

    def __call__(self, item: ShardJob) -> Shard:
        from scenegen.scenes.sets import shard_name

        scenes = self._draw(item)
        with item.store.whole(shard_name(item.number)) as sink:
            return _pack(item, scenes, sink)

    def pack(self, item: ShardJob) -> tuple[Shard, list[bytes | memoryview]]:
        """The shard and its bytes, not written."""
        from scenegen.scenes.files import Parts

        sink = Parts()
        return _pack(item, self._draw(item), sink), sink.parts

    def _draw(self, item: ShardJob) -> SceneSet:
        from scenegen.api.sample import draw_scenes

        made = item.made
        phi = {label: Range(*ends) for label, ends in made.phi.items()}
        # any one worker: the scenes do not depend on it, and jobs share the cores
        request = SampleRequest(phi, made.n, seed=made.seed, timeout=self.timeout, workers=1)
        return draw_scenes(parse(item.source), request)


def _pack(item: ShardJob, scenes: SceneSet, sink: Sink) -> Shard:
    from scenegen.scenes.sets import pack_shard

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
    made: ShardRequest
    rarity: dict[str, Rareness] | None


@dataclass(frozen=True, slots=True)
class _PlanJob:
    """The job of one spec: its text, and the plan that its set was begun with, if it was."""

    seed: int

    def __call__(self, item: tuple[str, SpecPlan | None]) -> SpecPlan:
        source, begun = item
        plan = plan_spec(parse(source), self.seed) if begun is None else begun
        if not plan.parts:
            raise RequestError(NO_PART(missing=plan.missing))
        return plan


@dataclass(slots=True)
class _PartialSet:
    """A set of one spec, as its shards come in."""

    name: str
    store: Store
    manifest: Manifest
    wanted: int  # shards

    def add(self, shard: Shard) -> None:
        from scenegen.scenes import sets

        shards = sorted([*self.manifest.shards, shard], key=lambda one: one.file)
        done = len(shards) == self.wanted
        self.manifest = self.manifest.model_copy(update={"shards": shards, "complete": done})
        sets.write_manifest(self.store, self.manifest)
        if done:
            self.finish()

    def finish(self) -> None:
        from scenegen.api.set_card import write_card
        from scenegen.scenes import sets

        write_card(self.store, self.manifest)
        sets.finish(self.store, self.manifest)


def make_dataset(
    location: str,
    specs: Iterable[tuple[str, Path]],
    n: int,
    *,
    seed: int = 0,
    shard_size: int = BLOCK,
    timeout: float = SHARD_SECONDS,
    resume: bool = False,
    license: str = "unknown",
    engine: str = "local",
    workers: int | None = None,
    address: str | None = None,
    root: Path | None = None,
    told: OnJob = lambda what, ended, done, count: None,
) -> dict[str, Manifest]:
    """n scenes of named specs, in equal shares, as a folder of sets with a card; returns their manifests by name.

    Of each spec there are as many scenes of each label that are satisfied as of those that are not, evenly over phi on
    both sides, with phi of all labels and how rare it is. Jobs that fail are reported to `told`, and leave their set
    unfinished; `resume` goes on. The bytes follow from the specs, n, `seed` and `shard_size` alone. Raises RequestError
    and OutputError for a place that cannot be written to, and what `engine.many.run_each` raises.
    """
    from scenegen.scenes import sets

    listed = list(specs)
    size = sets.shard_size(as_int("shard_size", shard_size), 4)
    stores = {name: open_store(inside(location, name)) for name, _ in listed}
    begun = {name: sets.refuse_taken(store, resume=resume) for name, store in stores.items()}
    known = {name: None if one is None or "parts" not in one.request else plan_from(one) for name, one in begun.items()}
    if not resume and sets.CARD in open_store(location).sizes():
        raise RequestError(FINISHED_SET(location=location))
    loaded: dict[str, Spec] = {}
    for ended in run_here(lambda path: load(path, root), listed):
        if ended.errors:
            told(MEASURING, ended, 0, len(listed))
        else:
            loaded[ended.name] = ended.value
    plans: dict[str, SpecPlan] = {}
    named = [(name, (spec.checked.source, known[name])) for name, spec in loaded.items()]
    for count, ended in enumerate(run_each(_PlanJob(seed), named, engine, workers, address), 1):
        told(MEASURING, ended, count, len(named))
        if not ended.errors:
            plans[ended.name] = ended.value
    growing: dict[str, _PartialSet] = {}
    jobs: list[tuple[str, ShardJob]] = []
    places: dict[str, _PartialSet] = {}
    with ExitStack() as stack:
        for (name, _), share in zip(listed, shares(as_int("n", n), len(listed)), strict=True):
            if name not in plans or not share:
                continue
            spec, plan, store = loaded[name], plans[name], stores[name]
            wanted = requests(spec, plan.parts, share, size, seed)
            wanted = [one for one in wanted if one.n]
            stack.enter_context(acquire(store))
            manifest = sets.begin(store, _manifest(spec, plan, share, seed, size, license), resume=resume)
            one = growing[name] = _PartialSet(name, store, manifest, len(wanted))
            there = {shard.file for shard in manifest.shards}
            for number, made in enumerate(wanted):
                if sets.shard_name(number) not in there:
                    wish = ", ".join(f"{label}={low:g}:{high:g}" for label, (low, high) in made.phi.items())
                    job = f"{name} {sets.shard_name(number)} ({wish})"
                    places[job] = one
                    jobs.append((job, ShardJob(spec.checked.source, store, number, made, plan.rarity)))
        for count, ended in enumerate(run_each(ShardDrawJob(timeout), jobs, engine, workers, address), 1):
            if not ended.errors:
                places[ended.name].add(ended.value)
            told(DRAWING, ended, count, len(jobs))
    manifests = {name: one.manifest for name, one in growing.items()}
    failed = tuple(name for name, _ in listed if name not in growing)
    open_store(location).write(sets.CARD, dataset_card(manifests, failed, license).encode())
    return manifests


def _manifest(spec: Spec, plan: SpecPlan, n: int, seed: int, size: int, license: str) -> Manifest:
    """Of a set before its first shard."""
    from scenegen.resources import __version__
    from scenegen.scenes import sets

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


def remake(location: str, number: int, timeout: float = SHARD_SECONDS) -> tuple[Shard, bool]:
    """Make shard `number` of a data set again, from its request alone, and write it where its bytes are those of the
    manifest. Returns it, and whether the file there was missing or had other bytes. Raises RequestError for a number
    that no shard has and for sets whose shards have no requests of their own, DataError for other bytes, as other
    versions of numpy and pyarrow can give, and what sampling raises."""
    import hashlib

    from scenegen.api.set_report import checked_spec
    from scenegen.api.stored import open_set
    from scenegen.errors import DataError
    from scenegen.errors.files import NO_SEED, REMADE_DIFFERS
    from scenegen.errors.requests import OUT_OF_RANGE
    from scenegen.scenes.sets import shard_name

    stored = open_set(location)
    shard = next((one for one in stored.shards if one.file == shard_name(number)), None)
    if shard is None:
        raise RequestError(OUT_OF_RANGE(argument="shard", value=number, wanted=f"from 0 to {len(stored.shards) - 1}"))
    if shard.made is None:
        raise RequestError(NO_SEED(location=stored.location))
    checked_spec(stored)
    job = ShardJob(stored.header.spec.source, stored.store, number, shard.made, stored.manifest.rarity)
    again, parts = ShardDrawJob(timeout).pack(job)
    if again.sha256 != shard.sha256:
        facts = {"scenegen": stored.manifest.request.get("scenegen"), "numpy": stored.manifest.request.get("numpy")}
        raise DataError(REMADE_DIFFERS(file=shard.file, location=stored.location, **facts))
    there = stored.files().get(shard.file) == shard.bytes
    whole = there and hashlib.sha256(stored.store.read(shard.file)).hexdigest() == shard.sha256
    if not whole:
        stored.store.write(shard.file, *parts)
    return again, not whole


def dataset_card(manifests: Mapping[str, Manifest], failed: Sequence[str], license: str) -> str:
    """The text of the card. It names what is missing: parts that no scene can have, and parts that failed."""
    scenes = sum(one.scenes for one in manifests.values())
    there = {name: one for name, one in manifests.items() if one.shards}
    configs = {name: f"{name}/part-*.parquet" for name in there}
    rows = "\n".join(_row(name, one) for name, one in there.items())
    missing = [f"* {name}: {why}" for name, one in manifests.items() for why in one.missing or ()]
    missing += [f"* {name}: nothing was made" for name in failed]
    missing += [
        f"* {name}: {one.request['n'] - one.scenes:,} of {one.request['n']:,} scenes were not found in time"
        for name, one in manifests.items()
        if not one.complete
    ]
    return f"""{front_matter("Table-top scenes at every difficulty", license, scenes, configs)}

# Table-top scenes at every difficulty

{scenes:,} scenes of {len(there)} specs, as many of each as of the others. Of each label of a spec there are as many
scenes that satisfy it as scenes that do not, evenly spread over phi on both sides.

Each row is a scene: `mug.x`, `mug.y` in metres and `mug.theta` in radians for every object; `phi.LABEL`, the
satisfaction value of each label (0 or more where it holds, the lower the harder); and `log10p.LABEL`, how rare that is:
log10 of the share of the spec's base distribution (uniform scenes that meet what the spec requires) that lies at least
as far out on the same side, the smaller of P(phi' <= phi) and P(phi' >= phi). It is an estimate; where the estimate
ends, the last value stands.

Each folder is a set with a card of its own, which has the spec, and a manifest, which has the request and the seed of
every shard. `scenegen data remake FOLDER --shard N` makes a shard again, with the same bytes.

| spec | scenes | shards | labels | rarest log10 p |
| --- | ---: | ---: | --- | ---: |
{rows}

Missing:

{chr(10).join(missing) if missing else "* nothing"}
"""


def _row(name: str, manifest: Manifest) -> str:
    labels = ", ".join(f"`{label}`" for label in manifest.labels)
    rarest = min(min(one.log10p) for one in (manifest.rarity or {}).values())
    return f"| {name} | {manifest.scenes:,} | {len(manifest.shards)} | {labels} | {rarest:.1f} |"
