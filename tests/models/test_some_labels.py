"""A model that is told some of its labels: which are left out in training, and what the networks then see."""

import math

import pytest
import torch

from scenegen.errors import DataError
from scenegen.lang.checker import check_text
from scenegen.learn.models.checkpoint import TrainedModel
from scenegen.learn.models.codec import EVERY, NONE, Examples
from scenegen.learn.models.conditioned import given

from .conftest import card_for


def batch(balanced, labels=4):
    count = len(balanced)
    zeros = torch.zeros(count, labels)
    return Examples(torch.zeros(count, 6), zeros, torch.zeros(count, dtype=torch.int64), torch.tensor(balanced))


def test_labels_by_which_scenes_were_balanced_are_never_left_out():
    told = given(batch([2] * 500 + [EVERY] * 500 + [NONE] * 500), torch.Generator().manual_seed(0))
    assert bool(told[:500, 2].all()) and bool(told[500:1000].all())
    counts = told.sum(1)
    assert {1, 2, 4} <= set(counts[:500].tolist()) and int(counts.min()) == 1
    assert all(0.2 < float(told[1000:, label].float().mean()) < 0.7 for label in range(4))


def test_free_labels_do_not_reach_the_network(make_model):
    model = make_model("flow", 2, 3, width=16, depth=2)
    phi = torch.tensor([[0.1, math.nan, -0.2], [0.1, 0.3, -0.2]])
    features = model.view.features(phi)
    assert features.shape == (2, 9) and bool(torch.isfinite(features).all())
    assert features[0, [1, 4, 7]].tolist() == [0.0] * 3 and features[1, 7] == 1.0
    torch.testing.assert_close(features[0, [0, 2, 3, 5]], features[1, [0, 2, 3, 5]])


@pytest.mark.parametrize("name", ["energy", "flow", "gan", "aae"])
def test_every_default_model_is_asked_for_some(name, make):
    made = make(name, 2, 3)
    spec = check_text("object a, b\none: leftOf(a, b)\ntwo: aboveOf(a, b)\nthree: closeTo(a, b)", "three.spec")
    trained = TrainedModel(made.model, card_for(name, made.model, spec, "default"), spec)
    phi = trained.asked(torch.zeros(3, 5), ["two"])
    assert bool(torch.isnan(phi[[0, 2]]).all()) and bool((phi[1] == 0.0).all())
    assert trained.propose(phi, torch.Generator().manual_seed(0)).shape == (6, 5)
    assert torch.equal(trained.asked(torch.zeros(3, 5), []), torch.zeros(3, 5))


def test_published_models_have_to_be_told_all(make):
    made = make("gan", recipe="paper")
    spec = check_text("object a, b\none: leftOf(a, b)\ntwo: aboveOf(a, b)", "two.spec")
    trained = TrainedModel(made.model, card_for("gan", made.model, spec), spec)
    assert torch.equal(trained.asked(torch.zeros(2, 5), ["two"]), torch.zeros(2, 5))
    with pytest.raises(DataError, match="told every label"):
        trained.propose(torch.full((2, 5), math.nan), torch.Generator())
