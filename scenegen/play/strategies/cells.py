"""Strategies over a grid of cells of all labels: the outcomes of a cell's episodes decide how often it is chosen."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from pydantic import Field

from scenegen.play.strategies.base import (
    Base,
    DifficultyGrid,
    Floats,
    Ints,
    Settings,
    draw_index,
    random_index,
    update_rate,
)
from scenegen.play.tasks import Outcome, PhiBox


class LearnabilitySettings(Settings):
    """`cells` along each label (None: 16, or fewer where there are several); `beta`: how strongly p (1 - p) counts; p
    over about `window` outcomes; `share` of scenes from any cell."""

    cells: int | None = Field(default=None, ge=1, le=1000)
    beta: float = Field(default=20.0, ge=0.0, le=1000.0)
    window: int = Field(default=15, ge=2, le=100_000)
    share: float = Field(default=0.1, gt=0.0, le=1.0)


class Learnability(Base):
    """Scenes with uncertain success: a scene teaches most if its probability p of success is neither 0 nor 1.

    A cell's weight is exp(beta p (1 - p)) (Tzannetos, Ribeiro, Kamalaruban and Singla, Proximal curriculum for
    reinforcement learning agents, TMLR 2023, with a best value of 1); Rutherford, Beukman, Willi, Lacerda, Hawes and
    Foerster, No regrets, NeurIPS 2024, choose levels by the same score, and also draw a share of levels at random. p
    is a running mean of success, not a learner's own value estimate, and begins at one half, so that untried cells
    are tried.

    Several labels: a grid of cells over all of them.
    """

    name = "learnability"
    settings_class = LearnabilitySettings
    settings: LearnabilitySettings
    memory = (*DifficultyGrid.memory, "rate", "heard", "weight")
    rate: Floats
    heard: Ints
    weight: Floats

    def begin(self) -> None:
        self.cells = DifficultyGrid(self.axis, self.settings.cells)
        self.rate = np.full(self.cells.count, 0.5)
        self.heard = np.zeros(self.cells.count, dtype=np.int64)
        self.weight = np.ones(self.cells.count)  # relative to the largest weight: exp(beta (p (1 - p) - 1 / 4))

    def next_task(self) -> PhiBox:
        by_chance = self.rng.random() < self.settings.share
        cell = self.cells.random_open(self.rng) if by_chance else draw_index(self.weight * self.cells.open, self.rng)
        return self.cells.box(cell)

    def report(self, outcome: Outcome) -> None:
        cell = self.cells.index_of(outcome)
        if cell is None:
            return
        update_rate(self.rate, self.heard, cell, float(outcome.success), self.settings.window)
        rate = float(self.rate[cell])
        self.weight[cell] = math.exp(self.settings.beta * (rate * (1.0 - rate) - 0.25))

    def log(self) -> dict[str, float]:
        return {"learnability": float((self.rate * (1.0 - self.rate)).mean()), "rate": float(self.rate.mean())}


class ReplaySettings(Settings):
    """`cells` along each label (None: 16, or fewer for several labels); `temperature`: weight is rank^(-1 /
    temperature); `staleness`: share of draws by how long ago a cell was chosen; means over about `window` outcomes;
    `worth` of an episode: its success or its total reward."""

    cells: int | None = Field(default=None, ge=1, le=1000)
    temperature: float = Field(default=0.5, gt=0.0, le=1000.0)
    staleness: float = Field(default=0.2, gt=0.0, le=1.0)
    window: int = Field(default=15, ge=2, le=100_000)
    worth: Literal["success", "total"] = "success"


class Replay(Base):
    """Prioritised level replay: cells with surprising outcomes, and cells that were not used recently (Jiang,
    Grefenstette and Rocktäschel, Prioritized level replay, ICML 2021).

    In the source, a level is one seed of a generator, and its score is the mean absolute error of the value function
    over an episode. Here a level is a cell of phi, and no value function is used: the cell keeps a running mean of
    its episodes' worth, and its score is the running mean of an episode's distance from that mean. So randomness
    within a cell counts as a surprise for ever, while the learner's own errors would decrease. An episode is worth
    its success, or with `worth="total"` its total reward; then falls from the table count most, and the edge of the
    table gets more episodes than the way there. Only the rank of scores matters, so the scale of rewards does not. As
    in the source, cells that were not used yet are drawn in proportion to their number.

    Several labels: a grid of cells over all of them.
    """

    name = "replay"
    settings_class = ReplaySettings
    settings: ReplaySettings
    memory = (*DifficultyGrid.memory, "mean", "score", "heard", "last", "tasks")
    mean: Floats
    score: Floats
    heard: Ints
    last: Ints
    """When a cell was last chosen, as a count of tasks; -1: never."""
    tasks: int
    """How many were drawn so far."""

    def begin(self) -> None:
        self.cells = DifficultyGrid(self.axis, self.settings.cells)
        count = self.cells.count
        self.mean, self.score = np.zeros(count), np.zeros(count)
        self.heard, self.last, self.tasks = np.zeros(count, dtype=np.int64), np.full(count, -1), 0
        self._by_rank = (1.0 + np.arange(count)) ** (-1.0 / self.settings.temperature)

    def next_task(self) -> PhiBox:
        cell = self._cell()
        self.last[cell] = self.tasks
        self.tasks += 1
        return self.cells.box(cell)

    def _cell(self) -> int:
        count, there = self.cells.count, self.cells.open
        if self.tasks < 100 * count:  # after so many draws none is left, with probability 1 - e^-100
            new = np.flatnonzero(self.last < 0)
            draw = self.rng.random() * count
            if draw < len(new):
                return int(new[int(draw)])
        if self.rng.random() < self.settings.staleness:
            return draw_index((self.tasks - self.last) * there, self.rng)
        place = draw_index(self._by_rank[: int(there.sum())], self.rng)
        # the cell of that rank, closed ones last; sorting all of them for each draw would cost more
        return int(np.argpartition(1.0 - there - self.score * there, place)[place])

    def report(self, outcome: Outcome) -> None:
        cell = self.cells.index_of(outcome)
        worth = float(outcome.success) if self.settings.worth == "success" else outcome.total
        if cell is None or not math.isfinite(worth):
            return
        surprise = abs(worth - self.mean[cell]) if self.heard[cell] else 0.0
        span = self.settings.window
        self.mean[cell] += (worth - self.mean[cell]) / min(int(self.heard[cell]) + 1, span)
        update_rate(self.score, self.heard, cell, surprise, span)

    def log(self) -> dict[str, float]:
        return {"seen": int((self.last >= 0).sum()), "surprise": float(self.score.mean())}


UNKNOWN_SLOPE = 1.0  # more than any slope over three outcomes or more
SLOPE_DIGITS = 9  # rounding of a slope: ties are broken at random, not by rounding errors


class TeacherSettings(Settings):
    """`cells` along each label (None: 16, or fewer for several labels); `window`: number of outcomes for a slope;
    `share` of scenes from any cell."""

    cells: int | None = Field(default=None, ge=1, le=1000)
    window: int = Field(default=20, ge=3, le=1000)
    share: float = Field(default=0.2, gt=0.0, le=1.0)


class Teacher(Base):
    """A teacher that chooses tasks on which the student's score changes most (Matiisen, Oliver, Cohen and Schulman,
    Teacher-student curriculum learning, 2017: the `window` algorithm).

    Each cell keeps its last outcomes; the absolute slope of a line through them, in success per outcome, is the
    cell's progress. The cell with the greatest progress is chosen, sometimes a random one. Falling counts like
    rising: what the learner forgets should be practised again. In the source the line is a function of time; here of
    the cell's own outcomes, so that the age of outcomes does not matter for rarely chosen cells. Cells without enough
    outcomes come first: their slope is unknown.

    Several labels: a grid of cells over all of them.
    """

    name = "teacher"
    settings_class = TeacherSettings
    settings: TeacherSettings
    memory = (*DifficultyGrid.memory, "score", "heard", "progress")
    score: Floats
    """(cells, window): a ring of each cell's last outcomes."""
    heard: Ints
    progress: Floats

    def begin(self) -> None:
        self.cells = DifficultyGrid(self.axis, self.settings.cells)
        count, window = self.cells.count, self.settings.window
        self.score = np.zeros((count, window))
        self.heard = np.zeros(count, dtype=np.int64)
        self.progress = np.full(count, UNKNOWN_SLOPE)
        time = np.arange(window) - (window - 1) / 2
        # row k: weights of the slope when the oldest outcome stands at k in the ring
        self._slope = np.array([np.roll(time, k) for k in range(window)]) / (time @ time)

    def next_task(self) -> PhiBox:
        if self.rng.random() < self.settings.share:
            return self.cells.box(self.cells.random_open(self.rng))
        progress = np.where(self.cells.open, self.progress, -1.0)
        best = np.flatnonzero(progress == progress.max())
        return self.cells.box(int(best[random_index(len(best), self.rng)]))

    def report(self, outcome: Outcome) -> None:
        cell = self.cells.index_of(outcome)
        if cell is None:
            return
        window, heard = self.settings.window, int(self.heard[cell])
        self.score[cell, heard % window] = outcome.success
        self.heard[cell] = heard + 1
        if heard + 1 >= window:
            slope = float(self._slope[(heard + 1) % window] @ self.score[cell])
            self.progress[cell] = round(abs(slope), SLOPE_DIGITS)

    def log(self) -> dict[str, float]:
        known = self.progress[self.progress < UNKNOWN_SLOPE]
        return {"progress": float(known.max(initial=0.0)), "rate": float(self.score.mean())}


