"""What the page needs to know of a spec to draw its scenes and to speak of them."""

from __future__ import annotations

import hashlib
import json
import math
from dataclasses import asdict
from functools import lru_cache
from typing import Any

import numpy as np

from scenegen.api.outline import Outline
from scenegen.api.scene_arrays import make_header
from scenegen.api.spec import Spec
from scenegen.geometry import Box, Circle, Footprint
from scenegen.geometry.footprint import corners
from scenegen.lang.formula.core import REQUIRE
from scenegen.scenes.data import RAISED, ObjectData, RequestData, SceneFile, carried_first
from scenegen.scenes.stage import TALLEST, TALLEST_DECLARED, WOOD, PictureObject, PictureSetup, stage_of
from scenegen.show.view.jobs import trees as timed
from scenegen.show.view.jobs.trees import Trees
from scenegen.show.view.limits import most_scenes
from scenegen.things.palette import mix


def describe(spec: Spec) -> dict[str, Any]:
    """Objects, regions and labels of a spec, and its formulas as trees."""
    checked = spec.declared
    header = header_of(spec)
    stage = stage_of_spec(spec)
    bounds = spec.bounds()
    trees = formulas_of(spec)
    return {
        "sha256": checked.sha256,
        "source": checked.source,
        "title": checked.title,
        "workspace": {"x": list(checked.workspace.x), "y": list(checked.workspace.y)},
        "table": list(stage.table),
        "thickness": stage.thickness,
        "tall": _tall(header, stage),
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
                "surfaces": surfaces_of(header.objects[index]),
            }
            for index, (name, shape, thing) in enumerate(zip(spec.objects, checked.shapes, stage.things, strict=True))
        ],
        "regions": [
            {
                "name": region.name,
                "footprint": footprint_data(patch.footprint),
                "pose": list(patch.pose),
                "color": list(patch.color),
                "height": patch.height,
                "board": list(mix(patch.color, WOOD, 0.5)),
            }
            for region, patch in zip(checked.regions, stage.patches, strict=True)
        ],
        "labels": [{"name": name, "bounds": plain(bounds[name])} for name in spec.labels],
        "requires": REQUIRE in trees,
        "trees": trees,
        "time": _time(spec),
        "most": most_scenes(len(spec.objects)) if spec.horizon is None else timed.most_of(spec),
    }


def _time(spec: Spec) -> dict[str, Any] | None:
    """How long a motion lasts; None where the spec is about single scenes."""
    if spec.horizon is None:
        return None
    return {"steps": spec.horizon.steps, "dt": spec.horizon.dt, "moves": spec.moves}


def numbers_data(family: Spec, numbers: dict[str, int]) -> list[dict[str, Any]]:
    """The numbers of things that a spec draws: those of which it has how many now, and between what. Of an object of a
    category, the number is that of its asset, from 1."""
    return [
        {"name": name, "least": least, "most": most, "now": numbers[name], "assets": list(family.assets.get(name, ()))}
        for name, (least, most) in family.counts.items()
    ]


def formulas_of(spec: Spec) -> dict[str, Any]:
    """The formula of each label, and what is required, as a tree."""
    if spec.over_time is None:
        return trees_of(spec).trees
    return timed.trees_of(spec).trees


def plain(ends: tuple[float, float]) -> list[float]:
    """Bounds that a plot can have: windows that look beyond the last moment have infinite ones."""
    return [one if math.isfinite(one) else math.copysign(1.0, one) for one in ends]


def surfaces_of(item: ObjectData) -> list[str]:
    """What an object is declared to stand on: one of these in each scene. Nothing where that follows from its pose,
    "workspace" for the table where it is one of several."""
    if item.support is None:
        return []
    if item.support.z is None:
        return [one.on or "workspace" for one in item.support.any]
    return [item.support.on] if item.support.on else []


def _tall(header: SceneFile, stage: PictureSetup) -> float:
    """How high a picture has to reach above the table in any scene, in metres: over boards, and what stands highest."""
    known = np.array([0.0 if one.support is None else one.support.z or 0.0 for one in header.objects])
    place = {one.name: number for number, one in enumerate(header.objects)}
    for which in carried_first(header.objects):
        support = header.objects[which].support
        assert support is not None
        known[which] = max(one.rise + (known[place[one.carrier]] if one.carrier else 0.0) for one in support.any)
    tops = [base + thing.shape.height for base, thing in zip(known.tolist(), stage.things, strict=True)]
    boards = [patch.height for patch in stage.patches]
    raised = header.version == RAISED or any(boards)
    return min(max([*tops, *boards], default=0.0), (TALLEST_DECLARED if raised else TALLEST) * stage.side)


@lru_cache(maxsize=2)
def header_of(spec: Spec) -> SceneFile:
    """A scene file of a spec without any scene."""
    return make_header(spec.declared, {}, RequestData(phi={}, n=1, spread="flat"))


@lru_cache(maxsize=2)
def stage_of_spec(spec: Spec) -> PictureSetup:
    """The table of a spec without any scene on it."""
    return stage_of(header_of(spec))


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


def mesh_key(thing: PictureObject) -> str:
    """A name for what an object looks like: two objects of one key share a mesh."""
    facts = [thing.shape.asset, asdict(thing.shape)["footprint"], thing.shape.height, list(thing.color)]
    return hashlib.sha256(json.dumps(facts).encode()).hexdigest()[:16]
