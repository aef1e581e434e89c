"""Core formula -> vectorised torch robustness.

Storage is (3N, B): one contiguous row per coordinate, 3 to 4 times faster than one row per scene. The
tape is run row-wise with each intermediate freed after its last use, in chunks of scenes that stay in cache.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from types import MappingProxyType
from typing import Any, cast

import torch
from torch import Tensor
from torch._C import _functorch

from scenegen.geometry import PRIMITIVES, Footprint, Namespace
from scenegen.geometry.namespace import Turning
from scenegen.lang.formula.core import Apply, Const, Coord, Core, Junction, last_uses, part_of
from scenegen.lang.formula.interpret import (
    GapMinima,
    NearestPairs,
    Numbers,
    bare_rows,
    every,
    find_groups,
    fold,
    minimum,
    with_others,
)
from scenegen.pose import AXES, NAMES, SIZE, THETA, TWO_PI, axis_of, owner, row_count, row_of

# The primitives' functions over torch tensors.


def _sqrt(square: Tensor) -> Tensor:
    """The square root whose gradient at 0 is 0: torch's own gives infinity there, and NaN further down the chain."""
    if not (torch.is_grad_enabled() and square.requires_grad):
        return square.sqrt()
    zero = square == 0
    return torch.where(zero, torch.zeros_like(square), torch.where(zero, torch.ones_like(square), square).sqrt())


def _hypot(a: Tensor, b: Tensor) -> Tensor:
    """sqrt(a^2 + b^2) whose gradient at coincident points is 0: torch's own sqrt and hypot give NaN there."""
    return _sqrt(a * a + b * b)


def _atan2(y: Tensor, x: Tensor) -> Tensor:
    """atan2 whose gradient is 0 where x^2 + y^2, by which torch divides, is 0 or too small for 1 over it."""
    angle = torch.atan2(y, x)
    if not (torch.is_grad_enabled() and angle.requires_grad):
        return angle
    zero = x * x + y * y < torch.finfo(angle.dtype).tiny
    return torch.where(zero, angle.detach(), torch.atan2(y, torch.where(zero, torch.ones_like(x), x)))


def _turn(a: Tensor) -> tuple[Tensor, Tensor]:
    return a.cos(), a.sin()


def _signed_root(square: Tensor, signed: Tensor) -> Tensor:
    """sqrt(square) with the sign of `signed`, whose gradient is the result's where that is 0."""
    root = torch.copysign(_sqrt(square), signed)
    if not (torch.is_grad_enabled() and root.requires_grad):
        return root
    return torch.where(root == 0, signed, root)


def _clip(a: Tensor, lowest: float, highest: float) -> Tensor:
    return a.clamp(lowest, highest)


def _beyond(a: Tensor, half: float) -> Tensor:
    return a - a.clamp(-half, half)


def _copysign(size: Tensor, sign: Tensor) -> Tensor:
    return torch.copysign(size, sign.detach())


def _where(condition: Tensor, a: Tensor, b: Tensor) -> Tensor:
    return torch.where(condition, a, b)


def _only(condition: Tensor, function: Callable[..., Any], otherwise: Sequence[Any], *numbers: Any) -> Any:
    if _functorch.maybe_current_level() is not None:  # how many hold is not known where functions are transformed
        found = function(TORCH, *numbers)
        return [
            torch.where(condition, value, torch.as_tensor(other, dtype=value.dtype, device=value.device))
            for value, other in zip(found, otherwise, strict=True)
        ]
    count, places = condition.numel(), condition.reshape(-1).nonzero()[:, 0]
    if not len(places):
        return [torch.as_tensor(other).expand(condition.shape) for other in otherwise]

    def take(number: Any) -> Any:
        if not isinstance(number, Tensor) or not number.ndim:
            return number
        before = number.shape[: max(0, number.ndim - condition.ndim)]
        return number.expand(*before, *condition.shape).reshape(*before, count)[..., places]

    filled = []
    for value, other in zip(function(TORCH, *map(take, numbers)), otherwise, strict=True):
        whole = torch.as_tensor(other, dtype=value.dtype, device=value.device).expand(condition.shape).reshape(-1)
        whole = whole.expand(*value.shape[:-1], count).clone()
        whole[..., places] = value
        filled.append(whole.reshape(*value.shape[:-1], *condition.shape))
    return filled


