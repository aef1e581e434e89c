"""Sets of scenes: as many as one wants, in Parquet files of equal size, in a folder or an object store."""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import closing
from typing import TYPE_CHECKING, Any

from scenegen.api.request import Note, check_request, plan_of
from scenegen.api.sample import PhiSummary, Written, partial
from scenegen.api.scene_arrays import header_of, stored_form
from scenegen.api.spec import LearnedModel, Spec, spec_of
from scenegen.errors import Diagnostic, RequestError
from scenegen.pose import row_count
from scenegen.sampling.request import Progress, SampleRequest
from scenegen.scenes.blocks import BLOCK
from scenegen.scenes.formats.registry import MOTIONS
from scenegen.scenes.open_store import open_store

if TYPE_CHECKING:
    from scenegen.sampling.plan import Plan, Tally
    from scenegen.scenes.sets import Manifest
    from scenegen.scenes.stores import Store


MORE = 4  # columns of motions beside poses and phi: number, time and two facts


def write_set(
    location: str,
    source: Spec | LearnedModel,
    request: SampleRequest,
    *,
    progress: Progress | None = None,
    on_note: Note | None = None,
) -> Written:
    """The scenes of a request as a set of shards. The bytes depend on the request and `shard_size` alone, neither on
    the engine nor on the number of workers.

    Raises what `sample_to` raises, and RequestError for an engine that is not there.
    """
    store = open_store(location, on_note)
    request = check_request(source, request)
    from scenegen.resources import __version__
    from scenegen.sampling.engine.engines import ShardWriter, check_engine, open_engine
    from scenegen.sampling.engine.run import request_of
    from scenegen.sampling.engine.sets import write_set as write
    from scenegen.sampling.problem import Budget
    from scenegen.sampling.report import fell_short, summed_up
    from scenegen.scenes import sets
    from scenegen.scenes.lease import held, refuse_held

    numbers, block = _numbers(spec_of(source)), BLOCK
    if spec_of(source).over_time is not None:
        block = sets.motion_block(numbers)
    size = sets.shard_size(request.shard_size, numbers, len(spec_of(source).objects), block)
    check_engine(request.engine, request.address)
    refuse_held(store)
    sets.refuse_taken(store, resume=request.resume)
    budget = Budget(request.timeout)
    with closing(plan_of(source, request, budget, on_note)) as plan:
        labels = plan.problem.labels

        def account(tally: Tally) -> Mapping[str, Any]:
            return summed_up(plan, tally)[0]

        with held(store) as hold, open_engine(request.engine, request.workers, plan, request.address) as chosen:
            header = header_of(plan.problem, {"method": plan.method})
            writing = ShardWriter(plan, store, header, labels, stored_form(plan.problem))
            facts = {"plan": plan.plan_digest, "n": plan.wanted, "seed": plan.seed, "method": request.method}
            manifest = sets.Manifest(
                request={**request_of(plan.problem, {"scenegen": __version__}), **facts},
                labels=list(labels),
                shard_size=size,
                header=sets.header_data(header),
            )

            def spent() -> bool:
                hold.check()
                return budget.spent

            tally, manifest = write(
                store, plan, chosen, manifest, writing, account,
                resume=request.resume, keep_partial=request.keep_partial, spent=spent, progress=progress, block=block,
            )  # fmt: skip
            warnings: tuple[Diagnostic, ...] = ()
            if tally is not None:
                warnings, shortfall = _warnings(source, request, plan, tally), fell_short(plan, tally, budget.spent)
                if shortfall is not None:
                    if not manifest.complete:
                        raise RequestError(shortfall.but(folder=store.location if manifest.shards else None))
                    warnings = (*warnings, partial(shortfall))
            write_card(store, manifest)
    phi = {label: PhiSummary(one.lowest, one.mean, one.highest) for label, one in manifest.phi().items()}
    return Written(store.location, manifest.scenes, header_of(plan.problem, manifest.sampler), phi, warnings)


def _numbers(spec: Spec) -> int:
    """How many numbers of a scene, or motion, files have."""
    rows = row_count(len(spec.objects)) + len(spec.labels)
    return rows if spec.horizon is None else (rows + MORE) * spec.horizon.moments


