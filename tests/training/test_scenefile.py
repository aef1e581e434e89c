"""Training data from scene files: any format, relabelled, checked."""

import dataclasses

import numpy as np
import pytest
import torch

import scenegen
from scenegen.api.scene_arrays import make_header
from scenegen.api.scenes import SceneSet
from scenegen.errors import DataError, RequestError
from scenegen.lang.checker import check_text
from scenegen.learn.robustness import Robustness
from scenegen.learn.training import feed
from scenegen.learn.training.feed import whole_file
from scenegen.scenes.data import RequestData

TEXT = "object mug, plate\ntask: leftOf(mug, plate)\n"


@pytest.fixture(scope="module")
def scenes():
    return scenegen.sample(scenegen.parse(TEXT), {"task": (-0.5, 0.5)}, n=40, seed=1)


@pytest.mark.parametrize("ending", [".json", ".jsonl", ".parquet"])
def test_every_format_gives_the_same_scenes(ending, scenes, tmp_path):
    spec = check_text(TEXT, "a.spec")
    data = whole_file(spec, scenes.save(tmp_path / f"s{ending}"), None)
    assert (data.objects, data.labels, len(data)) == (("mug", "plate"), ("task",), 40)
    assert torch.equal(data.rows, torch.from_numpy(scenes.poses.reshape(40, 6).T).float())
    np.testing.assert_allclose(data.phi[0].numpy(), scenes.phi["task"], atol=1e-6)
    first = whole_file(spec, tmp_path / f"s{ending}", 7)
    assert torch.equal(first.rows, data.rows[:, :7])


def test_another_spec_of_the_same_objects_labels_anew(scenes, tmp_path):
    other = check_text("object plate, mug\nnear: closeTo(mug, plate)\nup: aboveOf(mug, plate)\n", "b.spec")
    data = whole_file(other, scenes.save(tmp_path / "s.parquet"), None)
    assert (data.objects, data.labels) == (("plate", "mug"), ("near", "up"))
    assert torch.equal(data.rows[3:], torch.from_numpy(scenes.poses[:, 0].T).float())
    assert torch.equal(data.phi, Robustness(other.core).rows(data.rows))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("object mug, fork\ntask: leftOf(mug, fork)", "the scenes lack `fork`"),
        ("object mug, plate at (0.5, 0.5, 0)\ntask: leftOf(mug, plate)", r"`plate` is held at \(0.5, 0.5, 0\)"),
        ("workspace [0, 0.1] x [0, 1]\nobject mug, plate\ntask: leftOf(mug, plate)", "outside of the workspace in"),
        ("object mug, plate\nrequire aboveOf(mug, plate)\ntask: leftOf(mug, plate)", "does not meet what the spec"),
    ],
)
def test_scenes_that_the_spec_does_not_have(text, said, scenes, tmp_path):
    with pytest.raises(DataError, match=said):
        whole_file(check_text(text, "other.spec"), scenes.save(tmp_path / "s.json"), None)


def test_the_scene_at_fault_is_named(scenes, tmp_path):
    poses = scenes.poses.copy()
    poses[33, 1, 0] = 1.25
    bad = dataclasses.replace(scenes, poses=poses, trusted=True).save(tmp_path / "s.jsonl")
    with pytest.raises(DataError, match="`plate` is outside of the workspace in scene 34"):
        whole_file(check_text(TEXT, "a.spec"), bad, None)


def test_too_few_and_too_many(scenes, tmp_path, monkeypatch):
    spec = check_text(TEXT, "a.spec")
    path = scenes.save(tmp_path / "s.json")
    with pytest.raises(DataError, match="holds 40 scenes, fewer than the 41 of `scenes`"):
        whole_file(spec, path, 41)
    monkeypatch.setattr(feed, "WHOLE", 7 * 39)
    with pytest.raises(RequestError, match="more scenes than fit into memory"):
        whole_file(spec, path, None)
    assert len(whole_file(spec, path, 39)) == 39


def test_an_empty_file(tmp_path):
    spec = check_text(TEXT, "a.spec")
    header = make_header(spec, {"method": "none"}, RequestData(phi={}, n=1))
    empty = SceneSet(np.empty((0, 2, 3)), {"task": np.empty(0)}, header)
    for ending in (".json", ".parquet"):
        with pytest.raises(DataError, match="no scenes"):
            whole_file(spec, empty.save(tmp_path / f"s{ending}"), None)


DRAWN = "object block[1..3], mug\ntask: forall b in block: leftOf(b, mug)\n"


@pytest.mark.parametrize("ending", [".json", ".parquet"])
def test_a_file_of_drawn_numbers_gives_each_model_its_own_scenes(ending, tmp_path):
    drawn = scenegen.parse(DRAWN)
    scenes = scenegen.sample(drawn, {"task": (-0.5, 0.5)}, n=30, seed=2)
    path = scenes.save(tmp_path / f"s{ending}")
    for numbers, member in drawn.members:
        mine = np.flatnonzero(scenes.counts["block"] == numbers["block"])
        data = whole_file(member.checked, path, None)
        assert (data.objects, len(data)) == (member.objects, 10)
        there = [column for column, name in enumerate(scenes.objects) if name in member.objects]
        assert torch.equal(data.rows, torch.from_numpy(scenes.poses[mine][:, there].reshape(10, -1).T).float())
        np.testing.assert_allclose(data.phi[0].numpy(), scenes.phi["task"][mine], atol=1e-6)
    two = whole_file(check_text(DRAWN.replace("1..3", "2"), "two.spec"), path, 4)
    assert len(two) == 4
    with pytest.raises(DataError, match=r"10 scenes with block\[2\], fewer than the 11"):
        whole_file(check_text(DRAWN.replace("1..3", "2"), "two.spec"), path, 11)
    with pytest.raises(DataError, match=r"the spec does not know|the scenes lack"):
        whole_file(check_text(DRAWN.replace("1..3", "4"), "four.spec"), path, None)


def test_a_number_that_a_file_has_not_is_named(tmp_path):
    scenes = scenegen.sample(scenegen.parse(DRAWN), n=3, seed=2)
    few = scenes.only({"block": 2}, np.flatnonzero(scenes.counts["block"] == 2))
    assert len(few) == 1
    kept = np.flatnonzero(scenes.counts["block"] != 2)
    path = SceneSet(scenes.poses[kept], {"task": scenes.phi["task"][kept]}, scenes.header).save(tmp_path / "s.json")
    with pytest.raises(DataError, match=r"there are no scenes in .*s.json with block\[2\]"):
        whole_file(check_text(DRAWN.replace("1..3", "2"), "two.spec"), path, None)
