"""The paper's conditional GAN, as published.

Generator: noise (256) and labels, widths 256-128-128-64-64-3N, ReLU, sigmoid. Discriminator: scene and labels, widths
128-128-64-64-32-32-1, LeakyReLU 0.2, sigmoid. Adam with betas (0.5, 0.999). One generator step, then one discriminator
step; binary cross-entropy; the discriminator's loss is halved. The generator's labels are drawn uniformly over the
label range, each label on its own. Labels enter as they are, positions as shares of the workspace, theta in turns.
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

BETAS = (0.5, 0.999)


class PublishedGANHyper(Hyper):
    """`latent`: dimensions of the noise."""

    latent: int = Field(default=256, ge=1, le=65_536)


class PublishedGAN(SceneModel):
    """See the module's text. Losses: `generator`, `discriminator`."""

    hyper_class = PublishedGANHyper
    TRAINING_ONLY = ("discriminator",)

    def __init__(self, layout: Layout, hyper: PublishedGANHyper) -> None:
        super().__init__(layout, hyper)
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
