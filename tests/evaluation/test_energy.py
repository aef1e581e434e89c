import numpy as np
import pytest
from scipy import stats
from scipy.spatial.distance import cdist

from experiments.metrics import energy_test
from scenegen.errors import DataError
from scenegen.learn.evaluation import fidelity as module
from scenegen.scenes.coverage import features


def by_hand(a, b):
    """Szekely and Rizzo's statistic in Mahalanobis distances of the pooled sample."""
    first, second = features(a), features(b)
    inverse = np.linalg.inv(np.cov(np.concatenate([first, second]).T, bias=True))
    between, left, right = (
        cdist(p, q, "mahalanobis", VI=inverse).mean() for p, q in ((first, second), (first, first), (second, second))
    )
    n, m = len(first), len(second)
    return n * m / (n + m) * (2.0 * between - left - right)


def test_the_statistic_is_the_definition_and_blocks_change_nothing(monkeypatch, true_scenes):
    rng = np.random.default_rng(0)
    a, b = true_scenes(rng, 300), true_scenes(rng, 200)
    b[3] += 0.002
    whole = energy_test(a, b, np.random.default_rng(1))
    assert whole.scenes == (300, 200)
    assert whole.statistic == pytest.approx(by_hand(a, b), rel=1e-4)
    monkeypatch.setattr(module, "_BLOCK", 37)
    parts = energy_test(a, b, np.random.default_rng(1))
    assert parts.statistic == pytest.approx(whole.statistic, rel=1e-4)
    assert parts.p == whole.p


def test_the_permuted_statistics_are_those_of_permuted_sets(true_scenes):
    """With 3 + 3 scenes all 20 relabellings are known, so p must come near the exact share."""
    rng = np.random.default_rng(2)
    pooled = true_scenes(rng, 6)
    exact = []
    points = module.whitened(features(pooled)).astype(float)
    distances = cdist(points, points)
    for code in range(64):
        chosen = [bit for bit in range(6) if code >> bit & 1]
        if len(chosen) == 3:
            rest = [bit for bit in range(6) if bit not in chosen]
            across, left, right = (
                distances[np.ix_(*pair)].mean() for pair in ((chosen, rest), (chosen,) * 2, (rest,) * 2)
            )
            exact.append((chosen, 2 * across - left - right))
    for chosen, value in exact[:6]:
        rest = [bit for bit in range(6) if bit not in chosen]
        share = np.mean([other >= value - 1e-4 for _, other in exact])
        p = energy_test(pooled[:, chosen], pooled[:, rest], rng, permutations=1999).p
        assert p == pytest.approx(share, abs=5 * np.sqrt(0.25 / 2000))


@pytest.mark.long
def test_p_is_uniform_under_the_null(true_scenes):
    rng = np.random.default_rng(3)
    p = []
    for _ in range(200):
        p.append(energy_test(true_scenes(rng, 80), true_scenes(rng, 60), rng, permutations=99).p)
    # p takes the values 0.01, 0.02, ..., 1: spread each over its step.
    assert stats.kstest(np.array(p) - rng.random(200) / 100, "uniform").pvalue > 0.01


@pytest.mark.long
@pytest.mark.parametrize("name", ["projected", "perturbed", "shifted", "reflected"])
def test_wrong_samplers_are_seen(name, wrong_scenes):
    right, wrong = wrong_scenes[name]
    for seed in range(3):
        rng = np.random.default_rng(seed)
        assert energy_test(right(rng, 1000), wrong(rng, 1000), rng).p == 0.005
        assert energy_test(right(rng, 1000), right(rng, 1000), rng).p > 0.005


def test_without_whitening_projected_scenes_would_pass(monkeypatch, wrong_scenes):
    """Why the test whitens; see the module's docstring."""
    right, wrong = wrong_scenes["projected"]
    monkeypatch.setattr("experiments.metrics.whitened", lambda points: points.astype(np.float32))
    p = []
    for seed in range(3):
        rng = np.random.default_rng(seed)
        p.append(energy_test(right(rng, 1000), wrong(rng, 1000), rng).p)
    assert max(p) > 0.05


def test_units_and_linear_changes_do_not_matter(true_scenes):
    rng = np.random.default_rng(4)
    a, b = true_scenes(rng, 300), true_scenes(rng, 300)
    plain = energy_test(a, b, np.random.default_rng(5))
    changed = []
    for scenes in (a, b):
        other = scenes.copy()
        other[3] = 100.0 * (scenes[3] - scenes[0]) + 7.0
        other[2] = scenes[2] + 1.0
        changed.append(other)
    moved = energy_test(*changed, np.random.default_rng(5))
    assert moved.statistic == pytest.approx(plain.statistic, rel=1e-3)
    assert moved.p == pytest.approx(plain.p, abs=0.011)


def test_objects_held_in_place_do_not_matter(true_scenes):
    rng = np.random.default_rng(6)
    a, b = true_scenes(rng, 200), true_scenes(rng, 200)
    fixed = np.repeat([[0.3], [0.7], [1.0]], 200, axis=1)
    plain = energy_test(a, b, np.random.default_rng(7))
    held = energy_test(np.concatenate([a, fixed]), np.concatenate([b, fixed]), np.random.default_rng(7))
    assert held.statistic == pytest.approx(plain.statistic, rel=1e-3)
    nothing = energy_test(fixed, fixed, rng)
    assert (nothing.statistic, nothing.p) == (0.0, 1.0)


def test_the_generator_alone_decides_and_large_sets_are_subsampled(true_scenes):
    rng = np.random.default_rng(8)
    a, b = true_scenes(rng, 500), true_scenes(rng, 90)
    first, again = (energy_test(a, b, np.random.default_rng(9), most=100) for _ in range(2))
    assert first == again
    assert first.scenes == (100, 90)
    assert energy_test(a, b, np.random.default_rng(10), most=100).statistic != first.statistic


def test_bad_input_is_a_diagnostic():
    rng, scenes = np.random.default_rng(0), np.zeros((3, 5))
    with pytest.raises(ValueError, match=r"least|from 0"):
        energy_test(scenes, scenes, rng, permutations=0)
    with pytest.raises(ValueError, match=r"least|from 0"):
        energy_test(scenes, scenes, rng, most=1)
    with pytest.raises(DataError):
        energy_test(scenes, np.zeros((3, 1)), rng)
    with pytest.raises(DataError):
        energy_test(scenes, np.zeros((6, 5)), rng)
