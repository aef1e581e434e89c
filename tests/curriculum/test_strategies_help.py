"""Which strategies help whom: a learner for whom a curriculum must help, and one for whom none can."""

import numpy as np
import pytest

from scenegen.curriculum.strategies import STRATEGIES

from .learners import Chain, Separate, episodes

SEEDS = (0, 1, 2)
CLOCKS = {"linear": {"episodes": 600}, "ordered": {"scenes": 600}}
# at most so much of uniform's episodes; measured 0.26, 0.26, 0.36, 0.5, 0.65, 0.8, 0.7, 0.8 over ten seeds
HELP = {"ordered": 0.4, "linear": 0.4, "self_paced": 0.55, "reverse": 0.7, "learnability": 0.85, "replay": 0.95,
        "teacher": 0.95}  # fmt: skip
NO_HELP = {"alp_gmm", "exp3s"}  # on this learner: it is done before they know what it learns from


@pytest.fixture(scope="module")
def baseline():
    return np.mean([episodes("uniform", Chain, seed) for seed in SEEDS])


def test_every_strategy_is_judged():
    assert {"uniform", *HELP, *NO_HELP} == set(STRATEGIES)


@pytest.mark.parametrize("name", HELP)
def test_where_levels_build_on_each_other_it_helps(name, baseline):
    taken = np.mean([episodes(name, Chain, seed, **CLOCKS.get(name, {})) for seed in SEEDS])
    assert taken < HELP[name] * baseline


@pytest.mark.parametrize("name", sorted(NO_HELP))
def test_those_that_do_not_help_cost_little(name, baseline):
    taken = np.mean([episodes(name, Chain, seed) for seed in SEEDS])
    assert 0.6 * baseline < taken < 2.0 * baseline


@pytest.mark.parametrize("name", ["linear", "self_paced", "reverse"])
def test_of_two_labels_too(name):
    """The easy corner is a hundredth of the square: uniform scenes hardly ever show it."""
    uniform = episodes("uniform", Chain, 0, labels=2)
    assert episodes(name, Chain, 0, labels=2, **CLOCKS.get(name, {})) < 0.3 * uniform


@pytest.mark.parametrize("name", [name for name in STRATEGIES if name != "uniform"])
def test_where_levels_are_separate_nothing_beats_evenly(name):
    settings = {"linear": {"episodes": 300}, "ordered": {"scenes": 300}}.get(name, {})
    even = np.mean([episodes("uniform", Separate, seed) for seed in SEEDS])
    taken = np.mean([episodes(name, Separate, seed, **settings) for seed in SEEDS])
    assert taken > 0.75 * even
