"""Manifests that were edited or damaged: one diagnostic that names the field, or the same scenes."""

import copy
import json
import shutil

import numpy as np
import pytest

import scenegen
from scenegen.api.dataset import make_dataset
from scenegen.api.set_report import set_report
from scenegen.api.sets import card
from scenegen.errors import DataError, ScenegenError

TWO = "region mat = rect(0.2, 0.2, 0.6, 0.6)\nobject mug, plate\na: leftOf(mug, plate)\nb: closeTo(mug, plate, 0.25)\n"
ODD = [None, -1, 0, "", "zz", [], {}, 1e308, True, "x" * 100_000]


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """A set of one request, and one of a data set: its shards have requests of their own."""
    home = tmp_path_factory.mktemp("manifests")
    (home / "two.spec").write_text(TWO)
    scenegen.sample_to(f"{home}/set/", scenegen.parse(TWO), {"a": (0.0, 0.2)}, n=20, workers=1)
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


@pytest.mark.parametrize("kind", ["set", "data"])
def test_any_field_of_a_manifest_may_be_anything(kind, folders, tmp_path):
    folder = tmp_path / "set"
    shutil.copytree(folders[kind], folder)
    manifest = json.loads((folder / "manifest.json").read_text())
    scenes = scenegen.open_set(folder).read()
    tried = 0
    for path in fields(manifest):
        for value in ODD:
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
    assert tried > 500


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
