"""The tape of a core formula, run once over torch tensors."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, cast

import torch
from torch import Tensor

from scenegen.lang.closest import Closest, least
from scenegen.lang.core import Apply, Const, Coord, Core, Junction
from scenegen.lang.fold import fold
from scenegen.lang.interpret import Numbers
from scenegen.pose import THETA
from scenegen.primitives import PRIMITIVES, Footprint, Namespace
from scenegen.primitives.namespace import Turning
from scenegen.robustness.namespace import TORCH


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


def run(
    core: Core,
    dead: list[list[int]],
    coordinate: Callable[[int], Any],
    constant: Callable[[float], Any],
    beta: float | None = None,
    closest: Mapping[int, Closest] = MappingProxyType({}),
) -> list[Any]:
    """phi of every label: tensors (B,), or () where no coordinate decides.

    `dead` is last_uses(core) or, with `closest`, last_uses_of(core, closest): each intermediate is freed after its last
    use. coordinate(row) is the row (B,) of the storage, constant(value) a tensor () of its dtype: torch.minimum and its
    kin take no floats. Each heading goes through `turn` once. Of the clearances in `closest`, only those that may
    decide are computed, which takes plain tensors on the CPU without gradients.
    """
    values: list[Any] = []
    algebra = _Tensors(coordinate, constant, beta, closest, values)
    fold(core.nodes, algebra, dead=dead, free=algebra.drop, values=values)
    return [values[node] for node in core.labels.values()]


class _Tensors(Numbers):
    """Nodes as tensors, see `run`; `values` are those of the nodes so far."""

    def __init__(
        self,
        coordinate: Callable[[int], Any],
        constant: Callable[[float], Any],
        beta: float | None,
        closest: Mapping[int, Closest],
        values: list[Any],
    ) -> None:
        self._turning = Turning(TORCH)
        super().__init__(cast(Namespace, self._turning), ())
        self._coordinate, self._constant, self._beta = coordinate, constant, beta
        self._closest, self._values = closest, values
        self.drop = self._turning.drop
        self._left_out = {node for some in closest.values() for node in some.nodes}

    def constant(self, index: int, node: Const) -> Any:
        return self._constant(node.value)

    def coordinate(self, index: int, node: Coord) -> Any:
        value = self._coordinate(node.row)
        if node.axis == THETA:
            self._turning.keep(value)
        return value

    def apply(self, index: int, node: Apply, args: list[Any]) -> Any:
        if index in self._left_out:
            return None
        return PRIMITIVES[node.primitive].evaluate(self.namespace, *node.shapes, *args)

    def junction(self, index: int, node: Junction, args: list[Any]) -> Any:
        if index in self._closest:
            return _least(self._closest[index], self._values, self.namespace)
        return _junction(node.kind, args, self._beta)


def _least(closest: Closest, values: list[Any], namespace: Namespace) -> Tensor:
    """The conjunction of clearances and whatever else is in it."""
    needed = {arg: values[arg].detach().numpy() for arg in closest.needs}
    gap = PRIMITIVES["gap"].evaluate

    def of_arrays(a: Footprint, b: Footprint, *numbers: Any) -> Any:
        return gap(TORCH, a, b, *map(torch.from_numpy, numbers)).numpy()

    found = least(closest, needed, of_arrays)
    value: Tensor
    if found is None:
        every = (
            gap(namespace, *shapes, *(values[arg] for arg in pair))
            for shapes, pairs in closest.groups
            for pair in pairs
        )
        value = functools.reduce(torch.minimum, every)
    else:
        value = torch.from_numpy(found)
    for arg in closest.others:
        value = torch.minimum(value, values[arg])
    return value


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
