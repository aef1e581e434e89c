"""`scenegen data`: a report of a set, sets made of sets, and options that do not belong to an action. `scenegen
dataset`: equal shares, how rare each scene is, shards that come back from their seeds. Every format of scene files
goes in and out of the commands.
"""

import json
import shutil
from pathlib import Path

import numpy as np
import polars
import pytest
import yaml

from scenegen.scenes.formats.registry import FORMATS


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


def test_files_of_scenes_are_no_sets_and_are_joined_as_lines(scenegen, here, assert_one_diagnostic):
    for name, seed in (("a", 1), ("b", 2)):
        assert scenegen("sample", "good.spec", "-n", "2", "--seed", seed, "--out", f"{name}.jsonl").status == 0
    for words in (
        ["merge", "a.jsonl", "b.jsonl", "--out", "both/"],
        ["split", "a.jsonl", "--share", "x=1"],
        ["a.jsonl"],
    ):
        done = scenegen("data", *words, *(["--out", "p/"] if "split" in words else []))
        assert done.status == 1 and "a.jsonl is not a set of scenes: it is a file" in done.err
        assert_one_diagnostic(done.err)
    assert "(cat a.jsonl; tail -n +2 b.jsonl) > both.jsonl" in done.err
    lines = (here / "a.jsonl").read_text() + (here / "b.jsonl").read_text().partition("\n")[2]
    (here / "both.jsonl").write_text(lines)
    assert len(scenegen("eval", "good.spec", "both.jsonl").out.splitlines()) == 5


def test_other_endings_of_the_same_formats(scenegen, here):
    assert scenegen("sample", "good.spec", "-n", "3", "--out", "s.ndjson").status == 0
    assert scenegen("sample", "good.spec", "-n", "3", "--out", "s.jsonl").status == 0
    assert (here / "s.ndjson").read_bytes() == (here / "s.jsonl").read_bytes()
    assert scenegen("eval", "good.spec", "s.ndjson").out == scenegen("eval", "good.spec", "s.jsonl").out
    assert scenegen("export", "s.ndjson", "--out", "again.ndjson").status == 0
    assert (here / "again.ndjson").read_bytes() == (here / "s.jsonl").read_bytes()
    assert scenegen("pairs", "good.spec", "-n", "2", "--out", "m.ndjson").status == 0
    columns = "mug.x mug.y mug.theta plate.x plate.y plate.theta".split()
    (here / "p.tsv").write_text("\t".join(columns) + "\n" + "0.2\t0.5\t0\t0.75\t0.5\t0\n")
    (here / "p.csv").write_text(",".join(columns) + "\n" + "0.2,0.5,0,0.75,0.5,0\n")
    said = scenegen("eval", "good.spec", "p.tsv")
    assert said.status == 0 and said.out == scenegen("eval", "good.spec", "p.csv").out
    assert "unknown-ending" in scenegen("pairs", "good.spec", "-n", "2", "--out", "m.tsv").err  # commas are no tabs


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


GOOD = "object mug, plate\ntask: leftOf(mug, plate)\n"
NEAR = "object mug, plate\nrequire noOverlap()\ntask: closeTo(mug, plate, 30 cm)\nsafe: farFrom(mug, plate, 5 cm)\n"


