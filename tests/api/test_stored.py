"""Stored sets: read in parts, streamed to several readers, merged, split, filtered, reported. Sets of scenes that
differ in how many things there are, and in which asset of a category: made, read, edited. Manifests that were
edited or damaged: one diagnostic that names the field, or the same scenes.
"""

import copy
import json
import pickle
import shutil

import numpy as np
import pytest
import torch

import scenegen
from scenegen.api.dataset import make_dataset
from scenegen.api.set_card import card
from scenegen.api.set_edit import filter_set, merge_sets, split_set
from scenegen.api.set_report import set_report
from scenegen.errors import DataError, RequestError, ScenegenError
from scenegen.sampling.request import Range
from scenegen.scenes.blocks import BLOCK

from ..laws import FULL, in_full_again

COUNT = 2 * BLOCK + 1000


@pytest.fixture(scope="module")
def spec():
    return scenegen.parse("object mug, plate\ntask: leftOf(mug, plate)\n")


@pytest.fixture(scope="module")
def stored(spec, tmp_path_factory):
    folder = tmp_path_factory.mktemp("sets") / "set"
    written = scenegen.sample_to(f"{folder}/", spec, (0.0, 0.5), n=COUNT, shard_size=BLOCK, workers=1)
    assert written.count == COUNT and written.header.sampler["method"] == "rejection"
    return scenegen.open_set(folder)


@pytest.fixture(scope="module")
def whole(stored):
    return scenegen.read_scenes(stored.location)


def here(job, items):
    return (job(item) for item in items)


def test_reading(stored, whole):
    assert len(stored) == len(whole) == COUNT and stored.labels == ("task",) and stored.objects == ("mug", "plate")
    assert len(stored.shards) == 3 and "132072 scenes of mug, plate" in repr(stored)
    part = stored.read(BLOCK - 5, BLOCK + 5)
    np.testing.assert_array_equal(part.poses, whole.poses[BLOCK - 5 : BLOCK + 5])
    assert len(stored.read(COUNT)) == 0
    with pytest.raises(RequestError, match="`stop`"):
        stored.read(0, COUNT + 1)
    assert len(scenegen.read_scenes(stored.location, start=10, stop=20)) == 10


def test_refused_before_any_work(stored, spec, tmp_path, monkeypatch):
    """A complete set is returned with `resume`, and never planned for without."""
    place = f"{stored.location}/"
    again = scenegen.sample_to(place, spec, (0.0, 0.5), n=COUNT, shard_size=BLOCK, workers=1, resume=True)
    assert again.count == COUNT and not again.warnings
    monkeypatch.setattr("scenegen.api.stream.plan_for", lambda *_: pytest.fail("planned"))
    with pytest.raises(RequestError, match="has a set of scenes already"):
        scenegen.sample_to(place, spec, n=10)
    with pytest.raises(RequestError, match="there is no engine `rai`"):
        scenegen.sample_to(f"{tmp_path}/new/", spec, n=10, engine="rai")
    assert not (tmp_path / "new").exists()


def test_batches_in_order(stored, whole):
    poses, phi = (np.concatenate(parts) for parts in zip(*stored.batches(5000, shuffle=False), strict=True))
    np.testing.assert_array_equal(poses, whole.poses)
    np.testing.assert_array_equal(phi[:, 0], whole.phi["task"])


@pytest.mark.parametrize("even", [False, True])
def test_readers_share_the_scenes(even, stored, whole):
    """Each scene goes to one reader; another epoch is another order, the same epoch the same."""
    readers = 5
    batches = stored.batches(4096, seed=3, even=even)
    found = [[phi[:, 0] for _, phi in batches.for_reader(reader, readers, 1)] for reader in range(readers)]
    assert [len(parts) for parts in found] == [len(batches.for_reader(reader, readers, 1)) for reader in range(readers)]
    counts = [sum(map(len, parts)) for parts in found]
    assert max(counts) - min(counts) <= (0 if even else 1)
    seen = np.concatenate([part for parts in found for part in parts])
    assert len(seen) == COUNT - (COUNT % readers if even else 0)
    assert np.isin(seen, whole.phi["task"]).all() and len(np.unique(seen)) == len(seen)
    again = np.concatenate([phi[:, 0] for _, phi in batches.for_reader(0, readers, 1)])
    np.testing.assert_array_equal(again, np.concatenate(found[0]))
    other = np.concatenate([phi[:, 0] for _, phi in batches.for_reader(0, readers, 2)])
    assert not np.array_equal(other, again)
    # neighbours in the file are not neighbours in the stream: ranks of consecutive scenes are far apart
    order = {value: place for place, value in enumerate(whole.phi["task"].tolist())}
    places = np.array([order[value] for value in again.tolist()])
    assert np.median(np.abs(np.diff(places))) > 1000


