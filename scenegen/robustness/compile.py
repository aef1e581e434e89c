"""Core formula -> vectorised torch robustness.

Storage is (3N, B): one contiguous row per coordinate, 3 to 4 times faster than one row per scene. The
tape is run row-wise with each intermediate freed after its last use, in chunks of scenes that stay in cache; or as one
loop of machine code.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import torch
from torch import Tensor

from scenegen.lang.closest import find, last_uses_of
from scenegen.lang.core import Core, last_uses, part
from scenegen.lang.headings import bare_rows
from scenegen.pose import AXES, NAMES, SIZE, THETA, TWO_PI, axis_of, owner, row_count, row_of
from scenegen.robustness.fused import fused
from scenegen.robustness.headings import coordinates
from scenegen.robustness.tape import most_alive, run
from scenegen.robustness.transforms import plain, transformed

# Scenes at a time when no gradient is wanted, in float64; twice as many in float32: intermediates of 256 KiB. On a core
# with 1 MiB of cache, half of that was not faster for any formula, with or without footprints, and often slower.
CHUNK = 32_768
LIVE = 1 << 24  # numbers in float64 that are alive at a time; specs of thousands of atoms get smaller chunks
HELD = 1e-9  # metres and radians by which an object that the spec holds may be off, beside what its dtype rounds

Held = Mapping[int, tuple[float, float, float]]


class Robustness:
    """phi of every label of a core formula, for any number of scenes.

    Works in the dtype and on the device of its input. Values are the paper's quantitative semantics (Definition 2) with
    hard min and max, in metres and radians; they are differentiable, and `beta` asks for the straight-through gradient.
    The transforms of torch.func (vmap, grad, jacrev, jacfwd, ...) work on it; inside them, the message about a
    coordinate that is not finite cannot say whose it is.

    With `compiled`, the C compiler of the machine makes one loop of the formula: several times as fast on large
    batches. The first call in each dtype pays for that: 0.1 to 0.5 seconds, five for a formula of 4,000 operations;
    larger ones are not compiled. Values are the same but for rounding (the last bits of sin, cos and atan2, and
    products and sums that become one instruction), whatever the batch. A call that wants gradients or `beta`, or that
    is not on the CPU, runs operation by operation as without `compiled`; so do all calls after a RuntimeWarning where
    compiling fails, above all where there is no C compiler.

    `held` are the poses of objects that the spec holds, by index. phi takes these for granted, so other poses of these
    objects are refused, but inside transforms of torch.func, where nothing can be refused scene by scene.
    """

    def __init__(self, core: Core, *, compiled: bool = False, held: Held | None = None) -> None:
        self.core = core
        self.held = {} if held is None else dict(held)
        self.labels = tuple(core.labels)
        self.objects = core.objects
        self.compiled = compiled
        self._scored = part(core, self.labels)  # requirements are no part of phi
        self._dead = last_uses(self._scored)
        self._closest = find(self._scored)
        self._dead_closest = last_uses_of(self._scored, self._closest)
        self._bare = bare_rows(self._scored)
        pairs = max((closest.count for closest in self._closest.values()), default=0)
        self._most = max(256, LIVE // (pairs + max(most_alive(self._dead), most_alive(self._dead_closest))))
        self._chunk = min(CHUNK, self._most)
        self._fused = fused(self._scored) if compiled else None

    def __reduce__(self) -> tuple[Any, ...]:
        # Machine code is not pickled; it is compiled again on the other side, where there is a compiler.
        return _again, (self.core, self.compiled, self.held)

    def __call__(self, poses: Tensor, *, beta: float | None = None) -> Tensor:
        """(B, N, 3) poses -> (B, L). No copy is made where `poses` is a view of (3N, B) storage. A heading outside
        [0, 2 pi) is the same direction as the one inside.

        Raises ValueError for another shape, dtype or layout, for NaN or infinite coordinates and for an object that the
        spec holds elsewhere, TypeError for other arrays.
        """
        if not isinstance(poses, Tensor):
            raise TypeError(f"poses must be a torch tensor, not {type(poses).__name__}; use torch.from_numpy(poses)")
        _refuse_layout("poses", poses)
        if poses.ndim != 3 or tuple(poses.shape[1:]) != (len(self.objects), SIZE):
            want = f"(B, {len(self.objects)}, {SIZE})"
            raise ValueError(
                f"poses must have the shape {want}, one ({', '.join(NAMES)}) per object, not {tuple(poses.shape)}"
            )
        return self.rows(poses.permute(1, 2, 0).reshape(row_count(len(self.objects)), -1), beta=beta).T

    def rows(self, rows: Tensor, *, beta: float | None = None, check: bool = True, out: Tensor | None = None) -> Tensor:
        """(3N, B) storage -> (L, B). `check=False` skips the search for NaN, infinity and held objects that stand
        elsewhere, for inner loops.

        So does `out` with the system's handing out new pages: phi is written there, and `out` is returned. It must be
        contiguous, (L, B), of the same dtype and device, share no memory with `rows`, and gradients do not flow there.
        """
        _refuse_layout("rows", rows, check)
        if rows.ndim != 2 or rows.shape[0] != row_count(len(self.objects)):
            raise ValueError(f"rows must have the shape ({row_count(len(self.objects))}, B), not {tuple(rows.shape)}")
        if rows.dtype not in (torch.float32, torch.float64):
            raise ValueError(f"coordinates must be float32 or float64, not {str(rows.dtype).removeprefix('torch.')}")
        if check:
            self._refuse_nonfinite(rows)
            found = None if transformed(rows) else elsewhere(self.held, rows.detach())
            if found is not None:
                which, scene = found
                raise ValueError(held_elsewhere(self.objects[which], self.held[which], f"in scene {scene}"))
        if rows.requires_grad and torch.is_grad_enabled():
            if out is not None:
                raise ValueError("phi in `out` has no gradient; leave it out, or detach the rows")
            return torch.stack(self._run(rows, beta))
        shape = (len(self.labels), rows.shape[1])
        wider = 2 if rows.dtype == torch.float32 else 1
        if transformed(rows):  # no plain tensor takes what comes out
            if out is not None:
                raise ValueError("torch.func cannot transform what is written into `out`; leave it out")
            parts = torch.split(rows, wider * self._chunk, dim=1)
            return torch.cat([torch.stack(self._run(part, beta)) for part in parts], dim=1)
        if out is None:
            out = rows.new_empty(shape)
        elif out.shape != shape or (out.dtype, out.device) != (rows.dtype, rows.device) or not out.is_contiguous():
            raise ValueError(f"`out` must be contiguous, {shape}, {rows.dtype} and on {rows.device}")
        if self._fused is not None and beta is None and rows.device.type == "cpu" and self._fused(rows, out):
            return out
        plainly = rows.device.type == "cpu" and beta is None and not torch.compiler.is_compiling()
        for start in range(0, rows.shape[1], wider * self._chunk):
            some = slice(start, start + wider * self._chunk)
            near = rows[:, some].contiguous() if plainly else rows[:, some]
            for label, value in zip(out, self._run(near, beta, plainly), strict=True):
                label[some] = value
        return out

    def _refuse_nonfinite(self, rows: Tensor) -> None:
        # One sum, at the speed of memory, carries any NaN or infinity; only then is it worth to look where.
        if bool(torch.isfinite(plain(rows).detach().sum())):
            return
        if transformed(rows):
            if not bool(torch.isfinite(plain(rows)).all()):
                raise ValueError("a coordinate is not finite, in one of the scenes that torch.func works on at once")
            return
        bad = ~torch.isfinite(rows)
        if bool(bad.any()):
            row, scene = (int(index) for index in bad.nonzero()[0])
            name = self.objects[owner(row)]
            what, value = AXES[axis_of(row)].symbol, float(rows[row, scene])
            raise ValueError(f"{what} of `{name}` in scene {scene} is {value}; coordinates must be finite")

    def _run(self, rows: Tensor, beta: float | None, plainly: bool = False) -> list[Tensor]:
        """phi of every label, each (B,); `plainly`, without gradients of any kind, on the CPU."""
        batch = rows.shape[1]
        coordinate = coordinates(rows.__getitem__, self._bare)
        if plainly and self._closest:
            values = run(self._scored, self._dead_closest, coordinate, rows.new_tensor, closest=self._closest)
        else:
            values = run(self._scored, self._dead, coordinate, rows.new_tensor, beta)
        return [value.expand(batch) for value in values]


def _refuse_layout(name: str, tensor: Tensor, check: bool = True) -> None:
    if tensor.is_nested or tensor.layout is not torch.strided:
        kind = "nested" if tensor.is_nested else "sparse" if "sparse" in str(tensor.layout) else str(tensor.layout)
        remedy = "torch.stack its scenes" if tensor.is_nested else f"use {name}.to_dense()"
        raise ValueError(f"{name} must be a dense tensor, not a {kind} one; {remedy}")
    if check and tensor.is_meta:
        raise ValueError(f"{name} must hold numbers; a meta tensor has a shape alone")


def elsewhere(held: Held, rows: Tensor) -> tuple[int, int] | None:
    """The first held object that stands elsewhere in (3N, B) storage, and in which column; None if all are where the
    spec holds them. Headings are compared on the circle."""
    for index, pose in held.items():
        for axis, value in enumerate(pose):
            off = (rows[row_of(index, axis)] - value).abs()
            if axis == THETA:
                off = (off - TWO_PI * (off / TWO_PI).round()).abs()
            far = off > HELD + 4.0 * torch.finfo(rows.dtype).eps * max(1.0, abs(value), math.pi)
            if bool(far.any()):
                return index, int(far.nonzero()[0])
    return None


def held_elsewhere(name: str, pose: tuple[float, float, float], where: str) -> str:
    """The message about a held object that stands elsewhere."""
    place = ", ".join(f"{value:g}" for value in pose)
    return (
        f"`{name}` is held at ({place}) by the spec, but stands elsewhere {where};"
        f" take the `at` of `{name}` out of the spec to score it where it is"
    )


def _again(core: Core, compiled: bool, held: Held) -> Robustness:
    return Robustness(core, compiled=compiled, held=held)
