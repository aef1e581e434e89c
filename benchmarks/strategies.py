"""What a strategy costs, and whom it helps: microseconds an episode, episodes of two made-up learners.

    python benchmarks/strategies.py [--episodes 20000] [--seeds 10]

Cost: `next_task` and `report` together, CPU time, the fastest of three runs, less the same loop with a strategy that
does nothing; refits included. Half of the outcomes succeed, so that nothing ever settles.

Help: the learners of tests/play/strategies/learners.py. A chain of 20 levels, each of which can be learnt as far as
the one before it is: there a curriculum must help. 20 levels that have nothing to do with each other: there nothing
can beat even practice. `quick` moves a fifth of the way per episode, `slow` a twentieth. Means over the seeds, as
shares of uniform's episodes; `linear` and `ordered` are told how long to take: 30 and 120 episodes a level.
"""

from __future__ import annotations

import argparse
import sys
import time
from functools import partial
from pathlib import Path

import numpy as np

from scenegen.play.strategies import STRATEGIES, strategy
from scenegen.play.tasks import Outcome, PhiBox, Strategy

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))
LEVELS = 20
QUICK, SLOW = 0.2, 0.05
CLOCK = {"linear": "episodes", "ordered": "scenes"}


class Nothing:
    """What a loop costs without a strategy."""

    def __init__(self, space: PhiBox) -> None:
        self.space = space

    def next_task(self) -> PhiBox:
        return self.space

    def report(self, outcome: Outcome) -> None:
        pass


def loop(teacher: Strategy, draws: list[float]) -> float:
    """CPU seconds of as many episodes as there are draws."""
    started = time.process_time()
    for draw in draws:
        task = teacher.next_task()
        phi = tuple([low + (high - low) * draw for low, high in zip(task.low, task.high, strict=True)])
        teacher.report(Outcome(task, phi, draw * 1e3 % 1.0 < 0.5, draw, 10))
    return time.process_time() - started


def cost(name: str, labels: int, episodes: int) -> float:
    """Microseconds of next_task and report."""
    space = PhiBox((-1.0,) * labels, (0.0,) * labels)
    draws = np.random.default_rng(0).random(episodes).tolist()
    bare = min(loop(Nothing(space), draws) for _ in range(3))
    whole = min(loop(strategy(name, space, np.random.default_rng(1)), draws) for _ in range(3))
    return (whole - bare) / episodes * 1e6


def help_of(name: str, learner: str, labels: int, rate: float, seeds: int) -> float:
    """Mean episodes until the learner is done."""
    from tests.play.strategies import learners

    kind = partial(getattr(learners, learner), levels=LEVELS, rate=rate)
    settings = {CLOCK[name]: int(6 * LEVELS / rate)} if name in CLOCK else {}
    return float(np.mean([learners.episodes(name, kind, seed, labels, 60_000, **settings) for seed in range(seeds)]))


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--episodes", type=int, default=20_000)
    parser.add_argument("--seeds", type=int, default=10)
    wanted = parser.parse_args()
    learners = {
        "chain, quick": ("Chain", 1, QUICK),
        "chain, slow": ("Chain", 1, SLOW),
        "chain, two labels": ("Chain", 2, QUICK),
        "separate": ("Separate", 1, QUICK),
    }
    base = [help_of("uniform", *learner, wanted.seeds) for learner in learners.values()]
    print(f"| | us, one label | us, two | {' | '.join(learners)} |")
    print("|---|---|---|" + "---|" * len(learners))
    for name in STRATEGIES:
        costs = [f"{cost(name, labels, wanted.episodes):.1f}" for labels in (1, 2)]
        helps = [help_of(name, *learner, wanted.seeds) for learner in learners.values()]
        shares = [f"{took / even:.2f}" if name != "uniform" else f"{took:,.0f}"
                  for took, even in zip(helps, base, strict=True)]  # fmt: skip
        print(f"| {name} | {' | '.join(costs + shares)} |", flush=True)


if __name__ == "__main__":
    main()
