"""The bars of issue C at a size for every day: one spec per sampler, and the wrong samplers seen. The whole of it, with
n = 20,000 and nine specs, is tests/slow/test_exactness.py."""

import math

import numpy as np
import pytest
from scipy import stats

import scenegen
from scenegen.lang.checker import check_text
from scenegen.lang.formula.core import Core
from scenegen.lang.formula.interpret import evaluate

from .doubles import DOUBLES
from .plain import CASES, fits, setting_probability, truth, uniform
from .verdict import judge, uniform_p

N = 4000
SEEDS = range(3)


@pytest.mark.parametrize("name", CASES)
def test_phi_by_hand_is_the_interpreters(name):
    """Scene by scene in plain floats, in the range, near it and anywhere; requirements alike."""
    case, core = CASES[name], check_text(CASES[name].text, name).core
    rng = np.random.default_rng(0)
    near = truth(case, 100, rng)
    rows = np.concatenate([near, near + 0.02 * rng.standard_normal(near.shape), uniform(case, 100, rng)], axis=1)
    rows = rows[:, ((rows[2::3] >= 0) & (rows[2::3] < 2 * math.pi)).all(axis=0)]
    compared = 0
    for scene, mine in zip(rows.T, case.phi(rows).T, strict=True):
        values = evaluate(core, scene.tolist())
        theirs = [values[node] for node in core.labels.values()]
        if case.box is None or min(theirs) > 0:  # the published reading is written out for phi > 0 alone
            np.testing.assert_allclose(mine, theirs, rtol=0, atol=1e-14)
            compared += 1
        if case.required is not None:
            assert case.required(scene[:, None])[0] == (_requirement(core, values) >= 0)
    assert compared >= 100


def _requirement(core: Core, values):
    assert core.requirement is not None
    margin = values[core.requirement]
    assert abs(margin) > 1e-9  # two ways of rounding must not decide
    return margin


@pytest.fixture(scope="module")
def true():
    return [truth(CASES["exp1"], N, np.random.default_rng([seed, 77])) for seed in SEEDS]


@pytest.mark.long
@pytest.mark.parametrize("method", ["rejection", "splitting"])
def test_scenes_are_the_truth(method, true):
    case = CASES["exp1"]
    verdicts = []
    for seed in SEEDS:
        scenes = scenegen.sample(
            scenegen.parse(case.text), case.ranges, N, seed=seed, method=method, spread="base", workers=1
        )
        assert scenes.header.sampler["method"] == method
        rows = scenes.poses.reshape(N, -1).T
        assert fits(case, rows).all() and len(np.unique(rows, axis=1).T) == N
        verdicts.append(judge(true[seed], rows, np.random.default_rng([seed, 78])))
    assert sum(verdict.alike for verdict in verdicts) >= 2, verdicts


@pytest.mark.long
@pytest.mark.parametrize("double", DOUBLES)
def test_wrong_samplers_are_seen(double, true):
    case = CASES["exp1"]
    for seed in SEEDS[:1]:  # the slow tests take them all, more scenes and more specs
        wrong = DOUBLES[double](case, N, np.random.default_rng([seed, 79]))
        assert fits(case, wrong).all()
        assert not judge(true[seed], wrong, np.random.default_rng([seed, 80])).alike


@pytest.mark.parametrize("name", [name for name, case in CASES.items() if case.answers])
def test_plain_rejection_is_what_the_formula_says(name):
    """The truth and the analytic answers, which the samplers are held against, agree with each other."""
    p = [uniform_p(CASES[name].answers(truth(CASES[name], N, np.random.default_rng([seed, 81])))) for seed in SEEDS]
    assert sum(one > 0.01 for one in p) >= 2, p


@pytest.mark.parametrize("published", [False, True])
def test_the_integral_of_experiment_2_is_what_plain_rejection_counts(published):
    case = CASES["setting, published" if published else "setting"]
    low, high = np.array(case.box).T
    rows = low[:, None] + (high - low)[:, None] * np.random.default_rng(5).random((len(low), 400_000))
    size = np.tile([1.0, 1.0, 2 * math.pi], 4)
    expected = setting_probability(*case.ranges["task"], published) / float(np.prod((high - low) / size))
    counted = int(fits(case, rows).sum())
    assert stats.binomtest(counted, rows.shape[1], expected).pvalue > 0.001
