"""The judge of specs with priors: its draws are what they say, it knows a wrong sampler, and every case is a spec."""

import math

import numpy as np
import pytest
from scipy import stats

from experiments.priors.cases import CASES
from experiments.priors.draws import Draws, disc, polygon, turned_box
from experiments.priors.judge import compare
from experiments.priors.truth import fit, plain_rejection, spec_of

N = 20_000
LEAST_P = 1e-4  # of a right sample less than one in ten thousand


def draws(seed=0):
    return Draws(np.random.default_rng(seed), N)


@pytest.mark.parametrize(("middle", "deviation"), [(0.4, 0.05), (1.1, 0.3), (-0.17, 0.02)])
def test_a_normal_is_cut_off_at_the_workspace(middle, deviation):
    x, y = draws().normal(middle, 0.5, deviation)
    of = stats.truncnorm(-middle / deviation, (1.0 - middle) / deviation, middle, deviation)
    assert stats.kstest(x, of.cdf).pvalue > LEAST_P
    assert 0.0 <= min(x.min(), y.min()) <= max(x.max(), y.max()) <= 1.0


def test_a_relative_normal_is_cut_off_at_each_place_by_itself():
    d = draws()
    x, y = d.anywhere()
    near, _ = d.normal(x, y, 0.1)
    of = stats.truncnorm(-x / 0.1, (1.0 - x) / 0.1, x, 0.1)
    assert stats.kstest(of.cdf(near), "uniform").pvalue > LEAST_P  # the first still is uniform, whatever is cut off


@pytest.mark.parametrize(
    ("is_inside", "area"),
    [
        (disc(0.9, 0.5, 0.1), math.pi * 0.01),
        (turned_box(0.5, 0.5, 0.5, 0.4, 0.2), 0.08),
        (polygon([(0.2, 0.2), (0.8, 0.2), (0.2, 0.8)]), 0.18),
    ],
)
def test_regions_are_those_that_are_meant(is_inside, area):
    share = is_inside(*draws().anywhere()).mean()
    assert abs(share - area) < 4.0 * math.sqrt(area * (1.0 - area) / N)
    assert is_inside(*draws().uniform(is_inside)).all()


def test_rows_are_drawn_whole_and_stay_in_the_workspace():
    rows = np.array([[(0.0, 0.5, 0.0), (0.1, 0.5, 0.0)], [(1.0, 0.2, 0.0), (0.9, 0.2, 0.0)]])
    ((x, _), _), ((u, _), heading) = draws().recorded(rows, 0.05, 0.1)
    assert abs((x < 0.5).mean() - 0.5) < 0.02
    assert ((x < 0.5) == (u < 0.5)).all()
    assert stats.kstest(x[x < 0.5], stats.uniform(0.0, 0.05).cdf).pvalue > LEAST_P
    assert (np.abs(np.mod(heading + 0.1, math.tau) - 0.1) <= 0.1 + 1e-12).all()


@pytest.mark.parametrize("name", CASES)
def test_a_case_has_the_objects_of_its_spec(name):
    case = CASES[name]
    uniform, spec = spec_of(case, priors=False), spec_of(case, priors=True)
    assert spec.objects == uniform.objects
    drawn = case.draw(Draws(np.random.default_rng(0), 64))
    rows = np.array([one for (x, y), heading in drawn.poses for one in (x, y, heading)])
    surfaces = np.array([*(drawn.surfaces or {}).values()]).reshape(-1, 64)
    assert fit(uniform, rows, surfaces, case.phi).shape == (64,)


def test_the_judge_passes_the_truth_and_rejects_a_wider_prior():
    case = CASES["narrow"]
    one, other = (plain_rejection(case, 10_000, 60.0, seed).rows[:, :10_000] for seed in (1, 2))
    assert abs(plain_rejection(case, 4_000, 60.0, 3).log10 - plain_rejection(case, 4_000, 60.0, 4).log10) < 0.1
    right = compare(one, other, ("mug", "plate"), 1.0, np.random.default_rng(0))
    assert right.energy > 0.01
    assert max(right.marginal, right.sliced) < 0.03
    wrong = other.copy()
    wrong[:2] = np.array([[0.4], [0.3]]) + 1.15 * (other[:2] - np.array([[0.4], [0.3]]))
    found = compare(one, wrong, ("mug", "plate"), 1.0, np.random.default_rng(0))
    assert found.row in ("x(mug)", "y(mug)")
    assert not found.passes
