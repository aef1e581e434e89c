"""Does room for the hand, beside phi of the goal, tell success from failure? A table in Markdown.

    python -m experiments.success.grasp SUITE OUTCOMES.jsonl [AGAIN.jsonl]

An arm is added to each task where robosuite's Panda stands. At the start that is phi of `graspable` of the first object,
which is the one that is moved; at the goal the same in up to 64 places of it, of 4,096 uniform ones, where the goal
holds and nothing overlaps, with all else as at the start. Of those count the best, by the least of goal and grasp, and
the mean. `one hold` is the room at the same yaw in the frame of the object at both ends.

With the outcomes of the same policy with other noise: how alike the two of a start are, and the AUC that no score of
starts can exceed. For rates q and r of two starts the best AUC is 1/2 + E|q - r| / (4 p (1 - p)), with the share p of
successes, so it is at most 1/2 + sqrt(2 v) / (4 p (1 - p)), with the covariance v of the two outcomes of a start.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from scenegen.api.spec import Spec, parse
from scenegen.arrays import Array, Bool
from scenegen.lang.check.arms import YAWS
from scenegen.learn.success.measures import BOOTSTRAP_REPEATS, auc, auc_interval
from scenegen.play.suites.outcomes import SuiteOutcomes, read_outcomes
from scenegen.play.suites.suite import Suite, SuiteTask

BASE = 0.0, -0.56, math.pi / 2.0  # of robosuite's Panda in the frame of the world `table`; 11.2 cm above the table
ARM = """
region mount = rect(-0.3, -0.8, 0.3, -0.4) at 11.2 cm
robot arm = panda on mount at (0, -0.56, NORTH)
"""
PLACES, GOALS = 4096, 64  # of the object that is moved: tried for each start, and looked at where the goal holds


def main(folder: str, path: str, again: str = "") -> None:
    """Print a table of AUCs, and with `again` one of what the noise leaves."""
    suite = Suite.load(folder)
    outcomes = read_outcomes(Path(path), suite)
    repeats = read_outcomes(Path(again), suite) if again else None
    print("| task | episodes | success | score of a start | AUC |\n|---|---|---|---|---|")
    for task in suite.tasks:
        rows, success = ended(suite, task, outcomes)
        for name, score in zip(NAMES, scores(task, rows).T, strict=True):
            cells = task.name, len(success), f"{success.mean():.0%}", name, interval(success, score)
            print(f"| {' | '.join(map(str, cells))} |", flush=True)
    if repeats:
        print("\n| task | starts | failed again | failed after a success | highest possible AUC |\n|---|---|---|---|---|")
        for task in suite.tasks:
            print(f"| {' | '.join([task.name, *noise(outcomes, repeats, task)])} |")


NAMES = (
    "phi of the goal",
    "grasp at the start",
    "goal and grasp at the goal, best",
    "grasp at the goal, mean",
    "grasp at both ends, best",
    "grasp at both ends, mean",
    "one hold at both ends, best",
    "one hold at both ends, mean",
    "phi of the goal, and grasp at both ends, best",
    "phi of the goal, and grasp at both ends, mean",
)


def scores(task: SuiteTask, rows: list[int]) -> Array:
    """(n, scores) in metres of some starts of a task."""
    rng = np.random.default_rng(0)
    source, moved = task.spec.checked.source.rpartition("require !")[0], task.spec.objects[0]
    rooms = (f"room{k}: handRoom({moved}, arm, {k * 180 // YAWS} deg, GRASP_DEPTH) >= 0\n" for k in range(YAWS))
    goal = parse(f"{source}free: noOverlap()\n")
    hand = parse(f"{source}{ARM}grasp: graspable({moved}, arm)\n{''.join(rooms)}")
    (left, right), (near, far) = task.spec.checked.workspace.x, task.spec.checked.workspace.y
    found = []
    for start in task.scenes.poses[rows]:
        ends = np.repeat(start[None], PLACES, axis=0)
        ends[:, 0] = rng.uniform((left, near, 0.0), (right, far, math.tau), (PLACES, 3))
        there = goal.scenes(ends).phi
        margin = np.minimum(there[task.success], there["free"])
        which = np.flatnonzero(margin >= 0.0)[:GOALS] if margin.max() >= 0.0 else np.argmax(margin, keepdims=True)
        before, after = (grasps(hand, one) for one in (start[None], ends[which]))
        phi, here = goal.scenes(start[None]).phi[task.success][0], before[0, 0]
        best = np.minimum(margin[which], after[0]).max()
        mean = after[0].mean()
        hold = np.minimum(before[1:], after[1:]).max(axis=0)
        found.append([
            phi, here, best, mean, min(here, best), min(here, mean), hold.max(), hold.mean(),
            min(phi, here, best), min(phi, here, mean),
        ])  # fmt: skip
    return np.array(found)


def grasps(hand: Spec, poses: Array) -> Array:
    """(1 + YAWS, n): phi of `graspable`, and the room of the hand at each yaw, of scenes (n, N, 3) without the arm."""
    arm = np.broadcast_to(BASE, (len(poses), 1, 3))
    phi = hand.scenes(np.concatenate([poses, arm], axis=1)).phi
    return np.stack([phi["grasp"], *(phi[f"room{k}"] for k in range(YAWS))])


def ended(suite: Suite, task: SuiteTask, outcomes: SuiteOutcomes) -> tuple[list[int], Bool]:
    """The rows of a task's starts that were run, and which succeeded."""
    mine = [one for one in outcomes.episodes if one.task == task.name]
    return [suite[one.episode].row for one in mine], np.array([one.success for one in mine])


def interval(success: Bool, score: Array) -> str:
    return "{:.2f} ({:.2f} to {:.2f})".format(*auc_interval(success, score, np.arange(len(score))))


def noise(first: SuiteOutcomes, second: SuiteOutcomes, task: SuiteTask) -> Iterator[str]:
    """Cells: starts with two outcomes, failures again after a failure and after a success, the highest AUC."""
    return iter(())


if __name__ == "__main__":
    main(*sys.argv[1:])
