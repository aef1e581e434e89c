"""."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats
from scipy.spatial import KDTree
from scipy.spatial.distance import cdist

from experiments import metrics as module_duplicates
from experiments.metrics import chi_square, duplicates, energy_test, precision_recall, training_distances
from scenegen.errors import DataError
from scenegen.learn.evaluation import fidelity as module
from scenegen.scenes import coverage as coverage_neighbours
from scenegen.scenes.coverage import coverage, features, kth_squared, least_squared, nearest


def test_agrees_with_scipy():
    rng = np.random.default_rng(0)
    for classes in (2, 4, 32, 256):
        shares = rng.random(classes) + 0.1
        counts = rng.multinomial(50 * classes, shares / shares.sum())
        for expected in (None, shares):
            wanted = None if expected is None else shares / shares.sum() * counts.sum()
            theirs = stats.chisquare(counts, wanted)
            ours = chi_square(counts, expected)
            assert ours.degrees == classes - 1
            assert ours.statistic == pytest.approx(theirs.statistic)
            assert ours.p == pytest.approx(theirs.pvalue, rel=1e-9, abs=1e-290)


def test_p_is_uniform_for_right_shares():
    rng = np.random.default_rng(1)
    p = [chi_square(counts).p for counts in rng.multinomial(4000, np.full(8, 1 / 8), size=400)]
    assert stats.kstest(p, "uniform").pvalue > 0.01


def test_shares_that_scatter_too_much_are_rejected():
    """Four orderings at 20,000 scenes, two of them off by 0.02, as survivors of few ancestors are."""
    rng = np.random.default_rng(2)
    for counts in rng.multinomial(20_000, [0.27, 0.23, 0.25, 0.25], size=20):
        assert chi_square(counts).p < 1e-4


@pytest.mark.parametrize(
    ("counts", "expected", "title"),
    [
        ([5], None, "counts of shape"),
        ([[5, 5], [5, 5]], None, "counts of shape"),
        ([5, 5], [1, 1, 1], "counts of shape"),
        ([5, -1], None, "not a whole number"),
        ([5.5, 4.5], None, "not a whole number"),
        ([5, np.nan], None, "not a whole number"),
        ([5, 5], [1, 0], "not positive"),
        ([0, 0], None, "0 scenes are expected"),
        ([3, 3], [1, 99], "0.06 scenes are expected"),
    ],
)
def test_bad_input_is_a_diagnostic(counts, expected, title):
    with pytest.raises(ValueError, match=title):
        chi_square(counts, expected)


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
    points = module.whiten(features(pooled)).astype(float)
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
    monkeypatch.setattr("experiments.metrics.whiten", lambda points: points.astype(np.float32))
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


def test_bad_input_is_a_diagnostic_energy():
    rng, scenes = np.random.default_rng(0), np.zeros((3, 5))
    with pytest.raises(ValueError, match=r"least|from 0"):
        energy_test(scenes, scenes, rng, permutations=0)
    with pytest.raises(ValueError, match=r"least|from 0"):
        energy_test(scenes, scenes, rng, most=1)
    with pytest.raises(DataError):
        energy_test(scenes, np.zeros((3, 1)), rng)
    with pytest.raises(DataError):
        energy_test(scenes, np.zeros((6, 5)), rng)


def by_hand_manifold(points, queries, k):
    """Share of queries inside the ball of any point, by the definition."""
    among = np.linalg.norm(points[:, None] - points[None], axis=2)
    radius = np.sort(among, axis=1)[:, k]
    return (np.linalg.norm(queries[:, None] - points[None], axis=2) <= radius[None]).any(axis=1).mean()


@pytest.mark.parametrize("k", [1, 3, 7])
def test_agrees_with_the_definition(k, true_scenes):
    rng = np.random.default_rng(0)
    reference, generated = true_scenes(rng, 150), true_scenes(rng, 120)
    generated[0] += 0.05
    figures = precision_recall(reference, generated, neighbours=k)
    truth, made = features(reference), features(generated)
    assert figures.precision == by_hand_manifold(truth, made, k)
    assert figures.recall == by_hand_manifold(made, truth, k)
    assert precision_recall(generated, reference, neighbours=k).precision == figures.recall


def test_what_the_two_tell_apart(true_scenes):
    rng = np.random.default_rng(1)
    reference = true_scenes(rng, 1000)
    fresh = precision_recall(reference, true_scenes(rng, 1000))
    assert fresh.precision > 0.85
    assert fresh.recall > 0.85
    collapsed = np.repeat(true_scenes(rng, 5), 200, axis=1)
    collapsed += 0.002 * rng.standard_normal(collapsed.shape)
    narrow = precision_recall(reference, collapsed)
    assert narrow.precision > 0.7
    assert narrow.recall < 0.01
    everywhere = rng.random((6, 1000)) * np.array([1.0, 1.0, 2 * np.pi] * 2)[:, None]
    wide = precision_recall(reference, everywhere)
    assert wide.precision < 0.2
    assert wide.recall > 0.8
    # What Naeem et al. hold against recall: it believes in balls of outliers. Coverage does not.
    assert coverage(reference, everywhere) < 0.5


def test_bad_input_is_a_diagnostic_manifold():
    with pytest.raises(DataError):
        precision_recall(np.zeros((3, 3)), np.zeros((3, 10)))
    with pytest.raises(DataError):
        precision_recall(np.zeros((3, 10)), np.zeros((3, 3)))
    with pytest.raises(ValueError, match=r"least|from 0"):
        precision_recall(np.zeros((3, 10)), np.zeros((3, 10)), neighbours=0)


@pytest.fixture(params=[(16, 256, 64), (3, 20, 7), (1, 1, 1)])
def tiles(request, monkeypatch):
    """The same answers whatever the tiles: one, several, single distances."""
    for name, value in zip(("_STACK", "_WIDTH", "_QUERIES"), request.param, strict=True):
        monkeypatch.setattr(coverage_neighbours, name, value)


@pytest.mark.long
@pytest.mark.usefixtures("tiles")
def test_against_a_tree():
    rng = np.random.default_rng(0)
    points, queries = rng.random((300, 5)), rng.random((40, 5))
    points[17] = queries[3]
    distance, index = KDTree(points).query(queries)
    found, where = nearest(queries, points)
    assert found == pytest.approx(distance, abs=1e-15)
    assert (where == index).all()
    assert found[3] == 0.0
    assert least_squared(queries, points) == pytest.approx(distance**2, abs=1e-14)
    weights = rng.random(300)
    power = ((queries[:, None] - points[None]) ** 2).sum(axis=2) + weights
    assert least_squared(queries, points, weights) == pytest.approx(power.min(axis=1), abs=1e-14)
    few = points[:60]
    tree = KDTree(few)
    for k in (1, 4, 59):
        assert np.sqrt(kth_squared(few, k)) == pytest.approx(tree.query(few, k=k + 1)[0][:, k], abs=1e-7)


def test_classes_find_the_same_as_sorting():
    rng = np.random.default_rng(1)
    points = rng.random((5000, 2))
    points[2000:2010] = points[100]  # the ten nearest of a point may share a class
    for k in (1, 5, 12):
        exact = KDTree(points).query(points, k=k + 1)[0][:, k]
        assert np.sqrt(kth_squared(points, k)) == pytest.approx(exact, abs=1e-7)


def test_weights_make_balls():
    points, radius = np.array([[0.0, 0.0], [1.0, 0.0]]), np.array([0.5, 0.2])
    queries = np.array([[0.4, 0.0], [0.6, 0.0], [0.9, 0.0], [1.0, 0.3]])
    assert (least_squared(queries, points, -(radius**2)) <= 0.0).tolist() == [True, False, True, False]


TURN = 2.0 * np.pi


def by_hand_duplicates(rows, tolerance):
    """Scenes with an earlier one within the tolerance in every coordinate, pair by pair."""
    count = 0
    for later in range(rows.shape[1]):
        for earlier in range(later):
            apart = np.abs(rows[:, later] - rows[:, earlier])
            apart[2::3] = np.minimum(np.mod(apart[2::3], TURN), TURN - np.mod(apart[2::3], TURN))
            if (apart <= tolerance).all():
                count += 1
                break
    return count / rows.shape[1]


@given(st.integers(0, 2**32), st.integers(1, 40), st.sampled_from([3, 8, 40]), st.sampled_from([1, 16]))
def test_agrees_with_all_pairs(seed, scenes, levels, small):
    """Coordinates on a lattice finer than the tolerance, some jittered: chains, ties, the seam of theta."""
    rng = np.random.default_rng(seed)
    rows = (rng.integers(levels, size=(6, scenes)) - levels // 2) * 0.005
    rows *= rng.integers(2, size=6)[:, None]  # few coordinates vary: long chains
    rows = rows + 0.0004 * rng.random(rows.shape) * rng.integers(2, size=scenes)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module_duplicates, "_SMALL", small)
        found = duplicates(rows, tolerance=0.0127)
    rows[2::3] = np.mod(rows[2::3], TURN)
    assert found.exact == by_hand_duplicates(rows, 0.0)
    assert found.near == by_hand_duplicates(rows, 0.0127)


def test_definition():
    one = np.array([[0.5], [0.5], [0.0]])
    rows = np.repeat(one, 5, axis=1)
    rows[0, 1] += 4e-7  # near
    rows[0, 2] += 0.1  # another
    rows[2, 3] = TURN  # the same heading
    rows[2, 4] = TURN - 4e-7  # near, across the seam
    found = duplicates(rows)
    assert (found.exact, found.near, found.tolerance) == (0.2, 0.6, 1e-6)


def test_many_scenes():
    rng = np.random.default_rng(0)
    rows = rng.random((6, 100_000))
    assert duplicates(rows).near == 0.0
    rows[:, 60_000:] = rows[:, rng.integers(60_000, size=40_000)]
    rows[0, 80_000:] += 5e-7
    found = duplicates(rows[:, rng.permutation(100_000)])
    assert found.near == 0.4
    distinct = len(np.unique(rows, axis=1).T)
    assert found.exact == pytest.approx(1.0 - distinct / 100_000, abs=1e-12)


def test_a_collapsed_set_and_one_with_fixed_objects_are_quick():
    rng = np.random.default_rng(1)
    rows = np.repeat(rng.random((6, 1)), 50_000, axis=1)
    assert duplicates(rows).exact == 1.0 - 1 / 50_000
    near = rows + 1e-8 * rng.standard_normal(rows.shape)
    assert (duplicates(near).exact, duplicates(near).near) == (0.0, 1.0 - 1 / 50_000)
    rows[3:] = rng.random((3, 50_000))
    assert duplicates(rows).near == 0.0


def test_bad_input_is_a_diagnostic_duplicates():
    for tolerance in (-1e-9, 1.0, float("nan")):
        with pytest.raises(ValueError, match=r"least|from 0"):
            duplicates(np.zeros((3, 2)), tolerance=tolerance)
    with pytest.raises(DataError):
        duplicates(np.full((3, 2), np.nan))
    assert duplicates(np.zeros((3, 0))).exact == 0.0


def test_agrees_with_all_distances(true_scenes):
    rng = np.random.default_rng(0)
    training, generated = true_scenes(rng, 400), true_scenes(rng, 90)
    generated[:, 7] = training[:, 33]
    exact = cdist(features(generated), features(training)).min(axis=1)
    found = training_distances(generated, training, levels=(0.0, 0.3, 1.0))
    assert found.levels == (0.0, 0.3, 1.0)
    assert found.quantiles == pytest.approx(np.quantile(exact, [0.0, 0.3, 1.0]), abs=1e-12)
    assert found.quantiles[0] == 0.0
    assert found.mean == pytest.approx(exact.mean())


def test_a_memoriser_is_nearer_than_fresh_scenes(true_scenes):
    rng = np.random.default_rng(1)
    training = true_scenes(rng, 1000)
    copied = training[:, rng.integers(1000, size=500)] + 0.003 * rng.standard_normal((6, 500))
    fresh = training_distances(true_scenes(rng, 500), training)
    memorised = training_distances(copied, training)
    assert memorised.quantiles[5] < 0.5 * fresh.quantiles[1]


def test_bad_input_is_a_diagnostic_memorisation():
    scenes = np.zeros((3, 2))
    for levels in ((), (0.5, 1.1), (-0.1,), (float("nan"),)):
        with pytest.raises(ValueError, match=r"least|from 0"):
            training_distances(scenes, scenes, levels=levels)
    with pytest.raises(DataError):
        training_distances(scenes, np.zeros((3, 0)))
