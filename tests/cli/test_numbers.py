"""Specs with random numbers of things on the command line."""

import json

import pytest

SPEC = "# Blocks\nobject block[1..3], mug\ntask: forall b in block: leftOf(b, mug)\n"


@pytest.fixture
def spec(here):
    (here / "drawn.spec").write_text(SPEC)
    return "drawn.spec"


def test_sample_eval_and_count(scenegen, spec, here):
    assert scenegen("sample", spec, "--phi", "0:", "-n", "6", "--out", "s.json").status == 0
    scenes = json.loads((here / "s.json").read_text())["scenes"]
    assert sorted(scene["counts"]["block"] for scene in scenes) == [1, 1, 2, 2, 3, 3]
    found = scenegen("eval", spec, "s.json")
    assert found.status == 0
    assert [float(line.split("\t")[1]) for line in found.out.splitlines()[1:]] == [one["phi"]["task"] for one in scenes]
    one = scenegen("eval", spec, "s.json", "--explain", "--scene", "1", "--json")
    assert one.status == 0 and len(json.loads(one.out)["formulas"]["task"]) >= scenes[0]["counts"]["block"]
    assert scenegen("sample", spec, "--count", "block=2", "-n", "3", "--out", "t.json").status == 0
    assert "counts" not in json.loads((here / "t.json").read_text())
    assert scenegen("eval", spec, "t.json").status == 0, "a scene of two blocks is one of one to three"
    assert scenegen("eval", "good.spec", "s.json").status == 1


@pytest.mark.parametrize(
    ("count", "code"),
    [
        (["block"], "count-syntax"), (["block="], "count-syntax"), (["=3"], "count-syntax"),
        (["block=-1"], "count-syntax"),
        (["block=2.0"], "count-syntax"), (["block=0"], "count-out-of-range"), (["block=4"], "count-out-of-range"),
        (["mug=1"], "unknown-count"), (["block=2", "block=2"], "count-twice"), (["block=٣"], "count-syntax"),
    ],
)  # fmt: skip
def test_a_wrong_count_is_refused(scenegen, spec, count, code):
    found = scenegen("sample", spec, "-n", "1", *(word for text in count for word in ("--count", text)))
    assert found.status == 1 and f"error[{code}]" in found.err


def test_check_shows_the_numbers_and_the_bounds_of_all(scenegen, spec):
    found = scenegen("check", spec)
    assert found.status == 0
    assert "1 to 3 block: 3 specs" in found.out and "block[1..3], mug" in found.out
    data = json.loads(scenegen("check", spec, "--json").out)
    assert data[0]["counts"] == {"block": [1, 3]}
    fixed = scenegen("check", spec, "--count", "block=2")
    assert "block[1], block[2], mug" in fixed.out and "specs" not in fixed.out


def test_check_says_with_which_numbers_a_label_cannot_be_satisfied(scenegen, here):
    (here / "a.spec").write_text("object block[2..4], mug\ntask: x(mug) >= block.count * 0.3\n")
    found = scenegen("check", "a.spec")
    assert found.status == 0, "with two or three it can"
    assert "`task` can never be satisfied with block[4]" in found.err
    (here / "b.spec").write_text("object block[2..4], mug\ntask: x(mug) >= block.count * 0.6\n")
    found = scenegen("check", "b.spec")
    assert found.status == 1 and "with any number" in found.err


