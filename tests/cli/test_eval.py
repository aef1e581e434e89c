"""`scenegen eval`: phi of given scenes, with every digit in a pipe, beside what the file says. `scenegen info`: what a
model file is, and `scenegen train` as people use it. `scenegen grammar`: its answers to bad requests, each one
diagnostic, and the file that it writes. `scenegen lsp` before it serves; what it serves is in tests/editors/lsp.
"""

import csv
import io
import json
import math
import re
import subprocess
import sys

import pytest


@pytest.fixture
def scenes(scenegen, here):
    words = ["--phi", "task=-0.3:0.3", "--phi", "safe=:0.2", "-n", "40", "--out", "s.json"]
    assert scenegen("sample", "two.spec", *words).status == 0
    return json.loads((here / "s.json").read_text())["scenes"]


def test_a_table_for_programs(scenegen, scenes):
    outcome = scenegen("eval", "two.spec", "s.json")
    assert (outcome.status, outcome.err) == (0, "")
    rows = list(csv.DictReader(io.StringIO(outcome.out), delimiter="\t"))
    assert [int(row["scene"]) for row in rows] == list(range(1, 41))
    for row, scene in zip(rows, scenes, strict=True):
        mug, plate = scene["poses"]["mug"], scene["poses"]["plate"]
        task = min(plate["x"] - mug["x"], mug["y"] - plate["y"])
        safe = math.dist((mug["x"], mug["y"]), (plate["x"], plate["y"])) - 0.25
        for name, value in (("task", task), ("safe", safe)):
            assert abs(float(row[name]) - scene["phi"][name]) <= 1e-9
            assert abs(float(row[name]) - value) <= 1e-12
            assert row[name] == repr(float(row[name]))


def test_which_atom_decides(scenegen, scenes):
    rows = list(csv.DictReader(io.StringIO(scenegen("eval", "two.spec", "s.json", "--explain").out), delimiter="\t"))
    for row, scene in zip(rows, scenes, strict=True):
        mug, plate = scene["poses"]["mug"], scene["poses"]["plate"]
        left, above = plate["x"] - mug["x"], mug["y"] - plate["y"]
        expected = "leftOf(mug, plate)" if left < above else "aboveOf(mug, plate)"
        assert row["task is decided by"] == expected
        assert row["safe is decided by"] == "!closeTo(mug, plate, 0.25)"
    assert {row["task is decided by"] for row in rows} == {"leftOf(mug, plate)", "aboveOf(mug, plate)"}


def test_json(scenegen, scenes):
    outcome = scenegen("eval", "two.spec", "s.json", "--json")
    assert (outcome.status, outcome.err) == (0, "")
    found = json.loads(outcome.out)
    assert found["labels"] == ["task", "safe"] and len(found["scenes"]) == 40
    for number, (row, scene) in enumerate(zip(found["scenes"], scenes, strict=True), 1):
        assert row == {"scene": number, "phi": pytest.approx(scene["phi"], abs=1e-9)}
    explained = json.loads(scenegen("eval", "two.spec", "s.json", "--json", "--explain").out)["scenes"]
    assert {row["decided_by"]["safe"] for row in explained} == {"!closeTo(mug, plate, 0.25)"}
    one = json.loads(scenegen("eval", "two.spec", "s.json", "--json", "--explain", "--scene", "3").out)
    assert [row["scene"] for row in one["scenes"]] == [3]
    assert [line["text"] for line in one["formulas"]["task"]] == ["all of", "leftOf(mug, plate)", "aboveOf(mug, plate)"]
    assert one["formulas"]["task"][0]["value"] == one["scenes"][0]["phi"]["task"]


def test_json_of_scenes_that_the_file_has_wrong(scenegen, scenes, here):
    data = json.loads((here / "s.json").read_text())
    data["scenes"][1]["phi"]["task"] += 0.5
    (here / "s.json").write_text(json.dumps(data))
    outcome = scenegen("eval", "two.spec", "s.json", "--json")
    assert outcome.status == 1 and json.loads(outcome.out)["scenes"] and "scene 2 of s.json stores" in outcome.err


def test_scenes_of_another_spec_of_the_same_objects(scenegen, scenes, here):
    outcome = scenegen("eval", "good.spec", "s.json")
    assert outcome.status == 0
    assert outcome.out.startswith("scene\ttask\n1\t")
    assert outcome.err == "note[phi-not-compared]: s.json was made from another spec; its stored phi was not compared\n"


