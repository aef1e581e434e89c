"""Stopping and going on: the result must not show it, bit for bit. Early stopping: when it stops, what the model file
then holds, and that a break does not show.
"""

import dataclasses
import errno
import os
import signal

import pytest
import torch

from scenegen.errors import DataError, OutputError, RequestError
from scenegen.learn.models.checkpoint import load_model, pack, unpack
from scenegen.learn.models.games import AAE, GAN
from scenegen.learn.models.registry import MODELS, model_class
from scenegen.learn.training import session
from scenegen.learn.training.config import make_config
from scenegen.learn.training.loop import Interrupted, train
from scenegen.learn.training.session import Validation
from scenegen.learn.training.state import STATE_FORMAT, state_path

pytestmark = pytest.mark.usefixtures("interruptible")


# five steps an epoch, the last of 44 scenes
CONFIG = make_config("gan", data="uniform", hyper={"width": 16}, epochs=4, scenes=300, batch_size=64)


def signal_at_step(monkeypatch, cls, number, step):
    """Send this process a signal while step `step` (from 1, over all epochs) is under way."""
    update, calls = cls.update, []

    def sending(self, batch, generator):
        calls.append(1)
        if len(calls) == step:
            os.kill(os.getpid(), number)
        return update(self, batch, generator)

    monkeypatch.setattr(cls, "update", sending)


def files(out):
    return out.read_bytes(), state_path(out).read_bytes()


@pytest.mark.long
@pytest.mark.parametrize("step", [1, 5, 6, 8, 19])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_interrupted_and_resumed_is_bit_equal(step, number, tmp_path, exp1, monkeypatch):
    whole, broken = tmp_path / "whole", tmp_path / "broken"
    train(exp1, CONFIG, whole)
    handlers = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)
    with monkeypatch.context() as patch:
        signal_at_step(patch, GAN, number, step)
        with pytest.raises(Interrupted) as caught:
            train(exp1, CONFIG, broken)
    assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)) == handlers
    assert (caught.value.epochs_done, caught.value.epochs, caught.value.path) == (step // 5, 4, broken)
    usable = load_model(broken, exp1)
    assert usable.card.epochs_done == step // 5
    assert usable.propose(torch.zeros(2, 3), torch.Generator().manual_seed(0)).shape == (6, 3)
    train(exp1, CONFIG, broken, resume=True)
    assert files(broken) == files(whole)


@pytest.mark.long
def test_interrupted_many_times(tmp_path, exp1, monkeypatch):
    whole, broken = tmp_path / "whole", tmp_path / "broken"
    config = dataclasses.replace(CONFIG, model="aae")
    train(exp1, config, whole)
    times = 0
    while True:
        try:
            with monkeypatch.context() as patch:
                signal_at_step(patch, AAE, signal.SIGINT, 3)
                train(exp1, config, broken, resume=times > 0)
            break
        except Interrupted as stop:
            assert stop.epochs_done == 3 * (times + 1) // 5
            times += 1
    assert times == 6  # 20 steps by threes; the last two end the run
    assert files(broken) == files(whole)


def test_a_signal_at_the_very_end_still_says_so(tmp_path, exp1, monkeypatch):
    out, whole = tmp_path / "m", tmp_path / "whole"
    train(exp1, CONFIG, whole)
    with monkeypatch.context() as patch:
        signal_at_step(patch, GAN, signal.SIGTERM, 20)
        with pytest.raises(Interrupted) as caught:
            train(exp1, CONFIG, out)
    assert caught.value.epochs_done == 4
    assert files(out) == files(whole)


def test_a_second_signal_does_not_wait(tmp_path, exp1, monkeypatch):
    update = GAN.update

    def twice(self, batch, generator):
        os.kill(os.getpid(), signal.SIGINT)
        os.kill(os.getpid(), signal.SIGINT)
        return update(self, batch, generator)

    monkeypatch.setattr(GAN, "update", twice)
    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt) as caught:
        train(exp1, CONFIG, tmp_path / "m")
    assert not isinstance(caught.value, Interrupted)
    assert signal.getsignal(signal.SIGINT) == before
    assert list(tmp_path.iterdir()) == []


def test_epochs_that_are_done_are_not_done_again(tmp_path, exp1):
    out = tmp_path / "m"
    train(exp1, CONFIG, out)
    before, notes = files(out), []
    for epochs in (4, 2):
        config = dataclasses.replace(CONFIG, epochs=epochs)
        trained = train(exp1, config, out, resume=True, on_epoch=pytest.fail, on_note=notes.append)
        assert trained.card.epochs_done == 4
    assert files(out) == before
    assert len([note for note in notes if "4 epochs are already done" in str(note)]) == 2
    out.unlink()
    assert train(exp1, CONFIG, out, resume=True).card.epochs_done == 4
    assert files(out) == before


