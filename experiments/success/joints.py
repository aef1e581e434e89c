"""How often wrist and elbow of the Panda are at their ends where a policy fails, and where it does not.

    python -m experiments.success.joints SUITE OUTCOMES.jsonl

Episodes that failed, and as many of each task that did not, are played again as they were. A joint counts that is
within 0.01 rad of its end after 10 actions or more.
"""

from __future__ import annotations

import sys
from collections import Counter
from pathlib import Path

import numpy as np

from experiments.success.again import STEPS, failed_and_others
from scenegen.play.suites.adapters.table import make
from scenegen.play.suites.loading import load_named
from scenegen.play.suites.outcomes import read_outcomes
from scenegen.play.suites.suite import Suite

JOINTS = {"elbow": 3, "wrist": 6}
NEAR, ACTIONS = 0.01, 10


def main(folder: str, path: str) -> None:
    """Print a line for each task and end."""
    suite = Suite.load(folder)
    outcomes = read_outcomes(Path(path), suite)
    numbers, ended = failed_and_others(suite, outcomes), {one.episode: one.success for one in outcomes.episodes}
    make_policy = load_named("policy", outcomes.header.policy)
    for task in suite.tasks:
        world, counts = make(task), {False: Counter[str](), True: Counter[str]()}
        policy = make_policy(world)
        model = world.sim.model
        ends = np.array([model.jnt_range[model.joint_name2id(one)] for one in world.env.robots[0].robot_joints])
        for start in (suite[number] for number in numbers if suite[number].task is task):
            observation, _ = world.reset(options={"start": start})
            policy.reset(start.seed)
            near, success = np.zeros(len(ends), dtype=int), False
            for _ in range(STEPS):
                observation, _, success, _, _ = world.step(policy(observation, task.instruction))
                near += np.abs(observation["joints"][:, None] - ends).min(axis=1) < NEAR
                if success:
                    break
            assert success == ended[start.number], start.number
            held = [name for name, joint in JOINTS.items() if near[joint] >= ACTIONS]
            counts[success].update(["episodes", *held, *(["either"] if held else [])])
        for success, count in counts.items():
            print(f"{task.name}, {'success' if success else 'failure'}: {dict(count)}", flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
