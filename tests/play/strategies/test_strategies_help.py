"""Which strategies help whom: learners for whom a curriculum must help, and one for whom none can.

Figures in comments are those of benchmarks/strategies.py over ten seeds, as shares of uniform's episodes.
"""

from functools import partial

import numpy as np
import pytest

from scenegen.play.strategies import STRATEGIES

from .learners import Chain, Separate, episodes

QUICK, SLOW = partial(Chain, rate=0.2), partial(Chain, rate=0.05)
# measured 0.26, 0.26, 0.47, 0.42, 0.56, 0.41, 0.49, 0.60, 0.54
SLOW_HELP = {"ordered": 0.4, "linear": 0.4, "self_paced": 0.6, "reverse": 0.6, "learnability": 0.7, "alp_gmm": 0.6,
             "replay": 0.7, "teacher": 0.8, "exp3s": 0.8}  # fmt: skip
# measured 0.26, 0.26, 0.40, 0.53, 0.66
QUICK_HELP = {"ordered": 0.4, "linear": 0.4, "self_paced": 0.55, "reverse": 0.7, "learnability": 0.85}
# measured 0.85, 0.74, 0.74, 1.31: it is done before they have found out what it learns from
TOO_QUICK_FOR = {"alp_gmm", "replay", "teacher", "exp3s"}
# not measured: baselines, which need not help
NO_HELP = {
    "uniform",
}


def clock(name, episodes):
    """What the strategies that go by the clock are told of the learner's pace."""
    return {"linear": {"episodes": episodes}, "ordered": {"scenes": episodes}}.get(name, {})


def mean(name, learner, seeds, **settings):
    return np.mean([episodes(name, learner, seed, **settings) for seed in range(seeds)])


@pytest.fixture(scope="module")
def quick():
    return mean("uniform", QUICK, 3)


@pytest.fixture(scope="module")
def slow():
    return mean("uniform", SLOW, 1)


def test_every_strategy_is_judged():
    assert {*NO_HELP, *SLOW_HELP} == {*NO_HELP, *QUICK_HELP, *TOO_QUICK_FOR} == set(STRATEGIES)


@pytest.mark.long
@pytest.mark.parametrize("name", SLOW_HELP)
def test_where_levels_build_on_each_other_all_help(name, slow):
    assert mean(name, SLOW, 1, **clock(name, 2400)) < SLOW_HELP[name] * slow


@pytest.mark.parametrize("name", QUICK_HELP)
def test_a_quick_learner_is_helped_by_those_that_know_the_way(name, quick):
    assert mean(name, QUICK, 3, **clock(name, 600)) < QUICK_HELP[name] * quick


@pytest.mark.long
@pytest.mark.parametrize("name", sorted(TOO_QUICK_FOR))
def test_those_that_have_to_find_it_out_hardly_help_a_quick_learner(name, quick):
    assert 0.6 * quick < mean(name, QUICK, 2) < 1.8 * quick


@pytest.mark.parametrize("name", ["linear", "self_paced", "reverse"])
def test_of_two_labels_more_so(name):
    """The easiest level is a 400th of the square: uniform scenes hardly ever show it."""
    uniform = episodes("uniform", Chain, 0, labels=2)
    assert episodes(name, Chain, 0, labels=2, **clock(name, 600)) < 0.3 * uniform


@pytest.mark.parametrize("name", [name for name in STRATEGIES if name != "uniform"])
def test_where_levels_are_separate_nothing_beats_evenly(name):
    assert mean(name, Separate, 3, **clock(name, 300)) > 0.75 * mean("uniform", Separate, 3)