def test_streams_of_tensors(stored):
    import torch
    from torch.utils.data import DataLoader

    stream = stored.stream(10_000, seed=1)
    first = torch.cat([phi for _, phi in stream])
    second = torch.cat([phi for _, phi in stream])
    assert first.dtype == torch.float32 and first.shape == (COUNT, 1) and not torch.equal(first, second)
    stream.set_epoch(0)
    assert torch.equal(torch.cat([phi for _, phi in stream]), first)
    assert len(pickle.loads(pickle.dumps(stream))._batches.stored) == COUNT  # noqa: S301 - our own
    loaded = DataLoader(stored.stream(10_000, rank=1, ranks=2, even=True), batch_size=None, num_workers=1)
    assert sum(len(poses) for poses, _ in loaded) == COUNT // 2
    with pytest.raises(RequestError, match="`rank`"):
        stored.stream(rank=2, ranks=2)
    with pytest.raises(RequestError, match="`batch`"):
        stored.stream(0)


def test_edits(stored, whole, tmp_path):
    parts = split_set(stored, {"train": 0.75, "test": 0.25}, 7, f"{tmp_path}/parts/")
    assert sum(one.scenes for one in parts.values()) == COUNT
    assert abs(parts["train"].scenes / COUNT - 0.75) < 0.01
    train, test = (scenegen.open_set(tmp_path / "parts" / name) for name in parts)
    values = [np.concatenate([phi[:, 0] for _, phi in one.batches(shuffle=False)]) for one in (train, test)]
    np.testing.assert_array_equal(np.sort(np.concatenate(values)), np.sort(whole.phi["task"]))
    merged = merge_sets([train, test], f"{tmp_path}/merged/")
    assert merged.scenes == COUNT
    sources = merged.request["from"]["merged"]
    assert sources[0]["request"]["from"]["part"] == "train" and len(sources[1]["sha256"]) == 1
    hard = filter_set(stored, {"task": Range(0.0, 0.1)}, f"{tmp_path}/hard/")
    kept = scenegen.read_scenes(tmp_path / "hard").phi["task"]
    np.testing.assert_array_equal(kept, whole.phi["task"][whole.phi["task"] <= 0.1])
    assert hard.complete and hard.request["from"]["phi"] == {"task": [0.0, 0.1]}
    with pytest.raises(DataError, match="no scene of"):
        filter_set(stored, {"task": Range(0.9, None)}, f"{tmp_path}/none/")
    assert not (tmp_path / "none" / "manifest.json").exists()
    with pytest.raises(RequestError, match="shares of a split"):
        split_set(stored, {"a": 0.9, "b": 0.2}, 0, f"{tmp_path}/more/")
    other = scenegen.parse("object mug, plate\ntask: rightOf(mug, plate)\n")
    scenegen.sample_to(f"{tmp_path}/other/", other, n=100, workers=1)
    with pytest.raises(DataError, match="their spec differ"):
        merge_sets([stored, scenegen.open_set(tmp_path / "other")], f"{tmp_path}/both/")


@pytest.mark.long
def test_a_report(stored, whole, tmp_path):
    report = set_report(stored, map_jobs=here, verify=True)
    assert not report.faults and report.repeated == 0 and report.scenes == COUNT and report.verified
    assert report.phi["task"].sum() == COUNT and report.phi["task"].max() < 1.1 * COUNT / 32
    assert report.places["mug"].sum() == COUNT and report.places["mug"].shape == (24, 16)
    assert report.coverage is not None and min(report.coverage) > 0.9
    twice = merge_sets([stored, stored], f"{tmp_path}/twice/")
    assert set_report(scenegen.open_set(tmp_path / "twice"), map_jobs=here, timeout=0).repeated == twice.scenes // 2


