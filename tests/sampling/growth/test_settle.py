"""How long a population is moved, and which part of it is taken."""

from types import SimpleNamespace

import numpy as np
import pytest

from scenegen.sampling.growth.population import ALIKE, SURE, apart, part_of, partners, settle

from .made import anywhere, everything_placed, machine_of


def copies(index):
    """Particles of which some are copies of others."""
    machine = machine_of("leftOf(a, b) & leftOf(b, c)")
    particles = everything_placed(machine, anywhere(machine.problem, max(index) + 1))
    particles.take(np.array(index))
    return particles


def test_scenes_that_share_a_place_are_told():
    particles = copies([0, 0, 0, 1, 2, 2])
    assert partners(particles) == pytest.approx((3 * 2 + 0 + 2 * 1) / 6)
    assert apart(particles, np.arange(6)).tolist() == [0, 3, 4]
    assert apart(particles, np.array([2, 5, 1, 3])).tolist() == [2, 5, 3]
    # one object that has moved is not enough, all must
    particles.scenes[[0, 1, 2], 1] += 0.1
    assert apart(particles, np.arange(6)).tolist() == [0, 3, 4]
    particles.scenes[3:, 1] += 0.1
    assert apart(particles, np.arange(6)).tolist() == [0, 1, 3, 4]
    assert partners(particles) == pytest.approx((2 * 1 + 0 + 2 * 1) / 6)


def test_a_place_that_went_to_another_object_is_still_shared():
    particles = copies([0, 0])
    particles.scenes[[0, 1, 3, 4], 1] = particles.scenes[[3, 4, 0, 1], 1]
    particles.scenes[6:, 1] += 0.1
    assert partners(particles) == 1.0 and len(apart(particles, np.arange(2))) == 1


def test_a_part_has_as_many_scenes_of_each_cell_and_asks_for_nothing_else():
    rng, cell = np.random.default_rng(0), np.repeat([0, 1, 2], [40, 40, 20])
    taken = np.zeros(100)
    for _ in range(400):
        some = part_of(cell, 5.0, rng)
        assert len(set(some)) == 20 and np.ptp(np.bincount(cell[some])) <= 1
        taken[some] += 1
    for number, share in ((0, 20 / 3 / 40), (1, 20 / 3 / 40), (2, 20 / 3 / 20)):  # everyone of a cell equally often
        counts = taken[cell == number]
        assert np.abs(counts / 400 - share).max() < 5 * np.sqrt(share / 400)
    assert sorted(part_of(cell, 1.0, rng)) == list(range(100))


def run(effects, count=500, wanted=100.0, grown=100.0):
    """`settle` where the design effect falls as told and a sweep takes one evaluation."""
    machine = SimpleNamespace(work=0.0)
    particles = SimpleNamespace(machine=machine, count=count, placed=(), scenes=np.zeros((3, count)))
    machine.graph = SimpleNamespace(rows=frozenset())

    def sweep():
        machine.work += 1.0

    return settle(particles, sweep, lambda _: effects(machine.work), grown, wanted)


def test_sweeps_end_once_the_particles_are_enough():
    best, now = run(lambda work: 2.0)
    assert best.sweeps == now.sweeps == 4 and now.thin == pytest.approx(1.0 / (ALIKE - 1.0))
    assert now.left == pytest.approx(ALIKE)


def test_sweeps_that_help_go_on_and_those_that_do_not_end_early():
    falling, _ = run(lambda work: 1.0 + 30.0 * np.exp(-work / 20.0), wanted=2000.0)
    flat, now = run(lambda work: 8.0, wanted=2000.0)
    assert falling.sweeps > 40 and falling.thin < 3.0
    assert flat.sweeps == 4 and flat.thin == pytest.approx(7.0 / (ALIKE - 1.0))  # the fewest: more bring nothing
    assert now.sweeps > 4


def test_sweeps_that_bring_little_for_long_end():
    """The effect falls by a half in 16 sweeps, which is less than they cost: 17 are enough to see that."""
    slow = lambda work: 1.0 + 8.0 * 0.5 ** (work / 16.0)  # noqa: E731
    best, now = run(slow, wanted=4000.0, grown=1.0)
    assert best.sweeps == 4 and now.sweeps == 17
    # where growing costs more, the same sweeps are worth it
    best, now = run(slow, wanted=4000.0, grown=1000.0)
    assert best.sweeps > 17


def test_of_trusted_numbers_of_sweeps_the_cheapest_is_taken():
    """Scenes that come apart in the end: a slightly larger population is cheaper than four times the sweeps."""
    best, now = run(lambda work: 1.6 if work < 45.0 else 1.4, wanted=5000.0)
    assert now.sweeps >= 45 and now.thin == 1.0
    assert SURE <= best.sweeps < 20 and best.thin == pytest.approx(0.6 / (ALIKE - 1.0))
