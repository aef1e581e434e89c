"""Requests that cannot be: ranges of phi, counts, times, names. `sample --satisfied` and `--violated`: short for the
ranges that are asked for most. `--steps`: a flow is trained once and taken in any number of jumps. -h, -q, -v, and
what a shell completes.
"""

import json
import os
import re
import shlex
import subprocess
import sys

import pytest

from tests.corpus import read_corpus

CASES = read_corpus("cli/errors/requests")


def cases(*commands):
    """The cases whose names begin so."""
    return [name for name in CASES if name.startswith(commands)]


@pytest.mark.parametrize("name", cases("phi_"))
def test_range(name, refusal):
    """The caret points at the end or the label that is wrong."""
    assert re.fullmatch(r" +--> --phi:1:\d+", refusal("requests", name).splitlines()[1])


@pytest.mark.parametrize("name", cases("sample_", "train_"))
def test_option(name, refusal):
    refusal("requests", name)


@pytest.mark.parametrize("size", ["640", "640x", "axb", "0x0", "100000x5", "640X480x3"])
def test_render_size(size, refused, scenegen):
    scenegen("sample", "good.spec", "-n", "1", "--out", "s.json")
    refused("render", "s.json", "--out", "pictures", "--size", size)


@pytest.mark.parametrize("name", cases("render_"))
def test_render_option(name, refusal, scenegen):
    scenegen("sample", "good.spec", "-n", "1", "--out", "s.json")
    refusal("requests", name)


@pytest.mark.parametrize("name", cases("grasp_"))
def test_grasps(name, here, refusal):
    arm = "robot arm = panda at (0.5, -0.25, NORTH)\nrequire noOverlap()\n"
    (here / "arm.spec").write_text(f"object cube = box(4 cm, 4 cm, 4 cm), apple\n{arm}goal: leftOf(cube, apple)\n")
    (here / "held.spec").write_text("object cube at (0.5, 0.5)\nrobot arm = panda\ngoal: leftOf(cube, arm)\n")
    refusal("requests", name)


@pytest.mark.parametrize("name", cases("usage_"))
def test_wrong_usage_is_status_2(name, scenegen, here, message):
    outcome = scenegen(*shlex.split(CASES[name].text)[1:])
    assert (outcome.status, outcome.out) == (2, "")
    assert sorted(path.name for path in here.iterdir()) == ["forks.spec", "good.spec", "two.spec"]
    message("cli/errors/requests", name, outcome.err)


def test_an_unknown_model_is_refused_before_anything_is_loaded(here):
    """It took as long as loading torch, 17 seconds on a slow disk."""
    import subprocess
    import sys

    program = (
        "import sys; from scenegen.cli.app import run; status = run(sys.argv[1:]);"
        "print(status, [name for name in ('torch', 'lark') if name in sys.modules])"
    )
    words = ["train", "good.spec", "--model", "diffusion", "--out", "m.safetensors"]
    done = subprocess.run([sys.executable, "-c", program, *words], capture_output=True, text=True, timeout=60)
    assert done.stdout == "1 []\n" and "`flow`" in done.stderr and "did you mean" not in done.stderr


def test_a_format_that_is_not_there(refused, scenegen, here):
    assert scenegen("sample", "good.spec", "-n", "1", "--out", "s.json").status == 0
    said = refused("export", "s.json", "--to", "gltf", "--out", "worlds")
    assert "the formats are `mjcf`, `sdf`" in said and "did you mean" not in said


@pytest.mark.long
def test_no_range_is_blamed_for_what_the_spec_requires(refused, here):
    text = "object a[4] = box(0.48, 0.48, 0.1)\nrequire noOverlap() & insideWorkspace()\ntask: leftOf(a[1], a[2])\n"
    (here / "tight.spec").write_text(text)
    words = ("--phi", "0:", "-n", "4", "--method", "rejection", "--timeout", "1.5", "--out", "x.json")
    said = refused("sample", "tight.spec", *words)
    assert "phi of `require` was outside" in said and "= help: require less" in said and "widen" not in said


FLAGS = {
    "--satisfied": {"task": (0.0, None), "safe": (0.0, None)},
    "--violated": {"task": (None, 0.0), "safe": (None, 0.0)},
    "--satisfied --phi task=-0.2:0": {"task": (-0.2, 0.0), "safe": (0.0, None)},
    "--violated --phi safe=0:": {"task": (None, 0.0), "safe": (0.0, None)},
}


@pytest.mark.parametrize(("words", "wanted"), FLAGS.items())
def test_every_label_that_is_not_named(scenegen, here, words, wanted):
    outcome = scenegen("sample", "two.spec", *words.split(), "-n", "8", "--out", "s.json")
    assert outcome.status == 0
    data = json.loads((here / "s.json").read_text())
    assert data["request"]["phi"] == {name: list(ends) for name, ends in wanted.items()}
    for scene in data["scenes"]:
        for name, (low, high) in wanted.items():
            assert (low is None or scene["phi"][name] >= low) and (high is None or scene["phi"][name] <= high)


def test_short_for_phi(scenegen, here):
    for words in (["--satisfied"], ["--phi", "task=0:"]):
        assert scenegen("sample", "good.spec", *words, "-n", "4", "--out", f"{len(words)}.json").status == 0
    assert (here / "1.json").read_bytes() == (here / "2.json").read_bytes()


def test_both_contradict(refused):
    assert "contradict each other" in refused("sample", "good.spec", "--satisfied", "--violated")


def test_a_flow_in_any_number_of_jumps(scenegen, refused, here):
    trained = ["--model", "flow", "--epochs", "1", "--scenes", "128", "--data", "uniform", "--no-card", "--out"]
    assert scenegen("train", "good.spec", *trained, "m.safetensors").status == 0
    poses = {}
    for steps in ("1", "3"):
        asked = ["sample", "m.safetensors", "--phi=-0.5:0.5", "-n", "4", "--raw", "--out", "s.json"]
        assert scenegen(*asked, "--steps", steps).status == 0
        found = json.loads((here / "s.json").read_text())
        assert found["sampler"]["steps"] == int(steps)
        poses[steps] = [scene["poses"] for scene in found["scenes"]]
    assert poses["1"] != poses["3"]
    for wrong in ("0", "1001"):
        assert "must be from 1 to 1,000" in refused("sample", "m.safetensors", "--steps", wrong)
    assert "no model takes part" in refused("sample", "good.spec", "--steps", "2")


def test_models_without_steps(scenegen, refused, here):
    trained = ["--model", "gan", "--data", "uniform", "--epochs", "1", "--scenes", "64", "--no-card", "--out"]
    assert scenegen("train", "good.spec", *trained, "m.safetensors").status == 0
    assert "one evaluation of its network" in refused("sample", "m.safetensors", "--steps", "2")


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


def test_both_contradict_options(refused):
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