def _warnings(source: Spec | LearnedModel, request: SampleRequest, plan: Plan, tally: Tally) -> tuple[Diagnostic, ...]:
    from scenegen.sampling.report import summed_up

    warnings = summed_up(plan, tally)[1]
    if isinstance(source, LearnedModel) and request.method == "model":
        warnings = (*warnings, *source.advice(request.phi, None, request.raw))
    return warnings


def write_card(store: Store, manifest: Manifest) -> None:
    """The set's README.md: YAML front matter as dataset hubs read it, the spec, and what phi is in the set."""
    from scenegen.scenes.sets import CARD

    store.write(CARD, card(manifest).encode())


def card(manifest: Manifest) -> str:
    """The text of the card."""
    header = manifest.header
    spec, request = header["spec"], manifest.request
    scenes = manifest.scenes
    phi = manifest.phi()
    rows = "\n".join(
        f"| `{label}` | {one.lowest:+.4f} | {one.mean:+.4f} | {one.highest:+.4f} |" for label, one in phi.items()
    )
    wanted = ", ".join(f"{label} = {_range(*ends)}" for label, ends in request["phi"].items()) or "any phi"
    method = header["sampler"].get("method", "unknown")
    asked = f"Wanted: {wanted}; spread {request['spread']}; seed {request['seed']}; method {method}."
    if manifest.rarity is not None and "parts" in request:
        parts = ", ".join(f"{one['label']} = {_range(*one['phi'])}" for one in request["parts"])
        asked = f"""Parts of equal size: {parts}; spread {request["spread"]} within each.
Every shard has a request and a seed of its own in manifest.json, all from seed {request["seed"]}. `log10p.LABEL` is
how rare phi is: log10 of the smaller of P(phi' <= phi) and P(phi' >= phi), for uniform scenes that meet what the
spec requires."""
        asked += "".join(f" Missing: {why}." for why in manifest.missing or ())
    objects = ", ".join(f"`{one['name']}`" for one in header["objects"])
    title = spec.get("title") or "Table-top scenes"
    drawn = ", ".join(f"`count.{one['name']}`" for one in header.get("counts", ()))
    if drawn:
        drawn = f"\nHow many things there are, or which asset, differs by scene: {drawn}. What is not there is null.\n"
    moving = header["format"] == MOTIONS
    what = "motions" if moving else "scenes"
    rows_are = "Each row is a moment of a motion, at `t` seconds" if moving else "Each row is a scene"
    front = front_matter(title, request.get("license", "unknown"), scenes, {"default": "part-*.parquet"})
    return f"""{front}

# {title}

{scenes:,} {what} of {objects} in {len(manifest.shards)} shards. {rows_are}: `mug.x`, `mug.y` in
metres and `mug.theta` in radians for every object, and `phi.LABEL`, the satisfaction value of each label: 0 or more
where it holds, the lower the harder. Heights, shapes and the workspace are in the header, under the key `scenegen` of
each file's metadata.
{drawn}
{asked} The
same request with scenegen {request["scenegen"]} and numpy {request["numpy"]} gives the same bytes.

| label | lowest phi | mean | highest |
| --- | ---: | ---: | ---: |
{rows}

The spec:

```
{spec["source"].rstrip()}
```
"""


SIZES = (
    (1_000, "n<1K"),
    (10_000, "1K<n<10K"),
    (100_000, "10K<n<100K"),
    (1_000_000, "100K<n<1M"),
    (10_000_000, "1M<n<10M"),
    (100_000_000, "10M<n<100M"),
    (1_000_000_000, "100M<n<1B"),
    (math.inf, "n>1B"),
)


def front_matter(title: str, license: str, scenes: int, configs: Mapping[str, str]) -> str:
    """What data hubs read at the top of a card; `configs` are the files of each part by its name."""
    parts = "\n".join(f"- config_name: {name}\n  data_files: {files}" for name, files in configs.items())
    return f"""---
pretty_name: {quoted(title)}
license: {license}
tags:
- robotics
- scene-generation
- scenegen
size_categories:
- {size_category(scenes)}
configs:
{parts}
---"""


def size_category(scenes: int) -> str:
    """The category of a number of scenes, as dataset hubs name it."""
    return next(name for most, name in SIZES if scenes < most)


def _range(low: float | None, high: float | None) -> str:
    return f"{'' if low is None else format(low, 'g')}:{'' if high is None else format(high, 'g')}"


def quoted(text: str) -> str:
    """A text as YAML."""
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'
