"""What only the default AAE has: its encoder. How it learns is in test_games.py. What only the default GAN has: the
error of phi comes in after a start. How it learns is in test_games.py. The game of the default GAN and AAE, held to
its definition. What the flow's jumps must do, beyond the contract of every model (test_contract.py).
"""

import math

import pytest
import torch
from torch.nn.functional import softplus

from scenegen.errors import RequestError
from scenegen.learn.models.base import Mlp
from scenegen.learn.models.card import Layout
from scenegen.learn.models.flow import Flow, FlowMap, departure
from scenegen.learn.models.games import AAE, FIRST_WEIGHT_SHARE, AAEHyper, Critic, Encoder, contest, directions
from scenegen.learn.models.registry import parse_hyper

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


def pushes(make, done, **hyper):
    """How hard the first step pushes the generator's last bias, with so many steps already done."""
    made = make("gan", 2, 1, **hyper)
    model = made.started(lr=1e-3)
    model.steps.fill_(done)
    (batch,) = made.batches(1, 64)
    model.update(batch, torch.Generator().manual_seed(3))
    return model.generator.body.linear()[-1].bias.grad.clone()


@pytest.mark.parametrize(("done", "share"), [(0, FIRST_WEIGHT_SHARE), (49, 0.5), (99, 1.0), (5_000, 1.0)])
def test_the_error_of_phi_comes_in_after_a_start(make, done, share):
    without = pushes(make, done, ramp=100, consistency=0.0)
    whole = pushes(make, 0, ramp=1, consistency=2.0) - without
    part = pushes(make, done, ramp=100, consistency=2.0) - without
    assert whole.norm() > 0.0
    torch.testing.assert_close(part, share * whole, rtol=1e-3, atol=1e-6)


def test_steps_are_counted_where_resume_finds_them_and_left_out_of_the_file(make):
    made = make("gan", 2, 1)
    model = made.started()
    for batch in made.batches(3, 4):
        model.update(batch, torch.Generator().manual_seed(3))
    assert model.training_state()["model.steps"] == 3
    assert {name.partition(".")[0] for name in model.sampler_state()} == {
        *("generator", "selector", "view", "label_lowest", "label_highest", "label_scale")
    }


LAYOUT_ADVERSARY = Layout(objects=2, labels=1, positions=(0, 1, 3), branches=3)


@pytest.fixture
def critic():
    made = Critic(LAYOUT_ADVERSARY, 3, 16, 2)
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


def test_initial_weights_are_uniform_within_one_over_root_inputs():
    mlp = Mlp((100, 200), 0.0)
    mlp.initialise(torch.Generator().manual_seed(0))
    weight = mlp.linear()[0].weight.detach()
    assert float(weight.abs().max()) <= 0.1
    assert float(weight.std()) == pytest.approx(0.1 / 3**0.5, rel=0.02)


LAYOUT_FLOW = Layout(objects=2, labels=1, positions=(0, 1, 3), angles=(5,), branches=3)


@pytest.fixture
def flow():
    """A map with fresh weights, points of the base distribution, and a context."""
    made = FlowMap(LAYOUT_FLOW, 16, 2)
    made.initialise(seeded(0))
    context = made.context(torch.linspace(-1.0, 1.0, 80).reshape(40, 2), torch.arange(40) % 3)
    return made, departure(40, LAYOUT_FLOW, seeded(1), torch.device("cpu")), context


def at(value):
    return torch.full((40, 1), value)


def steer(flow, gate, shift):
    """Give every coordinate the same gate and shift, whatever the inputs."""
    last = flow.body.linear()[-1]
    with torch.no_grad():
        last.weight.zero_()
        last.bias[: flow.coordinates] = shift
        last.bias[flow.coordinates :] = gate


def test_departures_follow_the_base_distribution():
    u = departure(20_000, LAYOUT_FLOW, seeded(3), torch.device("cpu"))
    assert u.shape == (20_000, LAYOUT_FLOW.coordinates)
    positions, cosine, sine = u[:, :3], u[:, 3], u[:, 4]
    torch.testing.assert_close(cosine.square() + sine.square(), torch.ones(20_000))
    for column in (*positions.T, torch.atan2(sine, cosine) / torch.pi):
        shares = torch.histc(column, 10, -1.0, 1.0) / 20_000
        assert bool(((shares - 0.1).abs() < 0.015).all())  # seven standard deviations


