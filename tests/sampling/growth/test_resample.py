"""Resampling: unbiased, as even as it can be, within groups."""

import numpy as np

from scenegen.sampling.growth.machine import resample

from .made import anywhere, everything_placed, machine_of


def test_copies_are_as_many_as_weights_say_on_average_and_nearly_so_always():
    weights = np.array([0.0, 0.3, 1.2, 0.1, 2.4, 1.0, 0.5, 0.5])
    group, rng, runs = np.zeros(8, dtype=np.intp), np.random.default_rng(0), 4000
    wanted = weights / weights.mean()
    counts = np.zeros((runs, 8))
    for run in range(runs):
        keep, mean = resample(weights, group, rng)
        counts[run] = np.bincount(keep, minlength=8)
        assert len(keep) == 8 and (mean == weights.mean()).all()
    assert (np.abs(counts - wanted) < 1.0 + 1e-9).all()
    error = counts.std(axis=0) / np.sqrt(runs)
    assert (np.abs(counts.mean(axis=0) - wanted) < 4 * error + 1e-12).all()


def test_groups_keep_to_themselves_and_the_dead_are_left_out():
    weights = np.array([1.0, 0.0, 0.0, 0.0, 3.0, 1.0, 2.0, 2.0])
    group = np.array([0, 0, 1, 1, 2, 2, 3, 3])
    keep, mean = resample(weights, group, np.random.default_rng(1))
    assert keep[:2].tolist() == [0, 0] and (group[keep] == [0, 0, 2, 2, 3, 3]).all()
    assert keep[4:].tolist() == [6, 7]  # equal weights: everyone goes on as they are
    assert mean.tolist() == [0.5, 0.5, 0.0, 0.0, 2.0, 2.0, 2.0, 2.0]


def test_copies_know_their_ancestors():
    machine = machine_of("leftOf(a, b) & leftOf(b, c)")
    particles = everything_placed(machine, anywhere(machine.problem, 5))
    before = particles.scenes.copy()
    particles.take(np.array([1, 1, 3, 1, 4]))
    assert (particles.scenes == before[:, [1, 1, 3, 1, 4]]).all()
    assert particles.families[0].tolist() == [1, 1, 3, 1, 4]
