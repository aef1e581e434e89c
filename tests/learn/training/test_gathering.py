"""Whoever waits for training scenes sees numbers, may set a limit, and may stop at any time."""

import io
import itertools
import os
import signal
import time
from types import SimpleNamespace

import pytest
import torch
from rich.console import Console

import scenegen
from scenegen.errors import DataError, RequestError
from scenegen.learn.training import balanced
from scenegen.learn.training import gathering as module
from scenegen.learn.training.config import DATASETS, GATHER_SECONDS, GATHERING, dataset_maker
from scenegen.learn.training.gathering import Gathering
from scenegen.learn.training.progress import GatheringLines, TrainingProgress

RARE = "object a, b, c\nrequire noOverlap()\ntask: leftOf(a, b) & closeTo(a, c, 0.3)\nsafe: farFrom(a, b, 0.4)"


@pytest.fixture(scope="module")
def spec():
    return scenegen.parse(RARE)


@pytest.fixture(scope="module")
def easy():
    return scenegen.parse("leftOf(mug, plate)")


@pytest.mark.long
@pytest.mark.parametrize("name", DATASETS)
def test_every_data_set_counts_and_is_not_changed_by_it(name, easy):
    told = []
    gathering = Gathering(tell=lambda *said: told.append(said))
    data = dataset_maker(name)(easy.checked, 300, torch.Generator().manual_seed(1), gathering)
    again = dataset_maker(name)(easy.checked, 300, torch.Generator().manual_seed(1))
    assert data.sha256 == again.sha256
    assert (GATHERING if name == "balanced" else "gathering scenes", 0, 300) in told
    for (stage, done, _), (later, more, wanted) in itertools.pairwise(told):
        assert more <= wanted and (more >= done or later != stage)
    if name == "balanced":
        assert told[0][0] == "measuring the range of phi" and told[-1] == (GATHERING, 300, 300)


class _Clock:
    """Goes on by a second whenever it is looked at."""

    def __init__(self):
        self.now = 0.0

    def __call__(self):
        self.now += 1.0
        return self.now


@pytest.mark.long
@pytest.mark.parametrize("seconds", [3, 30])
def test_time_is_up_wherever_it_is(seconds, spec, tmp_path, monkeypatch):
    """While phi is measured, while it is planned, while scenes are drawn: one answer, with numbers, no model, and the
    scenes that are there already are kept."""
    clock = _Clock()
    monkeypatch.setattr(module.time, "monotonic", clock)
    with pytest.raises(RequestError, match=rf"time was up after {seconds} s of (measuring|gathering)") as caught:
        scenegen.train(spec, "gan", out=tmp_path / "m.safetensors", scenes=2000, timeout=seconds)
    kept = [one.name for one in tmp_path.iterdir()]
    assert kept in ([], ["m.safetensors.scenes"])
    assert ("scenes are kept in" if kept else "nothing was written") in str(caught.value)
    assert "`timeout`" in caught.value.diagnostics[0].help


def stopping(after):
    """Raises KeyboardInterrupt once so many scenes are there."""

    def interrupt(stage, done, wanted):
        if stage == GATHERING and done > after:
            raise KeyboardInterrupt

    return interrupt


def test_an_interrupt_says_how_far_it_was_and_keeps_the_scenes(easy, tmp_path):
    """What is gathered goes on to the scenes, and so to the bytes, of an unbroken run; nothing is left over."""
    settings = {"scenes": 200, "epochs": 1, "seed": 3}
    scenegen.train(easy, "gan", out=tmp_path / "whole", **settings)
    says = r"interrupted while gathering exact scenes: \d+ of 220; \d+ scenes are kept in .*; go on with `resume="
    for after in (0, 150):
        with pytest.raises(KeyboardInterrupt, match=says):
            scenegen.train(easy, "gan", out=tmp_path / "m", on_gather=stopping(after), resume=after > 0, **settings)
        assert {one.name for one in tmp_path.iterdir()} == {"m.scenes", "whole", "whole.train"}
    scenegen.train(easy, "gan", out=tmp_path / "m", resume=True, **settings)
    assert {one.name for one in tmp_path.iterdir()} == {"m", "m.train", "whole", "whole.train"}
    assert (tmp_path / "m").read_bytes() == (tmp_path / "whole").read_bytes()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_keeps_the_scenes(number, easy, tmp_path):
    def strike(stage, done, wanted):
        if stage == GATHERING and done >= 100:
            os.kill(os.getpid(), number)

    with pytest.raises(KeyboardInterrupt, match="scenes are kept in"):
        scenegen.train(easy, "gan", out=tmp_path / "m", scenes=200, on_gather=lambda *said: strike(*said))
    with pytest.raises(DataError, match="with other options"):
        scenegen.train(easy, "gan", out=tmp_path / "m", scenes=300, resume=True)
    (tmp_path / "m.scenes").write_bytes((tmp_path / "m.scenes").read_bytes()[:-3])
    with pytest.raises(DataError, match="damaged"):
        scenegen.train(easy, "gan", out=tmp_path / "m", scenes=200, resume=True)


def test_what_takes_its_share_of_the_processor_is_cut(easy, monkeypatch):
    monkeypatch.setattr(Gathering, "overdrawn", property(lambda self: self.done > 500))
    notes = []
    data = dataset_maker("balanced")(easy.checked, 100_000, torch.Generator(), Gathering(note=notes.append))
    assert 500 < len(data) < 100_000 and notes and all(one.code == "rare-scenes" for one in notes)


