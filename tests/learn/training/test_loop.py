"""What is measured after each epoch, and that measuring changes nothing. Every model does all of its work on its
device: on the meta device, a tensor left on the CPU would not mix.
"""

import dataclasses
import math
import threading

import numpy as np
import pytest
import torch

from scenegen.errors import OutputError, RequestError
from scenegen.lang.checker import check_text
from scenegen.learn.models.base import SpecLoss
from scenegen.learn.models.checkpoint import load_model
from scenegen.learn.models.codec import Codec, Examples
from scenegen.learn.models.games import AAE
from scenegen.learn.models.registry import MODELS
from scenegen.learn.training import session
from scenegen.learn.training.config import make_config
from scenegen.learn.training.feed import make_feed
from scenegen.learn.training.loop import train
from scenegen.learn.training.session import TrainingSession, Validation, validate
from scenegen.learn.training.state import state_path

SMALL = make_config("aae", data="uniform", epochs=3, scenes=300, batch_size=64, hyper={"width": 16})


@pytest.mark.parametrize("model", ["gan", "aae"])
def test_a_run_ends_with_a_model_file(model, tmp_path, exp1):
    out = tmp_path / "m.safetensors"
    reports = []
    threads = torch.get_num_threads()
    trained = train(exp1, make_config(model, data="uniform", epochs=3, scenes=300), out, on_epoch=reports.append)
    assert torch.get_num_threads() == threads
    assert [report.epoch for report in reports] == [1, 2, 3]
    assert all(report.epochs == 3 and report.seconds > 0.0 for report in reports)
    card = trained.card
    assert (card.model, card.epochs_done, card.objects) == (model, 3, ["mug", "plate"])
    assert card.losses.epochs == [1, 2, 3]
    for name, means in card.losses.means.items():
        assert means == [report.losses[name] for report in reports]
    assert card.spec.source == exp1.source and card.spec.sha256 == exp1.sha256
    low, high = trained.label_ranges["safe"]
    assert -0.25 <= low < 0.0 < high <= 2**0.5 - 0.25
    assert card.training == dataclasses.asdict(make_config(model, data="uniform", epochs=3, scenes=300))
    again = load_model(out, exp1)
    phi = torch.zeros(2, 5)
    one, two = (each.propose(phi, torch.Generator().manual_seed(0)) for each in (trained, again))
    assert torch.equal(one, two)
    assert {entry.name for entry in tmp_path.iterdir()} == {"m.safetensors", "m.safetensors.train"}


def test_another_thread(tmp_path, exp1):
    done = []
    thread = threading.Thread(target=lambda: done.append(train(exp1, SMALL, tmp_path / "m")))
    thread.start()
    thread.join()
    assert done and done[0].card.training["data"] == "uniform"


def test_the_seed_decides_every_byte(tmp_path, exp1):
    paths = [tmp_path / name for name in ("a", "b", "c")]
    for path, seed in zip(paths, (1, 1, 2), strict=True):
        train(exp1, dataclasses.replace(SMALL, seed=seed), path)
    one, two, three = (path.read_bytes() for path in paths)
    assert one == two != three
    assert state_path(paths[0]).read_bytes() == state_path(paths[1]).read_bytes()


def test_a_bad_place_is_told_before_the_work(tmp_path, exp1, monkeypatch):
    monkeypatch.setattr("scenegen.learn.training.loop.make_feed", lambda *_: pytest.fail("work was begun"))
    (tmp_path / "file").write_text("")
    for out in (tmp_path / "none" / "m", tmp_path, tmp_path / "file" / "m"):
        with pytest.raises(OutputError):
            train(exp1, SMALL, out)


def test_bad_settings_and_devices_are_told_before_the_work(tmp_path, exp1):
    for config, text in (
        (dataclasses.replace(SMALL, hyper={"widht": 3}), "widht"),
        (dataclasses.replace(SMALL, device="cuda:99"), "cuda:99"),
    ):
        with pytest.raises(RequestError, match=text):
            train(exp1, config, tmp_path / "m")
    assert list(tmp_path.iterdir()) == []


def test_divergence_is_told_and_the_last_good_checkpoint_kept(tmp_path, exp1, monkeypatch):
    out = tmp_path / "m"
    train(exp1, SMALL, out)
    good = out.read_bytes(), state_path(out).read_bytes()
    update, calls = AAE.update, []

    def broken(self, batch, generator):
        calls.append(1)
        losses = update(self, batch, generator)
        return {name: value * torch.nan for name, value in losses.items()} if len(calls) == 7 else losses

    monkeypatch.setattr(AAE, "update", broken)
    with pytest.raises(RequestError, match=r"diverged in epoch 5: the loss `reconstruction` is not finite"):
        train(exp1, dataclasses.replace(SMALL, epochs=9), out, resume=True)
    assert (out.read_bytes(), state_path(out).read_bytes()) == good