def test_checkpoints_on_the_way_change_nothing(tmp_path, exp1, monkeypatch):
    whole, often = tmp_path / "whole", tmp_path / "often"
    train(exp1, CONFIG, whole)
    monkeypatch.setattr(session, "SAVE_EVERY", 0.0)
    monkeypatch.setattr(session, "SAVE_SHARE", 1e9)
    seen = []
    train(exp1, CONFIG, often, on_epoch=lambda report: seen.append(often.exists()))
    assert seen == [False, True, True, True]
    assert files(often) == files(whole)


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"seed": 1}, "`seed` was 0"),
        ({"batch_size": 32}, "`batch_size` was 64"),
        ({"scenes": 301}, "`scenes` was 300"),
        ({"lr": 0.01}, "`lr` was 0.001"),
        ({"data": "balanced"}, "`data` was 'uniform'"),
        ({"model": "aae"}, "`model` was 'gan'"),
        ({"hyper": {"width": 8}}, "`hyper` was {'width': 16}"),
    ],
)
def test_other_options_are_refused_by_name(change, named, tmp_path, exp1):
    out = tmp_path / "m"
    train(exp1, dataclasses.replace(CONFIG, epochs=1), out)
    before = files(out)
    with pytest.raises(RequestError, match=named):
        train(exp1, dataclasses.replace(CONFIG, **change), out, resume=True)
    assert files(out) == before


def test_another_spec_is_refused(tmp_path, exp1, make_exp1):
    out = tmp_path / "m"
    train(exp1, dataclasses.replace(CONFIG, epochs=1), out)
    with pytest.raises(DataError, match=r"`exp1.spec`, not `other.spec`"):
        train(make_exp1(closeness=0.3, name="other.spec"), CONFIG, out, resume=True)


@pytest.mark.long
@pytest.mark.parametrize("name", MODELS)
def test_every_model_goes_on_bit_equal(name, tmp_path, exp1, monkeypatch):
    """Their learning rate changes from step to step, and the layout comes from the data."""
    whole, broken = tmp_path / "whole", tmp_path / "broken"
    config = make_config(name, epochs=2, scenes=300, batch_size=64, data="uniform")
    train(exp1, config, whole)
    with monkeypatch.context() as patch:
        signal_at_step(patch, model_class(name), signal.SIGINT, 7)
        with pytest.raises(Interrupted):
            train(exp1, config, broken)
    train(exp1, config, broken, resume=True)
    assert files(broken) == files(whole)


def test_nothing_to_resume(tmp_path, exp1):
    with pytest.raises(DataError, match="nothing to resume"):
        train(exp1, CONFIG, tmp_path / "m", resume=True)


def test_other_data_is_noticed(tmp_path, exp1, monkeypatch):
    out = tmp_path / "m"
    train(exp1, dataclasses.replace(CONFIG, epochs=1), out)
    monkeypatch.setattr("scenegen.learn.training.dataset.Dataset.sha256", property(lambda self: "0" * 64))
    with pytest.raises(DataError, match="cannot be rebuilt"):
        train(exp1, CONFIG, out, resume=True)


