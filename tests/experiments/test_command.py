"""`python -m experiments`: what it refuses, and that it refuses before any work."""

import sys

import pytest

from experiments import semantics
from experiments.__main__ import main, parser
from experiments.table import EXPERIMENTS


@pytest.fixture
def refused(capsys, tmp_path, monkeypatch):
    """Runs a command that must fail: status 1, one diagnostic with help, nothing written."""
    monkeypatch.chdir(tmp_path)

    def call(*words):
        assert main(words) == 1
        said = capsys.readouterr()
        assert said.out == "" and said.err.startswith("error[") and said.err.count("= help:") == 1
        assert not list(tmp_path.iterdir())
        return said.err

    return call


def test_a_misspelt_name(refused):
    assert "did you mean `exp1`?" in refused("ex1", "--out", "reports")


def test_numbers_out_of_range(refused):
    assert "`seeds` is 0" in refused("exp1", "--out", "reports", "--seeds", "0")
    assert "`workers` is 0" in refused("exp1", "--out", "reports", "--workers", "0")


def test_a_folder_that_cannot_be_made(refused):
    assert "nowhere" in refused("exp1", "--out", "nowhere/reports")


def test_a_missing_library_is_named_before_any_work(refused, monkeypatch):
    monkeypatch.setitem(sys.modules, "sklearn", None)
    said = refused("exp1", "--out", "reports", "--quick")
    assert "scikit-learn" in said and 'pip install "scenegen[experiments]"' in said


def test_a_quick_run_does_not_replace_real_numbers(tmp_path, capsys):
    report = tmp_path / "semantics.json"
    report.write_text('{"quick": false}')
    assert main(["semantics", "--out", str(tmp_path), "--quick"]) == 1
    assert "another folder" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["semantics.json"]


@pytest.mark.parametrize("words", [["exp1"], ["--out", "reports"], ["exp1", "--out", "reports", "--fast"]])
def test_wrong_usage(words, capsys):
    with pytest.raises(SystemExit) as caught:
        main(words)
    assert caught.value.code == 2 and "usage: python -m experiments" in capsys.readouterr().err


def test_an_interrupt_says_how_to_go_on(tmp_path, monkeypatch, capsys):
    def interrupted(plan):
        raise KeyboardInterrupt("stopped after 3 of 50 epochs; go on with --resume")

    monkeypatch.setattr(semantics, "run", interrupted)
    assert main(["semantics", "--out", str(tmp_path / "reports")]) == 130
    said = capsys.readouterr().err
    assert "the same command goes on" in said and "--resume" not in said


def test_the_help_lists_each_with_its_time():
    lines = [" ".join(line.split()) for line in parser().format_help().splitlines()]
    for name, entry in EXPERIMENTS.items():
        assert f"{name} {entry.time} {entry.about}" in lines
