"""The newest levels until they succeed, then one level further (the paper's Fig. 5, `self-paced`; the idea that the
learner's own success sets the pace: Kumar, Packer and Koller, Self-paced learning for latent variable models, NeurIPS
2010).

Three rules keep it from getting stuck. The band has at least two levels: on one level alone a learner may never be
rewarded for moving towards the goal, because the way leads through the level that it no longer visits. A share of the
scenes comes from the whole range. And after `patience` outcomes on one level the strategy advances in any case; after
the last level it is `uniform`, so at worst it costs `levels * patience` episodes. Short streaks are no proof of skill,
so `window` is long. The paper's rule, 40 successes in a row, is `window=40, rate=1`.

Several labels: levels are shells around the easy corner (base.py).
"""

from __future__ import annotations

from pydantic import Field

from scenegen.learn.curriculum.strategies.base import Base, Levels, Settings, any_of
from scenegen.learn.curriculum.tasks import Outcome, PhiBox


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
        return self.levels.box(oldest + any_of(self.level + 1 - oldest, self.rng), self.rng)

    def report(self, outcome: Outcome) -> None:
        if self.level == self.levels.count:
            return
        level = self.levels.of(outcome)
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