def _spread(low: Tensor, high: Tensor, count: int) -> Tensor:
    shares = (torch.arange(count, dtype=low.dtype, device=low.device) + 0.5) / count
    return low + (high - low) * shares[:, None]


class _TorchNamespace:
    minimum = staticmethod(torch.minimum)
    maximum = staticmethod(torch.maximum)
    absolute = staticmethod(torch.abs)
    ceil = staticmethod(torch.ceil)
    sin = staticmethod(torch.sin)
    cos = staticmethod(torch.cos)
    turn = staticmethod(_turn)
    sqrt = staticmethod(_sqrt)
    signed_root = staticmethod(_signed_root)
    hypot = staticmethod(_hypot)
    atan2 = staticmethod(_atan2)
    clip = staticmethod(_clip)
    beyond = staticmethod(_beyond)
    copysign = staticmethod(_copysign)
    where = staticmethod(_where)
    only = staticmethod(_only)
    spread = staticmethod(_spread)


TORCH: Namespace = _TorchNamespace()


# The tape of a core formula, run once over torch tensors.


class _Junction(torch.autograd.Function):
    """Hard min or max over the first dimension whose gradient is that of log-sum-exp at sharpness beta.

    A straight-through gradient: the value stays exact, and all arguments, not only the active one, get a gradient,
    with softmax weights. Written so that torch.func can transform it.
    """

    generate_vmap_rule = True

    @staticmethod
    def forward(stacked: Tensor, beta: float) -> Tensor:
        """stacked (K, B) -> (B,); beta < 0 is a minimum."""
        return stacked.amin(0) if beta < 0 else stacked.amax(0)

    @staticmethod
    def setup_context(ctx: Any, inputs: tuple[Tensor, float], output: Tensor) -> None:
        stacked, ctx.beta = inputs
        ctx.save_for_backward(stacked)
        ctx.save_for_forward(stacked)

    @staticmethod
    def backward(ctx: Any, *grads: Tensor) -> tuple[Tensor, None]:
        (stacked,) = ctx.saved_tensors
        return torch.softmax(ctx.beta * stacked, dim=0) * grads[0], None

    @staticmethod
    def jvp(ctx: Any, *tangents: Any) -> Tensor:
        (stacked,) = ctx.saved_tensors
        tangent: Tensor = (torch.softmax(ctx.beta * stacked, dim=0) * tangents[0]).sum(0)
        return tangent


FEWEST_PAIRS = 3  # the distances of fewer cost more than they save
NO_MINIMA = GapMinima(MappingProxyType({}), frozenset())


def run(
    core: Core,
    dead: list[list[int]],
    coordinate: Callable[[int], Any],
    constant: Callable[[float], Any],
    beta: float | None = None,
    minima: GapMinima = NO_MINIMA,
) -> list[Any]:
    """phi of every label: tensors (B,), or () where no coordinate decides.

    `dead` is last_uses(core) or, with `minima`, minima.last_uses(core): each intermediate is freed after its last use.
    coordinate(row) is the row (B,) of the storage, constant(value) a tensor () of its dtype: torch.minimum and its
    kin take no floats. Each heading goes through `turn` once. Of the gaps in `minima`, only those that may
    decide are computed, which takes plain tensors on the CPU without gradients.
    """
    values: list[Any] = []
    algebra = _Tensors(coordinate, constant, beta, minima, values)
    fold(core.nodes, algebra, dead=dead, free=algebra.drop, values=values)
    return [values[node] for node in core.labels.values()]