def test_a_damaged_state_is_a_diagnostic(tmp_path, exp1):
    out = tmp_path / "m"
    train(exp1, dataclasses.replace(CONFIG, epochs=1), out)
    state = state_path(out)
    whole = state.read_bytes()
    for length in (0, 4, 100, 3000, len(whole) // 2, len(whole) - 1):
        state.write_bytes(whole[:length])
        with pytest.raises(DataError):
            train(exp1, CONFIG, out, resume=True)
    for place in range(9, len(whole), len(whole) // 60):
        state.write_bytes(whole[:place] + bytes([whole[place] ^ 0x5A]) + whole[place + 1 :])
        with pytest.raises(DataError):
            train(exp1, CONFIG, out, resume=True)
    state.write_bytes(out.read_bytes())  # a model file is not a training state
    with pytest.raises(DataError, match="is not a training state"):
        train(exp1, CONFIG, out, resume=True)


def test_a_full_disk_keeps_the_earlier_run(tmp_path, exp1, monkeypatch):
    out = tmp_path / "m"
    train(exp1, dataclasses.replace(CONFIG, epochs=1), out)
    before = files(out)

    def full(descriptor):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", full)
        with pytest.raises(OutputError, match="no space left"):
            train(exp1, CONFIG, out, resume=True)
    assert files(out) == before
    assert len(list(tmp_path.iterdir())) == 2


def test_a_crash_between_the_state_and_the_model_is_made_good(tmp_path, exp1):
    out = tmp_path / "m"
    train(exp1, dataclasses.replace(CONFIG, epochs=1), out)
    early = out.read_bytes()
    train(exp1, CONFIG, out, resume=True)
    done = files(out)
    out.write_bytes(early)  # as if the machine had stopped before the last model was written
    train(exp1, CONFIG, out, resume=True)
    assert files(out) == done


CONFIG_PATIENCE = dataclasses.replace(CONFIG, epochs=9, patience=2)
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


def test_it_stops_and_keeps_the_best(scripted, tmp_path, exp1, monkeypatch):
    left, notes, reports = scripted(ERRORS), [], []
    found = train(exp1, CONFIG_PATIENCE, tmp_path / "m", on_note=notes.append, on_epoch=reports.append)
    assert len(left) == 2 and [report.kept for report in reports] == [1, 2, 2, 2]
    assert (found.card.epochs_done, found.card.kept_epoch) == (4, 2)
    assert [str(note) for note in notes] == [
        "stopped after 4 epochs: no better than epoch 2, which is kept (mean error of phi 1)"
    ]
    scripted(ERRORS)
    with monkeypatch.context() as patch:
        signal_at_step(patch, GAN, signal.SIGINT, 10)  # the last of epoch 2
        with pytest.raises(Interrupted):
            train(exp1, dataclasses.replace(CONFIG_PATIENCE, patience=None), tmp_path / "two")
    two = load_model(tmp_path / "two")
    assert same_weights(found, two) and two.card.kept_epoch is None
    before = (tmp_path / "m").read_bytes()
    again = train(exp1, CONFIG_PATIENCE, tmp_path / "m", resume=True, on_note=notes.append, on_epoch=pytest.fail)
    assert again.card.epochs_done == 4 and notes[1] == notes[0] and (tmp_path / "m").read_bytes() == before


def test_without_patience_the_last_is_kept(scripted, tmp_path, exp1):
    scripted(ERRORS)
    config = dataclasses.replace(CONFIG_PATIENCE, epochs=4, patience=None)
    found = train(exp1, config, tmp_path / "m")
    assert (found.card.epochs_done, found.card.kept_epoch) == (4, None)


@pytest.mark.parametrize(("step", "kept"), [(3, None), (8, 1), (17, 2)])
def test_interrupted_and_resumed_is_bit_equal_patience(step, kept, scripted, tmp_path, exp1, monkeypatch):
    whole, broken = tmp_path / "whole", tmp_path / "broken"
    scripted(ERRORS)
    train(exp1, CONFIG_PATIENCE, whole)
    left = scripted(ERRORS)
    update, calls = GAN.update, []

    def sending(self, batch, generator):
        calls.append(1)
        if len(calls) == step:
            os.kill(os.getpid(), signal.SIGINT)
        return update(self, batch, generator)

    monkeypatch.setattr(GAN, "update", sending)
    with pytest.raises(Interrupted):
        train(exp1, CONFIG_PATIENCE, broken)
    assert load_model(broken).card.kept_epoch == kept
    train(exp1, CONFIG_PATIENCE, broken, resume=True)
    assert len(left) == 2
    assert broken.read_bytes() == whole.read_bytes()
    assert state_path(broken).read_bytes() == state_path(whole).read_bytes()


def test_a_state_with_other_best_weights_is_refused(scripted, tmp_path, exp1):
    scripted(ERRORS)
    out = tmp_path / "m"
    train(exp1, CONFIG_PATIENCE, out)
    text, tensors = unpack(state_path(out), STATE_FORMAT, "a training state")
    name = next(name for name in tensors if name.startswith("best.generator"))
    for bad in ({**tensors, name: torch.zeros(3)}, {key: value for key, value in tensors.items() if key != name}):
        state_path(out).write_bytes(pack(STATE_FORMAT, text, bad))
        with pytest.raises(DataError, match="does not fit"):
            train(exp1, CONFIG_PATIENCE, out, resume=True)
    none = {key: value for key, value in tensors.items() if not key.startswith("best.")}
    state_path(out).write_bytes(pack(STATE_FORMAT, text, none))
    with pytest.raises(DataError, match="is not a training state that can be used"):
        train(exp1, CONFIG_PATIENCE, out, resume=True)


def test_a_rate_that_follows_another_plan_is_told(tmp_path, exp1):
    config = make_config("flow", epochs=1, scenes=64, data="uniform")
    notes = []
    train(exp1, config, tmp_path / "m")
    train(exp1, dataclasses.replace(config, epochs=2), tmp_path / "m", resume=True, on_note=notes.append)
    assert len(notes) == 1 and "plan of 2 epochs from here on" in str(notes[0])
