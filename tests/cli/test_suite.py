"""`scenegen suite`: from a suite to outcomes and their page, and what is refused."""

import io

import pytest


@pytest.fixture
def small(root):
    return root / "tests" / "golden" / "play" / "suites" / "small"


@pytest.mark.long
def test_the_program(small, scenegen, tmp_path):
    said = scenegen("suite", "check", str(small))
    assert said.status == 0 and said.err.count("are as they were made") == 2
    out = tmp_path / "mine.jsonl"
    toy = small.parents[3] / "play" / "suites" / "toy.py"
    run = ["suite", "run", str(small), "--world", f"{toy}:make", "--policy", f"{toy}:towards", "--out", str(out)]
    said = scenegen(*run, "--episodes", "0:2", "--steps", "30")
    assert said.status == 0 and "2 of 2 episodes succeed" in said.err
    assert scenegen(*run, "--steps", "30").err.startswith("error[unfinished-run]")
    said = scenegen(*run, "--steps", "30", "--resume")
    assert said.status == 0 and "4 of 4 episodes succeed" in said.err
    acting = out.read_text().replace('"success": true', '"success": false', 1)
    (tmp_path / "worse.jsonl").write_text(acting)
    page = tmp_path / "report.html"
    said = scenegen(
        "suite", "report", str(small), str(out), str(tmp_path / "worse.jsonl"), "--out", str(page), "--pictures", "1"
    )
    text = page.read_text()
    assert said.status == 0 and text.count("<img") == 1 and "http" not in text and "Put a beside b." in text


def test_episodes_that_end_by_an_error_are_told(small, scenegen, tmp_path):
    toy = small.parents[3] / "play" / "suites" / "toy.py"
    run = ["suite", "run", str(small), "--world", f"{toy}:make", "--policy", f"{toy}:dying", "--episodes", "0:2"]
    said = scenegen(*run, "--steps", "30", "--out", str(tmp_path / "dying.jsonl"))
    assert said.status == 0 and "1 of 2 episodes succeed" in said.err
    assert "1 of them ended by an error and count as failures, most often: ValueError: no plan" in " ".join(
        said.err.split()
    )


@pytest.mark.parametrize(
    "words, kind",
    [
        (["mend", "small"], "unknown-choice"),
        (["check", "small", "--steps", "3"], "out-of-place"),
        (["run", "small", "--out", "o.jsonl"], "missing-argument"),
        (["report", "small", "--out", "o.html"], "missing-argument"),
        (
            ["run", "small", "--out", "o.jsonl", "--world", "w:m", "--policy", "p:a", "--episodes", "7"],
            "argument-syntax",
        ),
        (
            ["run", "small", "--out", "o.jsonl", "--world", "w:m", "--policy", "p:a", "--episodes", "7:9"],
            "out-of-range",
        ),
        (["run", "small", "--out", "o.jsonl", "--world", "w", "--policy", "p:a"], "wrong-value"),
        (
            ["run", "small", "--out", "o.jsonl", "--world", "w:m", "--policy", "p:a", "--instruction", "loud"],
            "unknown-choice",
        ),
        (
            ["run", "small", "--out", "o.jsonl", "--world", "w:m", "--policy", "p:a", "--until", "better"],
            "unknown-choice",
        ),
        (
            ["run", "small", "--out", "o.jsonl", "--world", "w:m", "--policy", "p:a", "--until", "decided"],
            "missing-argument",
        ),
        (
            ["run", "small", "--out", "o.jsonl", "--world", "w:m", "--policy", "p:a", "--against", "b.jsonl"],
            "missing-argument",
        ),
        (
            ["run", "small", "--out", "o.jsonl", "--world", "w:m", "--policy", "p:a", "--blind", "A"],
            "missing-argument",
        ),
        (
            [
                *("run", "small", "--out", "o.jsonl", "--world", "w:m", "--policy", "p:a"),
                *("--order", "o.csv", "--blind", "C"),
            ],
            "unknown-choice",
        ),
        (
            [
                *("run", "small", "--out", "o.jsonl", "--world", "w:m", "--policy", "p:a"),
                *("--order", "o.csv", "--blind", "A"),
            ],
            "cannot-read",
        ),
        (["report", "small", "o.jsonl", "--out", "o.pdf"], "wrong-ending"),
        (["metaworld", "small"], "missing-argument"),
        (["metaworld", "small", "small", "--out", "t.pkl"], "out-of-place"),
        (["envhub", "small", "--out", "hub"], "missing-argument"),
        (["envhub", "small", "small", "--out", "hub", "--world", "table"], "out-of-place"),
        (["envhub", "small", "--out", "hub", "--world", "w.py:m"], "wrong-value"),
        (["envhub", "small", "--out", "hub", "--world", "no.such:m"], "world-fails"),
        (["envhub", "small", "--out", "hub", "--world", "no.such:m", "--steps", "0"], "out-of-range"),
        (["envhub", "small", "--out", ".", "--world", "no.such:m"], "cannot-write"),
        (["new", "table_setting", "--out", "x", "--bands", "0"], "out-of-range"),
        (["new", "table_setting", "--out", "x", "--bands", "near"], "argument-syntax"),
        (["new", "table_setting", "--out", "x", "--success", "nothing"], "unknown-label"),
    ],
)
def test_what_the_program_refuses(small, words, kind, scenegen, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "small").symlink_to(small)
    said = scenegen("suite", *words)
    assert said.status == 1 and said.err.startswith(f"error[{kind}]"), said.err


def test_a_folder_for_lerobot(small, scenegen, tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(small.parents[3] / "play" / "suites")
    said = scenegen("suite", "envhub", str(small), "--world", "toy:make", "--out", str(tmp_path / "hub"))
    assert said.status == 0 and "4 files" in said.err
    assert sorted(one.name for one in (tmp_path / "hub").iterdir())[-2:] == ["env.py", "suite.json"]


SPEC = """object a = cylinder(2 cm, 4 cm), b = cylinder(2 cm, 4 cm) at (0, 0)
workspace [-15 cm, 15 cm] x [-15 cm, 15 cm]
goal: closeTo(a, b, 6 cm)
"""


@pytest.mark.long
def test_an_error_is_said_once(scenegen, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("scenegen.sampling.rarity.RARITY_VISITS", 400_000)  # rough, which is enough here
    monkeypatch.setattr("scenegen.api.rarity.needs_growth", lambda *_: False)
    (tmp_path / "a.spec").write_text(SPEC)
    said = scenegen("suite", "new", "a.spec", "--bands", "far=-90cm:-80cm", "-n", "1", "--out", "s/", "--workers", "1")
    assert said.status == 1 and said.err.count("error[out-of-range]") == 1 and "a failed:" in said.err


@pytest.mark.long
def test_a_spec_on_standard_input(scenegen, tmp_path, monkeypatch):
    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(f"# Go.\n{SPEC}".encode())))
    words = ["--bands", "very near=-5cm:0", "-n", "1", "--out", str(tmp_path / "my suite"), "--workers", "1"]
    assert scenegen("suite", "new", "-", *words).status == 0
    said = scenegen("suite", "check", str(tmp_path / "my suite"))
    assert said.status == 0 and (tmp_path / "my suite" / "stdin.json").exists()
