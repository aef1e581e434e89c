"""The base distribution: every free object's centre uniform over the workspace, its heading over the circle."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from scenegen.pose import LENGTHS, THETA, TWO_PI, along, object_count
from scenegen.scene.workspace import Workspace

Array = npt.NDArray[np.float64]


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
    rows[along(THETA)] = wrap_heading(rows[along(THETA)])
    return rows


def wrap_heading(theta: Tensor) -> Tensor:
    """Headings wrapped to [0, 2 pi); where rounding gives 2 pi itself, the result is 0."""
    theta = torch.remainder(theta, TWO_PI)
    return torch.where(theta >= TWO_PI, torch.zeros_like(theta), theta)


def clamp_to(workspace: Workspace, rows: Tensor, held: tuple[Tensor, Tensor] | None = None) -> Tensor:
    """Scenes with every centre moved to the nearest point of the workspace and headings in [0, 2 pi).

    `held` are the rows that must not move: indices (H,) and their values (H,).
    """
    out = rows.clone()
    for axis in LENGTHS:
        low, high = (torch.from_numpy(ends)[:, None].to(out) for ends in workspace.ends(axis, object_count(len(rows))))
        out[along(axis)] = out[along(axis)].clamp(low, high)
    out[along(THETA)] = wrap_heading(out[along(THETA)])
    if held is not None:
        out[held[0]] = held[1][:, None]
    return out