@pytest.mark.long
def test_a_model_of_drawn_numbers_is_a_folder(scenegen, here):
    (here / "d.spec").write_text("object block[1..2], mug\ntask: forall b in block: leftOf(b, mug)\n")
    found = scenegen("train", "d.spec", "--out", "m.safetensors")
    assert found.status == 1
    assert "error[folder-of-models]" in found.err and "--out m/" in found.err
    made = scenegen(
        "train", "d.spec", "--out", "m/", "--epochs", "1", "--scenes", "2000", "--no-card", "--workers", "1"
    )
    assert made.status == 0 and "d with block[2]: wrote" in made.err
    names = sorted(path.name for path in (here / "m/d").iterdir() if path.suffix != ".train")
    assert names == ["block=1.safetensors", "block=2.safetensors", "numbers.spec"]

    assert scenegen("sample", "m/d/", "--phi", "0:0.3", "-n", "40", "--out", "s.json").status == 0
    scenes = json.loads((here / "s.json").read_text())
    counts = [one["counts"]["block"] for one in scenes["scenes"]]
    assert counts.count(1) == counts.count(2) == 20, "equal shares, as in exact scenes"
    assert all(len(one["poses"]) == 1 + count for one, count in zip(scenes["scenes"], counts, strict=True))
    assert scenegen("eval", "d.spec", "s.json").status == 0
    assert scenegen("sample", "m/d", "--phi", "0:0.3", "-n", "40", "--workers", "2", "--out", "t.json").status == 0
    assert (here / "s.json").read_bytes() == (here / "t.json").read_bytes()
    assert scenegen("sample", "m/d", "--phi", "0:0.3", "-n", "8", "--raw", "--out", "r.json").status == 0
    assert scenegen("sample", "m/d", "--phi", "0:0.3", "-n", "8", "--count", "block=2", "--out", "u.json").status == 0
    assert all(len(one["poses"]) == 3 for one in json.loads((here / "u.json").read_text())["scenes"])
    told = json.loads(scenegen("info", "m/d", "--json").out)["models"]
    assert [len(one["objects"]) for one in told] == [2, 3]

    (here / "m/d/block=1.safetensors").unlink()
    found = scenegen("sample", "m/d", "--phi", "0:0.3", "--out", "v.json")
    assert found.status == 1 and "error[no-model-of-number]" in found.err
    again = scenegen("train", "d.spec", "--out", "m/", "--epochs", "1", "--scenes", "2000", "--no-card", "--resume")
    assert again.status == 0 and "complete already: m/d/block=2.safetensors" in again.err
    assert (here / "m/d/block=1.safetensors").exists()


@pytest.mark.long
def test_range_is_the_mean_over_the_numbers(scenegen, here):
    (here / "c.spec").write_text("object block[1..2], mug\ntask: x(mug) >= block.count * 0.4\n")
    found = json.loads(scenegen("range", "c.spec", "--json").out)["labels"]["task"]
    zero = next(level for level in found["levels"] if level["phi"] == 0.0)
    assert abs(10.0 ** zero["above"]["log10"] - 0.4) < 0.03, "(0.6 + 0.2) / 2"
    assert found["bounds"] == [-0.8, 0.6]


def test_an_asset_is_fixed_by_its_name(scenegen, here):
    assets = '[asset("red", box(0.1, 0.1, 0.1)), asset("7", box(0.2, 0.1, 0.1))]'
    (here / "mug.spec").write_text(f'object mug of category("mug", {assets}), plate\ntask: leftOf(mug, plate)\n')
    assert scenegen("sample", "mug.spec", "--count", "mug=7", "-n", "2", "--out", "s.json").status == 0
    file = json.loads((here / "s.json").read_text())
    assert [one["name"] for one in file["objects"]] == ["mug:7", "plate"] and "counts" not in file
    assert scenegen("eval", "mug.spec", "s.json").status == 0, "a scene of one of the assets"
    found = scenegen("check", "mug.spec")
    assert "assets     mug is red or 7: 2 specs" in found.out
    found = scenegen("range", "mug.spec", "--count", "mug=rad")
    assert found.status == 1 and "did you mean `red`?" in found.err


def test_pairs_share_a_number(scenegen, spec, here):
    assert scenegen("pairs", spec, "-n", "6", "--out", "p.json").status == 0
    drawn = json.loads((here / "p.json").read_text())["motions"]
    assert sorted(one["counts"]["block"] for one in drawn) == [1, 1, 2, 2, 3, 3]
    assert scenegen("eval", spec, "p.json").status == 0
    assert scenegen("pairs", spec, "--count", "block=2", "-n", "6", "--out", "q.json").status == 0
    assert "counts" not in json.loads((here / "q.json").read_text())
    found = scenegen("pairs", spec, "--count", "block=7")
    assert found.status == 1 and "error[count-out-of-range]" in found.err


@pytest.mark.parametrize("command", ["sample", "pairs"])
def test_a_wrong_seed_is_refused_as_of_ordinary_specs(scenegen, spec, command):
    found = scenegen(command, spec, "--seed=-1", "-n", "2")
    assert found.status == 1 and "error[out-of-range]" in found.err
