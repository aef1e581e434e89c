"""Does room for the hand, beside phi of the goal, tell success from failure? A table in Markdown.

    python -m experiments.success.grasp SUITE OUTCOMES.jsonl [AGAIN.jsonl]

An arm is added to each task where robosuite's Panda stands. `grasp` is phi of `graspable` of the first object, which is
the one that is moved: at the start, and at the goal in up to 64 places of it, of 4,096 uniform ones, where the goal
holds and nothing overlaps, with all else as at the start. Of these count the best, by the least of goal and grasp, or
the mean. `one hold` is the room at the same yaw in the frame of the object at both ends. `fit` predicts starts that it
has not seen from phi of the goal at the start, the grasp there, and the best of the goal, as `scenegen fit --monotone`.

With outcomes of the same policy with other noise: how alike the two of a start are, and an AUC that no score of starts
can exceed. For rates q and r of two starts the best AUC is 1/2 + E|q - r| / (4 p (1 - p)), with the share p of
successes, so it is at most 1/2 + sqrt(2 v) / (4 p (1 - p)), with the covariance v of the two outcomes of a start.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from scenegen.api.spec import Spec, parse
from scenegen.arrays import Array, Bool
from scenegen.lang.check.arms import YAWS
from scenegen.learn.success.features import Feature
from scenegen.learn.success.logistic import Outcomes, predict_held_out
from scenegen.learn.success.measures import BOOTSTRAP_REPEATS, auc_interval
from scenegen.learn.success.statistics import wilson
from scenegen.play.suites.outcomes import read_outcomes
from scenegen.play.suites.suite import Suite, SuiteTask

BASE = 0.0, -0.56, math.pi / 2.0  # of robosuite's Panda in the frame of the world `table`; 11.2 cm above the table
ARM = """
region mount = rect(-0.3, -0.8, 0.3, -0.4) at 11.2 cm
robot arm = panda on mount at (0, -0.56, NORTH)
"""
PLACES, GOALS = 4096, 64  # of the object that is moved: tried for each start, and looked at where the goal holds
READ = Feature("goal", "phi"), Feature("grasp", "margin"), Feature("goal and grasp", "margin")  # by the fit


def main(folder: str, path: str, again: str = "") -> None:
    """Print a table of AUCs, and with `again` one of what the noise leaves."""
    suite, columns = Suite.load(folder), []
    first = read_outcomes(Path(path), suite).success
    second = read_outcomes(Path(again), suite).success if again else {}
    for task in suite.tasks:
        run = [number for number in sorted(first) if suite[number].task is task]
        success = np.array([first[number] for number in run])
        found = scores(task, [suite[number].row for number in run])
        data = Outcomes(READ, np.stack(list(found.values())[:3]), success, np.arange(len(run)))
        found["fit of the first three"] = predict_held_out(data, True)
        columns.append({"starts": f"{len(run)}", "success": f"{success.mean():.0%}"})
        columns[-1] |= {f"AUC of {name}": in_words(auc_interval(success, p, data.start)) for name, p in found.items()}
        if second:
            pairs = np.array([(first[number], second[number]) for number in run if number in second])
            columns[-1] |= noise(success, pairs)
    print(f"| | {' | '.join(task.name for task in suite.tasks)} |\n|---|{'---|' * len(columns)}")
    for name in columns[0]:
        print(f"| {name} | {' | '.join(one[name] for one in columns)} |")


def scores(task: SuiteTask, rows: Sequence[int]) -> dict[str, Array]:
    """(n,) of some starts of a task, by name, in metres."""
    source, moved, rng = task.spec.checked.source, task.spec.objects[0], np.random.default_rng(0)
    source = source.rpartition("require !")[0]  # what a suite adds: the goal does not hold
    rooms = "".join(f"room{k}: handRoom({moved}, arm, {k * 180 // YAWS} deg, GRASP_DEPTH) >= 0\n" for k in range(YAWS))
    goal = parse(f"{source}free: noOverlap()\nclear: forall p, q in objects: gap(p, q) >= 0 m\n")
    hand = parse(f"{source}{ARM}grasp: graspable({moved}, arm)\n{rooms}")
    (left, right), (near, far) = task.spec.checked.workspace.x, task.spec.checked.workspace.y
    starts, ends = task.scenes.poses[rows], []
    for start in starts:
        places = np.repeat(start[None], PLACES, axis=0)
        places[:, 0] = rng.uniform((left, near, 0.0), (right, far, math.tau), (PLACES, 3))
        there = goal.scenes(places).phi
        margin = np.minimum(there[task.success], there["free"])
        which = np.flatnonzero(margin >= 0.0)[:GOALS] if margin.max() >= 0.0 else np.argmax(margin, keepdims=True)
        grasp, *room = grasps(hand, places[which])
        ends.append((np.minimum(margin[which], grasp).max(), grasp.mean(), np.array(room)))
    before, (here, *rooms_here) = goal.scenes(starts).phi, grasps(hand, starts)
    best, mean = np.array([one[:2] for one in ends]).T
    holds = [
        np.minimum(one[2], room).max(axis=0) for one, room in zip(ends, np.array(rooms_here).T[:, :, None], strict=True)
    ]
    return {
        "phi of the goal at the start": before[task.success],
        "grasp at the start": here,
        "goal and grasp at the goal, best": best,
        "least of all three": np.minimum(before[task.success], np.minimum(here, best)),
        "grasp at both ends, best": np.minimum(here, best),
        "grasp at the goal, mean": mean,
        "grasp at both ends, mean": np.minimum(here, mean),
        "one hold at both ends, best": np.array([one.max() for one in holds]),
        "one hold at both ends, mean": np.array([one.mean() for one in holds]),
        "the smallest gap at the start": before["clear"],
    }


def grasps(hand: Spec, poses: Array) -> Array:
    """(1 + YAWS, n): phi of `graspable`, and the room of the hand at each yaw, of scenes (n, N, 3) without the arm."""
    arm = np.broadcast_to(BASE, (len(poses), 1, 3))
    phi = hand.scenes(np.concatenate([poses, arm], axis=1)).phi
    return np.stack([phi["grasp"], *(phi[f"room{k}"] for k in range(YAWS))])


def noise(success: Bool, pairs: Bool) -> dict[str, str]:
    """What the outcomes (n,) of starts and both outcomes (m, 2) of some of them say of the policy's own noise."""
    words, rng = {}, np.random.default_rng(0)
    for name, before in (("failed again", False), ("failed after a success", True)):
        again = ~pairs[pairs[:, 0] == before, 1]
        words[name] = (
            f"{again.sum()} of {len(again)} ({'{:.0%} to {:.0%}'.format(*wilson(float(again.mean()), len(again)))})"
        )
    draws = [[rng.integers(len(one), size=len(one)) for one in (success, pairs)] for _ in range(BOOTSTRAP_REPEATS)]
    low, high = np.nanquantile([highest_auc(success[one], pairs[other]) for one, other in draws], (0.025, 0.975))
    return words | {"no AUC above": in_words((highest_auc(success, pairs), low, high))}


def highest_auc(success: Bool, pairs: Bool) -> float:
    """The bound by the outcomes (n,) of starts and both outcomes (m, 2) of some, which the first may have chosen."""
    p = float(success.mean())
    lost, won = (float(pairs[pairs[:, 0] == before, 1].mean()) for before in (False, True))
    correlation = max(0.0, won - lost)  # of the two outcomes of a start
    return min(1.0, 0.5 + math.sqrt(2.0 * correlation / (p * (1.0 - p))) / 4.0)


def in_words(interval: tuple[float, float, float]) -> str:
    return "{:.2f} ({:.2f} to {:.2f})".format(*interval)


if __name__ == "__main__":
    main(*sys.argv[1:])
