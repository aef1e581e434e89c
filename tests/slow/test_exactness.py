"""The exact samplers against the truth, at n = 20,000 and five seeds; and what the same tests say of wrong samplers.

Ten minutes on one core. Each test prints the lines of docs/experiments/exactness.md that it measures:

    python -m pytest -m slow tests/slow/test_exactness.py -s | grep '^|'
"""

import functools
import math

import numpy as np
import pytest
from scipy import stats

import scenegen
from experiments.metrics import chi_square

from ..sampling.doubles import DOUBLES
from ..sampling.plain import CASES, fits, proposed, setting_probability, shipped, sorting, truth
from ..sampling.verdict import LEAST_P, judge, row, uniform_p

pytestmark = pytest.mark.slow

N = 20_000
SEEDS = range(5)
METHODS = ("rejection", "splitting", "growth")
SIZES = {"growth": 5000}  # scenes of a seed, where not N


def sampled(text, ranges, method, seed, n=N, spread="base"):
    """Rows (3N, n) by the public call, which are all different, and what the header says."""
    scenes = scenegen.sample(
        scenegen.parse(text), ranges, n, seed=seed, method=method, spread=spread, timeout=600.0, workers=1
    )
    rows = scenes.poses.reshape(n, -1).T
    assert scenes.header.sampler["method"] == method
    assert len(np.unique(rows, axis=1).T) == n
    return rows, scenes


@functools.lru_cache(maxsize=64)
def made(name, method, seed):
    case = CASES[name]
    rows, scenes = sampled(case.text, case.ranges, method, seed, SIZES.get(method, N))
    assert fits(case, rows).all()
    if method == "growth":  # it says how many independent scenes its own are worth: as many are judged
        return rows[:, : int(rows.shape[1] * scenes.header.sampler["effective_share"])]
    return rows


@functools.lru_cache(maxsize=64)
def true(name, seed):
    return truth(CASES[name], N, generator(seed, name))


def generator(seed, *words):
    """Random numbers of a test's own, apart from those of every other."""
    return np.random.default_rng([seed, *(ord(letter) for word in words for letter in word)])


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("method", METHODS)
def test_scenes_are_the_truth(name, method):
    verdicts = []
    for seed in SEEDS:
        scenes = made(name, method, seed)
        verdicts.append(judge(true(name, seed)[:, : scenes.shape[1]], scenes, generator(seed, name, method)))
    print("\n" + row(f"{name}: {method}", verdicts))
    for key in ("energy", "screen"):
        assert sum(getattr(verdict, key) > LEAST_P for verdict in verdicts) >= 4, verdicts
    assert all(verdict.covers for verdict in verdicts), verdicts


@pytest.mark.parametrize("name", [name for name, case in CASES.items() if case.answers])
@pytest.mark.parametrize("method", METHODS)
def test_scenes_are_what_the_formula_says(name, method):
    p = [uniform_p(CASES[name].answers(made(name, method, seed))) for seed in SEEDS]
    print(f"\n| {name}: {method} | {min(p):.2g} - {max(p):.2g} | {sum(one > LEAST_P for one in p)} of 5 |")
    assert sum(one > LEAST_P for one in p) >= 4, p


# A heading that moves onto a uniform value of its range, from either side, is as right as one drawn there.
RIGHT_AFTER_ALL = {("heading", "onto levels of the range")}


@pytest.mark.parametrize("name", [name for name in CASES if "published" not in name])
@pytest.mark.parametrize("double", DOUBLES)
def test_wrong_samplers_are_rejected_on_every_seed(name, double):
    verdicts = []
    for seed in SEEDS:
        wrong = DOUBLES[double](CASES[name], N, generator(seed, name, double))
        assert fits(CASES[name], wrong).all()
        # the issue's own specs are judged by all three bars, the others by as many as it takes
        short = name not in ("exp1", "sort_3")
        verdicts.append(judge(true(name, seed), wrong, generator(seed, name), short=short))
    print("\n" + row(f"{name}: {double}", verdicts))
    alike = sum(verdict.alike for verdict in verdicts)
    assert alike >= 4 if (name, double) in RIGHT_AFTER_ALL else alike == 0, verdicts


@pytest.mark.parametrize("name", ["setting", "setting, published"])
def test_the_samplers_agree_on_experiment_2(name):
    two = ("rejection", "splitting")
    verdicts = [judge(*(made(name, method, seed) for method in two), generator(seed, name)) for seed in SEEDS]
    print("\n" + row(f"{name}: rejection against splitting", verdicts))
    assert sum(verdict.alike for verdict in verdicts) >= 4, verdicts


PROBABILITIES = [("table_setting", False), ("table_setting_published", True)]


@pytest.mark.parametrize(("name", "published"), PROBABILITIES)
def test_the_probability_of_experiment_2_is_the_published_one(name, published):
    """What the samplers are held against: the integral agrees with the figures that are known from long runs."""
    exact = setting_probability(0.0175, 0.0425, published)
    assert round(exact * 1e8) / 1e8 == {False: 2.95e-6, True: 2.18e-6}[published]


