"""Core formula -> vectorised torch robustness.

Storage is (3N, B): one contiguous row per coordinate (design.md, section 5: 3 to 4 times faster than scenes-first). The
tape is run row-wise with each intermediate freed after its last use, in chunks of scenes that stay in cache.
"""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor

from scenegen.lang.core import Apply, Atom, Const, Coord, Core, Junction, last_uses
from scenegen.primitives import PRIMITIVES
from scenegen.robustness.namespace import TORCH

CHUNK = 65_536  # scenes at a time when no gradient is wanted: intermediates of most specs then stay in cache
LIVE = 1 << 25  # numbers alive at a time; specs of thousands of atoms get smaller chunks


class _Junction(torch.autograd.Function):
    """Hard min or max over the first dimension whose gradient is that of log-sum-exp at sharpness beta.

    The straight-through gradient of design.md, section 5: the value stays exact, and every argument, not the deciding
    one alone, is told where to go, with softmax weights.
    """

    @staticmethod
    def forward(ctx: Any, stacked: Tensor, beta: float) -> Tensor:
        """stacked (K, B) -> (B,); beta < 0 is a minimum."""
        ctx.save_for_backward(stacked)
        ctx.beta = beta
        return stacked.amin(0) if beta < 0 else stacked.amax(0)

    @staticmethod
    def backward(ctx: Any, *grads: Tensor) -> tuple[Tensor, None]:
        (stacked,) = ctx.saved_tensors
        return torch.softmax(ctx.beta * stacked, dim=0) * grads[0], None


class Robustness:
    """phi of every label of a core formula, for any number of scenes.

    Works in the dtype and on the device of its input. Values are the paper's quantitative semantics (Definition 2) with
    hard min and max, in metres and radians; they are differentiable, and `beta` asks for the straight-through gradient.
    """

    def __init__(self, core: Core) -> None:
        self.core = core
        self.labels = tuple(core.labels)
        self.objects = core.objects
        self._dead = last_uses(core)
        self._chunk = max(256, min(CHUNK, LIVE // _most_alive(self._dead)))

    def __call__(self, poses: Tensor, *, beta: float | None = None) -> Tensor:
        """(B, N, 3) poses -> (B, L). No copy is made where `poses` is a view of (3N, B) storage.

        Raises ValueError for another shape or dtype and for NaN or infinite coordinates, TypeError for other arrays.
        """
        if not isinstance(poses, Tensor):
            raise TypeError(f"poses must be a torch tensor, not {type(poses).__name__}; use torch.from_numpy(poses)")
        if poses.ndim != 3 or tuple(poses.shape[1:]) != (len(self.objects), 3):
            want = f"(B, {len(self.objects)}, 3)"
            raise ValueError(
                f"poses must have the shape {want}, one (x, y, theta) per object, not {tuple(poses.shape)}"
            )
        return self.rows(poses.permute(1, 2, 0).reshape(3 * len(self.objects), -1), beta=beta).T

    def rows(self, rows: Tensor, *, beta: float | None = None, check: bool = True) -> Tensor:
        """(3N, B) storage -> (L, B). `check=False` skips the search for NaN and infinity, for inner loops."""
        if rows.ndim != 2 or rows.shape[0] != 3 * len(self.objects):
            raise ValueError(f"rows must have the shape ({3 * len(self.objects)}, B), not {tuple(rows.shape)}")
        if rows.dtype not in (torch.float32, torch.float64):
            raise ValueError(f"coordinates must be float32 or float64, not {str(rows.dtype).removeprefix('torch.')}")
        if check:
            self._refuse_nonfinite(rows)
        if rows.shape[1] <= self._chunk or (rows.requires_grad and torch.is_grad_enabled()):
            return self._run(rows, beta)
        starts = range(0, rows.shape[1], self._chunk)
        return torch.cat([self._run(rows[:, start : start + self._chunk], beta) for start in starts], dim=1)

    def _refuse_nonfinite(self, rows: Tensor) -> None:
        # One sum, at the speed of memory, carries any NaN or infinity; only then is it worth to look where.
        if bool(torch.isfinite(rows.detach().sum())):
            return
        bad = ~torch.isfinite(rows)
        if bool(bad.any()):
            row, scene = (int(index) for index in bad.nonzero()[0])
            name = self.objects[row // 3]
            value = float(rows[row, scene])
            raise ValueError(f"{'xyθ'[row % 3]} of `{name}` in scene {scene} is {value}; coordinates must be finite")

    def _run(self, rows: Tensor, beta: float | None) -> Tensor:
        values: list[Any] = [None] * len(self.core.nodes)
        for index, node in enumerate(self.core.nodes):
            match node:
                case Const(value):
                    # A tensor, not a float: torch.minimum and its kin take tensors only.
                    values[index] = rows.new_tensor(value)
                case Coord():
                    values[index] = rows[node.row]
                case Apply(primitive, args, shapes):
                    values[index] = PRIMITIVES[primitive].evaluate(TORCH, *shapes, *(values[arg] for arg in args))
                case Atom(margin):
                    values[index] = values[margin]
                case Junction(kind, args):
                    values[index] = _junction(kind, [values[arg] for arg in args], beta)
            for child in self._dead[index]:
                values[child] = None
        batch = rows.shape[1]
        return torch.stack([values[node].expand(batch) for node in self.core.labels.values()])


def _most_alive(dead: list[list[int]]) -> int:
    """How many values are alive at once, at most, while the tape runs."""
    alive = most = 1
    for freed in dead:
        alive += 1
        most = max(most, alive)
        alive -= len(freed)
    return most


def _junction(kind: str, args: list[Tensor], beta: float | None) -> Tensor:
    if beta is not None:
        width = max(arg.numel() for arg in args)
        stacked = torch.stack([arg.expand(width) for arg in args])
        result: Tensor = _Junction.apply(stacked, -beta if kind == "min" else beta)  # type: ignore[no-untyped-call]
        return result
    step = torch.minimum if kind == "min" else torch.maximum
    value = args[0]
    for other in args[1:]:
        value = step(value, other)
    return value
