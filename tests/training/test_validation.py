"""What is measured after each epoch, and that measuring changes nothing."""

import dataclasses

import numpy as np
import pytest
import torch

from scenegen.learn.models.base import SpecLoss
from scenegen.learn.models.checkpoint import load_model
from scenegen.learn.models.codec import Codec, Examples
from scenegen.learn.training import session
from scenegen.learn.training.config import make_config
from scenegen.learn.training.feed import make_feed
from scenegen.learn.training.loop import train
from scenegen.learn.training.session import Validation, validate

CONFIG = make_config("gan", "paper", epochs=3, scenes=300, batch_size=64)


class Scripted:
    """A model whose scenes are given."""

    def __init__(self, *batches):
        self.batches = list(batches)

    def sample(self, n, phi, generator):
        assert phi.shape == (n, 2)
        return self.batches.pop(0)


@pytest.fixture
def spec_loss(exp1):
    return SpecLoss(exp1.core, torch.full((1, 2), -1), Codec(exp1.workspace, 2))


def held(spec_loss, count, seed=0):
    x = torch.rand(count, 6, generator=torch.Generator().manual_seed(seed))
    return Examples(x, spec_loss.phi(x), torch.zeros(count, dtype=torch.int64))


def test_errors_and_score_by_hand(spec_loss):
    truth = held(spec_loss, 7)
    one, two = torch.rand(7, 6), torch.rand(7, 6)
    found = validate(Scripted(one, two), spec_loss, truth, ("task", "safe"), torch.Generator())

    def phi(x):
        mx, my, _, px, py, _ = x.double().numpy().T
        return np.stack([np.minimum(px - mx, my - py), np.hypot(mx - px, my - py) - 0.25])

    def points(x):
        x = x.double().numpy()
        turns = 2 * np.pi * x[:, 2::3]
        return np.hstack([x[:, 0::3], x[:, 1::3], np.cos(turns) / 2 / np.pi, np.sin(turns) / 2 / np.pi])

    def apart(a, b):
        return np.linalg.norm(points(a) - points(b), axis=1).mean()

    error = (np.abs(phi(one) - phi(truth.x)) + np.abs(phi(two) - phi(truth.x))).mean(axis=1) / 2
    assert [found.errors["task"], found.errors["safe"]] == pytest.approx(error.tolist(), abs=1e-6)
    assert found.error == pytest.approx(error.mean(), abs=1e-6)
    score = (apart(truth.x, one) + apart(truth.x, two) - apart(one, two)) / 2
    assert found.score == pytest.approx(score, abs=1e-6)


def test_the_score_sees_a_collapse_that_the_error_does_not(spec_loss):
    truth = held(spec_loss, 2000)
    same = held(spec_loss, 1).x.expand(2000, 6)  # one scene, again and again
    fresh = [held(spec_loss, 2000, seed).x for seed in (1, 2)]
    collapsed, good = (
        validate(Scripted(*made), spec_loss, truth, ("task", "safe"), torch.Generator())
        for made in ((same, same), fresh)
    )
    assert collapsed.score > 1.2 * good.score


def test_held_out_scenes_never_train(exp1):
    feed = make_feed(exp1, CONFIG)
    seen = torch.cat([batch.x for batch in feed.batches(0, 0)])
    assert (len(seen), len(feed.held), feed.scenes, feed.steps) == (300, 30, 300, 5)
    every = torch.cat([seen, feed.held.x])
    assert len(torch.unique(every, dim=0)) == 330
    later = torch.cat([batch.x for batch in feed.batches(1, 3)])
    assert len(later) == 300 - 3 * 64 and not torch.equal(later, seen[3 * 64 :])
    again = torch.cat([batch.x for batch in feed.batches(1, 0)])
    assert torch.equal(again[3 * 64 :], later)


@pytest.mark.parametrize(("model", "recipe"), [("gan", "paper"), ("energy", "default")])
def test_validation_changes_no_weight(model, recipe, tmp_path, exp1, monkeypatch):
    config = make_config(model, recipe, epochs=2, scenes=300, data="uniform", hyper={})
    seen = train(exp1, config, tmp_path / "seen")
    blind = Validation({"task": 0.0, "safe": 0.0}, 0.0)
    monkeypatch.setattr(session, "validate", lambda *_: blind)
    unseen = train(exp1, config, tmp_path / "unseen")
    one, two = seen.model.state_dict(), unseen.model.state_dict()
    assert all(torch.equal(one[name], two[name]) for name in one)


def test_reports_and_card_tell_the_same(tmp_path, exp1):
    reports, steps = [], []
    trained = train(
        exp1, CONFIG, tmp_path / "m", on_epoch=reports.append, on_step=lambda done, total: steps.append((done, total))
    )
    found = trained.card.validation
    assert found.epochs == [1, 2, 3]
    for label in ("task", "safe"):
        assert found.errors[label] == [report.validation.errors[label] for report in reports]
    assert found.scores == [report.validation.score for report in reports]
    assert (trained.card.data.scenes, trained.card.data.held_out, trained.card.kept_epoch) == (300, 30, None)
    assert steps == [(done, 15) for done in range(1, 16)]
    assert [(report.step, report.rate, report.scenes, report.kept) for report in reports] == [
        (5, 1e-3, 300, 1),
        (10, 1e-3, 300, 2),
        (15, 1e-3, 300, 3),
    ]


def test_files_without_the_new_fields_still_load(tmp_path, exp1):
    from scenegen.learn.models.card import FORMAT, ModelCard
    from scenegen.learn.models.checkpoint import pack, unpack

    train(exp1, dataclasses.replace(CONFIG, epochs=1), tmp_path / "m")
    text, tensors = unpack(tmp_path / "m", FORMAT, "a model file")
    card = ModelCard.model_validate_json(text)
    old = card.model_dump(exclude={"data", "validation", "kept_epoch"}, mode="json")
    import json

    (tmp_path / "old").write_bytes(pack(FORMAT, json.dumps(old), tensors))
    assert load_model(tmp_path / "old").card.validation is None
