import dataclasses
import threading

import pytest
import torch

from scenegen.errors import OutputError, RequestError
from scenegen.learn.models.checkpoint import load_model
from scenegen.learn.models.published import PublishedAAE
from scenegen.learn.robustness import Robustness
from scenegen.learn.training.config import make_config
from scenegen.learn.training.loop import train
from scenegen.learn.training.state import state_path

SMALL = make_config("aae", "paper", epochs=3, scenes=300, batch_size=64, hyper={"latent": 4})


@pytest.mark.parametrize("model", ["gan", "aae"])
def test_a_run_ends_with_a_model_file(model, tmp_path, exp1):
    out = tmp_path / "m.safetensors"
    reports = []
    threads = torch.get_num_threads()
    trained = train(exp1, make_config(model, "paper", epochs=3, scenes=300), out, on_epoch=reports.append)
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
    assert card.training == dataclasses.asdict(make_config(model, "paper", epochs=3, scenes=300))
    again = load_model(out, exp1)
    phi = torch.zeros(2, 5)
    one, two = (each.propose(phi, torch.Generator().manual_seed(0)) for each in (trained, again))
    assert torch.equal(one, two)
    assert {entry.name for entry in tmp_path.iterdir()} == {"m.safetensors", "m.safetensors.train"}


def test_the_seed_decides_every_byte(tmp_path, exp1):
    paths = [tmp_path / name for name in ("a", "b", "c")]
    for path, seed in zip(paths, (1, 1, 2), strict=True):
        train(exp1, dataclasses.replace(SMALL, seed=seed), path)
    one, two, three = (path.read_bytes() for path in paths)
    assert one == two != three
    assert state_path(paths[0]).read_bytes() == state_path(paths[1]).read_bytes()


@pytest.mark.slow
def test_training_brings_phi_closer_to_what_is_wanted(tmp_path, exp1):
    trained = train(exp1, make_config("gan", "paper", epochs=3), tmp_path / "m")
    generator = torch.Generator().manual_seed(0)
    wanted = torch.tensor([[0.19], [0.08]]).expand(2, 2000)
    robustness = Robustness(exp1.core)
    error = (robustness.rows(trained.propose(wanted, generator)) - wanted)[0].abs().mean()
    chance = (robustness.rows(torch.rand(6, 2000, generator=generator)) - wanted)[0].abs().mean()
    # Measured 0.07 against a chance of 0.45.
    assert float(error) < 0.5 * float(chance)


def test_boosted_data_and_another_thread(tmp_path, exp1):
    done = []
    config = dataclasses.replace(SMALL, data="boosted")
    thread = threading.Thread(target=lambda: done.append(train(exp1, config, tmp_path / "m")))
    thread.start()
    thread.join()
    assert done and done[0].card.training["data"] == "boosted"


def test_a_bad_place_is_told_before_the_work(tmp_path, exp1, monkeypatch):
    monkeypatch.setattr("scenegen.learn.training.loop.make_feed", lambda *_: pytest.fail("work was begun"))
    (tmp_path / "file").write_text("")
    for out in (tmp_path / "none" / "m", tmp_path, tmp_path / "file" / "m"):
        with pytest.raises(OutputError):
            train(exp1, SMALL, out)


def test_bad_settings_and_devices_are_told_before_the_work(tmp_path, exp1):
    for config, text in (
        (dataclasses.replace(SMALL, hyper={"latnet": 3}), "latnet"),
        (dataclasses.replace(SMALL, device="cuda:99"), "cuda:99"),
    ):
        with pytest.raises(RequestError, match=text):
            train(exp1, config, tmp_path / "m")
    assert list(tmp_path.iterdir()) == []


def test_divergence_is_told_and_the_last_good_checkpoint_kept(tmp_path, exp1, monkeypatch):
    out = tmp_path / "m"
    train(exp1, SMALL, out)
    good = out.read_bytes(), state_path(out).read_bytes()
    update, calls = PublishedAAE.update, []

    def broken(self, batch, generator):
        calls.append(1)
        losses = update(self, batch, generator)
        return {name: value * torch.nan for name, value in losses.items()} if len(calls) == 7 else losses

    monkeypatch.setattr(PublishedAAE, "update", broken)
    with pytest.raises(RequestError, match=r"diverged in epoch 5: the loss `reconstruction` is not finite"):
        train(exp1, dataclasses.replace(SMALL, epochs=9), out, resume=True)
    assert (out.read_bytes(), state_path(out).read_bytes()) == good


@pytest.mark.slow
def test_the_wildest_rate_leaves_a_sound_file_or_none(tmp_path, exp1):
    out = tmp_path / "m"
    for model in ("gan", "aae"):
        try:
            trained = train(exp1, make_config(model, "paper", epochs=30, scenes=500, lr=1.0), out)
        except RequestError as error:
            assert "diverged" in str(error) and not out.exists()
        else:
            assert all(bool(torch.isfinite(tensor).all()) for tensor in trained.model.state_dict().values())
