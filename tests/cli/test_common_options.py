"""-h, -q, -v, and what a shell completes."""

import os
import re
import subprocess
import sys

import pytest

SAMPLE = ("sample", "good.spec", "--phi", "0:0.2", "-n", "2", "--out", "s.json")


def test_short_help(scenegen):
    assert scenegen("check", "-h").out == scenegen("check", "--help").out
    assert scenegen("-h").out == scenegen("--help").out


def test_quiet_says_nothing_of_success(scenegen, here):
    assert scenegen(*SAMPLE).err != ""
    for words in ((*SAMPLE, "-q"), ("--quiet", *SAMPLE)):
        outcome = scenegen(*words)
        assert (outcome.status, outcome.out, outcome.err) == (0, "", "")


def test_quiet_still_says_what_is_wrong(scenegen, here):
    assert scenegen("check", "-q", "missing.spec").err.startswith("error[cannot-read]: cannot read missing.spec")
    (here / "spare.spec").write_text("object mug, plate\nconst SPARE = 3\ntask: leftOf(mug, plate)\n")
    assert scenegen("check", "-q", "spare.spec").err.startswith("warning[")


def test_quiet_is_over_with_the_command(scenegen, here):
    scenegen(*SAMPLE, "-q")
    assert "2 scenes" in scenegen(*SAMPLE).err


def test_verbose_says_what_is_done_and_when(scenegen, here):
    lines = [line for line in scenegen(*SAMPLE, "-v").err.splitlines() if line.startswith("[")]
    assert len(lines) >= 2 and all(re.match(r"\[ *\d+\.\d\d s\] \w", line) for line in lines)
    assert "task=0:0.2" in lines[0]


def test_both_contradict(refused):
    assert "-q and -v contradict each other" in refused("check", "good.spec", "-q", "-v")


@pytest.mark.parametrize(
    ("line", "wanted"),
    [
        ("scenegen sa", ["sample"]),
        ("scenegen sample --sat", ["--satisfied"]),
        ("scenegen sample table_set", ["table_setting", "table_setting_published"]),
        ("scenegen sample goo", []),  # a file of that name: the shell completes it
        ("scenegen sample x --method rej", ["rejection"]),
        ("scenegen train x --model f", ["flow"]),
    ],
)
def test_what_a_shell_completes(scenegen, here, monkeypatch, capfd, line, wanted):
    for name, value in (("_SCENEGEN_COMPLETE", "complete_bash"), ("COMP_WORDS", line)):
        monkeypatch.setenv(name, value)
    monkeypatch.setenv("COMP_CWORD", str(len(line.split()) - 1))
    with pytest.raises(SystemExit) as done:
        scenegen()
    assert done.value.code == 0
    assert capfd.readouterr().out.split() == wanted


def test_a_shell_gets_its_script(root):
    """As `--show-completion` prints it, which looks for the shell among the processes above."""
    words = [sys.executable, "-m", "scenegen"]
    shell = {**os.environ, "_SCENEGEN_COMPLETE": "source_bash"}
    done = subprocess.run(words, env=shell, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0 and "complete -o default -F" in done.stdout and "scenegen" in done.stdout
