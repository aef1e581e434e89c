"""The networks of the published code, as they are.

They are so small that at batch 32 autograd and the optimiser cost more than the arithmetic.
`Trainable` lays the weights of an Mlp out in one vector, so that Adam is one kernel, and `Pass` runs forward and
backward in buffers that are made once. On one core this halves the time of a step (benchmarks/training.py); the tests
hold it to autograd's gradients.
"""

from __future__ import annotations

from functools import cache

import torch
from pydantic import Field
from torch import Tensor, nn
from torch.nn.functional import softplus

from scenegen.learn.models.base import Hyper, Mlp, SceneModel, SpecLoss
from scenegen.learn.models.card import Layout
from scenegen.learn.models.codec import Examples

_leaky_backward = torch.ops.aten.leaky_relu_backward.grad_input


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


# The paper's conditional GAN, as published.
#
# Generator: noise (256) and labels, widths 256-128-128-64-64-3N, ReLU, sigmoid. Discriminator: scene and labels,
# widths 128-128-64-64-32-32-1, LeakyReLU 0.2, sigmoid. Adam with betas (0.5, 0.999). One generator step, then one
# discriminator step; binary cross-entropy; the discriminator's loss is halved. The generator's labels are drawn
# uniformly over the label range, each label on its own. Labels enter as they are, positions as shares of the
# workspace, theta in turns.


BETAS = (0.5, 0.999)


class PublishedGANHyper(Hyper):
    """`latent`: dimensions of the noise."""

    latent: int = Field(default=256, ge=1, le=65_536)


class PublishedGAN(SceneModel):
    """See the module's text. Losses: `generator`, `discriminator`."""

    hyper_class = PublishedGANHyper
    corrected = False
    constant_rate = True
    TRAINING_ONLY = ("discriminator",)

    def __init__(self, layout: Layout, hyper: PublishedGANHyper) -> None:
        super().__init__(Layout(objects=layout.objects, labels=layout.labels), hyper)  # it is told all, as it is
        labels = layout.labels
        self.latent = hyper.latent
        self.generator = Mlp((self.latent + labels, 256, 128, 128, 64, 64, self.width), 0.0)
        self.discriminator = Mlp((self.width + labels, 128, 128, 64, 64, 32, 32, 1), 0.2)

    def start(self, lr: float, spec_loss: SpecLoss) -> None:
        maker, critic = Trainable(self.generator), Trainable(self.discriminator)
        self.optimisers = {
            "generator": torch.optim.Adam([maker.vector], lr=lr, betas=BETAS, fused=True),
            "discriminator": torch.optim.Adam([critic.vector], lr=lr, betas=BETAS, fused=True),
        }
        # One set of buffers per batch size: the full one and the last, smaller batch of an epoch.
        self._passes = cache(lambda rows: _GanBuffers(maker, critic, rows))

    @torch.no_grad()
    def update(self, batch: Examples, generator: torch.Generator) -> dict[str, Tensor]:
        x, phi = batch.x, batch.phi
        rows, width = x.shape
        passes = self._passes(rows)
        maker, both, fake = passes.maker, passes.both, passes.fake
        wanted = torch.rand(rows, self.labels, generator=generator, device=x.device)
        wanted = torch.lerp(self.label_lowest, self.label_highest, wanted)
        maker.inputs[:, : self.latent] = torch.randn(rows, self.latent, generator=generator, device=x.device)
        maker.inputs[:, self.latent :] = wanted
        made = torch.sigmoid(maker.forward())

        # Real scenes and made ones go through the discriminator together, once: it does not change between the two
        # steps, and its gradients need nothing of the generator's new weights.
        both.inputs[:rows, :width], both.inputs[:rows, width:] = x, phi
        fake.inputs[:, :width], fake.inputs[:, width:] = made, wanted
        logits = both.forward()
        probability = torch.sigmoid(logits)

        torch.sub(probability[rows:], 1.0, out=fake.out_grad).div_(rows)
        grad = fake.backward(weights=False, inputs=True)[:, :width]
        torch.mul(grad, made * (1.0 - made), out=maker.out_grad)
        maker.backward(weights=True, inputs=False)
        self.optimisers["generator"].step()

        torch.sub(probability, passes.is_real, out=both.out_grad).mul_(0.5 / rows)
        both.backward(weights=True, inputs=False)
        self.optimisers["discriminator"].step()

        # Binary cross-entropy with logits is softplus(-logit) for target 1 and softplus(-logit) + logit for target 0.
        surprise = softplus(-logits)
        return {
            "generator": surprise[rows:].mean(),
            "discriminator": surprise.mean() + 0.5 * logits[rows:].mean(),
        }

    @torch.no_grad()
    def sample(self, n: int, phi: Tensor, generator: torch.Generator) -> Tensor:
        device = self.label_lowest.device
        noise = torch.randn(n, self.latent, generator=generator, device=device)
        labels = phi.to(noise).expand(n, self.labels)
        return torch.sigmoid(self.generator(torch.cat([noise, labels], dim=1)))


class _GanBuffers:
    """The buffers of a step: the generator's, the discriminator's on real and made scenes (`fake`, the lower half)."""

    def __init__(self, maker: Trainable, spec_loss: Trainable, rows: int) -> None:
        self.maker = Pass(maker, rows)
        self.both = Pass(spec_loss, 2 * rows)
        self.fake = self.both.part(rows, 2 * rows)
        self.is_real = maker.vector.new_zeros(2 * rows, 1)
        self.is_real[:rows] = 1.0


