"""The published networks, which experiments add to the table: the contract of every model, hand-written passes against
autograd, and the published losses read plainly, with autograd and torch's own Adam. Their boosted data.
"""

import copy
import dataclasses
import math

import numpy as np
import pytest
import torch
from torch.nn.functional import binary_cross_entropy as bce

from experiments.published import register
from experiments.published.data import boosted
from experiments.published.networks import Pass, Trainable
from scenegen.errors import DataError, RequestError
from scenegen.geometry import ANGLE, LENGTH
from scenegen.geometry.workspace import Workspace
from scenegen.lang.checker import check_text
from scenegen.lang.formula.core import Apply, Atom, Const, Coord, Core, gate
from scenegen.lang.spec import CheckedSpec
from scenegen.learn.models import registry
from scenegen.learn.models.base import Mlp
from scenegen.learn.models.checkpoint import TrainedModel, load_model
from scenegen.learn.models.codec import Examples
from scenegen.learn.robustness import Robustness
from scenegen.learn.training.config import make_config
from scenegen.learn.training.dataset import uniform
from scenegen.learn.training.loop import train
from scenegen.learn.training.state import state_path

from ..learn.models.conftest import Made, card_for, new_model
from ..learn.models.test_contract import (  # noqa: F401 - the contract of every model, with the `make` of this file
    test_every_weight_gets_a_gradient,
    test_labels_are_heard,
    test_one_vector_of_labels_serves_all_scenes,
    test_samples_have_their_shape_and_lie_in_the_unit_box,
    test_the_generator_alone_decides,
    test_training_changes_the_model_and_keeps_it_finite,
    test_training_is_reproducible_and_goes_on_from_a_state,
)


@pytest.fixture(autouse=True)
def registered():
    register()


@pytest.fixture(params=["paper-gan", "paper-aae"])
def make(request):
    return lambda *words: Made(request.param, *words)


def seeded(seed=0):
    return torch.Generator().manual_seed(seed)


def paper(**options):
    return make_config("paper-gan", epochs=4, scenes=300, batch_size=64, **options)


def files(out):
    return out.read_bytes(), state_path(out).read_bytes()


def test_the_papers_settings():
    config = make_config("paper-gan")
    found = (config.epochs, config.batch_size, config.lr, config.scenes, config.data)
    assert found == (50, 32, 1e-3, 20_000, "uniform")


def test_the_product_does_not_know_them(tmp_path, exp1):
    train(exp1, dataclasses.replace(paper(), epochs=1), tmp_path / "m")
    del registry.MODELS["paper-gan"]
    with pytest.raises(DataError, match="unknown model `paper-gan`"):
        load_model(tmp_path / "m")


def test_more_epochs_than_planned_at_first(tmp_path, exp1):
    """The rate does not follow the plan."""
    whole, longer = tmp_path / "whole", tmp_path / "longer"
    train(exp1, paper(), whole)
    train(exp1, dataclasses.replace(paper(), epochs=2), longer)
    train(exp1, paper(), longer, resume=True)
    assert files(longer) == files(whole)


@pytest.mark.slow
def test_training_brings_phi_closer_to_what_is_wanted(tmp_path, exp1):
    trained = train(exp1, make_config("paper-gan", epochs=3), tmp_path / "m")
    generator = torch.Generator().manual_seed(0)
    wanted = torch.tensor([[0.19], [0.08]]).expand(2, 2000)
    robustness = Robustness(exp1.core)
    error = (robustness.rows(trained.propose(wanted, generator)) - wanted)[0].abs().mean()
    chance = (robustness.rows(torch.rand(6, 2000, generator=generator)) - wanted)[0].abs().mean()
    # Measured 0.07 against a chance of 0.45.
    assert float(error) < 0.5 * float(chance)


def test_published_models_have_to_be_told_all():
    made = Made("paper-gan")
    spec = check_text("object a, b\none: leftOf(a, b)\ntwo: aboveOf(a, b)", "two.spec")
    trained = TrainedModel(made.model, card_for("gan", made.model, spec), spec)
    assert torch.equal(trained.with_free_labels(torch.zeros(2, 5), ["two"]), torch.zeros(2, 5))
    with pytest.raises(DataError, match="told every label"):
        trained.propose(torch.full((2, 5), math.nan), torch.Generator())


WIDTHS = (5, 16, 8, 3)


def network(slope, seed=0):
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
    mlp, generator = network(slope)
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
    mlp, generator = network(0.2)
    net = Trainable(mlp)
    step = Pass(net, 4)
    step.inputs.copy_(torch.randn(4, 5, generator=generator))
    step.forward()
    step.out_grad.fill_(1.0)
    net.vector.grad.fill_(123.0)
    step.backward(weights=False, inputs=True)
    assert (net.vector.grad == 123.0).all()


