"""Multi-layer perceptrons, and a fast way to train small ones.

The published networks are so small that at batch 32 autograd and the optimiser cost more than the arithmetic. `Mlp` is
an ordinary module (autograd works, any batch size). `Trainable` lays its weights out in one vector, so that Adam is one
kernel, and `Pass` runs forward and backward in buffers that are made once. On one core this halves the time of a step
(benchmarks/training.py); the tests hold it to autograd's gradients.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import torch
from torch import Tensor, nn

_leaky_backward = torch.ops.aten.leaky_relu_backward.grad_input


class Mlp(nn.Module):
    """Linear layers of the given widths with LeakyReLU(slope) between them (0 is ReLU) and nothing after the last.

    Made without weights (on torch's meta device): call `initialise`, or load a state with `assign=True`.
    """

    def __init__(self, widths: Sequence[int], slope: float) -> None:
        super().__init__()
        self.slope = slope
        self.layers = nn.ModuleList(nn.Linear(a, b, device="meta") for a, b in pairwise(widths))

    def initialise(self, generator: torch.Generator) -> None:
        """Fresh weights by torch's own rule for linear layers: uniform within 1 / sqrt(inputs)."""
        for layer in self.linear():
            layer.to_empty(device=generator.device)
            bound = layer.in_features**-0.5
            nn.init.uniform_(layer.weight, -bound, bound, generator=generator)
            nn.init.uniform_(layer.bias, -bound, bound, generator=generator)

    def linear(self) -> list[nn.Linear]:
        return [layer for layer in self.layers if isinstance(layer, nn.Linear)]

    def forward(self, x: Tensor) -> Tensor:
        """(B, first width) -> (B, last width)."""
        *hidden, last = self.linear()
        for layer in hidden:
            x = nn.functional.leaky_relu(layer(x), self.slope, inplace=True)
        result: Tensor = last(x)
        return result


def one_hot(index: Tensor, count: int) -> Tensor:
    """(B,) int64 below `count` -> (B, count) float32 of zeros and a single one: a branch as input of a network."""
    zeros = torch.zeros(len(index), count, device=index.device)
    return zeros.scatter_(1, index[:, None], 1.0)


class Trainable:
    """An Mlp whose weights, and gradients, are views of one vector each: `vector` and `vector.grad`.

    The module's parameters are pointed into the vector, so move it to its device before, not after.
    """

    def __init__(self, mlp: Mlp) -> None:
        layers = mlp.linear()
        parameters = [parameter for layer in layers for parameter in (layer.weight, layer.bias)]
        self.slope = mlp.slope
        self.widths = [layers[0].in_features, *(layer.out_features for layer in layers)]
        self.vector = nn.Parameter(torch.cat([parameter.detach().reshape(-1) for parameter in parameters]))
        self.vector.grad = torch.zeros_like(self.vector)
        sizes = [parameter.numel() for parameter in parameters]
        values, grads = torch.split(self.vector.data, sizes), torch.split(self.vector.grad, sizes)
        for parameter, value in zip(parameters, values, strict=True):
            parameter.data = value.view(parameter.shape)
        self.weights = [layer.weight.data for layer in layers]
        self.transposed = [weight.t() for weight in self.weights]
        self.biases = [layer.bias.data for layer in layers]
        self.weight_grads = [grad.view(w.shape) for grad, w in zip(grads[0::2], self.weights, strict=True)]
        self.bias_grads = list(grads[1::2])


class Pass:
    """Buffers for one batch size of a Trainable: fill `inputs`, call `forward`, fill `out_grad`, call `backward`."""

    def __init__(self, net: Trainable, rows: int) -> None:
        self._net = net
        self._set(
            [net.vector.new_empty(rows, width) for width in net.widths],
            [net.vector.new_empty(rows, width) for width in net.widths],
        )

    def _set(self, values: list[Tensor], grads: list[Tensor]) -> None:
        # detach: new_empty of a parameter carries no graph, but views of it would be counted as such.
        self._values, self._grads = [value.detach() for value in values], [grad.detach() for grad in grads]
        self._grads_t = [grad.t() for grad in self._grads]
        self.inputs, self.outputs, self.out_grad = self._values[0], self._values[-1], self._grads[-1]

    def part(self, start: int, stop: int) -> Pass:
        """The same pass seen through some of its rows; memory is shared."""
        view = Pass.__new__(Pass)
        view._net = self._net
        view._set([value[start:stop] for value in self._values], [grad[start:stop] for grad in self._grads])
        return view

    def forward(self) -> Tensor:
        """`inputs` (B, first width) -> `outputs` (B, last width)."""
        net, values = self._net, self._values
        last = len(net.weights) - 1
        for index in range(last + 1):
            torch.addmm(net.biases[index], values[index], net.transposed[index], out=values[index + 1])
            if index < last:
                nn.functional.leaky_relu(values[index + 1], net.slope, inplace=True)
        return self.outputs

    def backward(self, *, weights: bool, inputs: bool) -> Tensor:
        """From `out_grad`, write the gradients of the weights into the vector's grad (overwriting), of the inputs into
        the buffer that is returned (B, first width); either only where asked for."""
        net, values, grads = self._net, self._values, self._grads
        for index in reversed(range(len(net.weights))):
            if weights:
                torch.mm(self._grads_t[index + 1], values[index], out=net.weight_grads[index])
                torch.sum(grads[index + 1], 0, out=net.bias_grads[index])
            if index or inputs:
                torch.mm(grads[index + 1], net.weights[index], out=grads[index])
            if index:
                _leaky_backward(grads[index], values[index], net.slope, True, grad_input=grads[index])
        return grads[0]
