"""phi of scenes that a person has moved, and why it is what it is."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from functools import lru_cache
from typing import Any

import numpy as np

from scenegen.api.outline import FormulaTree, Outline, OutlinePart
from scenegen.api.scene_arrays import make_header, rows_of
from scenegen.api.scenes import SceneSet, requirement
from scenegen.api.scenes import evaluate as score
from scenegen.api.spec import Spec
from scenegen.arrays import Array
from scenegen.errors import DataError
from scenegen.errors.program import NO_MESSAGE
from scenegen.geometry import NUMPY
from scenegen.lang.formula.core import Core
from scenegen.lang.formula.interpret import deciding_atom, is_constant, settled_atoms
from scenegen.lang.formula.interpret import evaluate as interpret
from scenegen.lang.sights import sights_of
from scenegen.lang.spec import CheckedSpec
from scenegen.looks.overlay import hand_outlines
from scenegen.looks.usual import usual_places
from scenegen.page.jobs.source import (
    MAX_LINE_NODES,
    Json,
    decider_json,
    line_of,
    numbers_of,
    spec_of,
    stage_of_spec,
    tree_of,
)
from scenegen.page.limits import MAX_POSES
from scenegen.scenes.data import RequestData, SceneFile, heights_of
from scenegen.things.surfaces import base_heights, overlapping


def evaluate(message: dict[str, Any]) -> Iterator[Any]:
    """phi of each scene in `poses`, (n, N, 3), by the reader that `scenegen eval` uses; `on` (n, M) says on which of
    their surfaces objects stand. With `why` also the value of every line of the trees and the atom that decides each
    label, of the first scene. Of a spec over time `poses` are motions, (n, T + 1, N, 3), and `why` is about the first
    one."""
    spec = spec_of(message)
    if spec.over_time is not None:
        from scenegen.page.jobs import motions

        found = motions.motions_of(spec, message["poses"])
        why = motions.reasons(spec, found[0]) if message.get("why") else {}
        yield {**motions.phi_json(spec, found), **why}
        return
    scenes = scene_set(spec, message["poses"], on=message.get("on"))
    yield evaluation_json(spec, scenes, bool(message.get("why")))


def scene_set(spec: Spec, poses: object, sampler: Mapping[str, Any] | None = None, on: object = None) -> SceneSet:
    """Poses as they come from a page, and where there are choices the surfaces: (n, M) numbers, counted from 1. Raises
    DataError for what are no poses of the spec's objects, or no surfaces of its choices."""
    array = numbers_of(poses)
    count = len(spec.objects)
    if array.ndim != 3 or array.shape[1:] != (count, 3) or not np.isfinite(array).all():
        raise DataError(NO_MESSAGE(reason=f"no poses of {count} objects"))
    if array.shape[0] * count > MAX_POSES:
        raise DataError(NO_MESSAGE(reason="too many scenes at a time"))
    header = make_header(spec.checked, sampler or {}, RequestData(phi={}, n=max(1, len(array)), spread="flat"))
    scenes = SceneSet(array, {}, header, on=_surfaces(header, len(array), on))
    return replace(scenes, phi=score(spec.checked, scenes), trusted=True)


def _surfaces(header: SceneFile, count: int, on: object) -> Array | None:
    """The surfaces of `count` scenes, (n, M); None where a spec has no choices. Raises DataError."""
    choosers = header.choosers
    if not choosers:
        return None
    found = numbers_of(on)
    most = [len(one.support.any) for one in choosers if one.support is not None]
    fits = found.shape == (count, len(choosers)) and bool(((found >= 1) & (found <= most) & (found % 1 == 0)).all())
    if not fits:
        raise DataError(NO_MESSAGE(reason=f"no surfaces for the {len(choosers)} objects that stand on one of several"))
    return found


def evaluation_json(spec: Spec, scenes: SceneSet, why: bool) -> dict[str, Any]:
    """What the page shows of scenes."""
    required = requirement(spec.checked, scenes)
    found: dict[str, Any] = {
        "phi": {name: values.tolist() for name, values in scenes.phi.items()},
        "require": None if required is None else required.tolist(),
        "bases": bases_of(spec, scenes).tolist(),
        "on": None if scenes.on is None else scenes.on.astype(int).tolist(),
    }
    if why:
        found |= reasons(spec, scenes)
    return found


def scenes_json(spec: Spec, scenes: SceneSet, *notes: str) -> dict[str, Any]:
    """Scenes that are there already, as the job `sample` sends those that it draws."""
    made = {"poses": scenes.poses.tolist(), "sampler": scenes.header.sampler}
    return {**evaluation_json(spec, scenes, False), **made, "warnings": [], "notes": list(notes), "took": 0.0}


