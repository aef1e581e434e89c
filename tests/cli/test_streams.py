"""Data on standard output, words on standard error, a traceback for whoever asks for one and nobody else. A spec from
standard input or a pipe, for every command that reads one; numbers as people type them.
"""

import io
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
        "--data",
        "uniform",
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
@pytest.mark.parametrize("words", ["--help", "sample -h", "--version", "specs"])
def test_help_may_be_left_early_too(words, here):
    """rich, which prints help, ended the program with 1."""
    said, statuses = shell(f"$S {words} | true")
    assert statuses == [0, 0] and "Traceback" not in said, said
    assert shell("$S check missing.spec 2>&1 --help | true")[1] == [0, 0]


@pytest.mark.long
def test_a_completion_that_nobody_reads_is_no_traceback(here):
    said, statuses = shell("_SCENEGEN_COMPLETE=complete_bash COMP_WORDS='scenegen s' COMP_CWORD=1 $S | true")
    assert statuses == [0, 0] and "Traceback" not in said, said


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


TEXT = "object mug, plate\ntask: leftOf(mug, plate)\n"


@pytest.fixture
def piped(monkeypatch):
    """piped(text): what standard input has."""

    def put(text):
        monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(text.encode())))

    return put


COMMANDS = [
    ("check", "-"),
    ("range", "-"),
    ("sample", "-", "-n", "2", "--out", "s.json"),
    ("sample", "-", "-n", "2", "--out", "s/"),
    ("eval", "-", "s.json"),
    ("pairs", "-", "-n", "2", "--out", "p.json"),
    ("grammar", "-"),
    ("dataset", "-", "-n", "2", "--out", "d/"),
    ("view", "-", "--export", "v.html", "-n", "2"),
]


@pytest.mark.long
@pytest.mark.parametrize("words", COMMANDS, ids=" ".join)
def test_standard_input_is_a_spec(words, scenegen, here, piped):
    (here / "two.spec").write_text(TEXT)
    assert scenegen("sample", "two.spec", "-n", "2", "--out", "s.json").status == 0
    piped(TEXT)
    outcome = scenegen(*(f"o{word}" if word in ("s.json", "s/") and "--out" in words else word for word in words))
    assert outcome.status == 0, outcome.err


@pytest.mark.parametrize("name", ["-", "/dev/stdin", "/dev/fd/0"])
@pytest.mark.parametrize("words", [*COMMANDS, ("fmt", "-"), ("train", "-", "--out", "m.safetensors")], ids=" ".join)
def test_a_closed_standard_input_is_said(words, name, scenegen, here, monkeypatch, assert_one_diagnostic):
    if words[0] == "fmt" and name != "-":
        pytest.skip("is standard input as `-` alone: others are files to rewrite")
    monkeypatch.setattr(sys, "stdin", None)  # what Python makes of a stream that is closed
    outcome = scenegen(*(name if word == "-" else word for word in words))
    assert outcome.status == 1 and f"cannot read {name}: standard input is closed" in outcome.err
    if words[0] != "dataset":  # says which of its specs has failed, too
        assert_one_diagnostic(outcome.err)


def test_a_pipe_of_a_shell_is_a_spec(scenegen, here):
    read, write = os.pipe()
    os.write(write, TEXT.encode())
    os.close(write)
    outcome = scenegen("check", f"/dev/fd/{read}")
    os.close(read)
    assert outcome.status == 0 and outcome.out.startswith("<stdin>: ok\n")


def test_mistakes_and_imports_of_what_is_piped(scenegen, here, piped):
    piped("task: leftOf(mug, plate\n")
    outcome = scenegen("check", "-")
    assert outcome.status == 1 and " --> <stdin>:1:13" in outcome.err
    (here / "near.spec").write_text("const NEAR = 20 cm\n")
    piped('import "near.spec"\ntask: closeTo(mug, plate, NEAR)\n')
    assert scenegen("check", "-").status == 0  # from the current folder
    piped("")
    assert "<stdin> is empty" in scenegen("check", "-").err


@pytest.mark.parametrize(("text", "count"), [("1e1", 10), ("1_0", 10), ("1.5e1", 15), ("12", 12)])
def test_numbers_of_scenes(text, count, scenegen, here):
    import json

    (here / "two.spec").write_text(TEXT)
    assert scenegen("sample", "two.spec", "-n", text, "--out", "s.json").status == 0
    assert len(json.loads((here / "s.json").read_text())["scenes"]) == count


