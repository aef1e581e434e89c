"""`scenegen check`: fast, light, and readable by editors."""

import json
import subprocess
import sys

import pytest


@pytest.mark.long
def test_it_loads_nothing_heavy(root):
    """How fast it is, benchmarks/language.py says; here it is held to what makes it so."""
    program = (
        "import sys; from scenegen.cli.app import run; status = run(sys.argv[1:]);"
        "sys.exit(status or ','.join(m for m in ('torch', 'pybullet', 'PIL') if m in sys.modules) or None)"
    )
    specs = [str(root / "specs" / f"{name}.spec") for name in ("first", "office_desk", "sort_3", "table_setting")]
    done = subprocess.run([sys.executable, "-c", program, "check", *specs], capture_output=True, text=True, timeout=120)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize("name", ["first", "mug_left_of_plate", "table_setting"])
def test_what_is_printed(name, scenegen, root, monkeypatch, golden):
    monkeypatch.chdir(root)
    outcome = scenegen("check", f"specs/{name}.spec")
    assert (outcome.status, outcome.err) == (0, "")
    golden(f"cli/check/{name}.txt", outcome.out)


def test_json_for_editors(scenegen, here, golden):
    (here / "bad.spec").write_text("object mug, plate\ntask: leftOf(mug, fork)\n    & nextTo(mug,\n plate)\n")
    (here / "binary.spec").write_bytes(b"\0\1\2")
    outcome = scenegen("check", "--json", "good.spec", "bad.spec", "binary.spec", "missing.spec")
    assert (outcome.status, outcome.err) == (1, "")
    reports = json.loads(outcome.out)
    text = (here / "bad.spec").read_text().splitlines()
    pointed = []
    for problem in reports[1]["diagnostics"]:
        start, end = problem["range"]["start"], problem["range"]["end"]
        assert start["line"] == end["line"]
        pointed.append(text[start["line"]][start["character"] : end["character"]])
    assert pointed == ["fork", "nextTo"]
    golden("cli/check/json.txt", outcome.out)


def test_json_has_every_syntax_error_in_utf_16_units(scenegen, here):
    (here / "bad.spec").write_text('object mug plate\ntask: f("\U0001f36d" mug)\nsafe: (leftOf(mug, plate)\n')
    outcome = scenegen("check", "--json", "bad.spec")
    assert (outcome.status, outcome.err) == (1, "")
    (report,) = json.loads(outcome.out)
    starts = [(one["range"]["start"]["line"], one["range"]["start"]["character"]) for one in report["diagnostics"]]
    assert starts == [(0, 11), (1, 13), (2, 6)] and not report["ok"]
    assert all(one["title"] == one["message"] and one["file"] == "bad.spec" for one in report["diagnostics"])


def test_json_of_a_good_spec_has_status_0(scenegen, here):
    outcome = scenegen("check", "--json", "good.spec")
    assert outcome.status == 0
    (report,) = json.loads(outcome.out)
    assert report["ok"] and report["labels"] == {"task": [-1.0, 1.0]} and report["objects"] == ["mug", "plate"]


def test_a_label_that_no_scene_satisfies_is_an_error(scenegen, here):
    (here / "hopeless.spec").write_text("task: leftOf(mug, plate) & x(mug) >= x(plate) + 2\nsafe: leftOf(mug, plate)\n")
    outcome = scenegen("check", "hopeless.spec")
    assert outcome.status == 1 and outcome.out.startswith("hopeless.spec: cannot be satisfied\n")
    assert outcome.err.startswith(
        "error[cannot-be-satisfied]: `task` can never be satisfied: phi is at most -1\n --> hopeless.spec:1:28\n"
    )
    assert "bounds prove it" in outcome.err and "--allow-unsatisfiable" in outcome.err and "`safe`" not in outcome.err
    (report,) = json.loads(scenegen("check", "hopeless.spec", "--json").out)
    assert report["ok"] is False and report["diagnostics"][0]["severity"] == "error"
    assert report["labels"]["task"] == [-3.0, -1.0], "the data is there all the same"


def test_unless_it_is_meant_so(scenegen, here):
    (here / "hopeless.spec").write_text("task: leftOf(mug, plate) & x(mug) >= x(plate) + 2\n")
    outcome = scenegen("check", "hopeless.spec", "--allow-unsatisfiable")
    assert outcome.status == 0 and outcome.out.startswith("hopeless.spec: ok\n")
    assert outcome.err.startswith("warning[cannot-be-satisfied]: `task` can never be satisfied")
    (report,) = json.loads(scenegen("check", "hopeless.spec", "--json", "--allow-unsatisfiable").out)
    assert report["ok"] is True and report["diagnostics"][0]["severity"] == "warning"


