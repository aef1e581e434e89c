"""The faithful models against a plain reading of the published losses, with autograd and torch's own Adam."""

import copy

import pytest
import torch
from torch.nn.functional import binary_cross_entropy as bce

from scenegen.learn.models.codec import Examples


def parameters(mlp):
    return [parameter.requires_grad_() for parameter in mlp.parameters()]


def by_the_book_gan(model, data, generator):
    maker, spec_loss = copy.deepcopy(model.generator), copy.deepcopy(model.discriminator)
    adam_g = torch.optim.Adam(parameters(maker), lr=1e-3, betas=(0.5, 0.999))
    adam_d = torch.optim.Adam(parameters(spec_loss), lr=1e-3, betas=(0.5, 0.999))
    seen = []
    for x, phi in data:
        rows = len(x)
        span = model.label_highest - model.label_lowest
        wanted = model.label_lowest + span * torch.rand(rows, 2, generator=generator)
        z = torch.randn(rows, 256, generator=generator)
        made = torch.sigmoid(maker(torch.cat([z, wanted], 1)))
        adam_g.zero_grad()
        loss_g = bce(torch.sigmoid(spec_loss(torch.cat([made, wanted], 1))), torch.ones(rows, 1))
        loss_g.backward()
        adam_g.step()
        adam_d.zero_grad()
        real = bce(torch.sigmoid(spec_loss(torch.cat([x, phi], 1))), torch.ones(rows, 1))
        fake = bce(torch.sigmoid(spec_loss(torch.cat([made.detach(), wanted], 1))), torch.zeros(rows, 1))
        loss_d = (real + fake) / 2
        loss_d.backward()
        adam_d.step()
        seen.append({"generator": loss_g.item(), "discriminator": loss_d.item()})
    return {"generator": maker, "discriminator": spec_loss}, seen


def by_the_book_aae(model, data, generator):
    encoder, decoder, spec_loss = (copy.deepcopy(part) for part in (model.encoder, model.decoder, model.discriminator))
    adam_r = torch.optim.Adam([*parameters(encoder), *parameters(decoder)], lr=1e-3)
    adam_d = torch.optim.Adam(parameters(spec_loss), lr=1e-3)
    adam_e = torch.optim.Adam(encoder.parameters(), lr=1e-3)
    seen = []
    for x, phi in data:
        rows = len(x)
        adam_r.zero_grad()
        made = torch.sigmoid(decoder(torch.cat([encoder(x), phi - model.label_lowest], 1)))
        squares = ((made - x) ** 2).sum()
        squares.backward()
        adam_r.step()
        adam_d.zero_grad()
        real = bce(torch.sigmoid(spec_loss(torch.randn(rows, 16, generator=generator))), torch.ones(rows, 1))
        fake = bce(torch.sigmoid(spec_loss(encoder(x).detach())), torch.zeros(rows, 1))
        loss_d = (real + fake) / 2
        loss_d.backward()
        adam_d.step()
        adam_e.zero_grad()
        loss_e = bce(torch.sigmoid(spec_loss(encoder(x))), torch.ones(rows, 1))
        loss_e.backward()
        adam_e.step()
        seen.append({"reconstruction": squares.item() / rows, "discriminator": loss_d.item(), "encoder": loss_e.item()})
    return {"encoder": encoder, "decoder": decoder, "discriminator": spec_loss}, seen


@pytest.mark.parametrize(("name", "by_the_book"), [("gan", by_the_book_gan), ("aae", by_the_book_aae)])
def test_steps_are_the_published_ones(name, by_the_book, make):
    made = make(name, recipe="paper")
    model = made.model
    source = torch.Generator().manual_seed(1)
    sizes = (32, 32, 32, 5, 32)
    data = [(torch.rand(n, 6, generator=source), torch.rand(n, 2, generator=source) * 2.0 - 1.0) for n in sizes]
    parts, expected = by_the_book(model, data, torch.Generator().manual_seed(2))
    made.started()
    generator = torch.Generator().manual_seed(2)
    for (x, phi), losses in zip(data, expected, strict=True):
        got = model.update(Examples(x, phi, torch.zeros(len(x), dtype=torch.int64)), generator)
        assert {key: float(value) for key, value in got.items()} == pytest.approx(losses, rel=1e-4)
    for part, mlp in parts.items():
        for mine, theirs in zip(getattr(model, part).parameters(), mlp.parameters(), strict=True):
            # Adam divides by the gradient's own size, so the last bits of tiny gradients show; a step is 1e-3.
            torch.testing.assert_close(mine, theirs, atol=1e-4, rtol=1e-3)


def test_published_sizes(make_model):
    gan, aae = make_model("gan", recipe="paper"), make_model("aae", recipe="paper")
    assert sum(parameter.numel() for parameter in gan.generator.parameters()) == 128_518  # published: 128.5k
    assert [layer.out_features for layer in aae.encoder.linear()] == [64, 64, 128, 128, 256, 16]
    assert [layer.out_features for layer in aae.decoder.linear()] == [256, 128, 128, 64, 64, 6]
    assert aae.decoder.linear()[0].in_features == 18
    for model, inputs in ((gan, 8), (aae, 16)):
        layers = model.discriminator.linear()
        assert [layer.out_features for layer in layers] == [128, 128, 64, 64, 32, 32, 1]
        assert layers[0].in_features == inputs
