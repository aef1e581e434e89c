"""One layout from hard to solved: scenes that follow one another by the shortest moves.

A scene is moved until phi is where it should be, by Newton steps along the gradient of phi, in numpy. `learn/refine.py`
does the same for thousands of scenes of a model at once, in torch. Here phi is differentiated by central differences:
all shifted copies of the scene are one batch, and figures need no torch.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from scenegen.api.outline import chosen_label
from scenegen.api.scene_arrays import SceneArrays, make_header, rows_of, stored_rows
from scenegen.arrays import Array
from scenegen.errors import RequestError
from scenegen.errors.requests import NO_SCENES
from scenegen.geometry import NUMPY
from scenegen.geometry.workspace import Workspace
from scenegen.lang.checker import check_text
from scenegen.lang.formula.core import REQUIRE, Atom, Core, Junction, gate, part_of, read_rows
from scenegen.lang.formula.interpret import evaluate
from scenegen.lang.formula.interpret import phi as score
from scenegen.lang.spec import CheckedSpec
from scenegen.pose import THETA, as_poses, object_count, row_count, rows_along, span_of, wrap_heading
from scenegen.scenes.data import RequestData
from scenegen.search import spec_bounds

HARD_PHI = -0.25  # phi that a hard scene has at most, if it can be so low
SWEEP_CANDIDATES = 512  # scenes among which one is looked for where the set has none that hard
SOLVED_PHI = 0.05  # phi that a sweep reaches at the least, if it can be so high
SWEEP_TOLERANCE = 0.002  # how far from its target the phi of a scene may be
REQUIRE_MARGIN = 1e-4  # by which requirements are kept


def sweep(scenes: SceneArrays, label: str | None = None, frames: int = 24) -> tuple[SceneArrays, str]:
    """Scenes in which one layout goes from hard to solved, and the label that this is about.

    It starts at the set's hardest scene or, where all are nearly solved, at one drawn from the base distribution.
    Objects are moved by Newton steps along the gradient of phi, each scene from the one before it, up to what the set
    reaches at most, or to `SOLVED_PHI`; what the spec requires holds on the way, and what stands on one of several
    surfaces stays there. Where the number of things is drawn, it is that of the hardest scene. `label` is by default
    the first one. Fewer than `frames` scenes come back where some phi cannot be had. Raises RequestError for an unknown
    label and for a set without scenes.
    """
    if not len(scenes):
        raise RequestError(NO_SCENES())
    spec = scenes.header.spec.checked_spec
    chosen = chosen_label(spec.labels, label)
    if scenes.header.counts:
        spec, scenes = _hardest_numbers(spec, scenes, chosen)
    core = gate(spec.core)
    start = _start(spec, rows_of(spec, scenes), chosen)
    here = float(np.min(score(core, list(start), NUMPY)[chosen]))
    reached = float(scenes.phi[chosen].max()) if chosen in scenes.phi else SOLVED_PHI
    solved = min(max(SOLVED_PHI, reached), 0.98 * spec_bounds(spec)[chosen][1])
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
    core = gate(spec.core)
    low, high = spec.workspace.box(len(core.objects))
    drawn = np.random.default_rng(0).uniform(low[:, None], high[:, None], size=(len(low), SWEEP_CANDIDATES))
    for index, pose in spec.fixed.items():
        drawn[span_of(index, len(pose))] = np.array(pose)[:, None]
    for some in (rows, drawn):
        phi = {name: np.broadcast_to(value, some.shape[1]) for name, value in score(core, list(some), NUMPY).items()}
        allowed = phi.get(REQUIRE, np.zeros(some.shape[1])) >= 0.0
        hard = np.flatnonzero(allowed & (phi[label] <= HARD_PHI))
        if len(hard):
            # Of those that are hard enough, the easiest: the way from there is the shortest to follow.
            return np.ascontiguousarray(some[:, hard[np.argmax(phi[label][hard])], None])
    return np.ascontiguousarray(rows[:, np.argmin(score(core, list(rows), NUMPY)[label]), None])


def _walk(spec: CheckedSpec, start: Array, label: str, targets: Array) -> list[Array]:
    """Scenes (3N, 1) at each target in turn, as far as they can be had."""
    core = gate(spec.core)
    core = part_of(core, [label, *(name for name in core.labels if name == REQUIRE)])
    low, high = np.full(len(core.labels), -np.inf), np.full(len(core.labels), np.inf)
    aim = np.zeros(len(core.labels))
    low[1:], aim[1:] = 0.0, REQUIRE_MARGIN  # the requirement, if there is one
    free = np.ones(len(start), dtype=bool)
    for index in spec.fixed:
        free[span_of(index)] = False
    free[row_count(len(spec.objects)) :] = False  # what stands on one of several surfaces stays there
    found: list[Array] = []
    row = start[:, 0]
    for target in map(float, targets):
        low[0], high[0], aim[0] = target - SWEEP_TOLERANCE, target + SWEEP_TOLERANCE, target
        moved = approach(core, spec.workspace, row, aim, low, high, free)
        phi = np.array(list(score(core, moved.tolist()).values()))
        if ((phi >= low) & (phi <= high)).all():
            row = moved
            found.append(row[:, None])
    return found


SOFT_STEPS, HARD_STEPS = 20, 20  # as in learn/refine.py, like all that follows but the last two
SOFTMAX_BETA = 10.0
MAX_SWEEP_STEP = 0.25
SOFT_DAMPING, HARD_DAMPING = 0.1, 1e-9
SHIFT = 1e-6  # of the workspace, or radians: how far copies are apart of which phi is compared
MAX_COPY_NUMBERS = 1 << 22  # numbers that are alive at a time


def approach(
    core: Core, workspace: Workspace, row: Array, target: Array, low: Array, high: Array, free: npt.NDArray[np.bool_]
) -> Array:
    """A scene (3N,) moved until phi of every label lies within [low, high], (L,) each, where it can be done.

    `target` (L,) is where a label that is out of its range is headed. `free` (3N,) tells the rows that may move.
    Positions stay in the workspace. A scene that does not arrive is returned as it is: the caller verifies.
    """
    row = row.copy()
    scale = np.tile(workspace.scales, object_count(len(row)))
    moving = np.array([index for index in sorted(read_rows(core)) if free[index]], dtype=np.intp)
    lowest, highest = workspace.box(object_count(len(row)))
    for step in range(SOFT_STEPS + HARD_STEPS):
        soft = step < SOFT_STEPS
        values = evaluate(core, row.tolist())
        phi = np.array([values[node] for node in core.labels.values()])
        off = (phi < low) | (phi > high)
        if not off.any():
            break
        tops = [node for node, out in zip(core.labels.values(), off, strict=True) if out]
        shares = [atom_shares(core, values, node, SOFTMAX_BETA if soft else None) for node in tops]
        jacobian = gradients(core, row, shares, moving, SHIFT * scale) * scale[moving]
        shift = _newton(jacobian, (target - phi)[off], SOFT_DAMPING if soft else HARD_DAMPING)
        row[moving] += scale[moving] * shift
        row[rows_along(THETA)] = wrap_heading(np, row[rows_along(THETA)])
        row[moving] = np.clip(row, lowest, highest)[moving]
    return row


def atom_shares(core: Core, values: list[float], top: int, beta: float | None) -> dict[int, float]:
    """How much phi of a formula changes with the margin of each of its atoms, given the value of every node.

    Without `beta` the active atom has all of it. With it, junctions share by softmax weights, as in the
    straight-through gradient of `Robustness`.
    """
    waiting, found = {top: 1.0}, {}
    # Parents come after their children on the tape, so going downwards meets every node after all who point to it.
    for index in range(top, -1, -1):
        share = waiting.pop(index, 0.0)
        node = core.nodes[index]
        if not share:
            continue
        if not isinstance(node, Junction):
            found[index] = share
            continue
        if beta is None:
            weights = {next(arg for arg in node.args if values[arg] == values[index]): 1.0}
        else:
            each = [math.exp(-beta * abs(values[arg] - values[index])) for arg in node.args]
            weights = {}
            for arg, weight in zip(node.args, each, strict=True):  # an argument may occur twice
                weights[arg] = weights.get(arg, 0.0) + weight / sum(each)
        for arg, weight in weights.items():
            waiting[arg] = waiting.get(arg, 0.0) + share * weight
    return found


def gradients(
    core: Core, row: Array, shares: list[dict[int, float]], moving: npt.NDArray[np.intp], shift: Array
) -> Array:
    """(K, D): the derivative of K weighted sums of atoms by D rows of a scene (3N,), which are moved by `shift` (3N,)
    both ways."""
    atoms = sorted({atom for weights in shares for atom in weights})
    weights = np.array([[mine.get(atom, 0.0) for atom in atoms] for mine in shares])
    assert all(isinstance(core.nodes[atom], Atom) for atom in atoms)
    out = np.empty((len(shares), len(moving)))
    size = max(1, MAX_COPY_NUMBERS // (2 * len(core.nodes)))
    for start in range(0, len(moving), size):
        some = moving[start : start + size]
        count = len(some)
        copies = np.repeat(row[:, None], 2 * count, axis=1)
        copies[some, np.arange(count)] += shift[some]
        copies[some, count + np.arange(count)] -= shift[some]
        values = evaluate(core, list(copies), NUMPY)
        sums = weights @ np.stack([np.broadcast_to(values[atom], 2 * count) for atom in atoms])
        out[:, start : start + size] = (sums[:, :count] - sums[:, count:]) / (2.0 * shift[some])
    return out


def _newton(jacobian: Array, residual: Array, damping: float) -> Array:
    """The shortest step (D,) that closes the residual (K,) to first order, with bounded coordinates."""
    gram = jacobian @ jacobian.T
    gram += damping * max(float(gram.diagonal().max()), 1e-12) * np.eye(len(gram))
    step = jacobian.T @ np.linalg.solve(gram, residual)
    longest = max(float(np.abs(step).max(initial=0.0)), 1e-300)
    return np.asarray(step * min(1.0, MAX_SWEEP_STEP / longest))
