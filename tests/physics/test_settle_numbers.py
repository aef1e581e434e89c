"""Scenes that differ in how many things there are, or which: settled as scenes of fixed numbers are."""

import json

import numpy as np
import pyarrow.parquet as pq
import pytest

import scenegen

SPEC = """object tray, plate, block[2..4] = box(4 cm, 4 cm, 4 cm), cup on any of [plate.inside, tray.inside]
require noCollision()
task: forall b in block: closeTo(b, plate, 35 cm)
"""


@pytest.fixture(scope="module")
def scenes():
    return scenegen.sample(scenegen.parse(SPEC), (0.0, None), n=9, seed=1, workers=1)


@pytest.fixture(scope="module")
def settled(scenes):
    return scenegen.settle(scenes, workers=1)


@pytest.mark.long
def test_each_scene_is_settled_as_if_there_were_no_others(scenes, settled):
    assert set(scenes.counts["block"]) == {2, 3, 4}
    for k in (0, 4, 8):
        alone = scenegen.settle(scenes[k : k + 1], workers=1)
        np.testing.assert_array_equal(settled.poses[k], alone.poses[0])
        np.testing.assert_array_equal(settled.shift[k], alone.shift[0])
        assert settled.phi["task"][k] == alone.phi["task"][0] == pytest.approx(scenes[k].phi["task"], abs=1e-4)
        assert settled.contacts[k] == alone.contacts[0]


@pytest.mark.long
def test_objects_that_are_not_there_are_none(scenes, settled, tmp_path):
    assert np.array_equal(np.isnan(settled.poses).any(axis=2), ~scenes.present)
    assert settled.settled.all()
    assert "9 of 9 scenes settled" in repr(settled)
    table = pq.read_table(settled.save(tmp_path / "a.parquet")).to_pydict()
    assert [value is None for value in table["block[4].x"]] == (scenes.counts["block"] < 4).tolist()
    data = json.loads(settled.save(tmp_path / "a.json").read_text())
    for scene, plan in zip(data["scenes"], scenes, strict=True):
        assert list(scene["objects"]) == list(plan.poses)


@pytest.mark.long
def test_the_command_takes_them(scenes, tmp_path, capsys):
    from scenegen.cli.app import run

    scenes.save(tmp_path / "a.jsonl")
    line = [
        "settle",
        str(tmp_path / "a.jsonl"),
        "--out",
        str(tmp_path / "b.jsonl"),
        "--in",
        "pybullet",
        "--workers",
        "1",
    ]
    assert run(line) == 0
    assert "9 of 9 scenes settled (pybullet" in capsys.readouterr().err
    assert len((tmp_path / "b.jsonl").read_text().splitlines()) == 10
