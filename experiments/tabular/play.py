"""The one-step learner with any strategy: the curriculum in Python, every episode in compiled code."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from experiments.errors import GRID_TASK
from experiments.tabular.check import ANY, FIRST, solved
from experiments.tabular.grid import GOAL, OFF, Cells, GridTask
from experiments.tabular.qlearning import NEVER, REWARD, Learner, Result, Stop, replayed, stepwise
from experiments.tabular.rng import seeded
from scenegen.errors import RequestError
from scenegen.play.tasks import Outcome, PhiBox, Strategy


class Scenes:
    """Cells to begin in, by phi. A box that holds none gets the cells whose phi is nearest to its middle."""

    def __init__(self, task: GridTask, cells: Cells, seed: int = 0) -> None:
        """`cells` may name a cell several times; it is drawn so much more often. Raises RequestError where the spec has
        several labels, which a box of phi of one label does not know."""
        if len(task.spec.labels) != 1:
            problem = f"a grid task of {len(task.spec.labels)} labels"
            raise RequestError(GRID_TASK(problem=problem, remedy="give the spec one label, a formula of the others"))
        order = np.argsort(task.phi[cells], kind="stable")
        self.cells, self.phi = cells[order], task.phi[cells][order]
        self.random = np.random.default_rng(seed)

    @property
    def space(self) -> PhiBox:
        """From the hardest to the easiest cell."""
        return PhiBox((float(self.phi[0]),), (float(self.phi[-1]),))

    def draw(self, box: PhiBox) -> tuple[int, float]:
        """A cell of the box's, and its phi."""
        low = int(np.searchsorted(self.phi, box.low[0], "left"))
        high = int(np.searchsorted(self.phi, box.high[0], "right"))
        if low >= high:
            middle = (box.low[0] + box.high[0]) / 2.0
            near = self.phi[np.abs(self.phi[max(low - 1, 0) : low + 1] - middle).argmin() + max(low - 1, 0)]
            low = int(np.searchsorted(self.phi, near, "left"))
            high = int(np.searchsorted(self.phi, near, "right"))
        place = int(self.random.integers(low, high))
        return int(self.cells[place]), float(self.phi[place])


def play(
    task: GridTask,
    scenes: Scenes,
    learner: Learner,
    make: Callable[[PhiBox], Strategy],
    stop: Stop,
    seed: int = 0,
) -> Result:
    """Learn until `stop`, as `qlearning.train` does. `make` makes the strategy for a reach of phi; the result's `level`
    is 0."""
    strategy, rng = make(scenes.space), seeded(seed)
    q = np.zeros((len(task.phi), 4))
    episode = replayed if learner.replay else stepwise
    episodes, steps, resets, check, any_share = 0, 0, 0, 0, 0.0
    first, strict = (NEVER,) * 3, (NEVER,) * 3
    while episodes < stop.episodes:
        box = strategy.next_task()
        start, phi = scenes.draw(box)
        where, taken = episode(task.board, q, None, learner, start, rng)
        total = REWARD if where == GOAL else -REWARD if where == OFF else 0.0
        strategy.report(Outcome(box, (phi,), where == GOAL, total, taken))
        episodes, steps, resets = episodes + 1, steps + taken, resets + (where == OFF)
        if episodes < check:
            continue
        check = episodes + 1 + episodes // 100
        if solved(task.board, q, None, FIRST, learner.limit) < stop.share:
            continue
        share = solved(task.board, q, None, ANY, learner.limit)
        if first[0] == NEVER:
            first, any_share = (episodes, steps, resets), share
        if share >= stop.share:
            strict = (episodes, steps, resets)
            break
        if not stop.both:
            break
    return Result(*first, *strict, any_share, 0)