def test_what_is_not_proved_is_a_warning(scenegen, here):
    """Seven circles round one, just too large to fit: a search finds no scene, and bounds prove nothing in so little
    time."""
    text = "object ring[7] = cylinder(0.05, 0.1), hub = cylinder(0.05, 0.1)\nrequire noOverlap()\n"
    (here / "tight.spec").write_text(text + "task: forall p in ring: gap(p, hub) <= 1 mm\n")
    outcome = scenegen("check", "tight.spec")
    assert outcome.status == 0 and "can hardly be satisfied" in outcome.err and "error" not in outcome.err


def test_what_clashes_is_named_with_its_lines(scenegen, here):
    text = (
        "object mug, plate\ntask: closeTo(mug, plate, 5 cm)\n    & angle(mug, NORTH)\n    & x(mug) >= x(plate) + 0.1\n"
    )
    (here / "hopeless.spec").write_text(text)
    outcome = scenegen("check", "hopeless.spec")
    assert "hopeless.spec:2:7" in outcome.err and "hopeless.spec:4:7" in outcome.err and "angle" not in outcome.err


def test_a_requirement_that_no_scene_meets_is_told_once(scenegen, here):
    text = "object a = box(0.9, 0.9, 0.1), b = box(0.9, 0.9, 0.1)\nrequire insideWorkspace()\nrequire noOverlap()\n"
    (here / "hopeless.spec").write_text(text + "task: leftOf(a, b)\nother: leftOf(b, a)\n")
    outcome = scenegen("check", "hopeless.spec")
    assert outcome.status == 1 and outcome.err.startswith(
        "error[requirement-cannot-be-met]: what the spec requires can never be met\n"
    )
    assert outcome.err.count("error[") == 1 and "warning[" not in outcome.err


BLOCKS = "object block[30]\nrequire noOverlap() & insideWorkspace()\ntask: closeTo(block[1], block[2], 0.3)\n"
WIDE = "task: " + " & ".join(f"x(o{n}) <= y(p{n}) + 1" for n in range(100)) + "\n"
DEEP = "task: " + "".join(f"(x(a) <= 0.{n} | " for n in range(1, 60)) + "x(b) <= 1" + ")" * 59 + "\n"
MANY = "object a, b\n" + "".join(f"l{n}: leftOf(a, b) | x(a) >= 0.{n}\n" for n in range(1, 100))
LARGE = {"blocks": BLOCKS, "wide": WIDE, "deep": DEEP, "many": MANY}


@pytest.mark.long
@pytest.mark.parametrize("name", LARGE)
def test_a_page_at_most(scenegen, here, name):
    (here / "large.spec").write_text(LARGE[name])
    outcome = scenegen("check", "large.spec")
    lines = outcome.out.splitlines()
    assert outcome.status == 0 and len(lines) <= 42 and max(map(len, lines)) <= 120
    assert ("Only a page of it" in outcome.out) == (name != "blocks")
    assert len(scenegen("check", "large.spec", "--full").out.splitlines()) > 100


def test_what_repeats_is_folded(scenegen, here, golden):
    (here / "blocks.spec").write_text(BLOCKS)
    golden("cli/check/blocks.txt", scenegen("check", "blocks.spec").out)


def test_depth(scenegen, here):
    (here / "deep.spec").write_text(DEEP)
    for depth in (0, 3):
        lines = scenegen("check", "deep.spec", "--depth", str(depth)).out.splitlines()
        formulas = lines[lines.index(next(line for line in lines if line.startswith("  task:"))) + 1 :]
        assert max((len(line) - len(line.lstrip()) - 4) // 2 for line in formulas) == depth
    assert scenegen("check", "deep.spec", "--depth", "-1").status == 1
    assert len(scenegen("check", "deep.spec", "--depth", "58").out.splitlines()) > 100


def test_bounds_that_say_too_little_are_said_to_be_rough(scenegen, here):
    """40 boxes are too many for a search in half a second: nothing is claimed."""
    (here / "blocks.spec").write_text(BLOCKS.replace("block[30]", "block[40]"))
    outcome = scenegen("check", "blocks.spec")
    assert (outcome.status, outcome.err) == (0, "")
    assert "; rough: a quick look found no scene that meets it" in outcome.out