def test_damaged_shards_are_named(stored, tmp_path):
    import shutil

    folder = tmp_path / "set"
    shutil.copytree(stored.location, folder)
    first, second, _ = (folder / shard.file for shard in stored.shards)
    data = bytearray(first.read_bytes())
    data[len(data) // 2] ^= 1
    first.write_bytes(data)
    second.unlink()
    report = set_report(scenegen.open_set(folder), map_jobs=here, verify=True)
    assert [one.file for one in report.faults] == [first.name, second.name]
    assert "checksum" in report.faults[0].fault and "missing" in report.faults[1].fault and report.coverage is None
    with pytest.raises(DataError):
        scenegen.read_scenes(folder)


def test_phi_that_is_not_the_specs(stored, tmp_path, monkeypatch):
    """--verify scores every scene again, and does not trust a checksum that was written beside wrong values."""
    from scenegen.api import set_edit
    from scenegen.scenes.blocks import Block

    wrong = lambda one: (Block(block.rows, block.phi + 1e-6) for block in set_edit._blocks(one))  # noqa: E731
    set_edit.write_blocks(f"{tmp_path}/set/", stored, wrong(stored), {})
    report = set_report(scenegen.open_set(tmp_path / "set"), map_jobs=here, verify=True, timeout=0)
    assert len(report.faults) == 3 and "phi of `task` is off by 1e-06" in report.faults[0].fault


TWO = "object mug, plate, fork\na: leftOf(mug, plate)\nb: leftOf(fork, plate)\n"


def impostor(folder, name):
    """A shard that is not the one of the set's manifest, though each is a scene file that can be read."""
    import json

    import pyarrow.parquet as pq

    path, manifest = folder / "part-000000.parquet", json.loads((folder / "manifest.json").read_text())
    table = pq.read_table(path)
    header = json.loads(table.schema.metadata[b"scenegen"])
    names = list(table.column_names)
    if name == "labels":  # what their order says
        names[-2:] = names[-1], names[-2]
    elif name == "objects":
        header["objects"] = header["objects"][::-1]
        names[:9] = [*names[6:9], *names[3:6], *names[:3]]
    elif name == "rows":
        table = table.slice(1)
    elif name == "other scenes":
        other = scenegen.sample(scenegen.parse(TWO), n=len(table), seed=9, workers=1)
        other.save(path)
        table = pq.read_table(path)
    table = table.rename_columns(names).replace_schema_metadata({b"scenegen": json.dumps(header).encode()})
    pq.write_table(table, path, compression="zstd")
    manifest["shards"][0]["bytes"] = path.stat().st_size  # the size is checked, too; but it may be the same by chance
    (folder / "manifest.json").write_text(json.dumps(manifest))


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("labels", "its labels are not those of the manifest"),
        ("objects", "its objects are not those of the manifest"),
        ("rows", "its number of scenes is not that of the manifest"),
        ("other scenes", "its range of phi is not that of the manifest"),
    ],
)
def test_every_reader_names_a_shard_that_is_another(name, said, tmp_path):
    folder = tmp_path / "set"
    scenegen.sample_to(f"{folder}/", scenegen.parse(TWO), n=500, workers=1)
    impostor(folder, name)
    there = scenegen.open_set(folder)
    fine = tmp_path / "fine"
    scenegen.sample_to(f"{fine}/", scenegen.parse(TWO), n=500, workers=1)
    readers = [
        lambda: scenegen.read_scenes(folder),
        lambda: there.read(0, 5),
        lambda: next(iter(there.batches())),
        lambda: next(iter(there.stream())),
        lambda: merge_sets([scenegen.open_set(fine), there], f"{tmp_path}/both/"),
    ]
    for read in readers:
        with pytest.raises(DataError, match=rf"part-000000\.parquet in .*{said}|its checksum is not that"):
            read()
    assert not list((tmp_path / "both").glob("*.parquet"))
    faults = set_report(there, map_jobs=here, timeout=0).faults
    assert [(one.file, one.fault) for one in faults] == [("part-000000.parquet", said)]


