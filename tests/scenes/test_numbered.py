"""Files of scenes that differ in how many things there are: every format says how many, and reads back bit for bit."""

import json

import numpy as np
import pandas
import pyarrow.parquet as pq
import pytest

import scenegen
from scenegen.api.scene_arrays import rows_of
from scenegen.errors import DataError

SPEC = "object block[1..3], cup[1..2], mug\ntask: forall b in block: leftOf(b, mug)\n"


@pytest.fixture(scope="module")
def scenes():
    return scenegen.sample(scenegen.parse(SPEC), (0.0, None), n=12, seed=5)


@pytest.mark.parametrize("ending", ["json", "jsonl", "parquet"])
def test_a_file_reads_back(scenes, tmp_path, ending):
    again = scenegen.read_scenes(scenes.save(tmp_path / f"a.{ending}"))
    assert np.array_equal(again.poses, scenes.poses, equal_nan=True)
    assert {name: each.tolist() for name, each in again.counts.items()} == {
        name: each.tolist() for name, each in scenes.counts.items()
    }
    assert np.array_equal(again.phi["task"], scenes.phi["task"])
    assert again.header == scenes.header
    again.save(tmp_path / f"b.{ending}")
    assert (tmp_path / f"a.{ending}").read_bytes() == (tmp_path / f"b.{ending}").read_bytes()


def test_json_has_no_pose_of_what_is_not_there(scenes, tmp_path):
    data = json.loads(scenes.save(tmp_path / "a.json").read_bytes())
    assert data["version"] == 1
    assert data["counts"] == [{"name": "block", "least": 1, "most": 3}, {"name": "cup", "least": 1, "most": 2}]
    assert len(data["objects"]) == 6
    for scene in data["scenes"]:
        blocks = [name for name in scene["poses"] if name.startswith("block")]
        assert blocks == [f"block[{k}]" for k in range(1, scene["counts"]["block"] + 1)]


def test_any_layout_of_a_line_is_read(scenes, tmp_path):
    path = scenes.save(tmp_path / "a.jsonl")
    head, *lines = path.read_text().splitlines()
    odd = [json.dumps(dict(reversed(json.loads(line).items())), indent=None, separators=(",", ":")) for line in lines]
    path.write_text("\n".join([head, *odd]) + "\n")
    assert np.array_equal(scenegen.read_scenes(path).poses, scenes.poses, equal_nan=True)


def test_parquet_has_a_column_of_numbers_and_nulls(scenes, tmp_path):
    path = scenes.save(tmp_path / "a.parquet")
    table = pq.read_table(path)
    assert table["count.block"].to_pylist() == scenes.counts["block"].tolist()
    assert table["block[3].x"].null_count == int((scenes.counts["block"] < 3).sum()) > 0
    assert not table.schema.field("block[1].x").nullable
    assert pandas.read_parquet(path).equals(scenes.to_pandas())


def other_count(scene):
    scene["counts"]["block"] = 3 - scene["counts"]["block"] // 3


def no_pose(scene):
    del scene["poses"]["block[1]"]


def no_counts(scene):
    del scene["counts"]


def too_many(scene):
    scene["counts"]["block"] = 4


@pytest.mark.parametrize("ending", ["json", "jsonl"])
@pytest.mark.parametrize("damage", [other_count, no_pose, no_counts, too_many])
def test_a_scene_that_contradicts_itself_is_refused(scenes, tmp_path, ending, damage):
    path = scenes.save(tmp_path / f"a.{ending}")
    if ending == "json":
        data = json.loads(path.read_text())
        damage(data["scenes"][3])
        path.write_text(json.dumps(data))
    else:
        lines = path.read_text().splitlines()
        scene = json.loads(lines[4])
        damage(scene)
        path.write_text("\n".join([*lines[:4], json.dumps(scene), *lines[5:]]) + "\n")
    with pytest.raises(DataError) as error:
        scenegen.read_scenes(path)
    assert error.value.diagnostics[0].code in ("other-objects", "damaged-scenes")


@pytest.mark.parametrize("column", ["count.block", "mug.x", "block[2].x"])
def test_a_row_that_contradicts_itself_is_refused(scenes, tmp_path, column):
    path = scenes.save(tmp_path / "a.parquet")
    table = pq.read_table(path)
    place = table.schema.get_field_index(column)
    values = table[column].to_pylist()
    values[0] = 1 + values[0] % 3 if column == "count.block" else float("nan") if values[0] is not None else 0.5
    changed = table.set_column(place, table.schema.field(column), [values])
    pq.write_table(changed, path)
    with pytest.raises(DataError) as error:
        scenegen.read_scenes(path)
    assert error.value.diagnostics[0].code == "numbers-disagree"
    assert "scene 1 of" in error.value.diagnostics[0].title


def header_without_elements(header):
    header["objects"] = header["objects"][:2]


