"""Scenes of experiment 1 with |phi - (0.19, 0.08)| < 0.0125: right ones, and wrong ones that tests must see."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

WANTED = (0.19, 0.08)
HALF_WIDTH = 0.0125


def _phi(dx, dy):
    """Labels of mug at (0, 0) and plate at (dx, -dy): left of and above it; not within 0.25."""
    return np.minimum(dx, dy), np.hypot(dx, dy) - 0.25


def _in_band(dx, dy, half_width=HALF_WIDTH):
    task, safe = _phi(dx, dy)
    return (np.abs(task - WANTED[0]) < half_width) & (np.abs(safe - WANTED[1]) < half_width)


def _scenes(rng, n, half_width):
    """Rejection from a box of differences that holds the band: exact, and quicker than from the whole square."""
    kept, found = [], 0
    while found < n:
        dx, dy = rng.uniform(0.1, 0.4, (2, 4 * n + 1000))
        mx, my = rng.random((2, len(dx)))
        hit = _in_band(dx, dy, half_width) & (mx + dx <= 1.0) & (my - dy >= 0.0)
        # phi does not look at theta here, so it may be drawn afterwards.
        theta = rng.random((2, int(hit.sum()))) * 2.0 * np.pi
        kept.append(np.stack([mx[hit], my[hit], theta[0], (mx + dx)[hit], (my - dy)[hit], theta[1]]))
        found += kept[-1].shape[1]
    return np.concatenate(kept, axis=1)[:, :n]


def _true(rng, n):
    return _scenes(rng, n, HALF_WIDTH)


def _projected(rng, n):
    """Scenes of a wider band moved by Newton steps along grad phi onto the wanted level; the middles stay true."""
    kept, found = [], 0
    while found < n:
        scenes = _scenes(rng, 2 * n, 0.05)
        centre = (scenes[[0, 1]] + scenes[[3, 4]]) / 2.0
        dx, dy = scenes[3] - scenes[0], scenes[1] - scenes[4]
        for _ in range(40):
            # A step moves both objects alike, so the middle stays.
            dx, dy = np.where(dx < dy, WANTED[0], dx), np.where(dx < dy, dy, WANTED[0])
            longer = (WANTED[1] + 0.25) / np.hypot(dx, dy)
            dx, dy = dx * longer, dy * longer
        scenes[0], scenes[3] = centre[0] - dx / 2.0, centre[0] + dx / 2.0
        scenes[1], scenes[4] = centre[1] + dy / 2.0, centre[1] - dy / 2.0
        places = scenes[[0, 1, 3, 4]]
        hit = _in_band(dx, dy) & (places >= 0.0).all(axis=0) & (places <= 1.0).all(axis=0)
        kept.append(scenes[:, hit])
        found += int(hit.sum())
    return np.concatenate(kept, axis=1)[:, :n]


def _perturbed(rng, n, hits=60):
    """As few hits as the paper had for experiment 2, disturbed by a normal 0.02 (m, rad) until in the band again."""
    few, kept, found = _true(rng, hits), [], 0
    while found < n:
        scenes = few[:, rng.integers(hits, size=8 * n)]
        scenes = scenes + 0.02 * rng.standard_normal(scenes.shape)
        places = scenes[[0, 1, 3, 4]]
        hit = _in_band(scenes[3] - scenes[0], scenes[1] - scenes[4])
        kept.append(scenes[:, hit & (places >= 0.0).all(axis=0) & (places <= 1.0).all(axis=0)])
        found += kept[-1].shape[1]
    return np.concatenate(kept, axis=1)[:, :n]


def _reflected(rng, n, sign=-1.0):
    """Plate turned on from the mug by an exponential angle, then both mirrored: each theta alone is uniform."""
    scenes = _true(rng, n)
    scenes[5] = scenes[2] + rng.exponential(0.5, n)
    scenes[2::3] *= sign
    return scenes


Sampler = Callable[[np.random.Generator, int], np.ndarray]


@pytest.fixture
def true_scenes() -> Sampler:
    """(generator, n) -> (6, n) independent scenes of the true distribution."""
    return _true


@pytest.fixture
def wrong_scenes() -> dict[str, tuple[Sampler, Sampler]]:
    """Name -> the right sampler and a wrong one that is to be told from it."""

    def shifted(rng, n):
        scenes = _true(rng, n)
        scenes[0] += 0.01
        return scenes

    return {
        "projected": (_true, _projected),
        "perturbed": (_true, _perturbed),
        "shifted": (_true, shifted),
        "reflected": (lambda rng, n: _reflected(rng, n, 1.0), _reflected),
    }
