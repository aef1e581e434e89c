"""The game of the default GAN and AAE, held to its definition."""

import math

import pytest
import torch
from torch.nn.functional import softplus

from scenegen.learn.models.card import Layout
from scenegen.learn.models.games import Critic, contest

LAYOUT = Layout(objects=2, labels=1, positions=(0, 1, 3), branches=3)


def seeded(seed):
    return torch.Generator().manual_seed(seed)


@pytest.fixture
def critic():
    made = Critic(LAYOUT, 3, 16, 2)
    made.initialise(seeded(0))
    return made


@pytest.fixture
def pairs():
    generator = seeded(1)
    true, made = (torch.randn(8, 3, generator=generator) for _ in range(2))
    return true, made, torch.randn(8, 2, generator=generator), torch.arange(8) % 3


def test_the_maker_is_pulled_by_the_gradient_of_its_own_surprise(critic, pairs):
    true, made, features, branch = pairs
    made.requires_grad_()
    _, _, deceit = contest(critic, true, made, features, branch, 0.3)
    (got,) = torch.autograd.grad(deceit, made)
    lead = critic(true, features, branch) - critic(made, features, branch)
    (expected,) = torch.autograd.grad(softplus(lead).mean(), made)
    torch.testing.assert_close(got, expected)


def test_the_maker_s_loss_leaves_the_critic_alone_and_the_critic_s_the_maker(critic, pairs):
    true, made, features, branch = pairs
    made.requires_grad_()
    _, ruling, deceit = contest(critic, true, made, features, branch, 0.3)
    assert not any(p.grad_fn or p.grad is not None for p in critic.parameters())
    deceit.backward()
    assert all(p.grad is None for p in critic.parameters())
    made.grad = None
    ruling.backward()
    assert made.grad is None and all(p.grad is not None for p in critic.parameters())


def test_the_critic_pays_for_its_slope_on_either_side(critic, pairs):
    true, made, features, branch = pairs
    surprise, ruling, _ = contest(critic, true, made, features, branch, 0.3)
    total = 0.0
    for rows in (true, made):
        rows = rows.clone().requires_grad_()
        (slopes,) = torch.autograd.grad(critic(rows, features, branch).sum(), rows)
        total += slopes.square().sum(1).mean().item()
    assert ruling.item() - surprise.item() == pytest.approx(0.15 * total, rel=1e-4)


def test_the_critic_cannot_tell_a_scene_from_itself(critic, pairs):
    true, _, features, branch = pairs
    surprise, _, _ = contest(critic, true, true.clone(), features, branch, 0.3)
    assert surprise.item() == pytest.approx(math.log(2.0))


def test_the_critic_hears_the_labels_and_the_branch(critic, pairs):
    true, _, features, branch = pairs
    scores = critic(true, features, branch)
    assert not torch.equal(scores, critic(true, features + 1.0, branch))
    assert not torch.equal(scores, critic(true, features, (branch + 1) % 3))
