"""The primitives' functions over torch tensors."""

from __future__ import annotations

import torch
from torch import Tensor

from scenegen.geometry import Namespace


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


TORCH: Namespace = _TorchNamespace()