def test_a_new_set_is_made_of_the_bytes_that_its_source_had(tmp_path):
    """The checksum of a shard stands in the new set: where it is copied, it is checked."""
    import json

    scenegen.sample_to(f"{tmp_path}/set/", scenegen.parse(TWO), n=500, workers=1)
    path = tmp_path / "set" / "manifest.json"
    manifest = json.loads(path.read_text())
    manifest["shards"][0]["sha256"] = "0" * 64
    path.write_text(json.dumps(manifest))
    stored = scenegen.open_set(tmp_path / "set")
    with pytest.raises(DataError, match=r"part-000000\.parquet in .* its checksum is not that of the manifest"):
        filter_set(stored, {"a": Range(0.0, None)}, f"{tmp_path}/some/")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda m: m["header"]["objects"].reverse(), "its objects are not those of the manifest"),
        (lambda m: m["header"]["objects"].pop(), "has columns|has a column|its objects are not"),
        (lambda m: m["labels"].reverse(), "phi of part-000000.parquet is not that of the labels"),
        (lambda m: m["labels"].append("c"), "phi of part-000000.parquet is not that of the labels"),
        (lambda m: m["shards"][0]["phi"].pop("a"), "phi of part-000000.parquet is not that of the labels"),
        (lambda m: m["shards"][0].update(scenes=0), "greater than or equal to 1"),
        (lambda m: m["request"].pop("n"), "`request.n` in manifest.json: field required"),
        (lambda m: m["request"].update(phi="x"), "`request.phi` in manifest.json"),
    ],
)
def test_a_manifest_that_does_not_fit_its_shards(change, said, tmp_path):
    import json

    for name in ("set", "other"):
        scenegen.sample_to(f"{tmp_path}/{name}/", scenegen.parse(TWO), n=500, workers=1)
    path = tmp_path / "set" / "manifest.json"
    manifest = json.loads(path.read_text())
    change(manifest)
    path.write_text(json.dumps(manifest))
    with pytest.raises(DataError, match=said) as caught:
        next(iter(scenegen.open_set(tmp_path / "set").batches()))
    assert len(caught.value.diagnostics) == 1
    with pytest.raises(DataError):
        merge_sets([scenegen.open_set(tmp_path / "other"), scenegen.open_set(tmp_path / "set")], f"{tmp_path}/both/")


ASSETS = '[asset("red", box(10 cm, 10 cm, 10 cm)), asset("blue", box(20 cm, 10 cm, 10 cm))]'
SPEC = f'object block[2..4], mug of category("mug", {ASSETS}), plate\nnear: forall b in block: leftOf(b, plate)\n'
COUNT_NUMBERS = BLOCK + 500


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("drawn") / "set"
    scenegen.sample_to(f"{place}/", scenegen.parse(SPEC), n=COUNT_NUMBERS, seed=3, shard_size=BLOCK, workers=1)
    return place


@pytest.fixture(scope="module")
def stored_numbers(folder):
    return scenegen.open_set(folder)


def parts_of(folder):
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir()) if path.suffix in (".parquet", ".json")}


@pytest.mark.long
def test_workers_and_resuming_make_the_same_bytes(folder, tmp_path):
    again = tmp_path / "again"
    make = {"n": COUNT_NUMBERS, "seed": 3, "shard_size": BLOCK}
    scenegen.sample_to(f"{again}/", scenegen.parse(SPEC), workers=2, **make)
    assert parts_of(again) == parts_of(folder)
    manifest = json.loads((again / "manifest.json").read_text())
    manifest |= {"shards": manifest["shards"][:1], "complete": False}  # as a run that was killed leaves it
    (again / "manifest.json").write_text(json.dumps(manifest))
    (again / "part-000001.parquet").unlink()
    scenegen.sample_to(f"{again}/", scenegen.parse(SPEC), workers=1, resume=True, **make)
    assert parts_of(again) == parts_of(folder)


