"""Seconds of CPU time of an episode of the scripted policy, with robosuite's own physics and with ours.

python -m experiments.success.speed SUITE
"""

from __future__ import annotations

import sys
import time

from experiments.success import policies
from scenegen.play.suites.adapters import table
from scenegen.play.suites.outcomes import EpisodeOutcome
from scenegen.play.suites.run import Player
from scenegen.play.suites.suite import Suite

EPISODES, STEPS = 15, 100  # of each task; actions of an episode
SETTINGS = ((1, 0.002), (1, 0.004), (4, 0.004))  # steps for which torques stay, and seconds of a step


def main(folder: str) -> None:
    """Prints a line for each setting."""
    suite = Suite.load(folder)
    for table.TORQUE_STEPS, table.PHYSICS_STEP in SETTINGS:
        play = Player(
            suite.folder, suite.reverse, f"{table.__name__}:make", f"{policies.__file__}:steady", False, STEPS
        )
        spent, found = 0.0, list[EpisodeOutcome]()
        for task in suite.tasks:
            numbers = [start.number for start in suite if start.task is task][:EPISODES]
            play(numbers[0])  # makes the environment
            began = time.process_time()
            found += map(play, numbers)
            spent += time.process_time() - began
        won, steps = sum(one.success for one in found), sum(one.steps or 0 for one in found) / len(found)
        step = table.PHYSICS_STEP * 1e3
        print(f"torques each {table.TORQUE_STEPS * step:.0f} ms, steps of {step:.0f} ms: "
              f"{spent / len(found):.2f} s an episode of {steps:.0f} actions; {won} succeed")  # fmt: skip


if __name__ == "__main__":
    main(sys.argv[1])