def test_a_part_shares_memory_and_agrees():
    mlp, generator = network(0.2)
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
    mlp, generator = network(0.0)
    x = torch.randn(4, 5, generator=generator)
    net = Trainable(mlp)
    before = mlp(x).detach()
    with torch.no_grad():
        net.vector.mul_(0.5)
    assert not torch.equal(mlp(x), before)
    assert torch.equal(mlp.linear()[0].weight.reshape(-1), net.vector[: 5 * 16])


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
def test_steps_are_the_published_ones(name, by_the_book):
    made = Made(f"paper-{name}")
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


def test_published_sizes():
    gan, aae = new_model("paper-gan"), new_model("paper-aae")
    assert sum(parameter.numel() for parameter in gan.generator.parameters()) == 128_518  # published: 128.5k
    assert [layer.out_features for layer in aae.encoder.linear()] == [64, 64, 128, 128, 256, 16]
    assert [layer.out_features for layer in aae.decoder.linear()] == [256, 128, 128, 64, 64, 6]
    assert aae.decoder.linear()[0].in_features == 18
    for model, inputs in ((gan, 8), (aae, 16)):
        layers = model.discriminator.linear()
        assert [layer.out_features for layer in layers] == [128, 128, 64, 64, 32, 32, 1]
        assert layers[0].in_features == inputs


def narrow(limit, axis=0):
    """One object whose x (or theta) must be at most `limit`: as rare as one likes."""
    nodes = (Const(limit), Coord(0, axis), Apply("sub", (0, 1)), Atom(2, "atom", (LENGTH, ANGLE)[axis // 2], ()))
    return CheckedSpec("narrow.spec", f"task: {limit} {axis}\n", Workspace(), Core(nodes, {"task": 3}, ("mug",)))


def test_boosting_reaches_its_share_and_keeps_the_rest_uniform(exp1):
    data = boosted(exp1, 4000, seeded(), positives=0.56)
    assert data.positives == pytest.approx(0.56, abs=1e-3)
    good = (data.phi >= 0.0).all(dim=0)
    # Positives stand in random places, not in one block that batches would see at once.
    assert float(good[:2000].float().mean()) == pytest.approx(0.56, abs=0.04)
    assert torch.unique(data.rows, dim=1).shape[1] == 4000


def test_nothing_is_perturbed_where_the_share_is_there(exp1):
    plain, same = uniform(exp1, 1000, seeded()), boosted(exp1, 1000, seeded(), positives=0.1)
    assert torch.equal(plain.rows, same.rows)


def test_rare_positives_are_searched_for_and_stay_inside():
    spec = narrow(1e-4)
    data = boosted(spec, 300, seeded(), positives=0.5)
    assert data.positives == pytest.approx(0.5, abs=0.01)
    assert spec.workspace.contains(data.rows.double().numpy()).all()


def test_theta_is_wrapped_when_moved():
    data = boosted(narrow(0.02, axis=2), 300, seeded(), positives=0.9, noise=0.3)
    assert data.positives >= 0.9
    assert bool(((data.rows[2] >= 0.0) & (data.rows[2].double() < 2.0 * np.pi)).all())


def test_no_positives_is_a_diagnostic():
    with pytest.raises(RequestError, match="none of 70,000 uniform scenes"):
        boosted(narrow(-1.0), 100, seeded(), draws=70_000)


def test_positives_on_a_knifes_edge_are_repeated():
    # abs(x - c) <= 0 for the c of one drawn scene: no move keeps it.
    spec = narrow(1.0)
    x = float(uniform(spec, 50, seeded()).rows[0, 0])
    nodes = (
        Const(x),
        Coord(0, 0),
        Apply("sub", (0, 1)),
        Apply("abs", (2,)),
        Const(0.0),
        Apply("sub", (4, 3)),
        Atom(5, "edge", LENGTH, ()),
    )
    edge = CheckedSpec("edge.spec", "edge", Workspace(), Core(nodes, {"task": 6}, ("mug",)))
    assert boosted(edge, 50, seeded(), positives=0.5).positives == 0.5


def test_held_objects_and_requirements():
    text = "object mug, plate at (0.5, 0.4, 1)\nrequire noOverlap()\ntask: leftOf(mug, plate)"
    spec = check_text(text, "held.spec")
    data = boosted(spec, 3000, seeded())
    assert torch.allclose(data.rows[3:], torch.tensor([0.5, 0.4, 1.0])[:, None].expand(3, 3000))
    assert (Robustness(gate(spec.core)).rows(data.rows)[-1] >= 0.0).all()