def test_jumps_begin_where_they_are_and_end_at_their_goal(flow):
    made, x, context = flow
    torch.testing.assert_close(made.jump(x, at(0.3), at(0.3), context), x)
    assert torch.equal(made.jump(x, at(0.3), at(1.0), context), made.goal(x, at(0.3), at(1.0), context))
    half = made.jump(x, at(0.5), at(0.75), context)
    torch.testing.assert_close(half, 0.5 * (x + made.goal(x, at(0.5), at(0.75), context)))


def test_an_open_gate_leaves_everything_where_it_is(flow):
    made, x, context = flow
    steer(made, gate=1.0, shift=0.0)
    torch.testing.assert_close(made.goal(x, at(0.0), at(1.0), context), x, atol=2e-3, rtol=0.0)  # clamped off the edges


def test_a_closed_gate_computes_everything(flow):
    made, x, context = flow
    steer(made, gate=0.0, shift=0.7)
    goal = made.goal(x, at(0.0), at(1.0), context)
    torch.testing.assert_close(goal[:, :3], torch.full((40, 3), 0.7).tanh())
    torch.testing.assert_close(goal[:, 3:], torch.full((40, 2), 0.7))


def test_no_position_leaves_the_box_and_times_may_meet_at_the_end(flow):
    made, x, context = flow
    steer(made, gate=3.0, shift=50.0)
    for start, end in ((0.0, 0.4), (0.4, 1.0), (1.0, 1.0)):
        x = made.jump(x, at(start), at(end), context)
        assert bool(torch.isfinite(x).all()) and bool((x[:, :3].abs() <= 1.0).all())


def test_steps_are_jumps_from_one_time_to_the_next(make_model):
    one, three = (make_model("flow", width=16, depth=2, jumps=5, steps=steps) for steps in (1, 3))
    assert isinstance(one, Flow)
    three.load_weights(one.sampler_state())
    features, branch = one.view.features(torch.zeros(40, 2)), torch.zeros(40, dtype=torch.int64)
    x, context = departure(40, one.layout, seeded(4), torch.device("cpu")), one.flow.context(features, branch)
    torch.testing.assert_close(one.make(features, branch, seeded(4)), one.flow.jump(x, at(0.0), at(1.0), context))
    for start, end in ((0.0, 1 / 3), (1 / 3, 2 / 3), (2 / 3, 1.0)):
        x = one.flow.jump(x, at(start), at(end), context)
    torch.testing.assert_close(three.make(features, branch, seeded(4)), x)
    assert not torch.equal(one.make(features, branch, seeded(4)), x)


def test_without_jumps_a_step_is_the_midpoint_rule(make_model):
    """Of the field v(x) = -x it is x (1 - h + h^2 / 2), whatever the step."""
    model = make_model("flow", width=16, depth=2, steps=4)
    model.flow.goal = lambda x, start, end, context: x - (1.0 - start) * x
    start = departure(40, model.layout, seeded(4), torch.device("cpu"))
    features, branch = model.view.features(torch.zeros(40, 2)), torch.zeros(40, dtype=torch.int64)
    torch.testing.assert_close(model.make(features, branch, seeded(4)), start * (1.0 - 0.25 + 0.25**2 / 2) ** 4)


def test_bad_steps_are_refused():
    with pytest.raises(RequestError, match="steps"):
        parse_hyper("flow", {"steps": 0})


@pytest.mark.long
def test_training_brings_scenes_to_the_wanted_phi_in_one_jump_and_in_many(make):
    made = make("flow", 1, 1, width=32, depth=2, jumps=5)
    model, wanted = made.started(lr=5e-3), torch.tensor([-0.1])

    def errors():
        off = []
        for model.steps in (1, 8):
            off.append(float((made.spec_loss.phi(model.sample(1000, wanted, seeded(1))) - wanted).abs().mean()))
        return torch.tensor(off)

    before, generator = errors(), seeded(6)
    for batch in made.batches(200, 128):
        model.update(batch, generator)
    assert bool((errors() < 0.3 * before).all())
