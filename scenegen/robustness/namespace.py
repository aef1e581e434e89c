"""The primitives' functions over torch tensors."""

from __future__ import annotations

import torch
from torch import Tensor

from scenegen.primitives import Namespace


def _hypot(a: Tensor, b: Tensor) -> Tensor:
    """sqrt(a^2 + b^2) whose gradient at coincident points is 0: torch's own sqrt and hypot give NaN there."""
    square = a * a + b * b
    if not (torch.is_grad_enabled() and square.requires_grad):
        return square.sqrt()
    zero = square == 0
    return torch.where(zero, torch.zeros_like(square), torch.where(zero, torch.ones_like(square), square).sqrt())


class _Torch:
    minimum = staticmethod(torch.minimum)
    maximum = staticmethod(torch.maximum)
    absolute = staticmethod(torch.abs)
    ceil = staticmethod(torch.ceil)
    sin = staticmethod(torch.sin)
    cos = staticmethod(torch.cos)
    hypot = staticmethod(_hypot)


TORCH: Namespace = _Torch()