@pytest.mark.parametrize(("name", "published"), PROBABILITIES)
# Splitting's estimate scatters by 4 to 5 % at 20,000 scenes, as its error bar says; 200,000 bring it within the bar.
@pytest.mark.parametrize(("method", "n"), [("rejection", N), ("splitting", N), ("splitting", 10 * N)])
def test_the_probability_of_experiment_2(name, published, method, n):
    exact = setting_probability(0.0175, 0.0425, published)
    off, inside = [], []
    for seed in SEEDS:
        _, scenes = sampled(shipped(name), {"task": (0.0175, 0.0425)}, method, seed, n)
        info = scenes.header.sampler
        off.append(10 ** info["log10_probability"] / exact - 1)
        inside.append(abs(info["log10_probability"] - math.log10(exact)) <= info["log10_error"])
    shown = ", ".join(f"{100 * one:+.2f} %" for one in off)
    print(f"\n| {name}: {method}, n = {n:,} | {exact:.4g} | {shown} | {sum(inside)} of 5 |")
    assert sum(inside) >= 4
    if (method, n) != ("splitting", N):
        assert max(map(abs, off)) < 0.05


@pytest.mark.parametrize("name", ["sort_3", "sort_7"])
@pytest.mark.parametrize("method", ["rejection", "splitting"])  # growth: see test_growth.py
def test_the_four_orders_come_in_equal_shares(name, method):
    """Each scene counts for the order that decides phi; the four have the same probability by symmetry."""
    counts = []
    for seed in SEEDS:
        rows, _ = sampled(shipped(name), {"sorted": (0.0375, 0.0625)}, method, seed)
        counts.append(np.bincount(sorting(rows).argmax(axis=0), minlength=4))
    tests = [chi_square(one) for one in counts]
    together = float(stats.chi2.sf(sum(one.statistic for one in tests), sum(one.degrees for one in tests)))
    p = [one.p for one in tests]
    shares = np.array(counts) / N
    print(
        f"\n| {name}: {method} | {min(p):.2g} - {max(p):.2g} | {sum(one > LEAST_P for one in p)} of 5 "
        f"| {together:.2g} | {shares.min():.3f} - {shares.max():.3f} |"
    )
    assert sum(one > LEAST_P for one in p) >= 4, p
    assert together > 0.001


EVEN = {
    # mug and plate over 0.1875 apart along x and y are over 0.265 apart: that cell of `safe` is not to be had
    "exp1": ({"task": (0.0, 0.2), "safe": (0.0, 0.2)}, 16, 255),
    "setting": ({"task": (0.01, 0.06)}, 32, 32),
    "boxes": ({"task": (0.0, 0.15)}, 32, 32),
}


@pytest.mark.parametrize("name", EVEN)
@pytest.mark.parametrize("method", ["rejection", "splitting"])
def test_scenes_are_even_over_the_cells_and_right_within(name, method):
    ranges, along, reachable = EVEN[name]
    case = CASES[name]
    cells = along ** len(ranges)
    verdicts = []
    for seed in SEEDS:
        rows, _ = sampled(case.text, ranges, method, seed, spread="flat")
        counts = np.bincount(cell_of(case, ranges, along, rows), minlength=cells)
        reached = counts > 0
        assert reached.sum() == reachable
        assert chi_square(counts[reached]).p > LEAST_P
        assert np.ptp(counts[reached]) <= 1
        verdicts.append(judge(even(case, ranges, along, counts, generator(seed, name)), rows, generator(seed, method)))
    print("\n" + row(f"{name}, flat: {method}", verdicts))
    assert sum(verdict.alike for verdict in verdicts) >= 4, verdicts


def cell_of(case, ranges, along, rows):
    """The cell of each scene, (B,); -1 out of range."""
    cell = np.zeros(rows.shape[1], dtype=int)
    inside = np.ones(rows.shape[1], dtype=bool) if case.required is None else case.required(rows)
    for value, (low, high) in zip(case.phi(rows), ranges.values(), strict=True):
        cell = cell * along + np.clip(((value - low) / (high - low) * along).astype(int), 0, along - 1)
        inside &= (value >= low) & (value <= high)
    return np.where(inside, cell, -1)


def even(case, ranges, along, counts, rng):
    """Plain rejection, cell by cell: the first scenes of each, as many as `counts` says, (3N, n)."""
    lacking = counts.copy()
    kept = []
    while lacking.any():
        rows = proposed(case, 1 << 18, rng)
        cell = cell_of(case, ranges, along, rows)
        for wanted in np.unique(cell[cell >= 0]):
            mine = np.flatnonzero(cell == wanted)[: lacking[wanted]]
            lacking[wanted] -= len(mine)
            kept.append(rows[:, mine])
    scenes = np.concatenate(kept, axis=1)
    return scenes[:, rng.permutation(scenes.shape[1])]
