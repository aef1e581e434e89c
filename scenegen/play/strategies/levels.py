"""Strategies over levels of difficulty, 0 the easiest: by chance, by the clock, or by success at the newest levels.

Several labels: levels are shells around the easy corner (scenegen.play.strategies.base).
"""

from __future__ import annotations

import numpy as np
from pydantic import Field, model_validator

from scenegen.play.strategies.base import Base, Floats, Ints, Levels, Settings, random_index, update_rate
from scenegen.play.tasks import Outcome, PhiBox


class UniformSettings(Settings):
    """`levels`: of difficulty, each as likely as the others; 1 leaves the spread to the source."""

    levels: int = Field(default=1, ge=1, le=1000)


class Uniform(Base):
    """The baseline: the whole range, at all times.

    How scenes are spread in one wide box is left to their source. With `levels` above 1, every level of difficulty is
    chosen equally often instead. Several labels: the whole box, or its shells.
    """

    name = "uniform"
    settings_class = UniformSettings
    settings: UniformSettings

    def begin(self) -> None:
        self.levels = Levels(self.axis, self.settings.levels)

    def next_task(self) -> PhiBox:
        if self.levels.count == 1:
            return self.space
        return self.levels.box(random_index(self.levels.count, self.rng), self.rng)

    def report(self, outcome: Outcome) -> None:
        """Does nothing: outcomes do not change the tasks."""


class OrderedSettings(Settings):
    """`scenes` of a pass, in `levels` levels, but at most one level per scene."""

    scenes: int = Field(default=1000, ge=1, le=10**12)
    levels: int = Field(default=50, ge=1, le=1000)


