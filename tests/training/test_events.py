"""TensorBoard event files, read by TensorBoard itself."""

import importlib.util

import pytest

from scenegen.errors import OutputError, RequestError
from scenegen.learn.training.config import make_config
from scenegen.learn.training.loop import train

CONFIG = make_config("gan", "paper", epochs=2, scenes=300, batch_size=64)


def scalars(folder):
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    found = EventAccumulator(str(folder))
    found.Reload()
    return {tag: [(event.step, event.value) for event in found.Scalars(tag)] for tag in found.Tags()["scalars"]}


def test_every_figure_of_every_epoch(tmp_path, exp1):
    pytest.importorskip("tensorboard")
    folder, reports = tmp_path / "runs" / "first", []
    train(exp1, CONFIG, tmp_path / "m", log_dir=folder, on_epoch=reports.append)
    train(exp1, CONFIG, tmp_path / "m", log_dir=folder, resume=True)  # nothing to do, nothing to add
    import dataclasses

    longer = dataclasses.replace(CONFIG, epochs=3)
    train(exp1, longer, tmp_path / "m", log_dir=folder, resume=True, on_epoch=reports.append)
    found = scalars(folder)
    assert set(found) == {
        "loss/generator",
        "loss/discriminator",
        "error/task",
        "error/safe",
        "error",
        "score",
        "learning_rate",
        "scenes_per_second",
    }
    assert all([step for step, _ in values] == [5, 10, 15] for values in found.values())
    wanted = [report.validation.errors["task"] for report in reports]
    assert [value for _, value in found["error/task"]] == pytest.approx(wanted, rel=1e-6)
    wanted = [report.losses["generator"] for report in reports]
    assert [value for _, value in found["loss/generator"]] == pytest.approx(wanted, rel=1e-6)


def test_steps_that_are_done_again_count_once(tmp_path, exp1):
    pytest.importorskip("tensorboard")
    for _ in range(2):
        train(exp1, CONFIG, tmp_path / "m", log_dir=tmp_path / "log")
    assert [step for step, _ in scalars(tmp_path / "log")["error"]] == [5, 10]


def test_without_tensorboard_the_extra_is_named(tmp_path, exp1, monkeypatch):
    find = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == "tensorboard" else find(name))
    with pytest.raises(RequestError, match=r"pip install \"scenegen\[tensorboard\]\""):
        train(exp1, CONFIG, tmp_path / "m", log_dir=tmp_path / "log")
    assert list(tmp_path.iterdir()) == []


def test_a_bad_folder_is_told_and_an_empty_one_not_left(tmp_path, exp1, monkeypatch):
    pytest.importorskip("tensorboard")
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError):
        train(exp1, CONFIG, tmp_path / "m", log_dir=tmp_path / "file")

    def fails(*_):
        raise RequestError(*_nothing())

    monkeypatch.setattr("scenegen.learn.training.loop.make_feed", fails)
    with pytest.raises(RequestError):
        train(exp1, CONFIG, tmp_path / "m", log_dir=tmp_path / "a" / "b")
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def _nothing():
    from scenegen.errors import Kind

    return (Kind("nothing", "nothing to train on")(),)