WORDS = ("dataset", "good.spec", "bad.spec", "near.spec", "-n", "900", "--license", "mit", "--out", "data/")


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A data set, made once; from few chains, so the rarities are rough, and cheap."""
    from scenegen.api.dataset import make_dataset

    folder = tmp_path_factory.mktemp("dataset")
    for name, text in (("good", GOOD), ("bad", "leftof(mug"), ("near", NEAR)):
        (folder / f"{name}.spec").write_text(text)
    failed = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("scenegen.sampling.rarity.RARITY_VISITS", 4_000_000)
        make_dataset(
            f"{folder}/data", [(name, folder / f"{name}.spec") for name in ("good", "bad", "near")], 900,
            license="mit", workers=1, told=lambda what, ended, *_: failed.extend([ended.name] if ended.errors else []),
        )  # fmt: skip
    assert failed == ["bad"]
    return folder


@pytest.fixture
def made(whole, here):
    """A copy of it in the working directory."""
    shutil.copytree(whole, here, dirs_exist_ok=True)
    return here


def table(folder):
    return polars.read_parquet(f"{folder}/part-*.parquet")


@pytest.mark.long
def test_shares_rarity_and_cards(made, here, scenegen):
    done = scenegen(*WORDS, "--workers", "1", "--resume")  # nothing is left to be done
    assert done.status == 1 and "bad failed:\n" in done.err and "600 scenes of 2 specs in data/" in done.err
    assert "near: left out: safe: no scene with phi < 0 was found" in done.err
    good = table("data/good")
    assert good.height == 300 and (good["phi.task"] >= 0).sum() == 150
    near = json.loads((here / "data/near/manifest.json").read_text())
    assert [(*shard["made"]["phi"], shard["scenes"]) for shard in near["shards"]] == [
        ("task", 100), ("task", 100), ("safe", 100)
    ]  # fmt: skip
    assert near["complete"] and near["missing"] == ["safe: no scene with phi < 0 was found"]
    seeds = [shard["made"]["seed"] for shard in near["shards"]]
    assert len(set(seeds)) == 3 and max(seeds) < 2**53
    assert list(table("data/near").columns[-4:]) == ["phi.task", "phi.safe", "log10p.task", "log10p.safe"]
    front = yaml.safe_load((here / "data/README.md").read_text().split("---")[1])
    assert front["license"] == "mit" and [one["config_name"] for one in front["configs"]] == ["good", "near"]
    card = (here / "data/near/README.md").read_text()
    assert yaml.safe_load(card.split("---")[1])["license"] == "mit" and NEAR.rstrip() in card
    assert "* bad: nothing was made" in (here / "data/README.md").read_text()


@pytest.mark.long
def test_how_rare_is_what_counting_says(made):
    """mug.x and plate.x are uniform: P(plate.x - mug.x >= t) = (1 - t)^2 / 2, and the same on the other side."""
    good = table("data/good")
    exact = np.log10((1.0 - np.abs(good["phi.task"].to_numpy())) ** 2 / 2.0)
    off = good["log10p.task"].to_numpy() - exact
    assert np.abs(off[exact > -3.0]).max() < 0.35 and abs(np.median(off)) < 0.1


@pytest.mark.long
def test_a_shard_comes_back(made, here, scenegen):
    file = here / "data/near/part-000001.parquet"
    before = file.read_bytes()
    assert "the same bytes as there" in scenegen("data", "remake", "data/near", "--shard", "1").err
    file.write_bytes(before[:-1] + b"x")
    assert scenegen("data", "data/near/", "--verify", "--timeout", "0").status == 1
    assert "put back" in scenegen("data", "remake", "data/near", "--shard", "1").err
    assert file.read_bytes() == before
    said = scenegen("data", "data/near/", "--verify", "--json", "--timeout", "0")
    assert said.status == 0 and json.loads(said.out)["verified"]
    assert "--shard is 3" in scenegen("data", "remake", "data/near", "--shard", "3").err
    # parts of it keep how rare their scenes are
    assert scenegen("data", "split", "data/near/", "--share", "a=0.5", "--out", "parts/").status == 0
    assert "log10p.task" in table("parts/a").columns


@pytest.mark.long
def test_resumed_with_two_workers(made, here, scenegen, snapshot):
    """What is missing is made, to the same bytes, whoever makes it; what is there stays."""
    before = snapshot(here / "data")
    manifest = here / "data/near/manifest.json"
    facts = json.loads(manifest.read_text())
    manifest.write_text(json.dumps(facts | {"complete": False, "shards": facts["shards"][1:2]}))
    assert "error[finished-set]" in scenegen(*WORDS).err
    assert scenegen(*WORDS, "--workers", "2", "--resume").status == 1
    assert snapshot(here / "data") == before


WANTED = ["--phi", "0:0.2", "-n", "3", "--seed", "5"]


@pytest.mark.parametrize("ending", FORMATS)
def test_sample_and_eval(ending, scenegen, here):
    assert scenegen("sample", "good.spec", *WANTED, "--out", "all.json").status == 0
    sampled = scenegen("sample", "good.spec", *WANTED, "--out", f"x{ending}")
    assert sampled.status == 0 and "3 scenes (rejection" in sampled.err
    evaluated = scenegen("eval", "good.spec", f"x{ending}")
    assert evaluated.status == 0 and evaluated.err == ""
    assert evaluated.out == scenegen("eval", "good.spec", "all.json").out and len(evaluated.out.splitlines()) == 4


@pytest.mark.long
@pytest.mark.parametrize("ending", FORMATS)
def test_render(ending, scenegen, here):
    assert scenegen("sample", "good.spec", *WANTED, "--out", f"x{ending}").status == 0
    assert scenegen("render", f"x{ending}", "--out", "pictures", "--size", "32x24", "--workers", "1").status == 0
    assert len(list(Path("pictures").glob("scene_*_top.png"))) == 3


@pytest.mark.parametrize("ending", FORMATS)
def test_noise(ending, scenegen, here):
    Path(f"x{ending}").write_bytes(b"\x00noise\xff" * 10)
    refused = scenegen("eval", "good.spec", f"x{ending}")
    assert refused.status == 1 and refused.out == "" and refused.err.startswith("error[") and "help: " in refused.err


POSES = "mug.x,mug.y,mug.theta,plate.x,plate.y,plate.theta,cam\n0.2,0.5,0,0.6,0.5,0,front\n0.7,0.5,0,0.6,0.5,0,\n"


def test_poses_alone_go_everywhere_with_one_option(scenegen, here):
    (here / "w.spec").write_text("object mug, plate\nleft: leftOf(mug, plate)\n")
    (here / "mine.csv").write_text(POSES)
    scored = scenegen("eval", "w.spec", "mine.csv")
    assert scored.status == 0 and [float(line.split("\t")[1]) for line in scored.out.splitlines()[1:]] == [
        pytest.approx(0.4),
        pytest.approx(-0.1),
    ]
    assert "mine.csv has columns that the spec does not need: cam" in scored.err
    for words in (["export", "--out", "s.parquet"], ["export", "--to", "mjcf", "--out", "worlds"]):
        refused = scenegen(words[0], "mine.csv", *words[1:])
        assert refused.status == 1 and "error[not-scenes]" in refused.err and "--spec" in refused.err
        assert scenegen(words[0], "mine.csv", "--spec", "w.spec", *words[1:]).status == 0
    assert scenegen("eval", "w.spec", "s.parquet").out == scored.out
    assert sorted(path.name for path in (here / "worlds").glob("*.xml")) == ["scene_0001.xml", "scene_0002.xml"]
    refused = scenegen("export", "s.parquet", "--spec", "w.spec", "--out", "t.json")
    assert refused.status == 1 and "error[out-of-place]: --spec" in refused.err
    assert scenegen("export", "s.parquet", "--mirrored", "--out", "m.json").status == 0
    values = [float(line.split("\t")[1]) for line in scenegen("eval", "w.spec", "m.json").out.splitlines()[1:]]
    assert values == [pytest.approx(-0.4), pytest.approx(0.1)]


def test_a_file_of_scenes_is_completed(scenegen, here):
    (here / "w.spec").write_text("object mug, plate, can\ntask: leftOf(mug, plate)\n")
    assert scenegen("sample", "w.spec", "--violated", "-n", "7", "--out", "a.json").status == 0
    made = scenegen("sample", "w.spec", "--satisfied", "--fix-from", "a.json", "--fix", "can", "--out", "b.json")
    assert made.status == 0 and "7 scenes (completed, " in made.err
    before, after = (json.loads((here / name).read_text())["scenes"] for name in ("a.json", "b.json"))
    assert [one["poses"]["can"] for one in before] == [one["poses"]["can"] for one in after]
    assert scenegen("sample", "w.spec", "--fix-from", "a.json", "--fix", "can", "-n", "7").status == 0
    for words, said in (
        (["--fix-from", "a.json"], "error[all-held]"),
        (["--fix-from", "a.json", "--fix", "cup"], "error[unknown-object]"),
        (["--fix-from", "a.json", "--fix", "can", "--out", "set/"], "error[out-of-place]: --fix-from"),
        (["--fix-from", "none.json", "--fix", "can"], "error[cannot-read]"),
        (["--fix-from", "a.json", "--fix", "can=0.5,0.5"], "error[out-of-place]: --fix can=0.5,0.5 has no place"),
        (["--fix-from", "a.json", "--fix", "can", "-n", "16"], "error[out-of-place]: -n does not go with given scenes"),
    ):
        refused = scenegen("sample", "w.spec", "--satisfied", *words)
        assert refused.status == 1 and refused.err.startswith(said), refused.err


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--to", "pybullet", "--out", "o"), "scenegen.load_pybullet"),
        (("--to", "csv", "--out", "o.csv"), "to_csv"),
        (("--to", ".CSV", "--out", "o.csv"), "to_csv"),
        (("--out", "o.csv"), "to_csv"),
        (("--out", "o.PNG"), "scenegen render"),
        (("--to", "drake", "--out", "o"), "the format for drake is `sdf`"),
        (("--to", "urdf", "--out", "o"), "`mjcf`, `sdf` or `usd`"),
    ],
    ids=" ".join,
)
def test_what_is_no_format_names_what_does_it(words, said, scenegen, here):
    assert scenegen("sample", "good.spec", "-n", "1", "--out", "s.json").status == 0
    outcome = scenegen("export", "s.json", *words)
    assert outcome.status == 1 and outcome.err.count("error[") == 1 and said in outcome.err
    if "--to" not in words:
        assert said in scenegen("sample", "good.spec", "-n", "1", *words).err


@pytest.mark.parametrize("between", [",", ";", "\t"])
def test_columns_stand_between_commas_semicolons_or_tabs(between, scenegen, here):
    (here / "w.spec").write_text("object mug, plate\nleft: leftOf(mug, plate)\n")
    (here / "mine.csv").write_text(POSES)
    (here / "other.csv").write_text(POSES.replace(",", between))
    assert scenegen("eval", "w.spec", "other.csv").out == scenegen("eval", "w.spec", "mine.csv").out != ""


ALL = "mug.x,mug.y,mug.theta,plate.x,plate.y,plate.theta"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            f"{ALL}\n0.2,0.5,90,0.6,0.5,0\n",
            "warning[doubtful-pose]: t.csv: `mug.theta` in row 1 is 90: more than a turn",
        ),
        (
            f"{ALL}\n0.2,0.5,0,0.6,0.5,0\n200,500,0,600,500,0\n",
            "t.csv: `mug.x` in row 2 is 200: outside of the workspace",
        ),
        (f"{ALL.replace(',', ';')}\n0,2;0,5;0;0,6;0,5;0\n", "numbers have a decimal point: 0.2"),
        (f'{ALL}\n"0,2",0.5,0,0.6,0.5,0\n', "numbers have a decimal point: 0.2"),
        (f"{ALL}\n0,2,0,5,0,0,6,0,5,0\n", "row 1 has 10 values, not 6"),
        (f"{ALL.replace(',', ' ')}\n0.2 0.5 0 0.6 0.5 0\n", "its columns are separated by ` `"),
        (f"{ALL.replace(',', '|')}\n0.2|0.5|0|0.6|0.5|0\n", "its columns are separated by `|`"),
        (
            "mug.x,mug.y,mug.yaw\n0.2,0.5,0\n",
            "missing are mug.theta, plate.x, plate.y, plate.theta; its columns are mug.x",
        ),
        (f"{ALL}\n0.2,0.5,x,0.6,0.5,0\n", "error[table-cell]: t.csv: `mug.theta` in row 1 is `x`"),
        (f"{ALL}\n0.2,0.5,,0.6,0.5,0\n", "every x, y and theta is a finite number"),
    ],
)
def test_tables_of_poses_that_mean_something_else(text, said, scenegen, here):
    (here / "w.spec").write_text("object mug, plate\nleft: leftOf(mug, plate)\n")
    (here / "t.csv").write_text(text)
    outcome = scenegen("eval", "w.spec", "t.csv")
    assert said in outcome.err and "trajectory" not in outcome.err
    assert outcome.err.count("error[") == outcome.status and outcome.err.count("[") == 1


def test_trajectories_in_degrees_and_with_semicolons(scenegen, here):
    (here / "w.spec").write_text("time 1 steps\nobject mug\nleft: always leftOf(mug, (0.5, 0.5))\n")
    (here / "t.csv").write_text("t;mug.x;mug.y;mug.theta\n0;0.2;0.5;0\n1;0.2;0.5;90\n")
    outcome = scenegen("eval", "w.spec", "t.csv")
    assert outcome.status == 0 and "`mug.theta` in row 2 is 90: more than a turn" in outcome.err
