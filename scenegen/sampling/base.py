"""The base distribution: every free object's centre uniform over the workspace, its heading over the circle."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from scenegen.scene.workspace import TWO_PI, Workspace

Array = npt.NDArray[np.float64]


def piece_generator(seed: int, piece: int, stream: int = 0) -> torch.Generator:
    """The random numbers of piece k. `stream` parts uses that must not share them."""
    state = np.random.SeedSequence([seed, stream, piece]).generate_state(1, np.uint64)
    return torch.Generator().manual_seed(int(state[0] >> np.uint64(1)))


def draw(lowest: Array, highest: Array, count: int, generator: torch.Generator) -> Tensor:
    """`count` scenes uniform over a box of poses as (3N, count) float64 storage.

    `lowest` and `highest` are (3N,): CheckedSpec.box() for the base distribution before its requirement. A row whose
    ends are equal holds that very value, though it takes random numbers like the others.
    """
    low, high = torch.from_numpy(lowest)[:, None], torch.from_numpy(highest)[:, None]
    rows = torch.rand(len(lowest), count, generator=generator, dtype=torch.float64)
    rows.mul_(high - low).add_(low)
    torch.minimum(rows, high, out=rows)
    rows[2::3] = wrap_heading(rows[2::3])
    return rows


def wrap_heading(theta: Tensor) -> Tensor:
    """Headings brought to [0, 2 pi); rounding can land on 2 pi itself, which is 0."""
    theta = torch.remainder(theta, TWO_PI)
    return torch.where(theta >= TWO_PI, torch.zeros_like(theta), theta)


def clamp_to(workspace: Workspace, rows: Tensor, held: tuple[Tensor, Tensor] | None = None) -> Tensor:
    """Scenes with every centre moved to the nearest point of the workspace and headings in [0, 2 pi).

    `held` are rows that may not move, (H,) indices, and their values, (H,).
    """
    out = rows.clone()
    out[0::3].clamp_(*workspace.x)
    out[1::3].clamp_(*workspace.y)
    out[2::3] = wrap_heading(out[2::3])
    if held is not None:
        out[held[0]] = held[1][:, None]
    return out
