"""Tensors inside the transforms of torch.func (vmap, grad, jvp and what is made of them).

There a tensor is a wrapper around the one that holds the numbers: nothing can be written into plain tensors from it,
and no Python condition can be taken on its values. torch has no public call that tells; these are what torch.func
itself is made of, and a test calls them through it.
"""

from __future__ import annotations

from torch import Tensor
from torch._C import _functorch


def transformed(tensor: Tensor) -> bool:
    """Whether a transform is at work on the tensor."""
    return bool(_functorch.is_functorch_wrapped_tensor(tensor))


def plain(tensor: Tensor) -> Tensor:
    """The numbers behind all wrappers, those of every member of a vmap at once, in a shape of its own."""
    while transformed(tensor):
        tensor = _functorch.get_unwrapped(tensor)
    return tensor
