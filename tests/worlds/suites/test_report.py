"""Reports: what their tables say, and the program from a suite to its page."""

import numpy as np
import pytest

from scenegen.worlds.suites.outcomes import EpisodeOutcome, OutcomesHeader, SuiteOutcomes, dump_outcomes
from scenegen.worlds.suites.report import compared, report_suite
from scenegen.worlds.suites.suite import Suite


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
    golden("worlds/suites/report.md", path.read_text())


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

    found = compared(outcomes(one, range(8)), outcomes(other, range(2, 9)))
    assert (found.first, found.second, found.n) == ((one & ~other)[2:8].sum(), (other & ~one)[2:8].sum(), 6)
