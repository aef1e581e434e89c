"""Scenes of a file that is larger than memory, window by window: the same scenes, the same model after a break."""

import dataclasses
import os
import signal

import numpy as np
import pytest
import torch

from scenegen.api.scene_arrays import make_header
from scenegen.api.scenes import SceneSet
from scenegen.errors import DataError, RequestError
from scenegen.learn.models.codec import survey
from scenegen.learn.models.games import GAN
from scenegen.learn.training import feed
from scenegen.learn.training import feed as feeds
from scenegen.learn.training.config import make_config
from scenegen.learn.training.dataset import uniform
from scenegen.learn.training.feed import MemoryFeed, Windows, make_feed, rank_branches, sorted_into
from scenegen.learn.training.loop import Interrupted, train
from scenegen.learn.training.state import state_path
from scenegen.scenes.data import RequestData

M = 950


@pytest.fixture
def file(tmp_path, exp1, monkeypatch):
    """950 uniform scenes of experiment 1 as Parquet, in ten row groups."""
    monkeypatch.setattr("scenegen.scenes.formats.parquet.BLOCK", 100)
    rows = uniform(exp1, M, torch.Generator().manual_seed(0)).rows.double().numpy()
    header = make_header(exp1, {"method": "uniform"}, RequestData(phi={}, n=M))
    phi = dict.fromkeys(exp1.labels, np.zeros(M))  # not looked at
    return SceneSet(np.ascontiguousarray(rows.T).reshape(M, 2, 3), phi, header, trusted=True).save(
        tmp_path / "s.parquet"
    )


@pytest.fixture
def small(monkeypatch):
    """Nothing fits into memory; a window holds four batches of 32."""
    monkeypatch.setattr(feed, "MEMORY_NUMBERS", 0)
    monkeypatch.setattr(feeds, "WINDOW_NUMBERS", 8 * 32 * 4 + 5)


def config(file, **options):
    return make_config("gan", hyper={"width": 16}, data=str(file), epochs=2, batch_size=32, **options)


def table(examples):
    return torch.cat([examples.x, examples.phi], dim=1)


def sets(made, epoch=0):
    return torch.cat([table(batch) for batch in made.batches(epoch, 0)]), table(made.held)


def ordered(rows):
    return torch.unique(rows, dim=0)


def test_windows_hold_the_scenes_that_memory_would(file, exp1, small, monkeypatch):
    streamed = make_feed(exp1, config(file))
    monkeypatch.setattr(feed, "MEMORY_NUMBERS", 10**9)
    whole = make_feed(exp1, config(file))
    assert isinstance(streamed, Windows) and isinstance(whole, MemoryFeed)
    assert (streamed.scenes, streamed.steps) == (whole.scenes, whole.steps) == (855, 27)
    for one, two in zip(sets(streamed), sets(whole), strict=True):
        assert len(one) == len(two) and torch.equal(ordered(one), ordered(two))
    for one, two in ((streamed.fitting, whole.fitting),):
        assert torch.equal(one.phi.amin(0), two.phi.amin(0)) and torch.equal(one.phi.amax(0), two.phi.amax(0))
        assert torch.equal(one.x.amin(0), two.x.amin(0)) and torch.equal(one.x.amax(0), two.x.amax(0))


def test_batches_are_full_and_start_anywhere(file, exp1, small):
    made = make_feed(exp1, config(file))
    batches = [table(batch) for batch in made.batches(1, 0)]
    assert [len(batch) for batch in batches] == [32] * 26 + [855 - 26 * 32]
    for step in (1, 4, 5, 26):
        rest = [table(batch) for batch in made.batches(1, step)]
        assert len(rest) == 27 - step and all(map(torch.equal, rest, batches[step:]))
    other = [table(batch) for batch in made.batches(0, 0)]
    assert not torch.equal(other[0], batches[0])


def test_the_choice_keeps_the_extremes(file, exp1, small, monkeypatch):
    full = make_feed(exp1, config(file))
    monkeypatch.setattr("scenegen.learn.training.feed.CHOSEN", 8 * 95)
    some = make_feed(exp1, config(file))
    assert len(some.fitting) < 130 < len(full.fitting)
    for end in (torch.amin, torch.amax):
        assert torch.equal(end(some.fitting.phi, 0), end(full.fitting.phi, 0))
        assert torch.equal(end(some.fitting.x, 0), end(full.fitting.x, 0))


