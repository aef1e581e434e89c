"""Trained models as proposers, through the API: raw and refined. (One epoch: too few to be good, enough to be used.)"""

import numpy as np
import pytest

import scenegen
from scenegen.api.scenes import evaluate

WANTED = {"task": (0.05, 0.2), "safe": (0.0, None)}


@pytest.fixture(scope="module", params=["gan", "aae"])
def model(request, tmp_path_factory, root=None):
    from scenegen.resources import shipped_specs

    spec = scenegen.load(shipped_specs()["mug_left_of_plate"])
    out = tmp_path_factory.mktemp("models") / "m.safetensors"
    return scenegen.train(spec, request.param, out=out, epochs=1, scenes=640, card=False)


def in_range(phi):
    return (phi["task"] >= 0.05) & (phi["task"] <= 0.2) & (phi["safe"] >= 0.0)


@pytest.mark.long
def test_raw_is_unfiltered_and_marked(model):
    raw = scenegen.sample(model, WANTED, n=500, seed=1, raw=True)
    assert len(raw) == 500 and raw.header.sampler["raw"] is True
    assert not in_range(raw.phi).all()
    again = evaluate(model.spec.checked, raw)
    assert all(np.array_equal(again[label], raw.phi[label]) for label in again)
    assert np.array_equal(scenegen.sample(model, WANTED, n=500, seed=1, raw=True).poses, raw.poses)


@pytest.mark.long
def test_refined_is_verified_and_reproducible(model):
    fine = scenegen.sample(model, WANTED, n=320, seed=1)
    assert len(fine) == 320 and in_range(fine.phi).all()
    assert fine.header.sampler["raw"] is False and fine.header.sampler["model"] == model.name
    assert np.array_equal(scenegen.sample(model, WANTED, n=320, seed=1).poses, fine.poses)
    assert not np.array_equal(scenegen.sample(model, WANTED, n=320, seed=2).poses, fine.poses)


@pytest.mark.long
def test_rejection_from_a_model_file_uses_its_spec(model):
    one = scenegen.sample(model, WANTED, n=20, seed=1, method="rejection")
    two = scenegen.sample(model.spec, WANTED, n=20, seed=1)
    assert np.array_equal(one.poses, two.poses) and one.header.sampler["method"] == "rejection"


@pytest.mark.long
def test_raw_scenes_are_not_settled(model):
    with pytest.raises(scenegen.RequestError, match="leave `raw` or `settle` out"):
        scenegen.sample(model, WANTED, raw=True, settle=True)
