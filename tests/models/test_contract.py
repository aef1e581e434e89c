"""What every entry of MODELS keeps to. A new model is tested by being in the table."""

import pytest
import torch

from scenegen.errors import DataError, RequestError
from scenegen.models.base import SceneModel
from scenegen.models.table import MODELS, model_class, parse_hyper

SIZES = [(1, 1), (2, 2), (7, 1)]


def seeded(seed):
    return torch.Generator().manual_seed(seed)


def batches(model, count, rows, seed=5):
    generator = seeded(seed)
    for _ in range(count):
        yield (
            torch.rand(rows, model.width, generator=generator),
            torch.rand(rows, model.labels, generator=generator) * 2.0 - 1.0,
        )


@pytest.fixture(params=MODELS)
def name(request):
    return request.param


@pytest.mark.parametrize(("objects", "labels"), SIZES)
def test_samples_have_their_shape_and_lie_in_the_unit_box(name, objects, labels, make_model):
    model = make_model(name, objects, labels)
    phi = torch.linspace(-5.0, 5.0, 9 * labels).reshape(9, labels)
    x = model.sample(9, phi, seeded(1))
    assert x.shape == (9, 3 * objects) and x.dtype == torch.float32 and not x.requires_grad
    assert bool(((x >= 0.0) & (x <= 1.0)).all())


def test_one_vector_of_labels_serves_all_scenes(name, make_model):
    model = make_model(name)
    phi = torch.tensor([0.1, -0.2])
    assert torch.equal(model.sample(6, phi, seeded(1)), model.sample(6, phi.expand(6, 2), seeded(1)))


def test_labels_are_heard(name, make_model):
    model = make_model(name)
    low, high = (model.sample(6, torch.full((2,), value), seeded(1)) for value in (-1.0, 1.0))
    assert not torch.equal(low, high)


def test_the_generator_alone_decides(name, make_model):
    model = make_model(name)
    phi = torch.zeros(2)
    assert torch.equal(model.sample(8, phi, seeded(1)), model.sample(8, phi, seeded(1)))
    assert not torch.equal(model.sample(8, phi, seeded(1)), model.sample(8, phi, seeded(2)))
    torch.manual_seed(0)
    before = torch.random.get_rng_state()
    other = make_model(name)
    other.start(1e-3)
    other.sample(8, phi, seeded(1))
    for x, labels in batches(other, 2, 4):
        other.update(x, labels, seeded(3))
    assert torch.equal(torch.random.get_rng_state(), before)


@pytest.mark.parametrize(("objects", "labels"), SIZES)
def test_training_changes_the_model_and_keeps_it_finite(name, objects, labels, make_model):
    model = make_model(name, objects, labels)
    before = model.sampler_state()
    model.start(1e-3)
    generator = seeded(3)
    names = None
    for rows in (16, 1, 16):  # the last batch of an epoch may be smaller, down to one scene
        for x, phi in batches(model, 3, rows):
            losses = model.update(x, phi, generator)
            assert names in (None, list(losses)) and losses
            names = list(losses)
            assert all(value.ndim == 0 and bool(torch.isfinite(value)) for value in losses.values())
    after = model.sampler_state()
    weights = [key for key in after if key.endswith("weight")]
    assert weights and all(not torch.equal(before[key], after[key]) for key in weights)
    assert all(bool(torch.isfinite(tensor).all()) for tensor in model.training_state().values())


def test_every_weight_gets_a_gradient(name, make_model):
    model = make_model(name)
    before = {key: tensor.clone() for key, tensor in model.state_dict().items()}
    model.start(1e-2)
    generator = seeded(3)
    for x, phi in batches(model, 5, 32):
        model.update(x, phi, generator)
    still = [key for key, tensor in model.state_dict().items() if torch.equal(tensor, before[key])]
    assert still in ([], ["label_lowest", "label_highest"])


def test_training_is_reproducible_and_goes_on_from_a_state(name, make_model):
    whole, first = make_model(name), make_model(name)
    data = list(batches(whole, 6, 8))
    whole.start(1e-3)
    first.start(1e-3)
    generator, half = seeded(3), seeded(3)
    for x, phi in data:
        whole.update(x, phi, generator)
    for x, phi in data[:3]:
        first.update(x, phi, half)
    second = model_class(name)(2, 2, parse_hyper(name, {}))
    second.restore(first.training_state(), 1e-3, torch.device("cpu"))
    for x, phi in data[3:]:
        second.update(x, phi, half)
    expected, got = whole.training_state(), second.training_state()
    assert expected.keys() == got.keys()
    assert all(torch.equal(expected[key], got[key]) for key in expected)


def test_sampler_state_suffices_to_sample(name, make_model):
    model = make_model(name)
    copy = model_class(name)(2, 2, parse_hyper(name, {}))
    copy.drop_training_parts()
    copy.load_weights(model.sampler_state())
    phi = torch.zeros(2)
    assert torch.equal(copy.sample(8, phi, seeded(1)), model.sample(8, phi, seeded(1)))


def test_a_state_that_does_not_fit_is_refused(name, make_model):
    model = make_model(name)
    model.start(1e-3)
    for x, phi in batches(model, 1, 4):
        model.update(x, phi, seeded(3))
    good = model.training_state()
    for key in good:
        for bad in (
            {other: tensor for other, tensor in good.items() if other != key} if key.startswith("model.") else None,
            {**good, key: torch.zeros(3, 3, 3)},
            {**good, key: torch.full_like(good[key], torch.nan)},
        ):
            if bad is not None:
                fresh = model_class(name)(2, 2, parse_hyper(name, {}))
                with pytest.raises(DataError):
                    fresh.restore(bad, 1e-3, torch.device("cpu"))


def test_the_table(name):
    assert issubclass(model_class(name), SceneModel)
    assert model_class(name).__doc__


def test_unknown_names_and_settings_are_diagnostics():
    with pytest.raises(RequestError, match="did you mean `gan`"):
        model_class("gann")
    with pytest.raises(RequestError, match="`latent`"):
        parse_hyper("gan", {"latnt": 3})
    with pytest.raises(RequestError, match="latent"):
        parse_hyper("aae", {"latent": 0})