class Ordered(Base):
    """Plain training data, sorted by phi, from easy to hard: the paper finds that this suffices on small tables.

    One scene after another, `scenes` of them in a pass, evenly over the difficulties and sorted up to one of `levels`
    (a source needs long to find scenes for bands that are requested only once). The next pass begins with the easiest
    again, like the epochs of a data set (Bengio, Louradour, Collobert and Weston, Curriculum learning, ICML 2009).
    Several labels: sorted by the hardest label (scenegen.play.strategies.base).
    """

    name = "ordered"
    settings_class = OrderedSettings
    settings: OrderedSettings
    memory = ("tasks",)
    tasks: int
    """How many were drawn so far."""

    def begin(self) -> None:
        self.tasks = 0
        self.levels = Levels(self.axis, min(self.settings.levels, self.settings.scenes))

    def next_task(self) -> PhiBox:
        place = self.tasks % self.settings.scenes
        self.tasks += 1
        return self.levels.box(place * self.levels.count // self.settings.scenes, self.rng)

    def report(self, outcome: Outcome) -> None:
        """Does nothing: outcomes do not change the order."""

    def log(self) -> dict[str, float]:
        return {"difficulty": self.tasks % self.settings.scenes / self.settings.scenes}


class LinearSettings(Settings):
    """`episodes` until the last level is over, `levels` of equal length; `grow`: keep the easier ones."""

    episodes: int = Field(default=10_000, ge=1, le=10**12)
    levels: int = Field(default=20, ge=1, le=1000)
    grow: bool = False


class Linear(Base):
    """Difficulty that grows with the number of episodes, independently of the learner (the paper's Fig. 5, `linear`).

    The range is cut into levels; over `episodes` episodes one level after another is used equally often, from easy to
    hard. After that the strategy is `uniform`. With `grow` the easier levels stay in: the range grows, instead of a
    band that moves. Several labels: levels are shells around the easy corner
    (scenegen.play.strategies.base).
    """

    name = "linear"
    settings_class = LinearSettings
    settings: LinearSettings
    memory = ("tasks",)
    tasks: int
    """How many were drawn so far."""

    def begin(self) -> None:
        self.tasks = 0
        self.levels = Levels(self.axis, self.settings.levels)
        grown = [(level + 1) / self.levels.count for level in range(self.levels.count)]
        self._grown = [self.axis.shell(0.0, far)[0][1] for far in grown]

    @property
    def level(self) -> int:
        """The current level; after the last one, the number of levels."""
        return min(self.tasks * self.levels.count // self.settings.episodes, self.levels.count)

    def next_task(self) -> PhiBox:
        level = self.level
        self.tasks += 1
        if level == self.levels.count:
            return self.space
        return self._grown[level] if self.settings.grow else self.levels.box(level, self.rng)

    def report(self, outcome: Outcome) -> None:
        """Does nothing: the number of episodes determines the level."""

    def log(self) -> dict[str, float]:
        return {"level": self.level}


class SelfPacedSettings(Settings):
    """`levels` of the range, of which the newest `band` are used; success `rate` over the last `window` outcomes in the
    band at which it advances; `share` of scenes from the whole range; `patience`: number of outcomes, on any level,
    after which it advances anyway."""

    levels: int = Field(default=20, ge=2, le=1000)
    band: int = Field(default=2, ge=2, le=1000)
    window: int = Field(default=40, ge=1, le=100_000)
    rate: float = Field(default=0.9, gt=0.0, le=1.0)
    share: float = Field(default=0.1, ge=0.0, le=1.0)
    patience: int = Field(default=1000, ge=1, le=10**12)


class SelfPaced(Base):
    """The newest levels until they succeed, then one level further (the paper's Fig. 5, `self-paced`; the idea that the
    learner's own success sets the pace: Kumar, Packer and Koller, Self-paced learning for latent variable models,
    NeurIPS 2010).

    Three rules keep it from getting stuck. The band has at least two levels: on one level alone a learner may never
    be rewarded for moving towards the goal, because the way leads through the level that it no longer visits. A share
    of the scenes comes from the whole range. And after `patience` outcomes on one level the strategy advances in any
    case; after the last level it is `uniform`, so at worst it costs `levels * patience` episodes. Short streaks are
    no proof of skill, so `window` is long. The paper's rule, 40 successes in a row, is `window=40, rate=1`.

    Several labels: levels are shells around the easy corner (scenegen.play.strategies.base).
    """

    name = "self_paced"
    settings_class = SelfPacedSettings
    settings: SelfPacedSettings
    memory = ("level", "heard", "recent")
    level: int
    """The newest level; after the last one, the number of levels."""
    heard: int
    recent: list[int]

    def begin(self) -> None:
        self.levels = Levels(self.axis, self.settings.levels)
        self.level, self.heard, self.recent = 0, 0, []

    def next_task(self) -> PhiBox:
        if self.level == self.levels.count or self.rng.random() < self.settings.share:
            return self.space
        oldest = max(self.level + 1 - self.settings.band, 0)
        return self.levels.box(oldest + random_index(self.level + 1 - oldest, self.rng), self.rng)

    def report(self, outcome: Outcome) -> None:
        if self.level == self.levels.count:
            return
        level = self.levels.index_of(outcome)
        if level is None:
            return
        self.heard += 1
        if self.level - self.settings.band < level <= self.level:
            self.recent.append(int(outcome.success))
            if len(self.recent) > self.settings.window:
                del self.recent[0]
        full = len(self.recent) == self.settings.window
        sure = full and sum(self.recent) >= self.settings.rate * self.settings.window
        if sure or self.heard >= self.settings.patience:
            self.level, self.heard, self.recent = self.level + 1, 0, []

    def log(self) -> dict[str, float]:
        return {"level": self.level, "rate": sum(self.recent) / max(len(self.recent), 1)}


BELIEVED = 3  # outcomes of a level before its rate is believed


class ReverseSettings(Settings):
    """`levels` of the range; `low` and `high` success rate of a good level, over about `window` outcomes; `walk`: a
    walk's standard deviation in levels; `replay`: share of old starts, `share` of scenes from the whole range."""

    levels: int = Field(default=20, ge=1, le=1000)
    low: float = Field(default=0.1, ge=0.0, le=1.0)
    high: float = Field(default=0.9, ge=0.0, le=1.0)
    window: int = Field(default=15, ge=2, le=100_000)
    walk: float = Field(default=1.0, gt=0.0, le=1000.0)
    replay: float = Field(default=0.2, ge=0.0, le=1.0)
    share: float = Field(default=0.1, ge=0.0, le=1.0)

    @model_validator(mode="after")
    def _in_order(self) -> ReverseSettings:
        if self.low >= self.high:
            raise ValueError(f"low {self.low} is not below high {self.high}")
        if self.replay + self.share > 1.0:
            raise ValueError("replay and share make more than all scenes")
        return self


class Reverse(Base):
    """Outwards from the goal: starts near those that succeed sometimes (Florensa, Held, Wulfmeier, Zhang and Abbeel,
    Reverse curriculum generation for reinforcement learning, CoRL 2017).

    In the source, good starts are states whose success rate lies between two bounds; new ones are found by short
    random walks from them, and some old ones are replayed. Here a start is a level of difficulty, a walk is a normal
    step along the axis, and an old start is a level that succeeds more often than the upper bound. If no level is
    good, the walk starts from the hardest old one, at first from the goal. Not in the source: a share of scenes from
    the whole range, without which the strategy could not cross a gap without scenes that is wider than the walks.

    Several labels: levels are shells around the easy corner (scenegen.play.strategies.base).
    """

    name = "reverse"
    settings_class = ReverseSettings
    settings: ReverseSettings
    memory = ("rate", "heard", "good", "old")
    rate: Floats
    heard: Ints
    good: list[int]
    old: list[int]

    def begin(self) -> None:
        self.levels = Levels(self.axis, self.settings.levels)
        self.rate = np.full(self.levels.count, 0.5)
        self.heard = np.zeros(self.levels.count, dtype=np.int64)
        self.good, self.old = [], []

    def next_task(self) -> PhiBox:
        draw = self.rng.random() - self.settings.share
        if draw < 0.0:
            return self.space
        if draw < self.settings.replay and self.old:
            return self.levels.box(self.old[random_index(len(self.old), self.rng)], self.rng)
        start = self.good[random_index(len(self.good), self.rng)] if self.good else max(self.old, default=0)
        level = round(start + self.settings.walk * self.rng.standard_normal())
        return self.levels.box(min(max(level, 0), self.levels.count - 1), self.rng)

    def report(self, outcome: Outcome) -> None:
        level = self.levels.index_of(outcome)
        if level is None:
            return
        update_rate(self.rate, self.heard, level, float(outcome.success), self.settings.window)
        if self.heard[level] < BELIEVED:
            return
        for levels in (self.good, self.old):
            if level in levels:
                levels.remove(level)
        rate = self.rate[level]
        if rate > self.settings.high:
            self.old.append(level)
        elif rate >= self.settings.low:
            self.good.append(level)

    def log(self) -> dict[str, float]:
        return {"good": len(self.good), "old": len(self.old), "furthest": max(self.good + self.old, default=0)}
