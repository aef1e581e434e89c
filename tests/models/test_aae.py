"""What only the default AAE has: its encoder. How it learns is in test_games.py."""

import math

import torch

from scenegen.learn.models.card import Layout
from scenegen.learn.models.games import AAE, AAEHyper, Encoder, directions

LAYOUT = Layout(objects=2, labels=1, positions=(0, 1, 3), angles=(2, 5), branches=3)


def seeded(seed):
    return torch.Generator().manual_seed(seed)


def inputs(count=16):
    generator = seeded(1)
    spread, turned = (torch.rand(count, size, generator=generator) * 2.0 - 1.0 for size in (3, 2))
    noise = torch.rand(count, 5, generator=generator) * 2.0 - 1.0
    features = torch.randn(count, 2, generator=generator)
    return torch.cat([spread, directions(turned)], dim=1), noise, features, torch.arange(count) % 3


def silent(own, other):
    """An encoder whose network says the same of every scene: these gates and no shift."""
    encoder = Encoder(LAYOUT, 8, 1)
    encoder.initialise(seeded(0))
    last = encoder.body.linear()[-1]
    with torch.no_grad():
        last.weight.zero_()
        last.bias.copy_(torch.tensor([0.0] * 7 + [own] * 5 + [other] * 5))
    return encoder


def test_with_open_gates_the_code_is_the_scene():
    u, noise, features, branch = inputs()
    torch.testing.assert_close(silent(1.0, 0.0)(u, noise, features, branch), u, atol=2e-3, rtol=0.0)


def test_with_the_other_gates_open_it_is_the_noise():
    u, noise, features, branch = inputs()
    expected = torch.cat([noise[:, :3], directions(noise[:, 3:])], dim=1)
    torch.testing.assert_close(silent(0.0, 1.0)(u, noise, features, branch), expected, atol=2e-3, rtol=0.0)


def test_codes_lie_in_the_box_and_headings_on_the_circle():
    encoder = Encoder(LAYOUT, 8, 2)
    encoder.initialise(seeded(0))
    u, noise, features, branch = inputs()
    code = encoder(u * 1.0001, noise, features * 50.0, branch)  # a scene may leave [-1, 1] by rounding
    assert bool((code[:, :3].abs() <= 1.0).all())
    torch.testing.assert_close(code[:, 3:5].square() + code[:, 5:].square(), torch.ones(16, 2), atol=1e-2, rtol=0.0)


def test_directions():
    cosine, sine = math.cos(math.pi / 4.0), math.sin(math.pi / 4.0)
    torch.testing.assert_close(directions(torch.tensor([[0.25, -0.5]])), torch.tensor([[cosine, 0.0, sine, -1.0]]))


def test_the_file_holds_the_decoder_and_not_what_trained_it():
    model = AAE(LAYOUT, AAEHyper())
    model.initialise(seeded(0))
    assert {name.partition(".")[0] for name in model.sampler_state()} == {
        *("decoder", "selector", "view", "label_lowest", "label_highest", "label_scale")
    }
