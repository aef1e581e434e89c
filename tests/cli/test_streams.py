"""Data on standard output, words on standard error, a traceback for whoever asks for one and nobody else."""

import json
import re

import pytest

from scenegen.errors import SpecError


def test_scenes_on_standard_output_are_a_scenes_file(scenegen, here):
    outcome = scenegen("sample", "good.spec", "--phi", "0:0.5", "-n", "5")
    assert outcome.status == 0
    assert len(json.loads(outcome.out)["scenes"]) == 5
    assert re.match(r"5 scenes \(rejection, [\d,]+ draws, [\d.]+% accepted\)\n", outcome.err.split("\n", 1)[1])
    to_file = scenegen("sample", "good.spec", "--phi", "0:0.5", "-n", "5", "--out", "s.json")
    assert to_file.out == ""
    assert (here / "s.json").read_text() == outcome.out


def test_check_prints_data_only(scenegen, here):
    outcome = scenegen("check", "good.spec", "two.spec")
    assert (outcome.status, outcome.err) == (0, "")
    assert outcome.out.count(": ok\n") == 2


def test_training_and_drawing_print_no_data(scenegen, here, small_pictures):
    words = [
        "train",
        "good.spec",
        "--model",
        "aae",
        "--recipe",
        "paper",
        "--epochs",
        "2",
        "--scenes",
        "64",
        "--out",
        "m.safetensors",
    ]
    train = scenegen(*words)
    assert (train.status, train.out) == (0, "")
    assert "wrote m.safetensors" in train.err
    drawn = scenegen("sample", "m.safetensors", "-n", "1", "--raw", "--out", "s.json", "--render", "pictures")
    assert (drawn.status, drawn.out) == (0, "")
    assert (here / "pictures" / "contact_sheet.png").exists()


@pytest.mark.parametrize("place", [0, 1, 2])
def test_debug_anywhere_shows_the_traceback(place, scenegen, here):
    words = ["check", "missing.spec"]
    words.insert(place, "--debug")
    (here / "bad.spec").write_text("leftOf(mug)")
    assert "Traceback" not in scenegen("eval", "bad.spec", "none.json").err
    with pytest.raises(SpecError):
        scenegen("--debug", "eval", "bad.spec", "none.json")
    assert scenegen(*words).status == 1  # check goes on to the next spec, so it has no error to show


def test_debug_in_a_process_of_its_own(process, here):
    (here / "bad.spec").write_text("leftOf(mug)")
    quiet = process("sample", "bad.spec")
    loud = process("sample", "bad.spec", "--debug")
    assert (quiet.returncode, quiet.stdout, "Traceback" in quiet.stderr) == (1, "", False)
    assert quiet.stderr.startswith("error: `leftOf` takes 2 arguments, not 1\n")
    assert (loud.returncode, loud.stdout, "Traceback" in loud.stderr) == (1, "", True)
    assert quiet.stderr.rstrip() in loud.stderr


def test_a_bug_of_ours_is_a_diagnostic_too(scenegen, here, monkeypatch):
    def broken(*_, **__):
        raise ZeroDivisionError("division by zero")

    monkeypatch.setattr("scenegen.api.sample.sample", broken)
    outcome = scenegen("sample", "good.spec")
    assert (outcome.status, outcome.out) == (1, "")
    assert outcome.err.startswith(
        "error: scenegen itself failed: ZeroDivisionError: division by zero\n = help: this is"
    )
    with pytest.raises(ZeroDivisionError):
        scenegen("sample", "good.spec", "--debug")


def test_a_reader_that_leaves_early_is_no_error(here, process):
    import subprocess
    import sys

    program = f"{sys.executable} -m scenegen"
    done = subprocess.run(
        ["bash", "-c", f"{program} sample good.spec -n 3000 | head -c 10"], capture_output=True, text=True, timeout=60
    )
    assert done.stdout == '{\n "format'
    assert "Traceback" not in done.stderr and "BrokenPipe" not in done.stderr