class _Tensors(Numbers):
    """Nodes as tensors, see `run`; `values` are those of the nodes so far."""

    def __init__(
        self,
        coordinate: Callable[[int], Any],
        constant: Callable[[float], Any],
        beta: float | None,
        minima: GapMinima,
        values: list[Any],
    ) -> None:
        self._turning = Turning(TORCH)
        super().__init__(cast(Namespace, self._turning), ())
        self._coordinate, self._constant, self._beta = coordinate, constant, beta
        self._minima, self._values = minima, values
        self.drop = self._turning.drop

    def constant(self, index: int, node: Const) -> Any:
        return self._constant(node.value)

    def coordinate(self, index: int, node: Coord) -> Any:
        value = self._coordinate(node.row)
        if node.axis == THETA:
            self._turning.keep(value)
        return value

    def apply(self, index: int, node: Apply, args: list[Any]) -> Any:
        if index in self._minima.skipped:
            return None
        return PRIMITIVES[node.primitive].evaluate(self.namespace, *node.shapes, *args)

    def junction(self, index: int, node: Junction, args: list[Any]) -> Any:
        pairs = self._minima.by_node.get(index)
        if pairs is None:
            return _junction(node.kind, args, self._beta)
        values = self._values.__getitem__
        least = nearest(pairs, values)
        if least is None:
            least = functools.reduce(torch.minimum, every(pairs, values, partial(EVALUATE_GAP, self.namespace)))
        return with_others(pairs, least, values, torch.minimum)


EVALUATE_GAP = PRIMITIVES["gap"].evaluate
MAX_NEAR_SHARE = (
    0.5  # of the gaps of a minimum: where more may decide, computing all, with each heading turned once, is cheaper
)


def nearest(pairs: NearestPairs, values: Callable[[int], Tensor], which: Tensor | None = None) -> Tensor | None:
    """(B,) the least of gaps; None where it is better to compute all. The atom of one that is it is written into
    `which`, (B,) int32, where that is given. Without gradients, on the CPU."""

    def of_arrays(a: Footprint, b: Footprint, *numbers: Any) -> Any:
        return EVALUATE_GAP(TORCH, a, b, *map(torch.from_numpy, numbers)).numpy()

    atoms = None if which is None else which.numpy()
    found = minimum(pairs, lambda node: values(node).detach().numpy(), of_arrays, share=MAX_NEAR_SHARE, which=atoms)
    return None if found is None else torch.from_numpy(found)


def minima_of(core: Core) -> GapMinima:
    """The minima of gaps, to regions, too, of which tensors leave out what cannot decide."""
    needed = [*core.labels.values(), *(() if core.requirement is None else (core.requirement,))]
    return find_groups(core, needed, FEWEST_PAIRS, 1, fixed=True)


def most_alive(dead: list[list[int]]) -> int:
    """How many values are alive at once, at most, while the tape runs."""
    alive = most = 1
    for freed in dead:
        alive += 1
        most = max(most, alive)
        alive -= len(freed)
    return most


def _junction(kind: str, args: list[Any], beta: float | None) -> Any:
    if beta is not None:
        width = max(arg.numel() for arg in args)
        stacked = torch.stack([arg.expand(width) for arg in args])
        return _Junction.apply(stacked, -beta if kind == "min" else beta)  # type: ignore[no-untyped-call]
    step = torch.minimum if kind == "min" else torch.maximum
    return functools.reduce(step, args)


# Headings brought to [0, 2 pi), where a formula takes them as numbers.


def coordinates(rows: Callable[[int], Any], bare: frozenset[int]) -> Callable[[int], Any]:
    """What `run` takes for the rows of poses whose headings may lie outside [0, 2 pi).

    Those that a formula takes as numbers, `bare` (lang.headings.bare_rows), are brought there, with the gradient 1; for
    the others a turn more or less makes no difference, and nothing is done.
    """
    if not bare:
        return rows

    def coordinate(row: int) -> Any:
        theta = rows(row)
        if row not in bare:
            return theta
        rest = torch.remainder(theta, TWO_PI)
        rest = torch.where(rest >= TWO_PI, rest - TWO_PI, rest)  # that of -1e-17 is rounded up
        return torch.where((theta < 0.0) | (theta >= TWO_PI), rest, theta)

    return coordinate


# Tensors inside the transforms of torch.func (vmap, grad, jvp and what is made of them).
#
# There a tensor is a wrapper around the one that holds the numbers: nothing can be written into plain tensors from
# it, and no Python condition can be taken on its values. torch has no public call that tells; these are what
# torch.func itself is made of, and a test calls them through it.


