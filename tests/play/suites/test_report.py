"""Reports: what their tables say, and the program from a suite to its page."""

import numpy as np
import pytest

from scenegen.errors import DataError, RequestError
from scenegen.errors.requests import GIVEN_TWICE
from scenegen.play.suites.outcomes import EpisodeOutcome, OutcomesHeader, SuiteOutcomes, compare_outcomes, dump_outcomes
from scenegen.play.suites.report import report_suite
from scenegen.play.suites.suite import Suite


def written(suite, path, policy, success, **header):
    facts = {"suite": suite.name, "digest": suite.digest, "world": "w:make", "policy": policy, "episodes": len(suite)}
    episodes = [
        EpisodeOutcome(episode=start.number, task=start.task.name, band=start.band, success=one, steps=3)
        for start, one in zip(suite, success, strict=True)
    ]
    path.write_bytes(dump_outcomes(OutcomesHeader(**facts, **header), episodes))
    return path


@pytest.fixture
def files(small, tmp_path):
    suite, back = Suite.load(small), Suite.load(small, reverse=True)
    good, bad = [True, True, True, True, True, False], [True, False, True, False, False, False]
    return [
        written(suite, tmp_path / "good.jsonl", "x/good.py:act", good),
        written(suite, tmp_path / "bad.jsonl", "bad.py:act", bad),
        written(suite, tmp_path / "empty.jsonl", "bad.py:act", [False] * 6, instruction="empty"),
        written(back, tmp_path / "back.jsonl", "bad.py:act", good, reverse=True),
    ]


def test_tables(small, files, tmp_path, golden):
    path = report_suite(small, files, tmp_path / "report.md")
    golden("play/suites/report.md", path.read_text())


def test_what_both_were_run_on(small):
    header = OutcomesHeader(suite="s", digest="0" * 64, world="w", policy="p", episodes=9)
    rng = np.random.default_rng(0)
    one, other = rng.random((2, 9)) < 0.5

    def outcomes(success, numbers):
        made = (
            EpisodeOutcome(episode=number, task="t", band="b", success=bool(success[number]), steps=1)
            for number in numbers
        )
        return SuiteOutcomes(header, tuple(made))

    found = compare_outcomes(outcomes(one, range(8)), outcomes(other, range(2, 9)))
    assert (found.first, found.second, found.n) == ((one & ~other)[2:8].sum(), (other & ~one)[2:8].sum(), 6)


HOW = {"steps": 20, "timeout": 600.0, "versions": {"scenegen": "0.1.0"}}


@pytest.mark.parametrize(
    "changes, names",
    [
        ({"steps": 100}, ["x.py:act (steps 20)", "x.py:act (steps 100)"]),
        ({"versions": {"scenegen": "0.2.0"}}, ["x.py:act (scenegen 0.1.0)", "x.py:act (scenegen 0.2.0)"]),
        ({"world": "v:make"}, ["x.py:act (world w:make)", "x.py:act (world v:make)"]),
        ({"timeout": 9.0}, ["x.py:act (timeout 600.0)", "x.py:act (timeout 9.0)"]),
        ({"steps": None}, ["x.py:act (steps 20)", "x.py:act (steps not recorded)"]),
        ({"policy": "b/x.py:act"}, ["x.py:act (policy a/x.py:act)", "x.py:act (policy b/x.py:act)"]),
        ({}, ["x.py:act (one.jsonl)", "x.py:act (two.jsonl)"]),
        ({"policy": "http://host:8000/"}, ["x.py:act", "host:8000"]),
        ({"policy": "C:\\me\\p.py:act"}, ["x.py:act", "p.py:act"]),
    ],
)
def test_columns_are_told_apart(small, tmp_path, changes, names):
    """Where runs differ in more than their policies, it is said beside the test, too."""
    suite = Suite.load(small)
    one = written(suite, tmp_path / "one.jsonl", "a/x.py:act", [True] * 6, **HOW)
    how = {**HOW, **changes}
    world, policy = how.pop("world", "w:make"), how.pop("policy", "a/x.py:act")
    other = written(suite, tmp_path / "two.jsonl", policy, [False] * 6, **how)
    other.write_text(other.read_text().replace("w:make", world))
    text = report_suite(small, [one, other], tmp_path / "report.md").read_text()
    assert text.count(" | ".join(names)) == 2 and f"| {names[0]} - {names[1]} |" in text
    unlike = [*changes][:1] if {*changes} & {"steps", "timeout", "world", "versions"} else []
    assert ("| yes, but the runs differ: " in text) == bool(unlike) and ("| yes |" in text) != bool(unlike)


def test_three_of_one_policy(small, tmp_path):
    """Two alike in all but their folders, and one of another number of steps."""
    (tmp_path / "a").mkdir()
    suite = Suite.load(small)
    places = [(tmp_path / "a" / "o.jsonl", 20), (tmp_path / "o.jsonl", 20), (tmp_path / "p.jsonl", 100)]
    files = [written(suite, path, "x.py:act", [True] * 6, steps=steps) for path, steps in places]
    head = report_suite(small, files, tmp_path / "report.md").read_text()
    assert f"x.py:act (steps 20, {files[0]}) | x.py:act (steps 20, {files[1]}) | x.py:act (steps 100) |" in head
    with pytest.raises(RequestError) as caught:
        report_suite(small, [files[0], files[0]], tmp_path / "report.md")
    assert caught.value.diagnostics[0].kind is GIVEN_TWICE


def test_a_file_without_episodes(small, files, tmp_path):
    empty = tmp_path / "none.jsonl"
    empty.write_text(files[0].read_text().splitlines()[0].replace("good", "none") + "\n")
    text = report_suite(small, [empty, *files], tmp_path / "report.md").read_text()
    assert "| base distribution | - |" in text and "| every episode | - |" in text and "none.py:act - " not in text


def test_reversed_outcomes_are_held_against_the_reversed_tasks(small, files, tmp_path):
    files[3].write_text(files[3].read_text().replace('"band": "level1"', '"band": "level2"', 1))
    with pytest.raises(DataError, match="names another task or band"):
        report_suite(small, files, tmp_path / "report.md")
