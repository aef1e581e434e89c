"""The card of a data set of many specs: README.md with front matter as dataset hubs read it, a configuration a spec."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from scenegen.api.sets import quoted, size_category

if TYPE_CHECKING:
    from scenegen.formats.sets import Manifest
    from scenegen.formats.stores import Store


def write_dataset_card(store: Store, manifests: Mapping[str, Manifest], failed: Sequence[str], license: str) -> None:
    """Write the card. Raises OutputError."""
    from scenegen.formats.sets import CARD

    store.write(CARD, dataset_card(manifests, failed, license).encode())


def dataset_card(manifests: Mapping[str, Manifest], failed: Sequence[str], license: str) -> str:
    """The text of the card. It names what is missing: parts that no scene can have, and parts that failed."""
    scenes = sum(one.scenes for one in manifests.values())
    there = {name: one for name, one in manifests.items() if one.shards}
    configs = "\n".join(f"- config_name: {name}\n  data_files: {name}/part-*.parquet" for name in there)
    rows = "\n".join(_row(name, one) for name, one in there.items())
    missing = [f"* {name}: {why}" for name, one in manifests.items() for why in one.missing or ()]
    missing += [f"* {name}: nothing was made" for name in failed]
    missing += [
        f"* {name}: {one.request['n'] - one.scenes:,} of {one.request['n']:,} scenes were not found in time"
        for name, one in manifests.items()
        if not one.complete
    ]
    return f"""---
pretty_name: {quoted("Table-top scenes at every difficulty")}
license: {license}
tags:
- robotics
- scene-generation
- scenegen
size_categories:
- {size_category(scenes)}
configs:
{configs}
---

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
