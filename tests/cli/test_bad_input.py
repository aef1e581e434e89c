"""Scenes files and model files that are not what they should be. Specs with a mistake, through the program: where it
is, what it is, what to do. A formula that nobody tested, from text to verified scenes in one command. Specs with
random numbers of things on the command line.
"""

import json
import math
import re

import pytest
import safetensors.torch

from tests.corpus import read_corpus


@pytest.fixture
def model(here):
    """A model file of good.spec, barely trained, with its training state beside it."""
    import scenegen

    scenegen.train(scenegen.load("good.spec"), "gan", data="uniform", out="m.safetensors", epochs=1, scenes=64)
    return here / "m.safetensors"


@pytest.fixture
def scenes(here):
    import scenegen

    scenegen.sample(scenegen.load("good.spec"), {"task": (0.1, 0.2)}, n=3).save("s.json")
    return here / "s.json"


def test_scenes_of_other_objects(refusal, scenes):
    refusal("files", "scenes_of_other_objects")


def _later(data):
    data["version"] = 3


def _other_format(data):
    data["format"] = "scenegen/pictures"


def _lost_object(data):
    del data["scenes"][1]["poses"]["mug"]


def _word_for_a_number(data):
    data["scenes"][0]["poses"]["mug"]["x"] = "left"


def _no_scenes(data):
    data["scenes"] = []


def _other_labels(data):
    data["scenes"][2]["phi"] = {"other": 0.1}


CHANGES = [_later, _other_format, _lost_object, _word_for_a_number, _no_scenes, _other_labels]


@pytest.mark.parametrize("change", CHANGES)
def test_changed_scenes_file(change, refused, refusal, scenes):
    data = json.loads(scenes.read_text())
    change(data)
    scenes.write_text(json.dumps(data))
    refusal("files", f"scenes{change.__name__}")
    if change is not _other_labels:
        assert refused("render", "s.json", "--out", "pictures").startswith("error[")


def test_garbage_truncated_and_missing_scenes_files(refused, refusal, scenes, here):
    # what a sampler says of itself changes from version to version: the cut comes before it
    whole = scenes.read_bytes()
    (here / "cut.json").write_bytes(whole[: whole.index(b'"sampler"') + 4])
    (here / "noise.json").write_bytes(bytes(range(255, 0, -1)))
    (here / "sub.json").mkdir()
    for name in ("cut", "noise", "sub", "ss"):
        refusal("files", f"scenes_{name}")
    assert "--> cut.json:" in refused("render", "cut.json", "--out", "pictures")


def test_tampered_phi_is_noticed(scenegen, scenes, golden):
    data = json.loads(scenes.read_text())
    data["scenes"][1]["phi"]["task"] += 2e-9
    scenes.write_text(json.dumps(data))
    outcome = scenegen("eval", "good.spec", "s.json")
    assert outcome.status == 1
    assert "scene 2 of s.json" in outcome.err
    data["scenes"][1]["phi"]["task"] -= 1.5e-9
    scenes.write_text(json.dumps(data))
    assert scenegen("eval", "good.spec", "s.json").status == 0


@pytest.mark.parametrize("name", ["garbage", "cut", "empty", "version", "spec"])
def test_model_file(name, refusal, model, here):
    whole = model.read_bytes()
    bad = here / "bad.safetensors"
    if name == "version":
        with safetensors.safe_open(model, "pt") as file:
            envelope = json.loads(file.metadata()["scenegen"])
        envelope["version"] = 2
        bad.write_bytes(safetensors.torch.save(safetensors.torch.load(whole), {"scenegen": json.dumps(envelope)}))
    elif name == "spec":
        bad.write_bytes(whole)
    else:
        bad.write_bytes({"garbage": bytes(range(1, 256)) * 9, "cut": whole[:-500], "empty": b""}[name])
    refusal("files", f"model_{name}", _without_sums)


def test_resume_with_another_spec_or_options(refusal, model):
    refusal("files", "resume_other_spec")
    refusal("files", "resume_other_seed")


def _without_sums(text):
    return "\n".join(line for line in text.splitlines() if "SHA-256" not in line) + "\n"


TEXTS = read_corpus("cli/errors/specs")
BYTES = {
    "binary": bytes(range(256)),
    "not_utf8": "# café\ntask: leftOf(mug, plate)\n".encode("latin-1"),
}


@pytest.mark.parametrize("name", [name for name in TEXTS if name != "three_mistakes"])
def test_a_mistake_in_the_text(name, refused, here, message):
    (here / "my.spec").write_text(TEXTS[name].text)
    said = refused("check", "my.spec")
    assert re.fullmatch(r" +--> my\.spec:\d+:\d+", said.splitlines()[1])
    message("cli/errors/specs", name, said)