@pytest.mark.parametrize("text", ["1.5", "abc", "1e-3", "1e400", "nan", "inf", "0x10", ""])
def test_what_is_no_number_of_scenes(text, scenegen, here):
    (here / "two.spec").write_text(TEXT)
    outcome = scenegen("sample", "two.spec", "-n", text)
    assert outcome.status == 1 and "is not a whole number" in outcome.err


@pytest.mark.parametrize(
    ("fix", "pose"),
    [
        ("plate=50cm,0.5,90deg", (0.5, 0.5, 1.5707963267948966)),
        ("plate=0.5, 500 mm, 0.25 turn", (0.5, 0.5, 1.5707963267948966)),
        ("plate=0.5m,0.5,1rad", (0.5, 0.5, 1.0)),
        ("plate=0.5,0.5,1", (0.5, 0.5, 1.0)),
        ("plate=0.5,0.5,-90deg", (0.5, 0.5, 4.71238898038469)),
        ("plate=0.5,0.5,90\N{DEGREE SIGN}", (0.5, 0.5, 1.5707963267948966)),
    ],
)
def test_units_of_fixed_objects(fix, pose, scenegen, here):
    import json

    (here / "two.spec").write_text(TEXT)
    assert scenegen("sample", "two.spec", "-n", "1", "--fix", fix, "--out", "s.json").status == 0
    (scene,) = json.loads((here / "s.json").read_text())["scenes"]
    assert tuple(scene["poses"]["plate"].values()) == pytest.approx(pose, abs=1e-15)


@pytest.mark.parametrize(
    ("words", "same"),
    [
        (("--phi", "5cm:10cm"), ("--phi", "0.05:0.1")),
        (("--phi", "task=-50 mm:0.1m"), ("--phi", "-0.05:0.1")),
        (("--phi", "-10deg:"), ("--phi", "-0.17453292519943295:")),
        (("--seed", "1e3"), ("--seed", "1000")),
        (("--timeout", "2min"), ("--timeout", "120")),
        (("--timeout", "90 s"), ("--timeout", "90")),
        (("--workers", "1e0"), ("--workers", "1")),
    ],
    ids=lambda words: " ".join(words),
)
def test_values_as_people_type_them(words, same, scenegen, here):
    (here / "two.spec").write_text(TEXT)
    made = [scenegen("sample", "two.spec", "-n", "2", *given) for given in (words, same)]
    assert made[0].status == 0 and made[0].out == made[1].out


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("sample", "two.spec", "--phi", "5kg:"), "or with units: 5cm:20cm"),
        (("sample", "two.spec", "--timeout", "1m"), "write seconds, 60, or a unit: 90s, 2min"),
        (("range", "two.spec", "--timeout", "1h"), "write seconds, 60, or a unit: 90s, 2min"),
        (("sample", "two.spec", "--seed", "one"), "write 1000, 1_000 or 1e3"),
        (("sample", "two.spec", "--fix", "mug=0.5,0.5,NORTH"), "90deg for NORTH"),
        (("sample", "two.spec", "--fix", "mug=0.5,0.5,west"), "180deg for west"),
        (("sample", "two.spec", "n", "16"), "an option begins with a dash: -n;"),
        (("check", "two.spec", "full"), "an option begins with a dash: --full;"),
        (("range", "two.spec", "seed", "3"), "an option begins with a dash: --seed"),
        (("pairs", "two.spec", "n"), "an option begins with a dash: -n"),
    ],
    ids=lambda words: " ".join(words) if isinstance(words, tuple) else "",
)
def test_the_right_spelling_is_named(words, said, scenegen, here):
    (here / "two.spec").write_text(TEXT)
    outcome = scenegen(*words)
    assert outcome.status in (1, 2) and outcome.err.count("error[") == 1 and said in outcome.err, outcome.err


@pytest.mark.parametrize(
    ("fix", "code"),
    [
        ("plate=0.5,0.5,90", "more-than-a-turn"),
        ("plate=0.5deg,0.5", "not-a-number"),
        ("plate=0.5,0.5,3cm", "not-a-number"),
        ("plate=0.5,0.5,north", "not-a-number"),
    ],
)
def test_wrong_units_of_fixed_objects(fix, code, scenegen, here):
    (here / "two.spec").write_text(TEXT)
    outcome = scenegen("sample", "two.spec", "-n", "1", "--fix", fix)
    assert outcome.status == 1 and f"error[{code}]" in outcome.err and "--fix:1:" in outcome.err
