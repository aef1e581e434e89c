"""Flat spread and several labels: equal shares of the cells, and the right scenes within each."""

import math

import numpy as np
from scipy import stats

from scenegen.lang.checker import check_text
from scenegen.sampling.growth.sampler import Growth, plan_growth
from scenegen.sampling.problem import Budget, make_problem
from scenegen.sampling.request import Range, SampleRequest


def planned(text, ranges, n, seed=0, spread="flat"):
    plan = plan_growth(make_problem(check_text(text), SampleRequest(ranges, n=n, seed=seed, spread=spread)), Budget())
    assert isinstance(plan, Growth)
    return plan


def test_all_cells_get_equal_shares_and_the_probability_adds_up():
    plan = planned("leftOf(a, b)", {"task": Range(0.1, 0.9)}, 3200)
    made = plan.draw(0)
    counts = np.bincount(made.cell, minlength=32)
    assert made.cell.min() >= 0 and len(counts) == 32 and np.ptp(counts) <= 8
    islands, total, square = made.facts[:3]
    truth = (0.9**2 - 0.1**2) / 2
    error = math.sqrt((square / islands - (total / islands) ** 2) / (islands - 1)) + 1e-3
    assert abs(total / islands - truth) < 5 * error
    # the density of a difference d of two uniform places is 1 - d; the left one is uniform in what it leaves
    apart = made.rows[3] - made.rows[0]
    low = 0.1 + 0.025 * made.cell
    within = ((1 - low) ** 2 - (1 - apart) ** 2) / ((1 - low) ** 2 - (1 - low - 0.025) ** 2)
    assert stats.kstest(within, "uniform").pvalue > 1e-3
    assert stats.kstest(made.rows[0] / (1 - apart), "uniform").pvalue > 1e-3
    for row in (1, 2, 4, 5):  # rows that nothing reads
        assert stats.kstest(made.rows[row] / (2 * math.pi if row % 3 == 2 else 1), "uniform").pvalue > 1e-3


def test_several_labels_have_a_product_of_cells():
    text = "left: leftOf(a, b)\nbelow: belowOf(a, b)\nfree: closeTo(a, b, 0.3)"
    plan = planned(text, {"left": Range(0.1, 0.5), "below": Range(0.2, 0.6)}, 256 * 4)
    made = plan.draw(0)
    counts = np.bincount(made.cell, minlength=256)
    assert (counts >= 4).all()
    phi = made.phi
    assert ((phi[0] >= 0.1) & (phi[0] <= 0.5) & (phi[1] >= 0.2) & (phi[1] <= 0.6)).all()
    np.testing.assert_allclose(phi[0], made.rows[3] - made.rows[0])
    assert abs(made.facts[1] / made.facts[0] / ((0.9**2 - 0.5**2) / 2 * (0.8**2 - 0.4**2) / 2) - 1) < 0.1


def test_cells_that_no_scene_reaches_are_left_out():
    """With both differences over 0.1875, mug and plate are over 0.265 apart."""
    text = "task: leftOf(mug, plate) & aboveOf(mug, plate)\nsafe: !closeTo(mug, plate, 0.25)"
    plan = planned(text, {"task": Range(0.0, 0.2), "safe": Range(0.0, 0.2)}, 1000)
    assert set(plan.reached) >= set(range(240)) - {cell for cell in range(256) if cell % 16 == 0}
    assert len(plan.reached) == 255


def test_the_deciding_atom_is_one_more_choice():
    """min(d1, d2) in a band: which of the two is the smaller one comes in equal shares."""
    plan = planned("leftOf(a, b) & leftOf(b, c)", {"task": Range(0.1, 0.12)}, 2000, spread="base")
    assert len(plan.machine.graph.choices) == 1
    made = plan.draw(1)  # larger than the first
    x = made.rows[0::3]
    first = x[1] - x[0] < x[2] - x[1]
    assert abs(first.mean() - 0.5) < 4 * 0.5 / math.sqrt(len(first) / plan.recipe.effect)
    # P(min >= t) of the gaps of three ordered points is (1 - 2 t)^3 / 6
    truth = ((1 - 0.2) ** 3 - (1 - 0.24) ** 3) / 6
    assert abs(made.facts[1] / made.facts[0] / truth - 1) < 0.2
