"""Sets of scenes that differ in how many things there are, and in which asset of a category: made, read, edited."""

import json

import numpy as np
import pytest
import torch

import scenegen
from scenegen.api.set_edit import filter_set, merge_sets, split_set
from scenegen.errors import ScenegenError
from scenegen.sampling.request import Range
from scenegen.scenes.blocks import BLOCK

ASSETS = '[asset("red", box(10 cm, 10 cm, 10 cm)), asset("blue", box(20 cm, 10 cm, 10 cm))]'
SPEC = f'object block[2..4], mug of category("mug", {ASSETS}), plate\nnear: forall b in block: leftOf(b, plate)\n'
COUNT = BLOCK + 500

pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("drawn") / "set"
    scenegen.sample_to(f"{place}/", scenegen.parse(SPEC), n=COUNT, seed=3, shard_size=BLOCK, workers=1)
    return place


@pytest.fixture(scope="module")
def stored(folder):
    return scenegen.open_set(folder)


def parts_of(folder):
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir()) if path.suffix in (".parquet", ".json")}


def test_workers_and_resuming_make_the_same_bytes(folder, tmp_path):
    again = tmp_path / "again"
    make = {"n": COUNT, "seed": 3, "shard_size": BLOCK}
    scenegen.sample_to(f"{again}/", scenegen.parse(SPEC), workers=2, **make)
    assert parts_of(again) == parts_of(folder)
    manifest = json.loads((again / "manifest.json").read_text())
    manifest |= {"shards": manifest["shards"][:1], "complete": False}  # as a run that was killed leaves it
    (again / "manifest.json").write_text(json.dumps(manifest))
    (again / "part-000001.parquet").unlink()
    scenegen.sample_to(f"{again}/", scenegen.parse(SPEC), workers=1, resume=True, **make)
    assert parts_of(again) == parts_of(folder)


def test_reading_says_what_is_there(stored):
    scenes = stored.read(BLOCK - 300, BLOCK + 300)
    assert np.array_equal(~np.isnan(scenes.poses).any(axis=2), scenes.present)
    assert scenes.present.sum(axis=1).tolist() == (scenes.counts["block"] + 2).tolist()


def test_streams_have_nan_where_nothing_is(stored):
    seen = 0
    for poses, phi in stored.stream(batch=4096, shuffle=True, seed=1):
        there = ~torch.isnan(poses).any(dim=2)
        names = list(stored.objects)
        red, blue = names.index("mug:red"), names.index("mug:blue")
        assert torch.all(there[:, red] ^ there[:, blue]) and torch.all(there[:, names.index("block[2]")])
        assert phi.isfinite().all()
        seen += len(poses)
    assert seen == COUNT


def test_parts_of_a_split_merge_into_the_whole(stored, tmp_path):
    parts = split_set(stored, {"train": 0.7, "test": 0.3}, 0, f"{tmp_path}/parts/")
    assert sum(part.scenes for part in parts.values()) == COUNT
    opened = [scenegen.open_set(tmp_path / "parts" / name) for name in parts]
    merge_sets(opened, f"{tmp_path}/whole/")
    whole = scenegen.open_set(tmp_path / "whole").read()
    mine, theirs = (np.sort(one.phi["near"]) for one in (stored.read(), whole))
    assert np.array_equal(mine, theirs)
    assert np.bincount(whole.counts["block"]).tolist() == np.bincount(stored.read().counts["block"]).tolist()


def test_a_filter_keeps_numbers_with_their_poses(stored, tmp_path):
    made = filter_set(stored, {"near": Range(0.0, None)}, f"{tmp_path}/near/")
    kept = scenegen.open_set(tmp_path / "near").read()
    before = stored.read()
    chosen = before.phi["near"] >= 0.0
    assert made.scenes == int(chosen.sum()) > 0
    assert np.array_equal(kept.poses, before.poses[chosen], equal_nan=True)
    assert np.array_equal(kept.counts["mug"], before.counts["mug"][chosen])


def test_nothing_is_left_of_a_merge_that_fails(folder, stored, tmp_path):
    import shutil

    torn = tmp_path / "torn"
    shutil.copytree(folder, torn)
    (torn / "part-000001.parquet").unlink()
    with pytest.raises(ScenegenError, match="part-000001"):
        merge_sets([stored, scenegen.open_set(torn)], f"{tmp_path}/both/")
    left = [path.name for path in (tmp_path / "both").iterdir() if not path.name.startswith(".")]
    assert left == []


def test_the_report_says_what_was_drawn(stored, folder):
    from scenegen.api.set_report import set_report

    report = set_report(stored, map_jobs=lambda job, items: (job(item) for item in items), verify=True, timeout=0)
    scenes = stored.read()
    assert report.drawn["block"] == {str(k): int((scenes.counts["block"] == k).sum()) for k in (2, 3, 4)}
    assert report.drawn["mug"] == {
        "red": int((scenes.counts["mug"] == 1).sum()),
        "blue": COUNT - report.drawn["mug"]["red"],
    }
    assert not report.faults
    card = (folder / "README.md").read_text()
    assert "`count.block`, `count.mug`" in card
