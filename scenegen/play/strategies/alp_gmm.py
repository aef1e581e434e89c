"""ALP-GMM: absolute learning progress by mixtures of Gaussians, which are fitted by expectation maximisation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydantic import Field

from scenegen.play.strategies.base import Base, Floats, Settings
from scenegen.play.tasks import Outcome, PhiBox

VARIANCE_FLOOR = 1e-4  # added to the variances: no Gaussian shrinks to a point
MIN_WEIGHT = 1e-12


@dataclass(frozen=True, slots=True)
class Mixture:
    """K Gaussians: weights (K,), means (K, D), covariances (K, D, D)."""

    weights: Floats
    means: Floats
    covariances: Floats


def fit(points: Floats, largest: int, rng: np.random.Generator, rounds: int = 10) -> Mixture:
    """A mixture of 2 to `largest` Gaussians for `points` (N, D), N > 0; at most as many as points. It starts from
    points drawn by `rng`.

    scikit-learn fits one mixture at a time, in tens of milliseconds; a strategy refits while its learner waits. Here
    the fits for 2, 3, ..., `largest` Gaussians are an additional axis of the same arrays, and the fit with the smallest
    value of Akaike's criterion (Akaike 1974) is kept.
    """
    count, width = points.shape
    largest = min(largest, count)
    sizes = np.arange(min(2, largest), largest + 1)  # (S,)
    there = np.arange(largest) < sizes[:, None]  # (S, K)
    weights = there / sizes[:, None]
    means = points[rng.permutation(count)[:largest]] + np.zeros((len(sizes), 1, 1))
    floor = VARIANCE_FLOOR * np.eye(width)
    spread = points - points.mean(0)
    covariances = np.broadcast_to(spread.T @ spread / count + floor, (len(sizes), largest, width, width))
    across = np.ascontiguousarray(points.T)  # points last: numpy is fast along long rows
    for left in reversed(range(rounds + 1)):
        apart = across - means[..., None]  # (S, K, D, N)
        far = (apart * (np.linalg.inv(covariances) @ apart)).sum(2)  # (S, K, N)
        scale = np.log(np.maximum(weights, MIN_WEIGHT)) - 0.5 * np.log(np.linalg.det(covariances))
        log = np.where(there, scale, -np.inf)[:, :, None] - 0.5 * far
        top = log.max(1, keepdims=True)
        parts = np.exp(log - top)
        total = parts.sum(1, keepdims=True)
        if not left:
            break
        parts /= total
        held = parts.sum(2) + MIN_WEIGHT  # (S, K)
        weights = held / count
        means = parts @ points / held[..., None]
        apart = across - means[..., None]
        covariances = (parts[:, :, None, :] * apart) @ np.swapaxes(apart, 2, 3) / held[..., None, None] + floor
    likelihood = (top + np.log(total)).sum((1, 2))  # up to a constant
    freedom = sizes * (1 + width + width * (width + 1) // 2) - 1
    best = int((freedom - likelihood).argmin())
    kept = slice(int(sizes[best]))
    return Mixture(weights[best, kept], means[best, kept], covariances[best, kept])


TASKS_AT_ONCE = 32  # tasks that are drawn at once
EM_ROUNDS = 6  # of expectation maximisation; more cost time, and did not improve the tasks


class AlpGmmSettings(Settings):
    """`share` of scenes from the whole range; `refit`: outcomes between two fits to the last `window`; `largest` number
    of Gaussians; `memory`: scenes among which the nearest is searched; `width` of a task, as a share of each label's
    range."""

    share: float = Field(default=0.2, gt=0.0, le=1.0)
    refit: int = Field(default=50, ge=1, le=1_000_000)
    window: int = Field(default=100, ge=10, le=100_000)
    largest: int = Field(default=4, ge=1, le=20)
    memory: int = Field(default=300, ge=1, le=1_000_000)
    width: float = Field(default=0.1, gt=0.0, le=1.0)


class AlpGmm(Base):
    """Where success changes, by a mixture of Gaussians (Portelas, Colas, Hofmann and Oudeyer, Teacher algorithms for
    curriculum learning of deep RL in continuously parameterized environments, CoRL 2019: ALP-GMM).

    The absolute learning progress of an outcome is the difference of its score from that of the nearest earlier
    scene. Every `refit` outcomes a mixture is fitted to the last `window` pairs of scene and progress; a task is
    drawn from a Gaussian that was chosen by its mean progress, sometimes from anywhere. Here the score is success, 0
    or 1. So where nothing is learnt, progress is 2 p (1 - p) on average, not 0, and the strategy is similar to
    `learnability`. The nearest scene is searched among the last `memory` ones, and a mixture has up to 4 Gaussians,
    not 10: both limit the cost. It refits more often than the source does (250), because the source's learners take
    far longer.

    Several labels: the space is that of all their shares, each label on its own; no cells.
    """

    name = "alp_gmm"
    settings_class = AlpGmmSettings
    settings: AlpGmmSettings
    fixed_shapes = False  # the number of Gaussians varies: the one that fits best
    memory = ("told", "scenes", "scores", "pairs", "worth", "means", "roots", "drawn")
    told: int
    scenes: Floats
    """(memory, labels): a ring of the shares of past scenes, with their `scores`."""
    scores: Floats
    pairs: Floats
    """(window, labels + 1): a ring of scenes and their progress."""
    worth: Floats
    """Of each Gaussian; none before the first fit."""
    means: Floats
    drawn: list[list[float]]
    """Tasks for later."""
    roots: Floats
    """Factors of the covariances: a factor times a standard normal draw is a draw from that Gaussian."""

    def begin(self) -> None:
        labels = self.axis.count
        self.told = 0
        self.scenes, self.scores = np.zeros((self.settings.memory, labels)), np.zeros(self.settings.memory)
        self.pairs = np.zeros((self.settings.window, labels + 1))
        self.worth, self.means, self.roots = np.zeros(0), np.zeros((0, labels)), np.zeros((0, labels, labels))
        self.drawn = []

    def next_task(self) -> PhiBox:
        if not len(self.worth) or self.rng.random() < self.settings.share:
            return self.space
        if not self.drawn:
            self.drawn = self._draw()
        near = self.drawn.pop()
        return self.axis.box(near, [share + self.settings.width for share in near])

    def _draw(self) -> list[list[float]]:
        """The easy ends of some tasks: drawn one by one they would cost ten times as much."""
        upto = self.worth.cumsum()
        chosen = upto.searchsorted(self.rng.random(TASKS_AT_ONCE) * upto[-1], side="right").clip(max=len(upto) - 1)
        noise = self.rng.standard_normal((TASKS_AT_ONCE, self.axis.count, 1))
        at = self.means[chosen] + (self.roots[chosen] @ noise)[:, :, 0]
        # moved inside as a whole: a task cut by the border would be chosen as often as any other
        found: list[list[float]] = (at - self.settings.width / 2).clip(0.0, 1.0 - self.settings.width).tolist()
        return found

    def report(self, outcome: Outcome) -> None:
        shares = self.axis.shares(outcome.phi)
        if shares is None:
            return
        known = min(self.told, self.settings.memory)
        progress = 0.0
        if known:
            apart = self.scenes[:known] - shares
            nearest = np.einsum("nd,nd->n", apart, apart).argmin()
            progress = abs(outcome.success - float(self.scores[nearest]))
        self.pairs[self.told % self.settings.window] = (*shares, progress)
        place = self.told % self.settings.memory
        self.scenes[place], self.scores[place] = shares, outcome.success
        self.told += 1
        if shares and self.told % self.settings.refit == 0:
            self._refit()

    def _refit(self) -> None:
        labels = self.axis.count
        found = fit(self.pairs[: self.told], self.settings.largest, self.rng, EM_ROUNDS)
        self.drawn = []
        self.worth = np.maximum(found.means[:, labels], 0.0) + 1e-6  # no progress at all: any Gaussian
        self.means = found.means[:, :labels]
        self.roots = np.asarray(np.linalg.cholesky(found.covariances[:, :labels, :labels]), dtype=np.float64)

    def log(self) -> dict[str, float]:
        return {"gaussians": len(self.worth), "progress": float(self.worth.max(initial=0.0))}
