"""Run starts that a policy failed once more, and as many of each task that it did not, with other errors.

    python -m experiments.success.again SUITE OUTCOMES.jsonl OUT.jsonl NUMBER

NUMBER tells one such run from another. What did not fail is drawn by lot.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

import numpy as np

from scenegen.play.suites.outcomes import SuiteOutcomes, read_outcomes
from scenegen.play.suites.run import run_suite
from scenegen.play.suites.suite import Suite

POLICY, STEPS = "experiments/success/policies.py:again", 100


def main(folder: str, path: str, out: str, number: str) -> None:
    """Writes the outcomes."""
    suite = Suite.load(folder)
    outcomes = read_outcomes(Path(path), suite)
    os.environ["AGAIN"] = number
    run_suite(
        suite,
        out,
        world="table",
        policy=POLICY,
        episodes=failed_and_others(suite, outcomes),
        steps=STEPS,
    )


def failed_and_others(suite: Suite, outcomes: SuiteOutcomes) -> list[int]:
    """Episodes that failed, and as many of each task that did not, drawn by lot."""
    chosen, rng = list[int](), np.random.default_rng(0)
    for task in suite.tasks:
        mine = [one for one in outcomes.episodes if one.task == task.name]
        failed, won = ([one.episode for one in mine if one.success == ended] for ended in (False, True))
        chosen += failed + rng.permutation(won)[: len(failed)].tolist()
    return sorted(chosen)


if __name__ == "__main__":
    main(*sys.argv[1:])
