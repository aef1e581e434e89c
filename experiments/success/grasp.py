"""Does room for the hand, beside phi of the goal, tell success from failure? A table in Markdown.

    python -m experiments.success.grasp SUITE OUTCOMES.jsonl [FIRST]

An arm is added to each task where robosuite's Panda stands. `grasp` is phi of `graspable` of the first object, which is
the one that is moved: at the start, and at the goal in up to 64 places of it, of 4,096 uniform ones, where the goal
holds and nothing overlaps, with all else as at the start. Of these count the best, by the least of goal and grasp, or
the mean. `one hold` is the room at the same yaw in the frame of the object at both ends. `fit` predicts starts that it
has not seen, as `scenegen fit --monotone`: from phi of the goal at the start, the grasp there, and the best of the
goal; and from these and one hold, the mean. With FIRST also a fit of all four to so many starts of each task, at those
after them.
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
from scenegen.learn.success.logistic import Outcomes, fit_logistic, predict_held_out
from scenegen.learn.success.measures import auc_interval
from scenegen.play.suites.outcomes import read_outcomes
from scenegen.play.suites.suite import Suite, SuiteTask

BASE = 0.0, -0.56, math.pi / 2.0  # of robosuite's Panda in the frame of the world `table`; 11.2 cm above the table
ARM = """
region mount = rect(-0.3, -0.8, 0.3, -0.4) at 11.2 cm
robot arm = panda on mount at (0, -0.56, NORTH)
"""
PLACES, GOALS = 4096, 64  # of the object that is moved: tried for each start, and looked at where the goal holds
THREE = (
    Feature("phi of the goal at the start", "phi"),
    Feature("grasp at the start", "margin"),
    Feature("goal and grasp at the goal, best", "margin"),
)
FOUR = (*THREE, Feature("one hold at both ends, mean", "margin"))


def main(folder: str, path: str, first: str = "0") -> None:
    """Print a column for each task."""
    suite, columns = Suite.load(folder), []
    outcomes = read_outcomes(Path(path), suite)
    for task in suite.tasks:
        mine = [one for one in outcomes.episodes if one.task == task.name]
        success = np.array([one.success for one in mine])
        found = scores(task, [suite[one.episode].row for one in mine])
        fits = {"fit of the first three": THREE, "fit of these and one hold, mean": FOUR}
        found |= {name: held_out(found, success, read) for name, read in fits.items()}
        column = {"starts": f"{len(mine)}", "success": f"{success.mean():.0%}"}
        for name, score in found.items():
            column[name] = interval(success, score)
        if count := int(first):
            data = outcomes_of(found, success, FOUR)
            seen, late = data.start < count, data.start >= count
            predicted = data.select(late).predict(fit_logistic(data.select(seen), True))
            column[f"fit of the first {count}, at the others"] = interval(success[late], predicted)
        columns.append(column)
    print(f"| | {' | '.join(task.name for task in suite.tasks)} |\n|---|{'---|' * len(columns)}")
    for name in columns[0]:
        print(f"| {name} | {' | '.join(one[name] for one in columns)} |")


def held_out(found: dict[str, Array], success: Bool, read: Sequence[Feature] = FOUR) -> Array:
    """(n,): the success that a fit of the other starts predicts, by their scores."""
    return predict_held_out(outcomes_of(found, success, read), True)


def outcomes_of(found: dict[str, Array], success: Bool, read: Sequence[Feature]) -> Outcomes:
    return Outcomes(tuple(read), np.stack([found[one.name] for one in read]), success, np.arange(len(success)))


def interval(success: Bool, score: Array) -> str:
    return "{:.2f} ({:.2f} to {:.2f})".format(*auc_interval(success, score, np.arange(len(success))))


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


if __name__ == "__main__":
    main(*sys.argv[1:])
