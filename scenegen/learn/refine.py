"""Moving scenes onto their target by Newton steps along the gradient of phi.

The step for labels with residual r and Jacobian J (one row per label) is the shortest one that reaches the target to
first order, J^T (J J^T)^-1 r; with one label this is (target - phi) g / |g|^2. The first steps follow the
straight-through gradient, which moves all objects involved, not only those of the active atom; the last steps follow
the exact gradient, which converges.
"""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from scenegen.arrays import Array
from scenegen.geometry.workspace import Workspace
from scenegen.learn.robustness import Robustness
from scenegen.pose import LENGTHS, THETA, object_count, rows_along, wrap_heading
from scenegen.search.effort import NEVER, Stop

# The base distribution: every free object's centre uniform over the workspace, its heading over the circle.


def piece_generator(seed: int, piece: int, stream: int = 0) -> torch.Generator:
    """The random numbers of piece k. Uses with different `stream` get independent random numbers."""
    state = np.random.SeedSequence([seed, stream, piece]).generate_state(1, np.uint64)
    return torch.Generator().manual_seed(int(state[0] >> np.uint64(1)))


def draw(lowest: Array, highest: Array, count: int, generator: torch.Generator) -> Tensor:
    """`count` scenes uniform over a box of poses as (3N, count) float64 storage.

    `lowest` and `highest` are (3N,): CheckedSpec.box() for the base distribution without its requirement. A row whose
    ends are equal has exactly that value, but uses random numbers like the others.
    """
    low, high = torch.from_numpy(lowest)[:, None], torch.from_numpy(highest)[:, None]
    rows = torch.rand(len(lowest), count, generator=generator, dtype=torch.float64)
    rows.mul_(high - low).add_(low)
    torch.minimum(rows, high, out=rows)
    rows[rows_along(THETA)] = wrap_heading(torch, rows[rows_along(THETA)])
    return rows


def clamp_to(workspace: Workspace, rows: Tensor, held: tuple[Tensor, Tensor] | None = None) -> Tensor:
    """Scenes with every centre moved to the nearest point of the workspace and headings in [0, 2 pi).

    `held` are the rows that must not move: indices (H,) and their values (H,).
    """
    out = rows.clone()
    for axis in LENGTHS:
        low, high = (torch.from_numpy(ends)[:, None].to(out) for ends in workspace.ends(axis, object_count(len(rows))))
        out[rows_along(axis)] = out[rows_along(axis)].clamp(low, high)
    out[rows_along(THETA)] = wrap_heading(torch, out[rows_along(THETA)])
    if held is not None:
        out[held[0]] = held[1][:, None]
    return out


SOFT_STEPS = 20
HARD_STEPS = 20
BETA = 10.0
MAX_REFINE_STEP = 0.25  # of the workspace, or radians: the longest step of a coordinate, since J is valid only nearby
# Far from the target the labels' gradients are often nearly parallel; the exact step is then a long jump sideways.
SOFT_DAMPING, HARD_DAMPING = 0.1, 1e-9


def refine(
    robustness: Robustness,
    workspace: Workspace,
    rows: Tensor,
    target: Tensor,
    low: Tensor,
    high: Tensor,
    held: tuple[Tensor, Tensor] | None = None,
    stop: Stop = NEVER,
) -> Tensor:
    """Scenes (3N, B) float64 moved until phi of every label lies within [low, high], (L, B) each, if possible.

    `target` (L, B) is the goal of labels that are out of their range; labels within their range are ignored until they
    leave it. Scenes that arrive stop moving. Positions stay in the workspace, and the rows in `held` (indices and
    values) keep their values. Scenes that do not arrive are returned as they are: the caller verifies. Raises what
    `stop` raises.
    """
    rows = clamp_to(workspace, rows, held)
    scale = torch.tensor(workspace.scales, dtype=rows.dtype).repeat(object_count(len(rows)))[:, None]
    if held is not None:
        scale[held[0]] = 0.0
    active = torch.arange(rows.shape[1])
    for step in range(SOFT_STEPS + HARD_STEPS):
        stop.check()
        part = rows[:, active].detach().requires_grad_(True)
        phi = robustness.rows(part, beta=BETA if step < SOFT_STEPS else None, check=False)
        value = phi.detach()
        off = (value < low[:, active]) | (value > high[:, active])
        moving = off.any(dim=0)
        if not bool(moving.any()):
            break
        jacobian = (_jacobian(phi, part, stop) * scale * off[:, None, :])[:, :, moving]
        residual = torch.where(off, target[:, active] - value, torch.zeros_like(value))[:, moving]
        active = active[moving]
        damping = SOFT_DAMPING if step < SOFT_STEPS else HARD_DAMPING
        moved = part.detach()[:, moving] + scale * newton(jacobian, residual, damping)
        rows[:, active] = clamp_to(workspace, moved, held)
    return rows


def _jacobian(phi: Tensor, rows: Tensor, stop: Stop) -> Tensor:
    """(L, 3N, B): the gradient of each label; scenes do not influence each other, so one backward pass per label is
    enough."""
    sweeps: list[Tensor] = []
    for label in range(phi.shape[0]):
        stop.check()
        sweeps += torch.autograd.grad(phi[label].sum(), rows, retain_graph=label + 1 < phi.shape[0])
    return torch.stack(sweeps)


def newton(
    jacobian: Tensor, residual: Tensor, damping: float, longest: float = MAX_REFINE_STEP, least: float = 1e-12
) -> Tensor:
    """The shortest step (3N, B) that closes the residual (L, B) to first order; no coordinate goes further than
    `longest`. What labels should not move has zeros in the jacobian (L, 3N, B) and the residual.

    Positions count in widths and heights of the workspace: a table of 20 m is refined like one of 1 m.
    """
    gram = torch.einsum("ldb,mdb->blm", jacobian, jacobian)
    # Labels with equal or vanishing gradients make the matrix singular; damping makes the step merely shorter.
    scale = gram.diagonal(dim1=1, dim2=2).amax(dim=1).clamp_min(least)
    gram = gram + (damping * scale)[:, None, None] * torch.eye(gram.shape[1], dtype=gram.dtype)
    weights = torch.linalg.solve(gram, residual.T[:, :, None])[:, :, 0]
    return limit_step(torch.einsum("ldb,bl->db", jacobian, weights), longest)


def limit_step(step: Tensor, longest: float) -> Tensor:
    """Steps (3N, B), shortened to those of which no coordinate goes further than `longest`."""
    return step * (longest / step.abs().amax(dim=0).clamp_min(1e-300)).clamp_max(1.0)