def test_objects_may_stand_in_another_order(scenegen, scenes, here):
    first = scenegen("eval", "two.spec", "s.json").out
    data = json.loads((here / "s.json").read_text())
    data["objects"].reverse()
    for scene in data["scenes"]:
        scene["poses"] = dict(reversed(scene["poses"].items()))
    (here / "s.json").write_text(json.dumps(data))
    assert scenegen("eval", "two.spec", "s.json").out == first


def test_a_rounded_table_for_people(scenegen, scenes, monkeypatch):
    monkeypatch.setattr("scenegen.cli.output.sys.stdout.isatty", lambda: True, raising=False)
    outcome = scenegen("eval", "two.spec", "s.json")
    assert outcome.status == 0
    header, first = (line.split() for line in outcome.out.splitlines()[:2])
    assert header == ["scene", "task", "safe"]
    assert first == ["1", *(f"{scenes[0]['phi'][name]:+.6f}" for name in ("task", "safe"))]


def test_every_sub_formula_of_one_scene(scenegen, scenes):
    scene = scenes[2]
    outcome = scenegen("eval", "two.spec", "s.json", "--explain", "--scene", "3")
    assert (outcome.status, outcome.err) == (0, "")
    mug, plate = scene["poses"]["mug"], scene["poses"]["plate"]
    left, above = plate["x"] - mug["x"], mug["y"] - plate["y"]
    lines = {line.split("  ")[0]: line for line in (line.strip() for line in outcome.out.splitlines()) if line}
    assert "scene 3 of 40" in lines
    for name, value in (("leftOf(mug, plate)", left), ("aboveOf(mug, plate)", above)):
        assert f"{value:+.6f} m" in lines[name]
        assert lines[name].endswith("<- decides") == (value == min(left, above))
    assert f"{min(left, above):+.6f}" in lines["all of"] and not lines["all of"].endswith("decides")
    assert outcome.out.count("<- decides") == 2  # one a label


def test_a_file_of_one_scene_is_explained_at_once(scenegen, here):
    assert scenegen("sample", "good.spec", "--phi", "0:0.2", "-n", "1", "--out", "s.json").status == 0
    assert scenegen("eval", "good.spec", "s.json", "--explain").out.startswith("scene 1 of 1\n")


def test_yaws_of_hands_and_shares_that_are_seen(scenegen, here):
    (here / "seen.spec").write_text(
        "robot arm = panda at (0.5, -0.25, NORTH)\ncamera front = at (0.5, -0.6, 0.7) looks at (0.5, 0.4, 0) "
        "fov 60 deg, 4:3\nobject can, mug, bottle\nrequire noOverlap()\n"
        "pick: graspable(can, arm)\nsee: visible(mug, front, 20 %, 70 %)\n"
    )
    asked = ("--phi", "pick=0:", "--phi", "see=0:", "-n", "3", "--seed", "1", "--out", "s.json")
    assert scenegen("sample", "seen.spec", *asked).status == 0
    table = scenegen("eval", "seen.spec", "s.json", "--explain").out.splitlines()
    column = table[0].split("\t").index("front sees of mug")
    shares = [line.split("\t")[column] for line in table[1:]]
    assert all(20 <= int(one.removesuffix(" %")) <= 70 for one in shares)
    (row,) = json.loads(scenegen("eval", "seen.spec", "s.json", "--explain", "--scene", "2", "--json").out)["scenes"]
    (hand,), (seen,) = row["hands"], row["seen"]
    assert (hand["object"], hand["robot"], seen["object"], seen["words"]) == ("can", "arm", "mug", shares[1])
    assert 0.1 * min(seen["share"] - 0.2, 0.7 - seen["share"]) == pytest.approx(row["phi"]["see"])
    told = scenegen("eval", "seen.spec", "s.json", "--explain", "--scene", "2").out.splitlines()
    assert f"  can at {math.degrees(hand['yaw']):.4g} deg: arm has {hand['room']:.3g} m of room" in told
    assert told[-1] == f"  front sees mug: {shares[1]}"


UNSHOWN = {
    "--scene 3": "--scene shows one scene",
    "--explain --scene 41": "no scene 41",
    "--explain --scene 0": "no scene 0",
}


@pytest.mark.parametrize(("words", "title"), UNSHOWN.items())
def test_a_scene_that_cannot_be_shown(scenegen, scenes, words, title):
    outcome = scenegen("eval", "two.spec", "s.json", *words.split())
    assert (outcome.status, outcome.out) == (1, "") and title in outcome.err


