"""What only the default AAE has: its encoder. How it learns is in test_games.py. What only the default GAN has: the
error of phi comes in after a start. How it learns is in test_games.py. The game of the default GAN and AAE, held to
its definition. The hand-written passes against autograd. The faithful models against a plain reading of the
published losses, with autograd and torch's own Adam. What the flow's jumps must do, beyond the contract of every
model (test_contract.py).
"""

import copy
import math

import pytest
import torch
from torch.nn.functional import binary_cross_entropy as bce
from torch.nn.functional import softplus

from scenegen.errors import RequestError
from scenegen.learn.models.base import Mlp
from scenegen.learn.models.card import Layout
from scenegen.learn.models.codec import Examples
from scenegen.learn.models.flow import Flow, FlowMap, departure
from scenegen.learn.models.games import AAE, START, AAEHyper, Critic, Encoder, contest, directions
from scenegen.learn.models.published import Pass, Trainable
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


@pytest.mark.parametrize(("done", "share"), [(0, START), (49, 0.5), (99, 1.0), (5_000, 1.0)])
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
