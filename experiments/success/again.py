"""Run starts that a policy failed once more, and as many of each task that it did not, with other errors.

    python -m experiments.success.again SUITE OUTCOMES.jsonl OUT.jsonl NUMBER

NUMBER tells one such run from another. What did not fail is drawn by lot.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

import numpy as np

from scenegen.play.suites.outcomes import read_outcomes
from scenegen.play.suites.run import run_suite
from scenegen.play.suites.suite import Suite

POLICY = "experiments/success/policies.py:again"


def main(folder: str, path: str, out: str, number: str) -> None:
    """Writes the outcomes."""
    suite, chosen, rng = Suite.load(folder), list[int](), np.random.default_rng(0)
    outcomes = read_outcomes(Path(path), suite)
    for task in suite.tasks:
        mine = [one for one in outcomes.episodes if one.task == task.name]
        failed, won = ([one.episode for one in mine if one.success == ended] for ended in (False, True))
        chosen += failed + rng.permutation(won)[: len(failed)].tolist()
    os.environ["AGAIN"] = number
    run_suite(suite, out, world="table", policy=POLICY, episodes=sorted(chosen), steps=outcomes.header.steps)


if __name__ == "__main__":
    main(*sys.argv[1:])