def test_what_the_spec_requires_and_holds(scenegen, here):
    text = "object mug, tray = box(0.3, 0.2, 0.04) at (0.5, 0.5)\nrequire clearOf(mug, tray)\ntask: leftOf(mug, tray)\n"
    (here / "held.spec").write_text(text)
    assert scenegen("sample", "held.spec", "--phi", "0:0.4", "-n", "8", "--out", "s.json").status == 0
    rows = list(csv.DictReader(io.StringIO(scenegen("eval", "held.spec", "s.json").out), delimiter="\t"))
    assert all(float(row["require"]) >= 0.0 and 0.0 <= float(row["task"]) <= 0.4 for row in rows)
    data = json.loads((here / "s.json").read_text())
    assert all(scene["poses"]["tray"] == {"x": 0.5, "y": 0.5, "theta": 0.0} for scene in data["scenes"])
    data["scenes"][4]["poses"]["tray"]["x"] = 0.6
    (here / "s.json").write_text(json.dumps(data))
    outcome = scenegen("eval", "held.spec", "s.json")
    assert outcome.status == 1 and "`tray` is held at (0.5, 0.5, 0)" in outcome.err and "scene 5" in outcome.err


def test_imports_stay_in_the_folder_unless_told_otherwise(scenegen, here):
    (here / "shared.spec").write_text("def beside(a, b) = alignedY(a, b, 5 cm) & closeTo(a, b)\n")
    (here / "sub").mkdir()
    (here / "sub" / "main.spec").write_text('import "../shared.spec"\ntask: beside(mug, plate)\n')
    outcome = scenegen("check", "sub/main.spec")
    assert outcome.status == 1 and "sub/main.spec:1:8" in outcome.err and "--root" in outcome.err
    assert scenegen("check", "sub/main.spec", "--root", ".").status == 0
    assert scenegen("sample", "sub/main.spec", "--root", ".", "--phi", "0:", "-n", "4", "--out", "s.json").status == 0
    # the scene file carries all of it
    source = json.loads((here / "s.json").read_text())["spec"]["source"]
    assert "import" not in source and source.startswith("def beside(a, b) = ")


TRAIN = ["train", "two.spec", "--model", "gan", "--data", "uniform", "--epochs", "2", "--scenes", "64"]


@pytest.fixture
def model(scenegen, here):
    outcome = scenegen(*TRAIN, "--seed", "3", "--out", "m.safetensors", "--no-card")
    assert outcome.status == 0 and outcome.out == ""
    assert "phi off by" in outcome.err
    return here / "m.safetensors"


def test_in_words(scenegen, model, golden):
    outcome = scenegen("info", "m.safetensors")
    assert (outcome.status, outcome.err) == (0, "")
    # digits of trained numbers are the machine's
    text = re.sub(r"-?\d+\.\d+(e-?\d+)?|[0-9a-f]{12}|\d{1,3}(,\d{3})+", "#", outcome.out)
    golden("cli/info.txt", text)


def test_as_json(scenegen, model):
    outcome = scenegen("info", "m.safetensors", "--json")
    assert (outcome.status, outcome.err) == (0, "")
    found = json.loads(outcome.out)
    assert found["objects"] == ["mug", "plate"] and found["model"] == "gan" and found["recipe"] == "default"
    assert found["bytes"] == model.stat().st_size and found["training"]["seed"] == 3
    assert found["validation"]["epochs"] == found["losses"]["epochs"] == [1, 2]
    assert found["data"]["scenes"] == 64 and found["data"]["held_out"] == 6
    assert "leftOf(mug, plate)" in found["spec"]["source"]


def test_files_that_are_no_models(refusal, model, here):
    (here / "noise").write_bytes(bytes(range(1, 256)))
    for name in ("noise", "m_safetensors_train", "two_spec", "missing"):
        refusal("files", f"info_{name}")


@pytest.mark.long
def test_the_card_is_the_default(scenegen, here, monkeypatch):
    for name in ("PATIENCE", "ALL"):  # however slow the machine
        monkeypatch.setattr(f"scenegen.learn.evaluation.card.{name}", float("inf"))
    outcome = scenegen(*TRAIN, "--out", "m.safetensors")
    assert outcome.status == 0
    names = {path.name for path in here.iterdir()}
    assert {"m.safetensors", "m.safetensors.train", "m.safetensors.md", "m.safetensors.png"} <= names
    assert "wrote m.safetensors.md" in outcome.err and "wrote m.safetensors.png" in outcome.err