def bases_of(spec: Spec, scenes: SceneSet) -> Array:
    """How high above the table each object stands, in metres: (n, N)."""
    stage = stage_of_spec(spec)
    declared = stage.declared if scenes.on is None else heights_of(scenes.header, scenes.on)
    return base_heights([thing.shape for thing in stage.things], scenes.poses, declared=declared)


def reasons(spec: Spec, scenes: SceneSet) -> dict[str, Any]:
    """Of the first scene: the value of every line of the trees, what decides each label, and what overlaps."""
    trees = trees_of(spec)
    core = trees.core
    rows = rows_of(spec.checked, scenes)[:, :1]
    values = [float(np.asarray(value).reshape(-1)[0]) for value in interpret(core, list(rows), NUMPY)]
    plain = rows[:, 0].tolist()
    shapes = [thing.shape for thing in stage_of_spec(spec).things]
    declared = bases_of(spec, scenes)[:1] if spec.checked.declares_heights else None
    pairs = overlapping(shapes, scenes.poses[:1], declared)[0]
    return {
        "values": trees.values(values),
        "decides": {label: _decides(spec, label, values, plain) for label in core.labels},
        "overlaps": [[spec.objects[a], spec.objects[b]] for a, b in pairs],
        **_sights(spec.checked, rows),
        **_usual(spec.checked, rows[:, 0]),
    }


def _usual(spec: CheckedSpec, row: Array) -> dict[str, Any]:
    """Where the things with priors usually are, in a scene (3M,)."""
    return {"usual": [asdict(one) for one in usual_places(spec, row)]} if spec.priors else {}


def _sights(spec: CheckedSpec, rows: Array) -> dict[str, Any]:
    """Of a scene's rows (3M, 1): the shares that cameras see, and the hands that formulas try, each at its best yaw, as
    outlines in the frame of the object."""
    sights = sights_of(spec)
    if sights is None:
        return {}
    return {
        "seen": [
            {"camera": one.camera, "thing": one.thing, "share": float(one.share[0]), "words": one.words(0)}
            for one in sights.views(rows)
        ],
        "hands": [
            {
                "thing": one.thing,
                "robot": one.robot,
                "yaw": float(one.yaw[0]),
                "room": float(one.room[0]),
                "boxes": hand_outlines(spec, one.thing, one.robot, float(one.yaw[0])),
            }
            for one in sights.grips(rows)
        ],
    }


def _decides(spec: Spec, label: str, values: Sequence[float], rows: Sequence[float]) -> dict[str, Any]:
    trees = trees_of(spec)
    core = trees.core
    met = {atom for atom in trees.settled if values[atom] >= 0.0 or is_constant(core, atom)}
    phi = values[core.labels[label]]
    index = deciding_atom(core, label, values, met or None)
    if values[index] < phi:  # what does not change lifts phi, as one of several: it decides
        index = deciding_atom(core, label, values)
    lines = [number for number, nodes in enumerate(trees.groups) if nodes[0] == index or index in nodes]
    found = {**decider_json(core, index, label, values[index], lines, rows), "settled": index in trees.settled}
    if values[index] != phi:  # another atom, which no move of an object changes, is phi
        keeper = deciding_atom(core, label, values, ())
        found["keeper"] = decider_json(core, keeper, label, values[keeper], [], rows)
    return found


# The formulas of a spec as trees: what repeats is folded into one line, and every line knows the nodes of the core that
# it stands for, so that values of a scene can be shown beside it.


class Trees:
    """`trees` maps each label, and `require`, to its tree; where some of the `count`
    objects stand on one of several surfaces, `settled` are the atoms that no move of one changes."""

    def __init__(self, outline: Outline, count: int) -> None:
        self.core: Core = outline.core
        self.settled = settled_atoms(self.core, count) if len(self.core.objects) > count else frozenset[int]()
        self.trees: dict[str, Json] = {}
        self.groups: list[tuple[int, ...]] = []  # by the number of a line: the nodes that it stands for
        self.least: list[bool] = []  # whether the smallest of their values counts, or the largest
        self._folded = FormulaTree(outline)
        for label in outline.labels:
            self.trees[label] = tree_of(self._folded.root(label), self._line)

    def _line(self, part: OutlinePart, least: bool) -> tuple[Json, list[OutlinePart]]:
        number = len(self.groups)
        self.groups.append(part.nodes[:MAX_LINE_NODES])
        self.least.append(least)
        return line_of(self.core, part, number), self._folded.children(part)

    def values(self, values: Sequence[float]) -> list[float]:
        """The value of every line in one scene, given the value of every node."""
        return [
            (min if least else max)(values[node] for node in nodes)
            for nodes, least in zip(self.groups, self.least, strict=True)
        ]


@lru_cache(maxsize=2)
def trees_of(spec: Spec) -> Trees:
    """The formulas of a spec."""
    return Trees(Outline(spec.checked), len(spec.objects))