@pytest.mark.long
def test_reading_says_what_is_there(stored_numbers):
    scenes = stored_numbers.read(BLOCK - 300, BLOCK + 300)
    assert np.array_equal(~np.isnan(scenes.poses).any(axis=2), scenes.present)
    assert scenes.present.sum(axis=1).tolist() == (scenes.counts["block"] + 2).tolist()


@pytest.mark.long
def test_streams_have_nan_where_nothing_is(stored_numbers):
    seen = 0
    for poses, phi in stored_numbers.stream(batch=4096, shuffle=True, seed=1):
        there = ~torch.isnan(poses).any(dim=2)
        names = list(stored_numbers.objects)
        red, blue = names.index("mug:red"), names.index("mug:blue")
        assert torch.all(there[:, red] ^ there[:, blue]) and torch.all(there[:, names.index("block[2]")])
        assert phi.isfinite().all()
        seen += len(poses)
    assert seen == COUNT_NUMBERS


@pytest.mark.long
def test_parts_of_a_split_merge_into_the_whole(stored_numbers, tmp_path):
    parts = split_set(stored_numbers, {"train": 0.7, "test": 0.3}, 0, f"{tmp_path}/parts/")
    assert sum(part.scenes for part in parts.values()) == COUNT_NUMBERS
    opened = [scenegen.open_set(tmp_path / "parts" / name) for name in parts]
    merge_sets(opened, f"{tmp_path}/whole/")
    whole = scenegen.open_set(tmp_path / "whole").read()
    mine, theirs = (np.sort(one.phi["near"]) for one in (stored_numbers.read(), whole))
    assert np.array_equal(mine, theirs)
    assert np.bincount(whole.counts["block"]).tolist() == np.bincount(stored_numbers.read().counts["block"]).tolist()


@pytest.mark.long
def test_a_filter_keeps_numbers_with_their_poses(stored_numbers, tmp_path):
    made = filter_set(stored_numbers, {"near": Range(0.0, None)}, f"{tmp_path}/near/")
    kept = scenegen.open_set(tmp_path / "near").read()
    before = stored_numbers.read()
    chosen = before.phi["near"] >= 0.0
    assert made.scenes == int(chosen.sum()) > 0
    assert np.array_equal(kept.poses, before.poses[chosen], equal_nan=True)
    assert np.array_equal(kept.counts["mug"], before.counts["mug"][chosen])


@pytest.mark.long
def test_nothing_is_left_of_a_merge_that_fails(folder, stored_numbers, tmp_path):
    import shutil

    torn = tmp_path / "torn"
    shutil.copytree(folder, torn)
    (torn / "part-000001.parquet").unlink()
    with pytest.raises(ScenegenError, match="part-000001"):
        merge_sets([stored_numbers, scenegen.open_set(torn)], f"{tmp_path}/both/")
    left = [path.name for path in (tmp_path / "both").iterdir() if not path.name.startswith(".")]
    assert left == []


@pytest.mark.long
def test_the_report_says_what_was_drawn(stored_numbers, folder):
    from scenegen.api.set_report import set_report

    report = set_report(
        stored_numbers, map_jobs=lambda job, items: (job(item) for item in items), verify=True, timeout=0
    )
    scenes = stored_numbers.read()
    assert report.drawn["block"] == {str(k): int((scenes.counts["block"] == k).sum()) for k in (2, 3, 4)}
    assert report.drawn["mug"] == {
        "red": int((scenes.counts["mug"] == 1).sum()),
        "blue": COUNT_NUMBERS - report.drawn["mug"]["red"],
    }
    assert not report.faults
    card = (folder / "README.md").read_text()
    assert "`count.block`, `count.mug`" in card


TWO_MANIFESTS = (
    "region mat = rect(0.2, 0.2, 0.6, 0.6)\nobject mug, plate\na: leftOf(mug, plate)\nb: closeTo(mug, plate, 0.25)\n"
)
ODD = [None, -1, 0, "", "zz", [], {}, 1e308, True, "x" * 100_000]


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """A set of one request, and one of a data set: its shards have requests of their own."""
    home = tmp_path_factory.mktemp("manifests")
    (home / "two.spec").write_text(TWO_MANIFESTS)
    scenegen.sample_to(f"{home}/set/", scenegen.parse(TWO_MANIFESTS), {"a": (0.0, 0.2)}, n=20, workers=1)
    make_dataset(f"{home}/data/", [("two", home / "two.spec")], 24, workers=1)
    return {"set": home / "set", "data": home / "data" / "two"}


