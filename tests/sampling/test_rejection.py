"""Rejection hands out the true conditional distribution, shared evenly over the cells."""

from functools import partial

import numpy as np
import pytest

from scenegen.sampling.engine.run import draw as run
from scenegen.sampling.problem import Budget, make_problem
from scenegen.sampling.request import Range, SampleRequest

rejection = partial(run, method="rejection")

N = 20_000
RANGE = Range(0.1, 0.3)


@pytest.fixture(scope="module")
def flat(exp1):
    return rejection(make_problem(exp1, SampleRequest({"task": RANGE}, n=N, seed=3)), Budget())


def test_every_scene_is_in_the_range_and_the_workspace(flat, phi1):
    assert flat.rows.shape == (6, N) and flat.shortfall is None and flat.warnings == ()
    phi = phi1(flat.rows)
    np.testing.assert_allclose(phi, flat.phi, rtol=0, atol=1e-14)
    assert phi[0].min() >= 0.1 and phi[0].max() <= 0.3
    assert flat.rows.min() >= 0 and flat.rows[[0, 1, 3, 4]].max() <= 1 and flat.rows[[2, 5]].max() < 2 * np.pi


def test_the_cells_share_exactly(flat):
    counts, _ = np.histogram(flat.phi[0], np.linspace(0.1, 0.3, 33))
    assert counts.tolist() == [N // 32] * 32


@pytest.mark.parametrize("n", [1, 31, 33, 100])
def test_shares_differ_by_at_most_one(exp1, n):
    found = rejection(make_problem(exp1, SampleRequest({"task": RANGE}, n=n, seed=n)), Budget())
    counts, _ = np.histogram(found.phi[0], np.linspace(0.1, 0.3, 33))
    assert counts.sum() == n and counts.max() - counts.min() <= 1


@pytest.mark.long
@pytest.mark.parametrize("cell", [0, 13, 31])
def test_within_a_cell_scenes_follow_the_base_distribution(flat, cell, phi1, direct, same_distribution):
    edges = np.linspace(0.1, 0.3, 33)[cell : cell + 2]
    truth = direct(3_000_000)
    truth = truth[:, _between(phi1(truth)[0], *edges)]
    mine = flat.rows[:, _between(flat.phi[0], *edges)]
    assert mine.shape[1] == N // 32 and truth.shape[1] > 5_000
    for row in range(6):
        assert same_distribution(mine[row], truth[row])
    assert same_distribution(mine[0] - mine[3], truth[0] - truth[3])


def test_spread_over_two_labels(exp1, phi1, direct, same_distribution):
    ranges = {"task": Range(0.0, 0.2), "safe": Range(0.0, 0.2)}
    found = rejection(make_problem(exp1, SampleRequest(ranges, n=2560, seed=8)), Budget())
    counts, _, _ = np.histogram2d(*found.phi, bins=[np.linspace(0, 0.2, 17)] * 2)
    assert found.info["cells"] == {"asked": 256, "reached": int((counts > 0).sum())}
    assert counts[counts > 0].max() - counts[counts > 0].min() <= 1 and counts.sum() == 2560


def test_spread_base_follows_the_base_distribution_over_the_whole_range(exp1, phi1, direct, same_distribution):
    found = rejection(make_problem(exp1, SampleRequest({"task": RANGE}, n=N, seed=4, spread="base")), Budget())
    truth = direct(500_000)
    truth = truth[:, _between(phi1(truth)[0], 0.1, 0.3)]
    assert same_distribution(found.phi[0], phi1(truth)[0])
    assert same_distribution(found.phi[1], phi1(truth)[1])
    for row in range(6):
        assert same_distribution(found.rows[row], truth[row])


def test_the_test_of_distributions_can_fail(flat, phi1, direct, same_distribution):
    truth = direct(500_000)
    truth = truth[:, _between(phi1(truth)[0], 0.1, 0.3)]
    assert not same_distribution(flat.phi[0], phi1(truth)[0])


def test_the_order_has_no_pattern(flat):
    first, second = flat.phi[0][: N // 2], flat.phi[0][N // 2 :]
    assert abs(first.mean() - second.mean()) < 4 * flat.phi[0].std() * np.sqrt(4 / N)
    assert abs(np.corrcoef(flat.phi[0][:-1], flat.phi[0][1:])[0, 1]) < 4 / np.sqrt(N)


def test_nothing_asked_is_the_base_distribution(exp1, direct, same_distribution):
    found = rejection(make_problem(exp1, SampleRequest(n=N, seed=1)), Budget())
    truth = direct(N)
    assert all(same_distribution(found.rows[row], truth[row]) for row in range(6))


def test_a_workspace_of_its_own(same_distribution):
    from scenegen.lang.checker import check_text

    spec = check_text("workspace [-2 m, 30 cm] x [5, 6]\ntask: leftOf(mug, plate)")
    found = rejection(make_problem(spec, SampleRequest({"task": Range(0.0)}, n=2000)), Budget())
    assert found.rows[0::3].min() >= -2 and found.rows[0::3].max() <= 0.3 and found.rows[0::3].min() < -1.9
    assert found.rows[1::3].min() >= 5 and found.rows[1::3].max() <= 6
    assert (found.rows[0] <= found.rows[3]).all()


def _between(values, low, high):
    return (values >= low) & (values <= high)
