"""The card of a set of scenes: its README.md, as hubs of data read it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

from scenegen.scenes.formats.registry import MOTIONS

if TYPE_CHECKING:
    from scenegen.scenes.sets import Manifest
    from scenegen.scenes.stores import Store


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


SIZE_CATEGORIES = (
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
pretty_name: {yaml_string(title)}
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
    return next(name for most, name in SIZE_CATEGORIES if scenes < most)


def _range(low: float | None, high: float | None) -> str:
    return f"{'' if low is None else format(low, 'g')}:{'' if high is None else format(high, 'g')}"


def yaml_string(text: str) -> str:
    """A text as YAML."""
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'
