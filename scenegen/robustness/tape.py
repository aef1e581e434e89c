"""The tape of a core formula, run once over torch tensors or over anything that records what is done to it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import torch
from torch import Tensor

from scenegen.lang.core import Apply, Atom, Const, Coord, Core, Junction
from scenegen.primitives import PRIMITIVES
from scenegen.robustness.namespace import TORCH


class _Junction(torch.autograd.Function):
    """Hard min or max over the first dimension whose gradient is that of log-sum-exp at sharpness beta.

    The straight-through gradient of design.md, section 5: the value stays exact, and every argument, not the deciding
    one alone, is told where to go, with softmax weights. Written so that torch.func can transform it.
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
) -> list[Any]:
    """phi of every label: tensors (B,), or () where no coordinate decides.

    `dead` is last_uses(core): each intermediate is freed after its last use. coordinate(row) is the row (B,) of the
    storage, constant(value) a tensor () of its dtype: torch.minimum and its kin take no floats.
    """
    values: list[Any] = [None] * len(core.nodes)
    for index, node in enumerate(core.nodes):
        match node:
            case Const(value):
                values[index] = constant(value)
            case Coord():
                values[index] = coordinate(node.row)
            case Apply(primitive, args, shapes):
                values[index] = PRIMITIVES[primitive].evaluate(TORCH, *shapes, *(values[arg] for arg in args))
            case Atom(margin):
                values[index] = values[margin]
            case Junction(kind, args):
                values[index] = _junction(kind, [values[arg] for arg in args], beta)
        for child in dead[index]:
            values[child] = None
    return [values[node] for node in core.labels.values()]


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
    value = args[0]
    for other in args[1:]:
        value = step(value, other)
    return value
