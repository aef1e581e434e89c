"""Moving one scene until phi is where it should be, by Newton steps along the gradient of phi, in numpy.

`sampling/refine.py` does the same for thousands of scenes of a model at once, in torch. Here phi is differentiated by
central differences: all shifted copies of the scene are one batch, and figures need no torch.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from scenegen.lang.core import Atom, Core, Junction, read_rows
from scenegen.lang.interpret import evaluate
from scenegen.pose import THETA, TWO_PI, along, object_count
from scenegen.primitives import NUMPY
from scenegen.scene.workspace import Workspace

Array = npt.NDArray[np.float64]

SOFT_STEPS, HARD_STEPS = 20, 20  # as in sampling/refine.py, like all that follows but the last two
BETA = 10.0
LONGEST = 0.25
SOFT_DAMPING, HARD_DAMPING = 0.1, 1e-9
SHIFT = 1e-6  # of the workspace, or radians: how far copies are apart of which phi is compared
LIVE = 1 << 22  # numbers that are alive at a time


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
        shares = [atom_shares(core, values, node, BETA if soft else None) for node in tops]
        jacobian = gradients(core, row, shares, moving, SHIFT * scale) * scale[moving]
        shift = _newton(jacobian, (target - phi)[off], SOFT_DAMPING if soft else HARD_DAMPING)
        row[moving] += scale[moving] * shift
        theta = row[along(THETA)]
        theta %= TWO_PI
        theta[theta >= TWO_PI] = 0.0  # to which rounding can bring what is just below 0
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
    size = max(1, LIVE // (2 * len(core.nodes)))
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
    return np.asarray(step * min(1.0, LONGEST / longest))
