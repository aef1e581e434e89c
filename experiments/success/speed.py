"""Seconds of CPU time of an episode of the scripted policy, with robosuite's own physics and with ours.

python -m experiments.success.speed SUITE
"""

from __future__ import annotations

import sys
import time

from experiments.success.run import Worlds, makers, play
from scenegen.worlds.suites.adapters import table
from scenegen.worlds.suites.suite import Suite

EPISODES = 45
SETTINGS = ((1, 0.002), (1, 0.004), (4, 0.004))  # steps for which torques stay, and seconds of a step


def main(folder: str) -> None:
    """Prints a line for each setting."""
    suite = Suite.load(folder)
    for table.HOLD, table.STEP in SETTINGS:
        worlds = Worlds()
        policies = {task.name: makers()["steady"](worlds[task]) for task in suite.tasks}
        began = time.process_time()
        found = [play(worlds[suite[k].task], policies[suite[k].task.name], suite[k]) for k in range(EPISODES)]
        spent = (time.process_time() - began) / EPISODES
        won, steps = sum(one.success for one in found), sum(one.steps for one in found) / EPISODES
        print(f"torques each {table.HOLD * table.STEP * 1e3:.0f} ms, steps of {table.STEP * 1e3:.0f} ms: "
              f"{spent:.2f} s an episode of {steps:.0f} actions; {won} of {EPISODES} succeed")  # fmt: skip


if __name__ == "__main__":
    main(sys.argv[1])
