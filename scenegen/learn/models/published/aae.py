"""The paper's conditional adversarial autoencoder, as published.

Encoder 3N-64-64-128-128-256-latent, not conditioned. Decoder: latent and labels, 256-128-128-64-64-3N, sigmoid.
Discriminator on the latent code, 128-128-64-64-32-32-1, LeakyReLU 0.2, sigmoid. Per step: the sum of squared errors
moves encoder and decoder; binary cross-entropy, halved, the discriminator (standard normal codes are the real ones);
binary cross-entropy the encoder. Labels are shifted so that the smallest of the training data is 0; positions enter as
shares of the workspace, theta in turns.

The published sizes of the code are 128 and 16; the paper's figures fit 16, the default here. Encoder and decoder use
ReLU, and Adam its usual betas (0.9, 0.999): other betas are known of the GAN only.
"""

from __future__ import annotations

from functools import cache

import torch
from pydantic import Field
from torch import Tensor
from torch.nn.functional import softplus

from scenegen.learn.models.base import Hyper, SceneModel, SpecLoss
from scenegen.learn.models.codec import Examples
from scenegen.learn.models.layout import Layout
from scenegen.learn.models.mlp import Mlp, Pass, Trainable


class PublishedAAEHyper(Hyper):
    """`latent`: dimensions of the code."""

    latent: int = Field(default=16, ge=1, le=65_536)


class PublishedAAE(SceneModel):
    """See the module's text. Losses: `reconstruction` (squared error per scene), `discriminator`, `encoder`."""

    hyper_class = PublishedAAEHyper
    TRAINING_ONLY = ("encoder", "discriminator")

    def __init__(self, layout: Layout, hyper: PublishedAAEHyper) -> None:
        super().__init__(layout, hyper)
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
        judged = softplus(-logits).mean() + 0.5 * logits[rows:].mean()  # the halved cross-entropy, see gan.py
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