def test_branches_are_those_of_a_survey(file, exp1, small, monkeypatch):
    rows = uniform(exp1, 500, torch.Generator().manual_seed(3)).rows
    branch, names = survey(exp1, rows)
    ways = {tuple(way): int((branch == index).sum()) for index, way in enumerate(names.tolist())}
    assert torch.equal(rank_branches(ways), names)
    assert torch.equal(sorted_into(exp1, rows, names), branch)
    monkeypatch.setattr(feeds, "MAX_BRANCHES", 1)
    assert rank_branches(ways).tolist() == [[-1, -1]]
    assert torch.equal(sorted_into(exp1, rows, names[:1]), torch.zeros(500, dtype=torch.int64))
    monkeypatch.undo()


def test_the_first_scenes_alone(file, exp1, small):
    made = make_feed(exp1, config(file, scenes=330))
    assert (made.scenes, len(made.held)) == (297, 33)
    with pytest.raises(DataError, match="950 scenes, fewer than the 951"):
        make_feed(exp1, config(file, scenes=951))


@pytest.mark.long
@pytest.mark.parametrize(("windows", "step"), [(True, 2), (True, 27), (True, 33), (False, 33)])
def test_interrupted_and_resumed_is_bit_equal(windows, step, file, exp1, tmp_path, monkeypatch, request):
    if windows:
        request.getfixturevalue("small")
    whole, broken = tmp_path / "whole", tmp_path / "broken"
    train(exp1, config(file), whole)
    update, calls = GAN.update, []

    def sending(self, batch, generator):
        calls.append(1)
        if len(calls) == step:
            os.kill(os.getpid(), signal.SIGTERM)
        return update(self, batch, generator)

    monkeypatch.setattr(GAN, "update", sending)
    with pytest.raises(Interrupted):
        train(exp1, config(file), broken)
    train(exp1, config(file), broken, resume=True)
    assert broken.read_bytes() == whole.read_bytes()
    assert state_path(broken).read_bytes() == state_path(whole).read_bytes()


def test_a_file_that_changes_is_noticed(file, exp1, tmp_path, small):
    made = make_feed(exp1, config(file))
    train(exp1, dataclasses.replace(config(file), epochs=1), tmp_path / "m")
    os.utime(file, ns=(1, 1))
    with pytest.raises(DataError, match="has changed since"):
        next(made.batches(0, 0))
    rows = uniform(exp1, M, torch.Generator().manual_seed(1)).rows.double().numpy()
    header = make_header(exp1, {"method": "uniform"}, RequestData(phi={}, n=M))
    poses = np.ascontiguousarray(rows.T).reshape(M, 2, 3)
    SceneSet(poses, dict.fromkeys(exp1.labels, np.zeros(M)), header, trusted=True).save(file)
    with pytest.raises(DataError, match="the training data is not what it was"):
        train(exp1, config(file), tmp_path / "m", resume=True)


def test_flow_learns_from_windows(file, exp1, tmp_path, small):
    options = make_config("flow", data=str(file), epochs=2, batch_size=32, hyper={"width": 16, "depth": 1})
    done = train(exp1, options, tmp_path / "m")
    assert done.card.data.scenes == 855 and done.card.training["scenes"] is None
    assert done.card.validation.epochs == [1, 2]


@pytest.mark.parametrize(
    ("data", "said"), [("scenes.csv", "not a format of scene files"), ("balancd", "did you mean `balanced`")]
)
def test_names_that_are_neither_data_set_nor_file(data, said):
    with pytest.raises(RequestError, match=said):
        make_config("gan", data=data)


def test_a_file_that_is_not_there(exp1, tmp_path):
    for ending in ("parquet", "jsonl"):
        with pytest.raises(DataError, match="no such file"):
            make_feed(exp1, config(tmp_path / f"none.{ending}"))


def test_everything_goes_to_the_device(exp1, file, small):
    """The meta device holds no numbers: a tensor that was left on the CPU does not mix with it."""
    for data in (str(file), "uniform"):
        options = make_config("flow", data=data, scenes=300, batch_size=32)
        made = make_feed(exp1, options)
        made.device = torch.device("meta")
        made._examples = made._examples.to("meta") if isinstance(made, MemoryFeed) else made._examples
        batch = next(made.batches(0, 0))
        assert {batch.x.device.type, batch.phi.device.type, batch.branch.device.type} == {"meta"}
