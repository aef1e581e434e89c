"""TensorBoard event files, read by TensorBoard itself. Training refuses what cannot be learnt before any work, says
where the time went, and does not gather for hours.
"""

import importlib.util
import io
import re

import pytest
import torch
from rich.console import Console

import scenegen
from scenegen.cli import train as command
from scenegen.errors import OutputError, RequestError
from scenegen.learn.models.codec import EVERY
from scenegen.learn.training import balanced as module
from scenegen.learn.training.balanced import _jointly, draw_balanced
from scenegen.learn.training.config import make_config
from scenegen.learn.training.gathering import Gathering
from scenegen.learn.training.loop import train
from scenegen.learn.training.progress import TrainingProgress
from scenegen.learn.training.session import EpochReport, Validation
from scenegen.sampling.request import Range


def report(epoch, epochs):
    return EpochReport(epoch, epochs, {"generator": 0.5, "discriminator": 0.25}, 0.5)


def test_plain_lines_where_there_is_no_terminal():
    text = io.StringIO()
    with TrainingProgress(50, "gan", Console(file=text)) as progress:
        for epoch in range(1, 51):
            progress(report(epoch, 50))
        progress.note("[bold]as it is[/bold]")
    lines = text.getvalue().splitlines()
    assert lines[0] == "gan: epoch 1/50  generator 0.5000  discriminator 0.2500  0.50 s/epoch, 24 s left"
    assert len(lines) == 12 and lines[-2].startswith("gan: epoch 50/50") and lines[-2].endswith(" 0 s left")
    assert lines[-1] == "gan: [bold]as it is[/bold]"
    assert "\x1b" not in text.getvalue()


def test_a_bar_in_a_terminal():
    text = io.StringIO()
    console = Console(file=text, force_terminal=True, width=120)
    with TrainingProgress(4, "gan", console) as progress:
        progress(report(2, 4))
    assert "2/4" in text.getvalue() and "generator 0.5000" in text.getvalue()


def test_the_default_is_standard_error(capsys):
    with TrainingProgress(2, "aae") as progress:
        progress(report(1, 2))
    captured = capsys.readouterr()
    assert captured.out == "" and "epoch 1/2" in captured.err


GOOD = Validation({"task": 0.01, "safe": 0.03}, 0.4)


def test_a_line_tells_the_error_of_phi():
    text = io.StringIO()
    with TrainingProgress(2, "gan", Console(file=text)) as progress:
        progress.step(3, 10)  # says nothing where there is no terminal
        progress(EpochReport(1, 2, {"generator": 0.5}, 0.25, GOOD, 5))
    line = "gan: epoch 1/2  generator 0.5000  phi off by 0.0200  0.25 s/epoch, 0 s left\n"
    assert text.getvalue() == line


def test_the_bar_moves_within_an_epoch():
    text = io.StringIO()
    console = Console(file=text, force_terminal=True, width=160)
    with TrainingProgress(4, "gan", console) as progress:
        assert "gathering scenes" in str(progress._bar.tasks[0].description)
        progress.step(21, 40)  # resumed in the third epoch
        (task,) = progress._bar.tasks
        assert (task.completed, task.total, task.description) == (21, 40, "gan: epoch 3/4")
        assert task.time_remaining is None  # nothing is known of its pace yet
        progress(EpochReport(3, 4, {"generator": 0.5}, 0.25, GOOD, 30))
        assert (task.completed, task.description) == (30, "gan: epoch 3/4")
        progress.step(40, 40)
        assert task.description == "gan: epoch 4/4"
    plain = re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", text.getvalue())
    assert "phi off by 0.0200" in plain and "100%" in plain


CONFIG = make_config("gan", data="uniform", epochs=2, scenes=300, batch_size=64, hyper={"width": 16})


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
        "loss/critic",
        "loss/phi",
        "loss/branch",
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
    wanted = [report.losses["critic"] for report in reports]
    assert [value for _, value in found["loss/critic"]] == pytest.approx(wanted, rel=1e-6)


def test_steps_that_are_done_again_count_once(tmp_path, exp1):
    pytest.importorskip("tensorboard")
    for _ in range(2):
        train(exp1, CONFIG, tmp_path / "m", log_dir=tmp_path / "log")
    assert [step for step, _ in scalars(tmp_path / "log")["error"]] == [5, 10]


def test_without_tensorboard_the_extra_is_named(tmp_path, exp1, monkeypatch):
    find = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == "tensorboard" else find(name))
    with pytest.raises(RequestError, match=r"pip install \"scenegen-dsl\[tensorboard\]\""):
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


NEVER = "object a, b\ntask: leftOf(a, b) & farFrom(a, b, 20 cm) & closeTo(a, b, 10 cm)"


def test_a_label_that_no_scene_satisfies_is_refused_with_the_reason_of_check(tmp_path, monkeypatch):
    from scenegen.learn.training import loop

    monkeypatch.setattr(loop, "make_feed", lambda *_: pytest.fail("work was done"))
    with pytest.raises(RequestError) as caught:
        scenegen.train(scenegen.parse(NEVER), out=tmp_path / "m")
    [diagnostic] = caught.value.diagnostics
    assert diagnostic.severity == "error" and "can never be satisfied" in diagnostic.title
    assert "closeTo(a, b, 0.1)" in diagnostic.note and not list(tmp_path.iterdir())


def test_a_label_that_does_not_vary_is_refused(tmp_path, monkeypatch):
    from scenegen.api import feasibility

    monkeypatch.setattr(feasibility, "spec_bounds", lambda spec: {"task": (0.3, 0.3)})
    with pytest.raises(RequestError, match="is 0\\.3 in every scene"):
        scenegen.train(scenegen.parse("leftOf(a, b)"), out=tmp_path / "m")


