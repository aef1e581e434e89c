"""Mixtures of Gaussians by expectation maximisation, of several sizes at once.

scikit-learn fits one mixture at a time, in tens of milliseconds; a strategy refits while its learner waits. Here the
fits for 2, 3, ..., `largest` Gaussians are an additional axis of the same arrays, and the fit with the smallest value
of Akaike's criterion (Akaike 1974) is kept.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenegen.curriculum.strategies.chances import Floats

FLOOR = 1e-4  # added to the variances: no Gaussian shrinks to a point
LIGHTEST = 1e-12


@dataclass(frozen=True, slots=True)
class Mixture:
    """K Gaussians: weights (K,), means (K, D), covariances (K, D, D)."""

    weights: Floats
    means: Floats
    covariances: Floats


def fit(points: Floats, largest: int, rng: np.random.Generator, rounds: int = 10) -> Mixture:
    """A mixture of 2 to `largest` Gaussians for `points` (N, D), N > 0; at most as many as points. It starts from
    points drawn by `rng`."""
    count, width = points.shape
    largest = min(largest, count)
    sizes = np.arange(min(2, largest), largest + 1)  # (S,)
    there = np.arange(largest) < sizes[:, None]  # (S, K)
    weights = there / sizes[:, None]
    means = points[rng.permutation(count)[:largest]] + np.zeros((len(sizes), 1, 1))
    floor = FLOOR * np.eye(width)
    spread = points - points.mean(0)
    covariances = np.broadcast_to(spread.T @ spread / count + floor, (len(sizes), largest, width, width))
    across = np.ascontiguousarray(points.T)  # points last: numpy is fast along long rows
    for left in reversed(range(rounds + 1)):
        apart = across - means[..., None]  # (S, K, D, N)
        far = (apart * (np.linalg.inv(covariances) @ apart)).sum(2)  # (S, K, N)
        scale = np.log(np.maximum(weights, LIGHTEST)) - 0.5 * np.log(np.linalg.det(covariances))
        log = np.where(there, scale, -np.inf)[:, :, None] - 0.5 * far
        top = log.max(1, keepdims=True)
        parts = np.exp(log - top)
        total = parts.sum(1, keepdims=True)
        if not left:
            break
        parts /= total
        held = parts.sum(2) + LIGHTEST  # (S, K)
        weights = held / count
        means = parts @ points / held[..., None]
        apart = across - means[..., None]
        covariances = (parts[:, :, None, :] * apart) @ np.swapaxes(apart, 2, 3) / held[..., None, None] + floor
    likelihood = (top + np.log(total)).sum((1, 2))  # up to a constant
    freedom = sizes * (1 + width + width * (width + 1) // 2) - 1
    best = int((freedom - likelihood).argmin())
    kept = slice(int(sizes[best]))
    return Mixture(weights[best, kept], means[best, kept], covariances[best, kept])