def header_backwards(header):
    header["counts"][0] |= {"least": 3, "most": 1}


def header_twice(header):
    header["counts"] *= 2


def header_of_millions(header):
    header["counts"][0]["most"] = 10**15


@pytest.mark.parametrize("damage", [header_without_elements, header_backwards, header_twice, header_of_millions])
def test_a_header_that_contradicts_itself_is_refused(scenes, tmp_path, damage):
    path = scenes.save(tmp_path / "a.jsonl")
    head, *lines = path.read_text().splitlines()
    header = json.loads(head)
    damage(header)
    path.write_text("\n".join([json.dumps(header), *lines]) + "\n")
    with pytest.raises(DataError) as error:
        scenegen.read_scenes(path)
    assert error.value.diagnostics[0].code == "damaged-scenes"


def test_what_needs_the_same_objects_refuses_them(scenes):
    with pytest.raises(DataError, match="differ in how many things there are"):
        rows_of(scenegen.parse("leftOf(mug, cup)").checked, scenes)


@pytest.mark.long
def test_simulators_get_a_file_for_each_scene(scenes, tmp_path):
    paths = scenes[:4].export(tmp_path / "m", "mjcf")
    assert [path.name for path in paths] == [f"scene_000{k}.xml" for k in range(1, 5)]
    for number, path in enumerate(paths):
        text = path.read_text()
        assert all(
            (f'body name="{name}"' in text) == here
            for name, here in zip(scenes.objects, scenes.present[number], strict=True)
        )
    scenes[:4].export(tmp_path / "s", "sdf")
    assert len(list((tmp_path / "s").glob("*.sdf"))) == 4
    with pytest.raises(scenegen.errors.RequestError) as error:
        scenes.export(tmp_path / "all.xml")
    assert error.value.diagnostics[0].code == "one-file-many-numbers"


def test_quaternions_of_what_is_not_there_are_nan(scenes):
    found = scenes.poses7()
    assert (np.isnan(found).all(axis=2) == ~scenes.present).all()
    assert not np.isnan(found[scenes.present]).any()


WEIGHTED = "object block[1: 1, 2: 2, 4: 5], cup[1..2], mug\ntask: forall b in block: leftOf(b, mug)\n"


@pytest.mark.parametrize("ending", ["json", "jsonl", "parquet"])
def test_weighted_numbers_have_their_shares_in_every_format(tmp_path, ending):
    spec = scenegen.parse(WEIGHTED)
    scenes = scenegen.sample(spec, (0.0, None), n=32, seed=5)
    again = scenegen.read_scenes(scenes.save(tmp_path / f"a.{ending}"))
    assert np.bincount(again.counts["block"]).tolist() == [0, 4, 8, 0, 20]
    assert np.bincount(again.counts["cup"]).tolist() == [0, 16, 16]
    assert np.array_equal(again.phi["task"], scenes.phi["task"]) and again.header == scenes.header
    assert [one["share"] for one in scenes.header.sampler["numbers"]] == [1 / 16, 1 / 16, 1 / 8, 1 / 8, 5 / 16, 5 / 16]
    assert scenegen.parse(spec.source).counts == spec.counts
    with pytest.raises(scenegen.RequestError, match="the spec draws 1, 2 or 4"):
        spec.with_counts({"block": 3})


def test_a_number_that_is_not_listed_is_refused(tmp_path):
    scenes = scenegen.sample(scenegen.parse(WEIGHTED), (0.0, None), n=16, seed=5)
    data = json.loads(scenes.save(tmp_path / "a.json").read_bytes())
    assert data["counts"][0] == {"name": "block", "least": 1, "most": 4, "values": [1, 2, 4]}
    scene = next(one for one in data["scenes"] if one["counts"]["block"] == 4)
    del scene["poses"]["block[4]"]
    scene["counts"]["block"] = 3
    (tmp_path / "b.json").write_text(json.dumps(data))
    with pytest.raises(DataError, match="there cannot be 3 of `block`"):
        scenegen.read_scenes(tmp_path / "b.json")


def test_pairs_have_the_shares_of_weighted_numbers():
    pairs = scenegen.pairs(scenegen.parse(WEIGHTED), (0.0, None), n=16, seed=5)
    assert np.bincount(pairs.counts["block"]).tolist() == [0, 2, 4, 0, 10]


def test_rarity_is_the_mean_by_weights():
    """With c cups right of the mug, all of them: P = 1 / (c + 1), by symmetry."""
    text = "object cup[{}], mug\ntask: forall c in cup: leftOf(mug, c)\n"
    found = scenegen.rarity(scenegen.parse(text.format("1: 3, 3: 1")), seed=1).labels[0]
    share = 10 ** next(one.above.log10 for one in found.levels if one.phi == 0.0)
    assert share == pytest.approx((3 / 2 + 1 / 4) / 4, rel=0.03)
