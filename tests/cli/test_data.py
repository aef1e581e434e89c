"""`scenegen data`: a report of a set, sets made of sets, and options that do not belong to an action."""

import json
import shutil

import pytest


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    import scenegen

    place = tmp_path_factory.mktemp("data") / "set"
    scenegen.sample_to(f"{place}/", scenegen.parse("task: leftOf(mug, plate)"), (0.0, 0.5), n=300, workers=1)
    return place


def test_report_and_edits(folder, scenegen, tmp_path):
    said = scenegen("data", f"{folder}/", "--json", "--verify", "--timeout", "0")
    report = json.loads(said.out)
    assert said.status == 0 and report["scenes"] == 300 and report["verified"] and report["repeated"] == 0
    assert sum(report["phi"]["task"]["counts"]) == 300 and [one["fault"] for one in report["shards"]] == [None]
    done = scenegen("data", "split", f"{folder}/", "--share", "a=0.5", "--share", "b=0.5", "--out", f"{tmp_path}/p/")
    assert done.status == 0
    done = scenegen("data", "merge", f"{tmp_path}/p/a", f"{tmp_path}/p/b", "--out", f"{tmp_path}/m/")
    assert done.status == 0 and "300 scenes in 1 shard in" in done.err
    assert "300 in 1 shard," in scenegen("data", f"{tmp_path}/m/", "--timeout", "0").out


@pytest.mark.parametrize("name", ["../part-000000.parquet", "a/../../x", "..\\\\x", "/etc/passwd", "C:/../x"])
def test_a_manifest_names_files_of_its_folder_alone(name, folder, scenegen, tmp_path, assert_one_diagnostic):
    shutil.copytree(folder, tmp_path / "set")
    manifest = tmp_path / "set" / "manifest.json"
    manifest.write_text(manifest.read_text().replace("part-000000.parquet", name))
    place = f"{tmp_path}/set/"
    for words in ((place,), ("merge", place, place, "--out", f"{tmp_path}/new/"), ("remake", place, "--shard", "0")):
        done = scenegen("data", *words)
        assert done.status == 1 and "it is not in the folder" in done.err, words
        assert_one_diagnostic(done.err)
    assert not (tmp_path / "new").exists()


def test_a_shard_that_is_a_link_out_of_its_set_is_refused(folder, scenegen, tmp_path):
    shutil.copytree(folder, tmp_path / "set")
    shard = next((tmp_path / "set").glob("part-*"))
    shard.rename(tmp_path / "elsewhere.parquet")
    shard.symlink_to(tmp_path / "elsewhere.parquet")
    done = scenegen("data", f"{tmp_path}/set/", "--timeout", "0")
    assert done.status == 1 and "a link that leads out of the folder" in done.err + done.out
    (tmp_path / "moved").symlink_to(tmp_path / "set")  # a link to all of it is well
    shard.unlink()
    (tmp_path / "elsewhere.parquet").rename(shard)
    assert scenegen("data", f"{tmp_path}/moved/", "--timeout", "0").status == 0


def test_a_run_does_not_write_through_links(folder, scenegen, here):
    """What lies in a folder that came from elsewhere, and what it does to a file of one's own."""
    own = here / "own.txt"
    own.write_text("mine")
    for name, out in (("set/.lock", "set/"), ("x.parquet.part/lock", "x.parquet")):
        (here / name).parent.mkdir()
        (here / name).symlink_to(own)
        done = scenegen("sample", "good.spec", "-n", "70000", "--satisfied", "--out", out)
        assert done.status == 1 and own.read_text() == "mine", done.err


@pytest.mark.parametrize(
    ("words", "code"),
    [
        (("--share", "a=1"), "out-of-place"),
        (("--seed", "3"), "out-of-place"),
        (("--out", "new/"), "out-of-place"),
    ],
)
def test_options_of_another_action(words, code, folder, scenegen):
    done = scenegen("data", f"{folder}/", *words)
    assert done.status == 1 and f"error[{code}]" in done.err and words[0] in done.err


def test_folder_of_sets(folder, scenegen, tmp_path):
    for name in ("one", "two"):
        shutil.copytree(folder, tmp_path / "all" / name)
    said = scenegen("data", f"{tmp_path}/all", "--verify", "--timeout", "0")
    assert said.status == 0 and "2 sets: 600 scenes, " in said.out and "0 damaged" in said.out
    named = [line.partition(": ")[0] for line in said.out.splitlines() if line.startswith(f"{tmp_path}/all/")]
    assert named == [f"{tmp_path}/all/one/", f"{tmp_path}/all/two/"]
    several = scenegen("data", f"{folder}/", f"{tmp_path}/all", "--json", "--timeout", "0")
    assert [one["scenes"] for one in json.loads(several.out)["sets"]] == [300, 300, 300]


def test_a_damaged_one_does_not_stop_the_rest(folder, scenegen, tmp_path):
    for name in ("a", "b", "c", "d"):
        shutil.copytree(folder, tmp_path / name)
    (tmp_path / "a" / "manifest.json").write_text("{}")
    shard = next((tmp_path / "c").glob("part-*"))
    shard.write_bytes(shard.read_bytes()[:-1])
    said = scenegen("data", f"{tmp_path}/", "--json", "--timeout", "0")
    found = json.loads(said.out)
    assert said.status == 1 and found["failed"] == [f"{tmp_path}/a/", f"{tmp_path}/c/"]
    assert [bool(one["shards"][0]["fault"]) for one in found["sets"]] == [False, True, False]
    assert "error[not-a-set]" in said.err and "error[damaged-shard]" in said.err and "error[some-failed]" in said.err


def test_a_folder_without_sets(scenegen, tmp_path):
    (tmp_path / "notes.txt").write_text("none here")
    said = scenegen("data", f"{tmp_path}/")
    assert said.status == 1 and "error[not-a-set]" in said.err and "manifest.json" in said.err
