"""The hand-written passes against autograd."""

import pytest
import torch

from scenegen.learn.models.base import Mlp
from scenegen.learn.models.published import Pass, Trainable

WIDTHS = (5, 16, 8, 3)


def make(slope, seed=0):
    generator = torch.Generator().manual_seed(seed)
    mlp = Mlp(WIDTHS, slope)
    mlp.initialise(generator)
    return mlp, generator


def reference(mlp, x, out_grad):
    """Outputs, gradient of the inputs, gradients of the weights, by autograd."""
    x = x.clone().requires_grad_()
    parameters = list(mlp.parameters())
    out = mlp(x)
    grads = torch.autograd.grad(out, [x, *parameters], out_grad)
    return out.detach(), grads[0], torch.cat([grad.reshape(-1) for grad in grads[1:]])


@pytest.mark.parametrize("slope", [0.0, 0.2])
def test_gradients_are_autograds(slope):
    mlp, generator = make(slope)
    x, out_grad = torch.randn(7, 5, generator=generator), torch.randn(7, 3, generator=generator)
    out, inputs, weights = reference(mlp, x, out_grad)
    net = Trainable(mlp)
    step = Pass(net, 7)
    for _ in range(2):  # buffers are overwritten, not added to
        step.inputs.copy_(x)
        torch.testing.assert_close(step.forward(), out)
        step.out_grad.copy_(out_grad)
        torch.testing.assert_close(step.backward(weights=True, inputs=True), inputs)
        torch.testing.assert_close(net.vector.grad, weights)


def test_inputs_alone_leave_the_weight_gradients():
    mlp, generator = make(0.2)
    net = Trainable(mlp)
    step = Pass(net, 4)
    step.inputs.copy_(torch.randn(4, 5, generator=generator))
    step.forward()
    step.out_grad.fill_(1.0)
    net.vector.grad.fill_(123.0)
    step.backward(weights=False, inputs=True)
    assert (net.vector.grad == 123.0).all()


def test_a_part_shares_memory_and_agrees():
    mlp, generator = make(0.2)
    x, out_grad = torch.randn(3, 5, generator=generator), torch.randn(3, 3, generator=generator)
    out, inputs, weights = reference(mlp, x, out_grad)
    net = Trainable(mlp)
    whole = Pass(net, 6)
    part = whole.part(3, 6)
    whole.inputs[:3] = 99.0
    part.inputs.copy_(x)
    torch.testing.assert_close(whole.forward()[3:], out)
    part.out_grad.copy_(out_grad)
    torch.testing.assert_close(part.backward(weights=True, inputs=True), inputs)
    torch.testing.assert_close(net.vector.grad, weights)


def test_the_module_sees_what_the_optimiser_does():
    mlp, generator = make(0.0)
    x = torch.randn(4, 5, generator=generator)
    net = Trainable(mlp)
    before = mlp(x).detach()
    with torch.no_grad():
        net.vector.mul_(0.5)
    assert not torch.equal(mlp(x), before)
    assert torch.equal(mlp.linear()[0].weight.reshape(-1), net.vector[: 5 * 16])


def test_initial_weights_are_uniform_within_one_over_root_inputs():
    mlp = Mlp((100, 200), 0.0)
    mlp.initialise(torch.Generator().manual_seed(0))
    weight = mlp.linear()[0].weight.detach()
    assert float(weight.abs().max()) <= 0.1
    assert float(weight.std()) == pytest.approx(0.1 / 3**0.5, rel=0.02)
