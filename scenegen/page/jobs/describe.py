"""What the page needs to know of a spec to draw its scenes and to speak of them, meshes of its objects among it."""

from __future__ import annotations

import base64
import hashlib
import json
import math
from collections.abc import Collection
from dataclasses import asdict
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from scenegen.api.spec import Spec
from scenegen.geometry import Box, Circle, Footprint
from scenegen.geometry.footprint import corners
from scenegen.lang.formula.core import REQUIRE
from scenegen.lang.spec import CheckedSpec
from scenegen.looks.overlay import frame_of, ring_of
from scenegen.looks.stage import TALLEST, TALLEST_DECLARED, WOOD, PictureObject, PictureSetup
from scenegen.page.jobs import evaluate, motions
from scenegen.page.jobs.source import header_of, stage_of_spec
from scenegen.page.limits import most_scenes
from scenegen.scenes.data import VERSION_WITH_HEIGHTS, ObjectData, SceneFile, carried_first
from scenegen.things import Shape
from scenegen.things.bodies import parts_of
from scenegen.things.mesh import shade_mesh
from scenegen.things.palette import mix


def describe(spec: Spec) -> dict[str, Any]:
    """Objects, regions and labels of a spec, and its formulas as trees."""
    checked = spec.definition
    header = header_of(spec)
    stage = stage_of_spec(spec)
    bounds = spec.bounds()
    over_time = spec.over_time is not None
    trees = motions.trees_of(spec).trees if over_time else evaluate.trees_of(spec).trees
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
                "ring": _ring(checked, index),
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
        "cameras": [asdict(frame_of(one, stage.table)) for one in checked.cameras],
        "labels": [{"name": name, "bounds": plain(bounds[name])} for name in spec.labels],
        "requires": REQUIRE in trees,
        "trees": trees,
        "time": _time(spec),
        "most": most_scenes(len(spec.objects)) if spec.horizon is None else motions.most_of(spec),
    }


def _ring(spec: CheckedSpec, which: int) -> dict[str, Any] | None:
    """What a robot reaches at the table; None of other objects."""
    arm = spec.shapes[which].arm
    if arm is None:
        return None
    foot = spec.heights[which] if spec.heights else 0.0
    return asdict(ring_of(arm, foot or 0.0))


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
    raised = header.version == VERSION_WITH_HEIGHTS or any(boards)
    return min(max([*tops, *boards], default=0.0), (TALLEST_DECLARED if raised else TALLEST) * stage.side)


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


POSITION_STEPS = 32767  # of the largest coordinate: positions are 16-bit numbers


def meshes_of(spec: Spec, have: Collection[str]) -> dict[str, Any]:
    """The meshes of the spec's objects by key, without those that a page has already."""
    things = {mesh_key(thing): thing for thing in stage_of_spec(spec).things}
    return {key: packed_mesh(one.shape, tuple(one.color)) for key, one in things.items() if key not in have}


@lru_cache(maxsize=256)
def packed_mesh(shape: Shape, color: tuple[float, float, float]) -> dict[str, Any]:
    """Vertices of all parts: `position` in 16-bit steps of `scale` metres, `normal` in 8-bit steps, `color` in bytes,
    `index` in 16 or 32 bits; each as base64 of little-endian numbers."""
    positions, normals, colors = [], [], []
    for part in parts_of(shape, color):
        vertices, normal, _ = shade_mesh(part.mesh)
        positions.append(vertices)
        normals.append(normal)
        colors.append(np.tile(np.array(part.color), (len(vertices), 1)))
    position = np.concatenate(positions)
    scale = max(float(np.abs(position).max()), 1e-9) / POSITION_STEPS
    table = np.concatenate(
        [
            np.round(position / scale),
            np.round(np.concatenate(normals) * 127.0),
            np.round(np.clip(np.concatenate(colors), 0.0, 1.0) * 255.0),
        ],
        axis=1,
    ).astype(np.int64)
    unique, index = _unique(table)
    wide = len(unique) > 65535
    return {
        "scale": scale,
        "position": _text(unique[:, :3].astype("<i2")),
        "normal": _text(unique[:, 3:6].astype("i1")),
        "color": _text(unique[:, 6:].astype("u1")),
        "index": _text(index.reshape(-1).astype("<u4" if wide else "<u2")),
        "wide": wide,
    }


def _unique(table: npt.NDArray[np.int64]) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """The different rows of a (V, 9) table of vertices in order, and where each row is among them. Two numbers hold a
    row, which sorts faster than nine."""
    place = (table[:, :3] + (1 << 15)) @ np.array([1 << 32, 1 << 16, 1])
    rest = (table[:, 3:] + (1 << 7)) @ (1 << np.arange(50, -1, -10))
    order = np.lexsort((rest, place))
    new = np.ones(len(table), dtype=np.int64)
    new[1:] = (np.diff(place[order]) != 0) | (np.diff(rest[order]) != 0)
    index = np.empty(len(table), dtype=np.int64)
    index[order] = np.cumsum(new) - 1
    return table[order[new == 1]], index


def _text(array: Any) -> str:
    return base64.b64encode(np.ascontiguousarray(array).tobytes()).decode()