@pytest.mark.parametrize("command", ["sample", "train", "eval"])
def test_every_command_reads_specs_alike(command, refused, here):
    (here / "my.spec").write_text(TEXTS["unknown_relation"].text)
    more = {"sample": ["--out", "o.json"], "train": ["--model", "gan", "--out", "m.st"], "eval": ["scenes.json"]}
    assert "--> my.spec:2:7" in refused(command, "my.spec", *more[command])


@pytest.mark.parametrize("name", BYTES)
def test_not_a_text(name, refusal, here):
    (here / "my.spec").write_bytes(BYTES[name])
    refusal("files", f"spec_{name}")


@pytest.mark.parametrize("name", ["missing", "missing_alone", "folder"])
def test_not_a_file(name, refusal, here):
    (here / "sub").mkdir()
    refusal("files", f"spec_{name}")


def test_every_mistake_of_a_spec_is_told_in_the_order_of_the_text(scenegen, here, message):
    (here / "my.spec").write_text(TEXTS["three_mistakes"].text)
    outcome = scenegen("check", "my.spec", "good.spec")
    assert outcome.status == 1
    assert outcome.err.count("error[") == 3
    assert outcome.out.startswith("\ngood.spec: ok") or outcome.out.startswith("good.spec: ok")
    message("cli/errors/specs", "three_mistakes", outcome.err)


FORMULA = "(leftOf(fork, plate) | aboveOf(fork, plate)) & !closeTo(fork, plate, 0.15) & closeTo(spoon, fork, 0.3)"


def phi_by_hand(poses):
    """The paper's Definition 2, written out; shares nothing with the package."""
    fork, plate, spoon = (poses[name] for name in ("fork", "plate", "spoon"))
    left_or_above = max(plate["x"] - fork["x"], fork["y"] - plate["y"])
    apart = math.sqrt((fork["x"] - plate["x"]) ** 2 + (fork["y"] - plate["y"]) ** 2) - 0.15
    together = 0.3 - math.sqrt((spoon["x"] - fork["x"]) ** 2 + (spoon["y"] - fork["y"]) ** 2)
    return min(left_or_above, apart, together)


def test_from_text_to_a_hundred_scenes(scenegen, here):
    (here / "mine.spec").write_text(FORMULA)
    outcome = scenegen("sample", "mine.spec", "--phi", "0.05:0.2", "-n", "100", "--out", "s.json")
    assert outcome.status == 0, outcome.err
    data = json.loads((here / "s.json").read_text())
    assert len(data["scenes"]) == 100
    values = [phi_by_hand(scene["poses"]) for scene in data["scenes"]]
    assert all(0.05 - 1e-12 <= value <= 0.2 + 1e-12 for value in values)
    for value, scene in zip(values, data["scenes"], strict=True):
        assert abs(value - scene["phi"]["task"]) <= 1e-12
        for pose in scene["poses"].values():
            assert 0 <= pose["x"] <= 1 and 0 <= pose["y"] <= 1 and 0 <= pose["theta"] < 2 * math.pi
    assert len({json.dumps(scene["poses"]) for scene in data["scenes"]}) == 100
    assert scenegen("eval", "mine.spec", "s.json").status == 0


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
        (["block"], "argument-syntax"), (["block="], "argument-syntax"), (["=3"], "argument-syntax"),
        (["block=-1"], "argument-syntax"),
        (["block=2.0"], "argument-syntax"), (["block=0"], "wrong-count"), (["block=4"], "wrong-count"),
        (["mug=1"], "wrong-count"), (["block=2", "block=2"], "given-twice"), (["block=٣"], "argument-syntax"),
    ],
)  # fmt: skip
def test_a_wrong_count_is_refused(scenegen, spec, count, code):
    found = scenegen("sample", spec, "-n", "1", *(word for text in count for word in ("--count", text)))
    assert found.status == 1 and f"error[{code}]" in found.err


def test_a_number_alone_is_taken_for_how_many_scenes(scenegen, spec):
    assert "for that many scenes: -n 20" in scenegen("sample", spec, "--count", "20").err


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
    assert found.status == 1 and "error[wrong-count]" in found.err


@pytest.mark.parametrize("command", ["sample", "pairs"])
def test_a_wrong_seed_is_refused_as_of_ordinary_specs(scenegen, spec, command):
    found = scenegen(command, spec, "--seed=-1", "-n", "2")
    assert found.status == 1 and "error[out-of-range]" in found.err