def is_transformed(tensor: Tensor) -> bool:
    """Whether a transform is at work on the tensor."""
    return bool(_functorch.is_functorch_wrapped_tensor(tensor))


def plain(tensor: Tensor) -> Tensor:
    """The numbers behind all wrappers, those of every member of a vmap at once, in a shape of its own."""
    while is_transformed(tensor):
        tensor = _functorch.get_unwrapped(tensor)
    return tensor


# Scenes at a time when no gradient is wanted, in float64; twice as many in float32: intermediates of 256 KiB. On a core
# with 1 MiB of cache, half of that was not faster for any formula, with or without footprints, and often slower.
CHUNK_SCENES = 32_768
MAX_LIVE_NUMBERS = (
    1 << 24
)  # numbers in float64 that are alive at a time; specs of thousands of atoms get smaller chunks
HELD_TOLERANCE = (
    1e-9  # metres and radians by which an object that the spec holds may be off, beside what its dtype rounds
)

Held = Mapping[int, tuple[float, float, float]]


class Robustness:
    """phi of every label of a core formula, for any number of scenes.

    Works in the dtype and on the device of its input. Values are the paper's quantitative semantics (Definition 2) with
    hard min and max, in metres and radians; they are differentiable, and `beta` asks for the straight-through gradient.
    The transforms of torch.func (vmap, grad, jacrev, jacfwd, ...) work on it; inside them, the message about a
    coordinate that is not finite cannot say whose it is.

    torch.compile takes it as it takes any function: faster on millions of scenes, after seconds of compiling.

    `held` are the poses of objects that the spec holds, by index. phi takes these for granted, so other poses of these
    objects are refused, but inside transforms of torch.func, where nothing can be refused scene by scene.
    """

    def __init__(self, core: Core, *, held: Held | None = None) -> None:
        self.core = core
        self.held = {} if held is None else dict(held)
        self.labels = tuple(core.labels)
        self.objects = core.objects
        self._scored = part_of(core, self.labels)  # requirements are no part of phi
        self._dead = last_uses(self._scored)
        self._minima = minima_of(self._scored)
        self._dead_nearest = self._minima.last_uses(self._scored)
        self._bare = bare_rows(self._scored)
        pairs = max((len(one.atoms) for one in self._minima.by_node.values()), default=0)
        self._most = max(256, MAX_LIVE_NUMBERS // (pairs + max(most_alive(self._dead), most_alive(self._dead_nearest))))
        self._chunk = min(CHUNK_SCENES, self._most)

    def __reduce__(self) -> tuple[Any, ...]:
        return _again, (self.core, self.held)

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
            found = None if is_transformed(rows) else elsewhere(self.held, rows.detach())
            if found is not None:
                which, scene = found
                raise ValueError(held_elsewhere(self.objects[which], self.held[which], f"in scene {scene}"))
        if rows.requires_grad and torch.is_grad_enabled():
            if out is not None:
                raise ValueError("phi in `out` has no gradient; leave it out, or detach the rows")
            return torch.stack(self._run(rows, beta))
        shape = (len(self.labels), rows.shape[1])
        wider = 2 if rows.dtype == torch.float32 else 1
        if is_transformed(rows):  # no plain tensor takes what comes out
            if out is not None:
                raise ValueError("torch.func cannot transform what is written into `out`; leave it out")
            parts = torch.split(rows, wider * self._chunk, dim=1)
            return torch.cat([torch.stack(self._run(part, beta)) for part in parts], dim=1)
        if out is None:
            out = rows.new_empty(shape)
        elif out.shape != shape or (out.dtype, out.device) != (rows.dtype, rows.device) or not out.is_contiguous():
            raise ValueError(f"`out` must be contiguous, {shape}, {rows.dtype} and on {rows.device}")
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
        if is_transformed(rows):
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
        if plainly and self._minima.by_node:
            values = run(self._scored, self._dead_nearest, coordinate, rows.new_tensor, minima=self._minima)
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
            far = off > HELD_TOLERANCE + 4.0 * torch.finfo(rows.dtype).eps * max(1.0, abs(value), math.pi)
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


def _again(core: Core, held: Held) -> Robustness:
    return Robustness(core, held=held)