def test_scene_files_as_data_and_patience(scenegen, refused, refusal, here):
    assert scenegen("sample", "two.spec", "--phi", "task=-0.5:0.5", "-n", "40", "--out", "s.json").status == 0
    words = [*TRAIN[:-2], "--data", "s.json", "--patience", "1", "--no-card"]
    assert scenegen(*words, "--out", "m.safetensors").status == 0
    assert "36 scenes of s.json, 4 more held out" in scenegen("info", "m.safetensors").out
    for name in ("train_data_objects", "train_data_ending", "train_patience"):
        refusal("files", name)
    assert refused(*words, "--data", "t.json", "--out", "f.safetensors").startswith(
        "error[cannot-read]: cannot read t.json"
    )


@pytest.mark.long
def test_settings_of_the_models_own(scenegen, here):
    words = [
        "train",
        "good.spec",
        "--model",
        "gan",
        "--epochs",
        "1",
        "--scenes",
        "600",
        "--no-card",
        "--out",
        "m.safetensors",
    ]
    assert scenegen(*words, "--hyper", "width=32", "--hyper", "consistency=0.5").status == 0
    told = scenegen("info", "m.safetensors").out
    assert "gan, width 32, depth 4, critic_width 192, critic_depth 3, consistency 0.5" in told


BAD = {
    "dialect": ["good.spec", "--to", "bnf"],
    "shape": ["good.spec", "--shape", "all"],
    "part": ["good.spec", "--only", "task"],
    "no_objects": ["--to", "gbnf"],
    "empty": ["--objects", ""],
    "twice": ["--objects", "mug,mug"],
    "a_keyword": ["--objects", "forall"],
    "too_many": ["--objects", "mug[41]"],
    "both": ["good.spec", "--objects", "mug"],
    "broken": ["broken.spec"],
    "not_there": ["nowhere.spec"],
    "impossible": ["impossible.spec"],
}


@pytest.mark.parametrize("name", BAD)
def test_one_diagnostic_each(name, refused, here):
    (here / "broken.spec").write_text("object mug\ntask: leftOf(mug,\n")
    text = "require closeTo(mug, plate, 5 cm) & x(mug) >= x(plate) + 10 cm\ntask: leftOf(mug, plate)\n"
    (here / "impossible.spec").write_text(text)
    assert len(re.findall(r"^error\[", refused("grammar", *BAD[name]), re.MULTILINE)) == 1


def test_a_name_that_is_none(scenegen):
    outcome = scenegen("grammar", "--objects", "9mug,plate")
    assert (outcome.status, outcome.out) == (1, "") and outcome.err.startswith("error[unexpected]: unexpected `9`")
    assert outcome.err.count("error[") == 1


@pytest.mark.long
def test_a_file_and_standard_output_are_the_same(scenegen, here):
    printed = scenegen("grammar", "--objects", "mug", "--to", "gbnf", "--only", "labels")
    written = scenegen("grammar", "--objects", "mug", "--to", "gbnf", "--only", "labels", "--out", "m.gbnf")
    assert (printed.status, written.status, written.out) == (0, 0, "")
    assert (here / "m.gbnf").read_text() == printed.out and printed.out.startswith("root ::= goal1\n")


def test_without_pygls(scenegen, monkeypatch, assert_one_diagnostic):
    for name in [one for one in sys.modules if one.startswith(("pygls", "scenegen.editors.lsp"))]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "pygls.lsp.server", None)
    monkeypatch.setitem(sys.modules, "pygls.exceptions", None)
    outcome = scenegen("lsp")
    assert (outcome.status, outcome.out) == (1, "")
    assert_one_diagnostic(outcome.err)
    assert 'pip install "scenegen-dsl[lsp]"' in outcome.err


def test_a_root_that_is_no_folder(scenegen, tmp_path, assert_one_diagnostic):
    outcome = scenegen("lsp", "--root", str(tmp_path / "none"))
    assert (outcome.status, outcome.out) == (1, "")
    assert_one_diagnostic(outcome.err)


@pytest.mark.long
def test_it_ends_with_its_input():
    """An editor that dies closes the pipe; nobody is left behind, and nothing was printed."""
    command = [sys.executable, "-m", "scenegen", "lsp"]
    done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, timeout=60)
    assert (done.stdout, done.returncode) == (b"", 0)
