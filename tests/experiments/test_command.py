"""`scenegen experiment`: what it refuses, and that it refuses before any work."""

import sys

from experiments import semantics


def test_a_misspelt_name(refused):
    assert "did you mean `exp1`?" in refused("experiment", "ex1", "--out", "reports")


def test_numbers_out_of_range(refused):
    assert "0 seeds" in refused("experiment", "exp1", "--out", "reports", "--seeds", "0")
    assert "0 workers" in refused("experiment", "exp1", "--out", "reports", "--workers", "0")


def test_a_folder_that_cannot_be_made(refused):
    assert "nowhere" in refused("experiment", "exp1", "--out", "nowhere/reports")


def test_a_missing_library_is_named_before_any_work(refused, monkeypatch):
    monkeypatch.setitem(sys.modules, "sklearn", None)
    said = refused("experiment", "exp1", "--out", "reports", "--quick")
    assert "scikit-learn" in said and 'pip install "scenegen[experiments]"' in said


def test_where_to_is_not_optional(scenegen, here):
    outcome = scenegen("experiment", "exp1")
    assert outcome.status == 2 and "--out" in outcome.err


def test_an_interrupt_says_how_to_go_on(scenegen, here, monkeypatch):
    def interrupted(plan):
        raise KeyboardInterrupt("stopped after 3 of 50 epochs; go on with --resume")

    monkeypatch.setattr(semantics, "run", interrupted)
    outcome = scenegen("experiment", "semantics", "--out", "reports")
    assert outcome.status == 130 and "the same command goes on" in outcome.err and "--resume" not in outcome.err