RECENT_REWARDS = 200  # recent rewards, which determine the scale
RESCALE_EVERY = 20  # outcomes between two updates of the scale
MAX_LOG_STEP = 1.0  # maximum step of a log weight, which a small probability would make huge
FAST_FACTOR = 3  # time constants of the two running means
MIN_FLOW = 1e-3  # share of the weight that flows, per outcome; with the source's 1 / t changes would stop


class Exp3SSettings(Settings):
    """`cells` along each label (None: 16, or fewer where there are several); `eta`: step of the log weights; `share` of
    scenes from any cell; `window`: outcomes of the slow mean."""

    cells: int | None = Field(default=None, ge=1, le=1000)
    eta: float = Field(default=0.1, gt=0.0, le=10.0)
    share: float = Field(default=0.1, gt=0.0, le=1.0)
    window: int = Field(default=30, ge=2 * FAST_FACTOR, le=100_000)


class Exp3S(Base):
    """A bandit over cells, rewarded with the student's progress (Graves, Bellemare, Menick, Munos and Kavukcuoglu,
    Automated curriculum learning for neural networks, ICML 2017; Exp3.S: Auer, Cesa-Bianchi, Freund and Schapire,
    SIAM Journal on Computing 2002).

    The source measures progress by the decrease of the learner's loss, which an outcome does not have; here progress
    is the distance between a fast and a slow running mean of the cell's success. As in the source, it is scaled to
    [-1, 1] by the 20 % and 80 % quantiles of recent rewards and divided by the cell's probability, and some weight
    flows from every cell to the others, so that a cell can always come back.

    Several labels: a grid of cells over all of them.
    """

    name = "exp3s"
    settings_class = Exp3SSettings
    settings: Exp3SSettings
    memory = (*DifficultyGrid.memory, "weight", "slow", "fast", "heard", "rewards", "told", "low", "high")
    weight: Floats
    """Sums to 1."""
    slow: Floats
    fast: Floats
    heard: Ints
    rewards: Floats
    told: int
    low: float
    high: float

    def begin(self) -> None:
        self.cells = DifficultyGrid(self.axis, self.settings.cells)
        count = self.cells.count
        self.weight = np.full(count, 1.0 / count)
        self.slow, self.fast = np.full(count, 0.5), np.full(count, 0.5)
        self.heard, self.rewards = np.zeros(count, dtype=np.int64), np.zeros(RECENT_REWARDS)
        self.told, self.low, self.high = 0, 0.0, 0.0

    def next_task(self) -> PhiBox:
        by_chance = self.rng.random() < self.settings.share
        cell = self.cells.random_open(self.rng) if by_chance else draw_index(self.weight * self.cells.open, self.rng)
        return self.cells.box(cell)

    def report(self, outcome: Outcome) -> None:
        cell = self.cells.index_of(outcome)
        if cell is None:
            return
        score, span, count = float(outcome.success), self.settings.window, self.cells.count
        self.slow[cell] += (score - self.slow[cell]) / min(int(self.heard[cell]) + 2, span)
        update_rate(self.fast, self.heard, cell, score, span // FAST_FACTOR)
        reward = self._scale(abs(float(self.fast[cell] - self.slow[cell])))
        chance = (1.0 - self.settings.share) * self.weight[cell] + self.settings.share / count  # if all cells were open
        self.weight[cell] *= math.exp(min(max(self.settings.eta * reward / chance, -MAX_LOG_STEP), MAX_LOG_STEP))
        flow = max(1.0 / self.told, MIN_FLOW)
        self.weight = (1.0 - flow) / self.weight.sum() * self.weight + flow / count

    def _scale(self, reward: float) -> float:
        self.rewards[self.told % RECENT_REWARDS] = reward
        self.told += 1
        if self.told % RESCALE_EVERY == 0:
            recent = np.sort(self.rewards[: min(self.told, RECENT_REWARDS)])
            self.low, self.high = float(recent[len(recent) // 5]), float(recent[len(recent) * 4 // 5])
        if self.high <= self.low:
            return 0.0
        return min(max(2.0 * (reward - self.low) / (self.high - self.low) - 1.0, -1.0), 1.0)

    def log(self) -> dict[str, float]:
        return {"likeliest": int(self.weight.argmax()), "weight": float(self.weight.max())}
