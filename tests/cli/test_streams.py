"""Data on standard output, words on standard error, a traceback for whoever asks for one and nobody else."""

import json
import os
import re
import subprocess
import sys

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


@pytest.mark.long
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


@pytest.mark.long
def test_debug_in_a_process_of_its_own(process, here):
    (here / "bad.spec").write_text("leftOf(mug)")
    quiet = process("sample", "bad.spec")
    loud = process("sample", "bad.spec", "--debug")
    assert (quiet.returncode, quiet.stdout, "Traceback" in quiet.stderr) == (1, "", False)
    assert quiet.stderr.startswith("error[wrong-number-of-arguments]: `leftOf` takes 2 arguments, not 1\n")
    assert (loud.returncode, loud.stdout, "Traceback" in loud.stderr) == (1, "", True)
    assert quiet.stderr.rstrip() in loud.stderr


def test_a_bug_of_ours_is_a_diagnostic_too(scenegen, here, monkeypatch):
    def broken(*_, **__):
        raise ZeroDivisionError("division by zero")

    monkeypatch.setattr("scenegen.api.sample.draw_scenes", broken)
    outcome = scenegen("sample", "good.spec")
    assert (outcome.status, outcome.out) == (1, "")
    assert outcome.err.startswith(
        "error[internal-error]: scenegen itself failed: ZeroDivisionError: division by zero\n = help: this is"
    )
    with pytest.raises(ZeroDivisionError):
        scenegen("sample", "good.spec", "--debug")


@pytest.mark.long
def test_a_reader_that_leaves_early_is_no_error(here, process):
    import subprocess
    import sys

    program = f"{sys.executable} -m scenegen"
    done = subprocess.run(
        ["bash", "-c", f"{program} sample good.spec -n 3000 | head -c 10"], capture_output=True, text=True, timeout=60
    )
    assert done.stdout == '{\n "format'
    assert "Traceback" not in done.stderr and "BrokenPipe" not in done.stderr


def shell(text):
    """A line of bash with `$S` for the program; (its output and messages, the status of each command in the pipe)."""
    line = f'S="{sys.executable} -m scenegen"; {text}; all="${{PIPESTATUS[@]}}"; echo; echo "$all"'
    environment = os.environ | {"NO_COLOR": "1"}
    done = subprocess.run(["bash", "-c", line], capture_output=True, text=True, timeout=120, env=environment)
    *said, status = done.stdout.splitlines()
    return "\n".join(said) + done.stderr, list(map(int, status.split()))


@pytest.mark.long
def test_whoever_reads_the_data_may_leave_early(here):
    """Both ways of writing data, in one pipe: `check` line by line, `sample` all at once and more than a pipe holds."""
    said, statuses = shell("$S check good.spec $(yes two.spec | head -50) | head -1")
    assert statuses == [0, 0] and said.split() == ["good.spec:", "ok"], said
    said, statuses = shell("$S sample good.spec -n 3000 | head -1")
    assert statuses == [0, 0] and "error" not in said, said


@pytest.mark.long
def test_a_wrong_spec_is_one_whoever_reads_the_messages(here):
    said, statuses = shell("$S check missing.spec 2>&1 | true")
    assert statuses == [1, 0] and "Traceback" not in said


@pytest.mark.long
def test_a_closed_standard_output_loses_no_scenes(here, snapshot):
    """With `>&-` the next file that was opened took its place, or what was printed went nowhere, with status 0."""
    before = snapshot(here)
    for words in ("sample good.spec -n 2", "check good.spec"):
        said, statuses = shell(f"$S {words} >&-")
        assert statuses == [1] and snapshot(here) == before
        assert said.strip().startswith(
            "error[cannot-write]: cannot write to standard output: bad file descriptor\n = help: "
        ), said
    assert shell("$S sample good.spec -n 2 --out s.json >&-")[1] == [0] and (here / "s.json").is_file()


def test_sampling_does_not_begin_for_a_closed_output(here, monkeypatch, scenegen):
    monkeypatch.setattr("scenegen.api.sample.draw_scenes", lambda *_, **__: pytest.fail("work was begun"))
    reading = os.open(os.devnull, os.O_RDONLY)
    monkeypatch.setattr(sys, "stdout", open(reading, "w", closefd=True))  # noqa: SIM115, PTH123
    monkeypatch.setattr("scenegen.cli.app.give_up", lambda stream: None)
    assert scenegen("sample", "good.spec").status == 1


@pytest.mark.long
def test_a_full_disk_behind_standard_output(here):
    said, statuses = shell("$S sample good.spec -n 3 >/dev/full")
    assert statuses == [1] and "cannot write to standard output: no space left on device" in said