@pytest.mark.slow
def test_the_wildest_rate_leaves_a_sound_file_or_none(tmp_path, exp1):
    out = tmp_path / "m"
    for model in ("gan", "aae"):
        try:
            trained = train(exp1, make_config(model, data="uniform", epochs=30, scenes=500, lr=1.0), out)
        except RequestError as error:
            assert "diverged" in str(error) and not out.exists()
        else:
            assert all(bool(torch.isfinite(tensor).all()) for tensor in trained.model.state_dict().values())


CONFIG = make_config("gan", data="uniform", epochs=3, scenes=300, batch_size=64)


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


@pytest.mark.parametrize("model", ["gan", "flow"])
def test_validation_changes_no_weight(model, tmp_path, exp1, monkeypatch):
    config = make_config(model, epochs=2, scenes=300, data="uniform", hyper={})
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
        (step, CONFIG.rate(step - 1, 15), 300, step // 5) for step in (5, 10, 15)
    ]


def test_files_without_the_new_fields_still_load(tmp_path, exp1):
    from scenegen.learn.models.card import MODEL_FORMAT, ModelCard
    from scenegen.learn.models.checkpoint import pack, unpack

    train(exp1, dataclasses.replace(CONFIG, epochs=1), tmp_path / "m")
    text, tensors = unpack(tmp_path / "m", MODEL_FORMAT, "a model file")
    card = ModelCard.model_validate_json(text)
    old = card.model_dump(exclude={"data", "validation", "kept_epoch"}, mode="json")
    import json

    (tmp_path / "old").write_bytes(pack(MODEL_FORMAT, json.dumps(old), tensors))
    assert load_model(tmp_path / "old").card.validation is None


@pytest.mark.parametrize("name", ["epochs", "batch_size", "scenes", "lr"])
@pytest.mark.parametrize("value", [0, -1, math.nan, math.inf, 10**12, True, "3"])
def test_values_out_of_range_say_what_is_allowed(name, value):
    with pytest.raises(RequestError, match=rf"`{name}` is .*\n.* from .* to "):
        make_config("gan", **{name: value})


@pytest.mark.parametrize("model", MODELS)
def test_every_entry_has_settings(model):
    config = make_config(model)
    assert config.model == model
    rates = [config.rate(step, 1000) for step in range(1001)]
    assert max(rates) <= config.lr and min(rates) > 0.0
    assert rates[0] < rates[199] > rates[999] and rates[1000] == pytest.approx(0.01 * config.lr)


def test_names_that_are_nowhere():
    for name, text in (("gann", "did you mean `gan`"), ("paper-gan", "unknown model `paper-gan`")):
        with pytest.raises(RequestError, match=text):
            make_config(name)


def test_left_out_and_none_are_the_models_own():
    assert make_config("gan", epochs=None, lr=None) == make_config("gan")


def test_whole_numbers_and_seeds():
    for bad in ({"epochs": 1.5}, {"seed": -1}, {"seed": 2**63}, {"seed": 0.0}):
        with pytest.raises(RequestError, match="whole number"):
            make_config("gan", **bad)
    make_config("gan", seed=2**63 - 1, lr=1)


def test_names_are_checked_and_every_problem_is_told():
    with pytest.raises(RequestError) as caught:
        make_config("gan", data="balance", device="gpu", epochs=0)
    text = str(caught.value)
    assert len(caught.value.diagnostics) == 3
    assert "did you mean `balanced`" in text and "`cuda`" in text


def test_differences_leave_the_epochs_out():
    mine, theirs = make_config("gan", epochs=3, seed=1), make_config("gan", epochs=9, seed=2)
    assert mine.differences(theirs) == [("seed", 1, 2)]


TEXT = """
object mug, plate, fork
task: leftOf(mug, plate) & angle(mug, NORTH, 0.2) | aboveOf(mug, plate)
safe: !closeTo(mug, plate, 0.25)
"""


@pytest.mark.long
@pytest.mark.parametrize("model", MODELS)
def test_a_step_and_a_sample(model):
    spec = check_text(TEXT, "a.spec")
    config = make_config(model, data="uniform", scenes=100)
    feed = make_feed(spec, config)
    session = TrainingSession(spec, config, feed, None)
    device = torch.device("meta")
    session.model.to(device)
    session.model.start(1e-3, session.spec_loss)
    for optimiser in session.model.optimisers.values():
        optimiser.step = lambda *_: None  # the fused kernels have no meta version; they know all devices that matter
    batch = feed.fitting.to(device).take(slice(0, 32))
    losses = session.model.update(batch, None)
    assert losses and all(value.device == device for value in losses.values())
    if model == "any":  # its frames depend on the values of phi, and tensors of this device have none
        session.model._graph_in_frames = lambda phi: session.model._graph(phi.device)
    for phi in (batch.phi[:10], batch.phi[0]):
        x = session.model.sample(10, phi, None)
        assert x.shape == (10, 9) and x.device == device
    reached = session.spec_loss.phi(x)
    assert reached.shape == (10, 2) and reached.device == device
