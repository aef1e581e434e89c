"""Made-up learners, for which it is known what practice is worth."""

import numpy as np

from scenegen.play.strategies import strategy
from scenegen.play.tasks import Outcome, PhiBox


def reach(labels=1):
    return PhiBox((-1.0,) * labels, (0.0,) * labels)


def draw(task, rng):
    """A phi in the task's box, as a source of scenes would hand it out."""
    return tuple(low + (high - low) * float(rng.random()) for low, high in zip(task.low, task.high, strict=True))


class Chain:
    """Value that travels from level to level, as it does in a table of values: practice moves a level's chance of
    success towards that of the level before it, a step of `rate`; level 0 lies at the goal. The hardest label counts.

    Practice that is spread over L levels needs in the order of L^2 / rate episodes; practice that goes through them
    one after another L / rate. So a curriculum must help.
    """

    after_the_one_before = True

    def __init__(self, rng, levels=20, rate=0.2):
        self.rng, self.rate = rng, rate
        self.skill = np.zeros(levels)

    def play(self, task):
        phi = draw(task, self.rng)
        level = min(int(-min(phi) * len(self.skill)), len(self.skill) - 1)
        success = bool(self.rng.random() < self.skill[level])
        limit = self.skill[level - 1] if self.after_the_one_before and level else 1.0
        self.skill[level] += self.rate * (limit - self.skill[level])
        return Outcome(task, phi, success, 10.0 * success, 1)


class Separate(Chain):
    """Levels that have nothing to do with each other: no order can be better than evenly."""

    after_the_one_before = False


def episodes(name, learner, seed, labels=1, limit=20_000, **settings):
    """How many until the mean chance of success is 0.95."""
    pupil = learner(np.random.default_rng([seed, 1]))
    teacher = strategy(name, reach(labels), np.random.default_rng([seed, 2]), **settings)
    for count in range(1, limit):
        teacher.report(pupil.play(teacher.next_task()))
        if pupil.skill.mean() >= 0.95:
            return count
    return limit