def fields(value, path=()):
    """The places of all fields in a JSON value; of the elements of a list those of the first."""
    items = value.items() if isinstance(value, dict) else enumerate(value[:1]) if isinstance(value, list) else ()
    for key, inner in items:
        yield (*path, key)
        yield from fields(inner, (*path, key))


def replaced(manifest, path, value):
    changed = copy.deepcopy(manifest)
    place = changed
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = value
    return changed


@in_full_again
@pytest.mark.parametrize("kind", ["set", "data"])
def test_any_field_of_a_manifest_may_be_anything(kind, folders, tmp_path):
    folder = tmp_path / "set"
    shutil.copytree(folders[kind], folder)
    manifest = json.loads((folder / "manifest.json").read_text())
    scenes = scenegen.open_set(folder).read()
    tried = 0
    for number, path in enumerate(fields(manifest)):
        for value in ODD if FULL else ODD[number % 3 :: 3]:
            (folder / "manifest.json").write_text(json.dumps(replaced(manifest, path, value)))
            tried += 1
            try:
                stored = scenegen.open_set(folder)
                found, again = stored.read(), scenegen.read_scenes(folder)
                told = set_report(stored, map_jobs=lambda job, items: map(job, items), timeout=0.0)
                assert card(stored.manifest)
            except ScenegenError as error:
                assert len(error.diagnostics) == 1 and len(str(error)) < 1500, (path, value)
                continue
            np.testing.assert_array_equal(found.poses, scenes.poses)
            np.testing.assert_array_equal(again.poses, scenes.poses)
            assert told.scenes == len(scenes) and not told.faults, (path, value)
    assert tried > (500 if FULL else 150)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda m: m["request"].update(n=3), "`request.n` is 3, and in `header` it is 20"),
        (lambda m: m["request"].update(phi={"a": [0.0, 0.3]}), "`request.phi` is"),
        (lambda m: m["request"].update(phi={"c": [0.0, 0.3]}), "`request.phi` is"),
        (lambda m: m["request"].update(spec="0" * 64), "`request.spec` is"),
        (lambda m: m["request"].update(spread="base"), "`request.spread` is"),
        (lambda m: m["request"].update(seed=-1), "`request.seed` in manifest.json"),
        (lambda m: m["shards"][0].update(sha256="zz"), "`shards.0.sha256` in manifest.json"),
        (lambda m: m["shards"][0].update(file=""), "`file` of a shard is ``"),
        (lambda m: m["shards"][0].update(scenes=10**9), "more `scenes` than the `shard_size`"),
        (lambda m: m["shards"].append(m["shards"][0]), "two shards have the same `file`"),
        (lambda m: m.update(shard_size=0), "`shard_size` in manifest.json"),
        (lambda m: m["header"]["spec"].pop("sha256"), "`spec.sha256`: field required"),
        (lambda m: m["header"]["regions"][0].update(name="rug"), "its regions are not those of the manifest"),
        (lambda m: m["header"]["workspace"].update(x=[0.0, 2.0]), "its workspace is not that of the manifest"),
        (lambda m: (m["request"].update(n=3), m["header"]["request"].update(n=3)), "its shards have 20 scenes"),
    ],
)
def test_a_manifest_that_contradicts_itself(change, said, folders, tmp_path):
    shutil.copytree(folders["set"], tmp_path / "set")
    path = tmp_path / "set" / "manifest.json"
    manifest = json.loads(path.read_text())
    change(manifest)
    path.write_text(json.dumps(manifest))
    with pytest.raises(DataError) as caught:
        scenegen.open_set(tmp_path / "set").read()
    assert len(caught.value.diagnostics) == 1 and said in str(caught.value)
    with pytest.raises(DataError):
        scenegen.read_scenes(tmp_path / "set")
