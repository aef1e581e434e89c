"""What the networks see, and the way back."""

import math

import pytest
import torch

from scenegen.learn.models.card import Layout
from scenegen.learn.models.codec import Examples
from scenegen.learn.models.conditioned import DataScaling, Selector
from scenegen.learn.models.generator import Generator, noise

LAYOUT = Layout(objects=2, labels=2, positions=(0, 4), angles=(2,), branches=3)


def seeded(seed=0):
    return torch.Generator().manual_seed(seed)


@pytest.fixture
def examples():
    x = torch.rand(1000, 6, generator=seeded())
    x[:, 1] = 0.25  # held in place
    x[:, 4] = 0.3 + 0.1 * x[:, 4]
    phi = torch.stack([x[:, 0] ** 3, torch.where(x[:, 4] > 0.35, 0.0, x[:, 0])], 1)
    return Examples(x, phi, torch.zeros(1000, dtype=torch.int64))


@pytest.fixture
def view(examples):
    made = DataScaling(LAYOUT)
    made.fit(examples)
    return made


def test_there_and_back(view, examples):
    u = view.encode(examples.x)
    assert u.shape == (1000, LAYOUT.coordinates) and float(u.abs().max()) <= 1.0 + 1e-5
    torch.testing.assert_close(u[:, :2].amin(0), torch.tensor([-1.0, -1.0]))
    torch.testing.assert_close(u[:, :2].amax(0), torch.tensor([1.0, 1.0]))
    back = view.scenes(u, seeded())
    torch.testing.assert_close(back[:, [0, 2, 4]], examples.x[:, [0, 2, 4]], atol=1e-5, rtol=0.0)
    assert (back[:, 1] == 0.25).all()
    free = back[:, [3, 5]]
    assert float(free.min()) < 0.01 and float(free.max()) > 0.99 and not torch.equal(free, examples.x[:, [3, 5]])


def test_features_grow_with_phi_and_span_the_data(view, examples):
    features = view.features(examples.phi)
    assert features.shape == (1000, 4) and bool(torch.isfinite(features).all())
    order = examples.phi[:, 0].sort().indices
    rank, place = features[order, 0], features[order, 2]
    assert (rank.diff() >= -1e-6).all() and (place.diff() >= -1e-6).all()
    assert float(rank[0]) == pytest.approx(-1.0, abs=1e-4) and float(rank[-1]) == pytest.approx(1.0, abs=1e-4)
    assert float(rank[500]) == pytest.approx(0.0, abs=0.02)  # the middle of the data, wherever its value lies
    beyond = view.features(torch.tensor([[50.0, -50.0], [-50.0, 50.0]]))
    assert bool(torch.isfinite(beyond).all()) and float(beyond.abs().max()) <= 9.0


def test_headings_have_no_seam(view):
    x = torch.full((2, 6), 0.35)
    x[:, 2] = torch.tensor([1e-6, 1.0 - 1e-6])
    one, two = view.encode(x)
    torch.testing.assert_close(one, two, atol=1e-4, rtol=0.0)


def test_an_open_gate_is_the_base_distribution():
    """Gates of 1 and shifts of 0, so a scene is its own noise."""
    made = Generator(LAYOUT, 8, 2)
    made.initialise(seeded())
    last = made.body.linear()[-1]
    with torch.no_grad():
        last.weight.zero_()
        last.bias.zero_()
        last.bias[-3:] = 1.0
    z = noise(500, LAYOUT, seeded(), torch.device("cpu"))
    u = made(z, torch.zeros(500, 4), torch.zeros(500, dtype=torch.int64))
    torch.testing.assert_close(u[:, :2], z[:, :2], atol=2e-3, rtol=0.0)
    torch.testing.assert_close(torch.atan2(u[:, 3], u[:, 2]), z[:, 2] * math.pi, atol=1e-4, rtol=0.0)


def test_the_selector_draws_what_it_says():
    selector = Selector(LAYOUT)
    selector.initialise(seeded())
    one = torch.zeros(1, 4)
    p = torch.softmax(selector.body(one), 1)[0]
    for features in (one.expand(30_000, -1), one.repeat(30_000, 1)):
        share = torch.bincount(selector.draw(features, seeded(1)), minlength=3) / 30_000
        # four standard errors
        torch.testing.assert_close(share, p.detach(), atol=4 * 0.5 / 30_000**0.5, rtol=0.0)