def test_the_time_of_the_whole_is_told(monkeypatch):
    now = iter([0.0, 31.0, 131.0, 142.0])
    monkeypatch.setattr(command.time, "monotonic", lambda: next(now))
    steps = []
    clock = command.Clock()
    step = clock.mark_first_step(lambda *both: steps.append(both))
    step(1, 9)
    step(2, 9)
    clock.mark_trained()
    assert str(clock) == "142 s in all (gathering 31 s, training 100 s, card 11 s)" and steps == [(1, 9), (2, 9)]


@pytest.mark.long
def test_rare_scenes_are_fewer_and_said_so(monkeypatch):
    monkeypatch.setattr(module, "BATCH_SECONDS", 1e-9)
    monkeypatch.setattr(module, "MIN_BATCH_SCENES", 50)
    spec, notes = scenegen.parse("leftOf(a, b) & closeTo(a, b, 0.2)").checked, []
    data = draw_balanced(spec, 400, torch.Generator().manual_seed(0), Gathering(note=notes.append))
    again = draw_balanced(spec, 400, torch.Generator().manual_seed(0))
    assert 100 <= len(data) < 300 and data.sha256 == again.sha256
    assert any("phi of task=0: are rare: 50 of 60 are drawn" in one.title for one in notes)


SOLVED = """object a, b
require noOverlap()
task: angle(a, NORTH, 5 deg) & angle(b, NORTH, 5 deg) & closeTo(a, b, 12 cm)"""


def test_satisfied_and_nearly_satisfied_scenes_are_a_good_share():
    """Of phi from -3 to 0.03 a range from 0 is a hundredth, and 1 scene in 50,000."""
    data = draw_balanced(scenegen.parse(SOLVED).checked, 3000, torch.Generator().manual_seed(0))
    phi = data.phi[0]
    assert float((phi >= 0.0).float().mean()) >= 0.24
    assert float(((phi < 0.0) & (phi >= -phi.max())).float().mean()) >= 0.23
    assert float((phi < -1.5).float().mean()) == pytest.approx(0.25, abs=0.04)


def test_phi_says_where_to_train():
    spec = scenegen.parse("object a, b\none: leftOf(a, b)\ntwo: closeTo(a, b, 0.3)").checked
    wanted = {"one": Range(0.1, 0.2), "two": Range(0.0, None)}
    data = draw_balanced(spec, 1000, torch.Generator().manual_seed(0), phi=wanted)
    there = (data.phi[0] >= 0.1) & (data.phi[0] <= 0.2) & (data.phi[1] >= 0.0)
    assert int((data.balanced == EVERY)[there].sum()) >= 600 and len(data) == 1000
    assert data.regions[0][0] == wanted and data.regions[0][1].shape == (2, 600)


@pytest.mark.parametrize(
    ("phi", "code"),
    [({"nothing": (0, 1)}, "unknown-label"), ({"task": (0.3, 0.1)}, "range-reversed"), ((9, 10), "beyond-bounds")],
)
def test_a_range_to_train_at_is_refused_as_sample_refuses_it(phi, code, tmp_path):
    with pytest.raises(RequestError) as trained:
        scenegen.train(scenegen.parse("leftOf(a, b)"), out=tmp_path / "m", phi=phi)
    with pytest.raises(RequestError) as sampled:
        scenegen.sample(scenegen.parse("leftOf(a, b)"), phi)
    assert trained.value.diagnostics[0].title == sampled.value.diagnostics[0].title
    assert trained.value.diagnostics[0].code == code and not list(tmp_path.iterdir())


def test_a_range_to_train_at_needs_scenes_that_are_drawn(tmp_path):
    with pytest.raises(RequestError, match="`phi` and `data` contradict each other"):
        scenegen.train(scenegen.parse("leftOf(a, b)"), out=tmp_path / "m", phi=(0, 1), data="uniform")


def test_what_is_not_thinned_is_as_it_came():
    """Thinning takes the rare cells first; what it leaves over would lack them."""
    phi = torch.rand(2, 30_000, generator=torch.Generator().manual_seed(0)) ** 3
    kept, joint = _jointly(phi, [(0.0, 1.0), (0.0, 1.0)], 10_000, torch.Generator().manual_seed(1))
    plain, thinned = phi[0, kept[~joint]], phi[0, kept[joint]]
    assert len(plain) == len(thinned) == 5000 and len(torch.unique(kept)) == 10_000
    assert float((plain > 0.5).float().mean()) == pytest.approx(float((phi[0] > 0.5).float().mean()), abs=0.02)
    assert float((thinned > 0.5).float().mean()) > 0.35


@pytest.mark.long
def test_scenes_of_several_labels_say_by_which_they_were_balanced():
    spec = scenegen.parse("object a, b\none: leftOf(a, b)\ntwo: closeTo(a, b, 0.3)").checked
    data = draw_balanced(spec, 2000, torch.Generator().manual_seed(0))
    assert set(data.balanced.tolist()) == {0, 1, EVERY}
    alone = data.phi[0][data.balanced == 0]  # flat in the first label, the other as it comes
    assert float((alone > 0.0).float().mean()) == pytest.approx(0.5, abs=0.06)
    assert draw_balanced(scenegen.parse("leftOf(a, b)").checked, 50, torch.Generator().manual_seed(0)).balanced is None


def test_a_model_asked_for_fewer_scenes_than_cells_is_not_blamed(tmp_path):
    model = scenegen.train(scenegen.parse("leftOf(a, b)"), out=tmp_path / "m", epochs=1, scenes=2000, card=False)
    scenes = scenegen.sample(model, {"task": (-0.3, 0.3)}, 10)
    assert len(scenes) == 10 and not [one for one in scenes.warnings if "cells" in one.title]
