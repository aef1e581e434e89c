"""Early stopping: when it stops, what the model file then holds, and that a break does not show."""

import dataclasses
import os
import signal

import pytest
import torch

from scenegen.errors import DataError
from scenegen.learn.models.checkpoint import load_model, pack, unpack
from scenegen.learn.models.published import PublishedGAN
from scenegen.learn.training import session
from scenegen.learn.training.config import make_config
from scenegen.learn.training.loop import Interrupted, train
from scenegen.learn.training.session import Validation
from scenegen.learn.training.state import FORMAT, state_path

pytestmark = pytest.mark.usefixtures("interruptible")
CONFIG = make_config("gan", "paper", epochs=9, scenes=300, batch_size=64, patience=2)
ERRORS = [3.0, 1.0, 2.0, 1.0, 0.5, 0.5]  # equals are no progress


@pytest.fixture
def scripted(monkeypatch):
    """scripted([...]): the errors that the validations of the next epochs find."""

    def script(errors):
        left, labels = list(errors), ("task", "safe")
        monkeypatch.setattr(session, "validate", lambda *_: Validation(dict.fromkeys(labels, left.pop(0)), 0.0))
        return left

    return script


def same_weights(one, two):
    a, b = one.model.state_dict(), two.model.state_dict()
    return all(torch.equal(a[name], b[name]) for name in a)


def test_it_stops_and_keeps_the_best(scripted, tmp_path, exp1):
    left, notes, reports = scripted(ERRORS), [], []
    found = train(exp1, CONFIG, tmp_path / "m", on_note=notes.append, on_epoch=reports.append)
    assert len(left) == 2 and [report.kept for report in reports] == [1, 2, 2, 2]
    assert (found.card.epochs_done, found.card.kept_epoch) == (4, 2)
    assert [str(note) for note in notes] == [
        "stopped after 4 epochs: no better than epoch 2, which is kept (mean error of phi 1)"
    ]
    scripted(ERRORS)
    two = train(exp1, dataclasses.replace(CONFIG, epochs=2, patience=None), tmp_path / "two")
    assert same_weights(found, two) and two.card.kept_epoch is None
    before = (tmp_path / "m").read_bytes()
    again = train(exp1, CONFIG, tmp_path / "m", resume=True, on_note=notes.append, on_epoch=pytest.fail)
    assert again.card.epochs_done == 4 and notes[1] == notes[0] and (tmp_path / "m").read_bytes() == before


def test_without_patience_the_last_is_kept(scripted, tmp_path, exp1):
    scripted(ERRORS)
    config = dataclasses.replace(CONFIG, epochs=4, patience=None)
    found = train(exp1, config, tmp_path / "m")
    assert (found.card.epochs_done, found.card.kept_epoch) == (4, None)


@pytest.mark.parametrize(("step", "kept"), [(3, None), (8, 1), (17, 2)])
def test_interrupted_and_resumed_is_bit_equal(step, kept, scripted, tmp_path, exp1, monkeypatch):
    whole, broken = tmp_path / "whole", tmp_path / "broken"
    scripted(ERRORS)
    train(exp1, CONFIG, whole)
    left = scripted(ERRORS)
    update, calls = PublishedGAN.update, []

    def sending(self, batch, generator):
        calls.append(1)
        if len(calls) == step:
            os.kill(os.getpid(), signal.SIGINT)
        return update(self, batch, generator)

    monkeypatch.setattr(PublishedGAN, "update", sending)
    with pytest.raises(Interrupted):
        train(exp1, CONFIG, broken)
    assert load_model(broken).card.kept_epoch == kept
    train(exp1, CONFIG, broken, resume=True)
    assert len(left) == 2
    assert broken.read_bytes() == whole.read_bytes()
    assert state_path(broken).read_bytes() == state_path(whole).read_bytes()


def test_a_state_with_other_best_weights_is_refused(scripted, tmp_path, exp1):
    scripted(ERRORS)
    out = tmp_path / "m"
    train(exp1, CONFIG, out)
    text, tensors = unpack(state_path(out), FORMAT, "a training state")
    name = next(name for name in tensors if name.startswith("best.generator"))
    for bad in ({**tensors, name: torch.zeros(3)}, {key: value for key, value in tensors.items() if key != name}):
        state_path(out).write_bytes(pack(FORMAT, text, bad))
        with pytest.raises(DataError, match="does not fit"):
            train(exp1, CONFIG, out, resume=True)
    none = {key: value for key, value in tensors.items() if not key.startswith("best.")}
    state_path(out).write_bytes(pack(FORMAT, text, none))
    with pytest.raises(DataError, match="is not a training state that can be used"):
        train(exp1, CONFIG, out, resume=True)


@pytest.mark.parametrize(("model", "recipe", "said"), [("gan", "paper", 0), ("energy", "default", 1)])
def test_a_rate_that_follows_another_plan_is_told(model, recipe, said, tmp_path, exp1):
    config = make_config(model, recipe, epochs=1, scenes=64, data="uniform")
    notes = []
    train(exp1, config, tmp_path / "m")
    train(exp1, dataclasses.replace(config, epochs=2), tmp_path / "m", resume=True, on_note=notes.append)
    assert len([note for note in notes if "plan of 2 epochs from here on" in str(note)]) == said == len(notes)
