"""Blind pairs: two policies by letters on one order, and what the report says of them."""

import json
from pathlib import Path

import pytest

from scenegen.errors import RequestError
from scenegen.errors.files import OTHER_REQUEST
from scenegen.play.stage.order import key_of, read_order, write_order
from scenegen.play.suites.outcomes import EpisodeOrder, EpisodeOutcome, OutcomesHeader, SuiteOutcomes, blind_pairs
from scenegen.play.suites.report import report_suite
from scenegen.play.suites.run import run_suite
from scenegen.play.suites.suite import Suite

from . import toy

TOY = Path(toy.__file__)


@pytest.fixture
def suite(small):
    return Suite.load(small)


@pytest.fixture
def order(suite, tmp_path):
    path = tmp_path / "order.csv"
    trials, letters = write_order(suite, [suite[number] for number in (4, 1, 0, 5)], True)
    path.write_bytes(trials)
    key_of(path).write_bytes(letters)
    return path


def outcomes(letter, trials, order="0" * 64):
    """Success by episode and trial."""
    facts = {"suite": "s", "digest": "1" * 64, "world": "w", "policy": "p", "episodes": 9}
    made = [
        EpisodeOutcome(episode=number, task="t", band="b", success=success, steps=1, trial=trial)
        for number, (trial, success) in trials.items()
    ]
    return SuiteOutcomes(OutcomesHeader(**facts, order=order, blind=letter), tuple(made))


def test_both_are_run_in_the_order_and_the_report_has_them(suite, order, tmp_path):
    """Each trial is the turn of one; no trial is left, and two on one start follow each other."""
    files = [tmp_path / f"{letter}.jsonl" for letter in "AB"]
    rows = [line.split(",") for line in order.read_text().splitlines()[1:]]
    for path, letter, policy in zip(files, "AB", ("towards", "away"), strict=True):
        given = {"world": f"{TOY}:make", "policy": f"{TOY}:{policy}", "steps": 30}
        told = []
        found = read_order(order, suite, range(6), letter)
        run_suite(suite, path, order=found, told=lambda one, done, count, told=told: told.append(one.trial), **given)
        assert told == sorted(found.trials.values()) and len(told) == 4
        header, *lines = map(json.loads, path.read_text().splitlines())
        assert header["blind"] == letter and header["order"] == found.digest
        assert {(str(one["trial"]), str(one["episode"])) for one in lines} <= {(row[0], row[1]) for row in rows}
    text = report_suite(suite.folder, files, tmp_path / "report.md").read_text()
    assert "Blind pairs" in text and "towards as A" in text and "| 4 | " in text
    order.write_text(order.read_text() + '9,2,"beside","level1"\n')
    with pytest.raises(RequestError) as caught:
        run_suite(
            suite,
            files[0],
            order=read_order(order, suite, range(6)),
            resume=True,
            **given | {"policy": f"{TOY}:towards"},
        )
    assert caught.value.diagnostics[0].kind is OTHER_REQUEST


def test_which_trial_came_first():
    """Whoever had it; pairs that are not back to back count for nothing."""
    one = outcomes("A", {0: (1, True), 1: (4, False), 2: (5, True), 3: (7, True), 4: (20, True)})
    other = outcomes("B", {0: (2, False), 1: (3, True), 2: (6, True), 3: (9, False), 4: (19, False), 5: (21, True)})
    for found in (blind_pairs(one, other), blind_pairs(other, one)):
        assert (found.first, found.second, found.n) == (2, 1, 4)
    assert blind_pairs(one, outcomes("A", {0: (2, True)})) is None
    assert blind_pairs(one, outcomes("B", {0: (2, True)}, order="2" * 64)) is None
    assert blind_pairs(outcomes("A", {}, order=None), outcomes("B", {}, order=None)) is None


def test_an_order_of_ones_own_is_no_lot(suite, tmp_path):
    with pytest.raises(RequestError, match="drawn by lot"):
        run_suite(
            suite, tmp_path / "o.jsonl", world="table", policy="a:b", order=EpisodeOrder({0: 1}, "0" * 64),
            against=tmp_path / "other.jsonl",
        )  # fmt: skip