# The paper's conditional adversarial autoencoder, as published.
#
# Encoder 3N-64-64-128-128-256-latent, not conditioned. Decoder: latent and labels, 256-128-128-64-64-3N, sigmoid.
# Discriminator on the latent code, 128-128-64-64-32-32-1, LeakyReLU 0.2, sigmoid. Per step: the sum of squared errors
# moves encoder and decoder; binary cross-entropy, halved, the discriminator (standard normal codes are the real
# ones); binary cross-entropy the encoder. Labels are shifted so that the smallest of the training data is 0;
# positions enter as shares of the workspace, theta in turns.
#
# The published sizes of the code are 128 and 16; the paper's figures fit 16, the default here. Encoder and decoder
# use ReLU, and Adam its usual betas (0.9, 0.999): other betas are known of the GAN only.


class PublishedAAEHyper(Hyper):
    """`latent`: dimensions of the code."""

    latent: int = Field(default=16, ge=1, le=65_536)


class PublishedAAE(SceneModel):
    """See the module's text. Losses: `reconstruction` (squared error per scene), `discriminator`, `encoder`."""

    hyper_class = PublishedAAEHyper
    corrected = False
    constant_rate = True
    TRAINING_ONLY = ("encoder", "discriminator")

    def __init__(self, layout: Layout, hyper: PublishedAAEHyper) -> None:
        super().__init__(Layout(objects=layout.objects, labels=layout.labels), hyper)  # it is told all, as it is
        labels = layout.labels
        self.latent = hyper.latent
        self.encoder = Mlp((self.width, 64, 64, 128, 128, 256, self.latent), 0.0)
        self.decoder = Mlp((self.latent + labels, 256, 128, 128, 64, 64, self.width), 0.0)
        self.discriminator = Mlp((self.latent, 128, 128, 64, 64, 32, 32, 1), 0.2)

    def start(self, lr: float, spec_loss: SpecLoss) -> None:
        encoder, decoder, critic = Trainable(self.encoder), Trainable(self.decoder), Trainable(self.discriminator)
        self.optimisers = {
            "reconstruction": torch.optim.Adam([encoder.vector, decoder.vector], lr=lr, fused=True),
            "discriminator": torch.optim.Adam([critic.vector], lr=lr, fused=True),
            "encoder": torch.optim.Adam([encoder.vector], lr=lr, fused=True),
        }
        # One set of buffers per batch size: the full one and the last, smaller batch of an epoch.
        self._passes = cache(lambda rows: _AaeBuffers(encoder, decoder, critic, rows))

    @torch.no_grad()
    def update(self, batch: Examples, generator: torch.Generator) -> dict[str, Tensor]:
        x, phi = batch.x, batch.phi
        rows = x.shape[0]
        passes = self._passes(rows)
        encoder, decoder, both, coded = passes.encoder, passes.decoder, passes.both, passes.coded

        encoder.inputs.copy_(x)
        decoder.inputs[:, : self.latent] = encoder.forward()
        torch.sub(phi, self.label_lowest, out=decoder.inputs[:, self.latent :])
        made = torch.sigmoid(decoder.forward())
        error = made - x
        torch.mul(2.0 * error, made * (1.0 - made), out=decoder.out_grad)
        encoder.out_grad.copy_(decoder.backward(weights=True, inputs=True)[:, : self.latent])
        encoder.backward(weights=True, inputs=False)
        self.optimisers["reconstruction"].step()

        # The lower half of the discriminator's batch holds the codes of the encoder as it now is, for both steps.
        both.inputs[:rows] = torch.randn(rows, self.latent, generator=generator, device=x.device)
        coded.inputs.copy_(encoder.forward())
        logits = both.forward()
        torch.sub(torch.sigmoid(logits), passes.is_real, out=both.out_grad).mul_(0.5 / rows)
        both.backward(weights=True, inputs=False)
        judged = softplus(-logits).mean() + 0.5 * logits[rows:].mean()  # the halved cross-entropy, as above
        self.optimisers["discriminator"].step()

        logits = coded.forward()
        torch.sub(torch.sigmoid(logits), 1.0, out=coded.out_grad).div_(rows)
        encoder.out_grad.copy_(coded.backward(weights=False, inputs=True))
        encoder.backward(weights=True, inputs=False)
        self.optimisers["encoder"].step()
        return {
            "reconstruction": error.square().sum() / rows,
            "discriminator": judged,
            "encoder": softplus(-logits).mean(),
        }

    @torch.no_grad()
    def sample(self, n: int, phi: Tensor, generator: torch.Generator) -> Tensor:
        device = self.label_lowest.device
        code = torch.randn(n, self.latent, generator=generator, device=device)
        labels = (phi.to(code) - self.label_lowest).expand(n, self.labels)
        return torch.sigmoid(self.decoder(torch.cat([code, labels], dim=1)))


class _AaeBuffers:
    """The buffers of a step; `coded` is the lower half of `both`, the discriminator's batch."""

    def __init__(self, encoder: Trainable, decoder: Trainable, spec_loss: Trainable, rows: int) -> None:
        self.encoder = Pass(encoder, rows)
        self.decoder = Pass(decoder, rows)
        self.both = Pass(spec_loss, 2 * rows)
        self.coded = self.both.part(rows, 2 * rows)
        self.is_real = spec_loss.vector.new_zeros(2 * rows, 1)
        self.is_real[:rows] = 1.0
