"""One layout from hard to solved: scenes that follow one another by the shortest moves."""

from __future__ import annotations

import numpy as np

from scenegen.api.approach import approach
from scenegen.api.labels import chosen_label
from scenegen.api.scene_arrays import Array, SceneArrays, make_header, rows_of, stored_rows
from scenegen.bounds import spec_bounds
from scenegen.errors import RequestError
from scenegen.errors.requests import NO_SCENES
from scenegen.lang.check import check_text
from scenegen.lang.core import REQUIRE, gated, part
from scenegen.lang.interpret import phi as score
from scenegen.lang.spec import CheckedSpec
from scenegen.pose import as_poses, row_count, span_of
from scenegen.primitives import NUMPY
from scenegen.scene.data import RequestData

HARD = -0.25  # phi that a hard scene has at most, if it can be so low
DRAWN = 512  # scenes among which one is looked for where the set has none that hard
DONE = 0.05  # phi that a sweep reaches at the least, if it can be so high
NEAR = 0.002  # how far from its target the phi of a scene may be
MARGIN = 1e-4  # by which requirements are kept


def sweep(scenes: SceneArrays, label: str | None = None, frames: int = 24) -> tuple[SceneArrays, str]:
    """Scenes in which one layout goes from hard to solved, and the label that this is about.

    It starts at the set's hardest scene or, where all are nearly solved, at one drawn from the base distribution.
    Objects are moved by Newton steps along the gradient of phi, each scene from the one before it, up to what the set
    reaches at most, or to `DONE`; what the spec requires holds on the way, and what stands on one of several
    surfaces stays there. Where the number of things is drawn, it is that of the hardest scene. `label` is by default
    the first one. Fewer than `frames` scenes come back where some phi cannot be had. Raises RequestError for an unknown
    label and for a set without scenes.
    """
    if not len(scenes):
        raise RequestError(NO_SCENES())
    spec = check_text(scenes.header.spec.source, "the spec of these scenes")
    chosen = chosen_label(spec.labels, label)
    if scenes.header.counts:
        spec, scenes = _hardest_numbers(spec, scenes, chosen)
    core = gated(spec.core)
    start = _start(spec, rows_of(spec, scenes), chosen)
    here = float(np.min(score(core, list(start), NUMPY)[chosen]))
    reached = float(scenes.phi[chosen].max()) if chosen in scenes.phi else DONE
    solved = min(max(DONE, reached), 0.98 * spec_bounds(spec)[chosen][1])
    targets = np.linspace(here, max(solved, here), frames)
    rows = np.concatenate([start, *_walk(spec, start, chosen, targets[1:])], axis=1)
    phi = score(core, list(rows), NUMPY)
    header = make_header(
        spec, {"method": "sweep"}, RequestData(phi={chosen: (here, float(targets[-1]))}, n=rows.shape[1])
    )
    placed = row_count(len(spec.objects))
    poses = np.ascontiguousarray(as_poses(rows[:placed]))
    on = stored_rows(spec, rows)[placed:].T if spec.choices else None
    values = {name: np.array(np.broadcast_to(phi[name], len(poses))) for name in spec.labels}
    return SceneArrays(poses, values, header, on=on), chosen


def _hardest_numbers(spec: CheckedSpec, scenes: SceneArrays, label: str) -> tuple[CheckedSpec, SceneArrays]:
    """The scenes with as many things as the hardest has, and the spec that these are of."""
    hardest = int(scenes.phi[label].argmin()) if label in scenes.phi else 0
    found = next((numbers, which) for numbers, which in scenes.parts() if hardest in which)
    return check_text(spec.source, spec.name, found[0]), scenes.only(*found)


def _start(spec: CheckedSpec, rows: Array, label: str) -> Array:
    """(3N, 1): a hard scene."""
    core = gated(spec.core)
    low, high = spec.workspace.box(len(core.objects))
    drawn = np.random.default_rng(0).uniform(low[:, None], high[:, None], size=(len(low), DRAWN))
    for index, pose in spec.fixed.items():
        drawn[span_of(index, len(pose))] = np.array(pose)[:, None]
    for some in (rows, drawn):
        phi = {name: np.broadcast_to(value, some.shape[1]) for name, value in score(core, list(some), NUMPY).items()}
        allowed = phi.get(REQUIRE, np.zeros(some.shape[1])) >= 0.0
        hard = np.flatnonzero(allowed & (phi[label] <= HARD))
        if len(hard):
            # Of those that are hard enough, the easiest: the way from there is the shortest to follow.
            return np.ascontiguousarray(some[:, hard[np.argmax(phi[label][hard])], None])
    return np.ascontiguousarray(rows[:, np.argmin(score(core, list(rows), NUMPY)[label]), None])


def _walk(spec: CheckedSpec, start: Array, label: str, targets: Array) -> list[Array]:
    """Scenes (3N, 1) at each target in turn, as far as they can be had."""
    core = gated(spec.core)
    core = part(core, [label, *(name for name in core.labels if name == REQUIRE)])
    low, high = np.full(len(core.labels), -np.inf), np.full(len(core.labels), np.inf)
    aim = np.zeros(len(core.labels))
    low[1:], aim[1:] = 0.0, MARGIN  # the requirement, if there is one
    free = np.ones(len(start), dtype=bool)
    for index in spec.fixed:
        free[span_of(index)] = False
    free[row_count(len(spec.objects)) :] = False  # what stands on one of several surfaces stays there
    found: list[Array] = []
    row = start[:, 0]
    for target in map(float, targets):
        low[0], high[0], aim[0] = target - NEAR, target + NEAR, target
        moved = approach(core, spec.workspace, row, aim, low, high, free)
        phi = np.array(list(score(core, moved.tolist()).values()))
        if ((phi >= low) & (phi <= high)).all():
            row = moved
            found.append(row[:, None])
    return found