def test_what_is_dear_leaves_the_others_their_time(monkeypatch):
    """Scenes that nobody has asked for cost much here, since the requirement is rare: they take half of the time, not
    what the satisfied and the nearly satisfied need."""
    spec = scenegen.parse(
        "object tray, mug, plate require noOverlap()"
        " task: angle(tray, NORTH, 2 deg) & closeTo(mug, plate, 30 cm) & leftOf(mug, tray)"
    )
    factor = 10_000  # scenes are too cheap for a test, and their estimate decides how many there are
    monkeypatch.setattr(balanced, "VISIT", {name: factor * one for name, one in balanced.VISIT.items()})
    notes = []
    data = dataset_maker("balanced")(
        spec.checked, 20_000, torch.Generator().manual_seed(1), Gathering(note=notes.append)
    )
    phi = data.phi[0]
    assert len(data) < 20_000 and "task=0:" in "".join(map(str, notes))
    assert float((phi >= 0.0).float().mean()) > 0.2 and float(((phi < 0.0) & (phi >= -phi.max())).float().mean()) > 0.1


class _RunsOut:
    """Time is up once the training loop has asked so often; what else in the process asks does not count."""

    def __init__(self, monkeypatch, after):
        self.seconds_left = after
        monkeypatch.setattr(
            "scenegen.learn.training.loop.time", SimpleNamespace(monotonic=self.ask, perf_counter=self.now)
        )
        monkeypatch.setattr("scenegen.learn.train.time", SimpleNamespace(monotonic=self.now))

    def ask(self):
        self.seconds_left -= 1
        return self.now()

    def now(self):
        return time.monotonic() + (1e6 if self.seconds_left < 0 else 0)


def test_time_is_up_between_steps(easy, tmp_path, monkeypatch):
    """The model is what training has come to; it goes on to the result of an unbroken run."""
    out, notes = tmp_path / "m.safetensors", []
    settings = {"data": "uniform", "scenes": 256, "epochs": 4, "on_note": notes.append}
    _RunsOut(monkeypatch, after=3)
    with pytest.raises(RequestError, match=r"in the first epoch(.|\n)*resume"):
        scenegen.train(easy, "gan", out=out, timeout=500.0, batch_size=32, **settings)
    _RunsOut(monkeypatch, after=8)
    made = scenegen.train(easy, "gan", out=out, timeout=500.0, batch_size=32, resume=True, card=True, **settings)
    monkeypatch.undo()
    assert made.trained.card.epochs_done == 1 and str(notes[-1]).startswith(
        "time is up after 1 of 4 epochs; go on with"
    )
    assert sorted(one.name for one in tmp_path.iterdir()) == ["m.safetensors", "m.safetensors.train"]
    scenegen.train(easy, "gan", out=out, batch_size=32, resume=True, **settings)
    scenegen.train(easy, "gan", out=tmp_path / "whole.safetensors", batch_size=32, **settings)
    assert out.read_bytes() == (tmp_path / "whole.safetensors").read_bytes()


@pytest.mark.parametrize("timeout", [0, -1, float("nan"), "5", True])
def test_a_limit_is_a_number_of_seconds(timeout, easy, tmp_path):
    with pytest.raises(RequestError, match="`timeout` is"):
        scenegen.train(easy, "gan", out=tmp_path / "m.safetensors", timeout=timeout)


def test_lines_with_numbers_and_an_estimate():
    now = used = 0.0
    lines = GatheringLines(lambda: now, lambda: used)
    assert lines("measuring the range of phi", 0, 0) is None  # what is quickly done says nothing
    now = 4.0
    assert lines("measuring the range of phi", 0, 0) == "measuring the range of phi, 4 s so far"
    now = 6.0
    assert lines("gathering scenes", 0, 5000) is None
    now = 16.0
    assert lines("gathering scenes", 1000, 5000) == "gathering scenes: 1,000 of 5,000, about 40 s left"
    now = 27.0
    assert lines("gathering scenes", 1000, 5000) == "gathering scenes: 1,000 of 5,000, none found lately"
    now, used = 38.0, 22.0  # scenes that are ever rarer: what is left follows from the limit, not from the pace
    assert lines(GATHERING, 1000, 5000) == "gathering exact scenes: 1,000 of 5,000, at most 88 s of CPU time left"


def test_a_bar_and_lines(monkeypatch):
    text = io.StringIO()
    with TrainingProgress(4, "gan", Console(file=text, force_terminal=True, width=160)) as progress:
        progress.gather("measuring the range of phi", 0, 0)
        progress.gather("gathering scenes", 1200, 5500)
        (task,) = progress._bar.tasks
        assert (task.completed, task.total, task.description) == (1200, 5500, "gan: gathering scenes")
        assert task.fields["figures"] == "1,200 of 5,500"
        progress.gather(GATHERING, 300, 5500)
        assert task.completed < 10.0 and (task.total, task.fields["left"]) == (GATHER_SECONDS, "left at most")
        progress.step(1, 40)
        assert task.fields["figures"] == "" and task.fields["left"] == "left" and task.description == "gan: epoch 1/4"
    monkeypatch.setattr("scenegen.learn.training.progress.FIRST", 0.0)
    plain = io.StringIO()
    with TrainingProgress(4, "gan", Console(file=plain)) as progress:
        progress.gather("gathering scenes", 0, 5500)
    assert plain.getvalue() == "gan: gathering scenes: 0 of 5,500, none found lately\n"
