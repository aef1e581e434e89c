"""What the page needs to know of a spec to draw its scenes and to speak of them."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict
from functools import lru_cache
from typing import Any

from scenegen.api.outline import Outline
from scenegen.api.scene_arrays import make_header
from scenegen.api.spec import Spec
from scenegen.lang.core import REQUIRE
from scenegen.primitives import Box, Circle, Footprint
from scenegen.primitives.outline import corners
from scenegen.scene.data import RequestData
from scenegen.scene.stage import TALLEST, TALLEST_DECLARED, Stage, Thing, stage_of
from scenegen.view.jobs.tree import Trees


def describe(spec: Spec) -> dict[str, Any]:
    """Objects, regions and labels of a spec, and its formulas as trees."""
    checked = spec.checked
    stage = stage_of_spec(spec)
    trees = trees_of(spec)
    bounds = spec.bounds()
    return {
        "sha256": checked.sha256,
        "source": checked.source,
        "title": checked.title,
        "workspace": {"x": list(checked.workspace.x), "y": list(checked.workspace.y)},
        "table": list(stage.table),
        "thickness": stage.thickness,
        "tall": _tall(stage),
        "objects": [
            {
                "name": name,
                "asset": shape.asset,
                "footprint": footprint_data(thing.shape.footprint),
                "height": thing.shape.height,
                "color": list(thing.color),
                "says": thing.label,
                "mesh": mesh_key(thing),
                "fixed": list(checked.fixed[index]) if index in checked.fixed else None,
            }
            for index, (name, shape, thing) in enumerate(zip(spec.objects, checked.shapes, stage.things, strict=True))
        ],
        "regions": [
            {
                "name": region.name,
                "footprint": footprint_data(patch.footprint),
                "pose": list(patch.pose),
                "color": list(patch.color),
            }
            for region, patch in zip(checked.regions, stage.patches, strict=True)
        ],
        "labels": [{"name": name, "bounds": list(bounds[name])} for name in spec.labels],
        "requires": REQUIRE in trees.trees,
        "trees": trees.trees,
    }


def _tall(stage: Stage) -> float:
    """How high a picture has to reach above the table, in metres."""
    declared = stage.declared or (0.0,) * len(stage.things)
    tops = (base + thing.shape.height for base, thing in zip(declared, stage.things, strict=True))
    return min(max(tops, default=0.0), (TALLEST_DECLARED if stage.declared else TALLEST) * stage.side)


@lru_cache(maxsize=2)
def stage_of_spec(spec: Spec) -> Stage:
    """The table of a spec without any scene on it."""
    return stage_of(make_header(spec.checked, {}, RequestData(phi={}, n=1, spread="flat")))


@lru_cache(maxsize=2)
def trees_of(spec: Spec) -> Trees:
    """The formulas of a spec."""
    return Trees(Outline(spec))


def footprint_data(footprint: Footprint) -> dict[str, Any]:
    """A footprint as the page draws it: a circle, or corners counter-clockwise."""
    if isinstance(footprint, Circle):
        return {"kind": "circle", "radius": footprint.radius}
    kind = "box" if isinstance(footprint, Box) else "polygon"
    return {"kind": kind, "corners": [list(corner) for corner in corners(footprint)]}


def mesh_key(thing: Thing) -> str:
    """A name for what an object looks like: two objects of one key share a mesh."""
    facts = [thing.shape.asset, asdict(thing.shape)["footprint"], thing.shape.height, list(thing.color)]
    return hashlib.sha256(json.dumps(facts).encode()).hexdigest()[:16]
