"""Every strategy teaches the same small learner to push a mug onto a plate: a table of values, 31 x 31 places.

The loop is all that a strategy needs: ask for a task, begin an episode with a scene of that phi, report how it went.
"""

import numpy as np
import torch

import scenegen
from scenegen.play.strategies import STRATEGIES, strategy
from scenegen.play.tasks import Outcome, PhiBox

M = 15  # places of the mug on each side of the plate
SIDE, CELLS = 2 * M + 1, (2 * M + 1) ** 2
MOVES = [(-1, 0), (1, 0), (0, -1), (0, 1)]
PACE = {"linear": {"episodes": 1000}, "ordered": {"scenes": 1000}}  # these go by the clock, not by success

# phi of every place of the mug, from the spec
spec = scenegen.parse("object mug\nobject plate = cylinder(0.12, 0.02) at (0.5, 0.5)\ntask: closeTo(mug, plate, 2 cm)")
places = torch.linspace(0.0, 1.0, SIDE)
poses = torch.zeros(CELLS, 2, 3)
poses[:, spec.objects.index("mug"), :2] = torch.cartesian_prod(places, places)
poses[:, spec.objects.index("plate"), :2] = 0.5
phi = spec.robustness()(poses)[:, 0].double().numpy()
there = np.array([[(x + dx) * SIDE + y + dy if 0 <= x + dx < SIDE and 0 <= y + dy < SIDE else CELLS
                   for dx, dy in MOVES] for x in range(SIDE) for y in range(SIDE)])  # fmt: skip
solved = phi >= 0
starts = np.flatnonzero(~solved)
starts = starts[np.argsort(phi[starts], kind="stable")]
reach = PhiBox((float(phi.min()),), (float(phi[starts].max()),))


def start(task: PhiBox, rng: np.random.Generator) -> int:
    """A place with a phi in the box, or the nearest to it."""
    low, high = np.searchsorted(phi[starts], task.low[0]), np.searchsorted(phi[starts], task.high[0], side="right")
    return int(starts[rng.integers(low, high) if low < high else min(low, len(starts) - 1)])


def episode(values: list[list[float]], place: int, rng: np.random.Generator) -> tuple[bool, float, int]:
    """Q-learning until the mug is on the plate, off the table, or 4 M steps are over."""
    draws, others = rng.random(4 * M).tolist(), rng.integers(4, size=4 * M).tolist()
    for step in range(4 * M):
        best = max(values[place])
        action = others[step]
        if draws[step] > 0.1:  # greedy, ties at random
            while values[place][action] < best:
                action = (action + 1) % 4
        after = next_place[place][action]
        reward = -10.0 if after == CELLS else 10.0 if on_plate[after] else 0.0
        goal = reward if reward else 0.95 * max(values[after])
        values[place][action] += 0.5 * (goal - values[place][action])
        if reward:
            return reward > 0, reward, step + 1
        place = after
    return False, 0.0, 4 * M


def share_solved(values: list[list[float]]) -> float:
    """From how many places the greedy policy brings the mug onto the plate."""
    follow = np.append(there[np.arange(CELLS), np.argmax(values, axis=1)], CELLS)
    follow[np.flatnonzero(solved)] = np.flatnonzero(solved)
    for _ in range(12):  # 2 ** 12 moves
        follow = follow[follow]
    return float(np.append(solved, False)[follow[starts]].mean())


next_place, on_plate = there.tolist(), solved.tolist()
for name in STRATEGIES:
    rng = np.random.default_rng(0)
    teacher = strategy(name, reach, np.random.default_rng(1), **PACE.get(name, {}))
    values, count, steps, fallen = [[0.0] * 4 for _ in range(CELLS)], 0, 0, 0
    while count < 20_000 and share_solved(values) < 0.95:
        for _ in range(100):
            task = teacher.next_task()
            place = start(task, rng)
            success, total, taken = episode(values, place, rng)
            teacher.report(Outcome(task, (float(phi[place]),), success, total, taken))
            count, steps, fallen = count + 1, steps + taken, fallen + (total < 0)
    print(f"{name:13} {count:6,} episodes, {steps:8,} steps, {fallen:5,} mugs off the table")
