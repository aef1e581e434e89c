"""Figures of generated scenes: what each sees, and what truth scores."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from experiments.metrics import kolmogorov_smirnov, ks_screen, kuiper
from scenegen.errors import DataError
from scenegen.learn.evaluation.fidelity import Fidelity, energy_distance, fidelity, sliced_distance
from scenegen.scenes import coverage as module
from scenegen.scenes.coverage import coverage, features


def scenes(seed, count=600):
    """Two objects: uniform places, headings anywhere."""
    random = np.random.default_rng(seed)
    rows = random.random((6, count))
    rows[2::3] *= 2.0 * np.pi
    return rows


def test_truth_scores_well():
    found = fidelity(scenes(0), scenes(1))
    assert found.coverage > 0.93 and found.ks < 0.12 and found.sliced < 0.14 and abs(found.energy) < 0.01


def test_a_lost_degree_of_freedom_is_seen_by_products_and_not_by_single_coordinates():
    """x and y of the first object, each uniform and tied to each other."""
    made = scenes(1)
    made[1] = np.random.default_rng(2).permutation(made[1])
    noise = 0.2 * np.random.default_rng(3).normal(size=600)
    order = np.argsort(np.argsort(made[0] + noise))
    made[1] = np.sort(made[1])[order]
    found = fidelity(scenes(0), made)
    assert found.ks < 0.12 and found.sliced > 0.2 and found.energy > 0.01


def test_what_is_left_out_and_what_crowds():
    half, crowded = scenes(1), scenes(1)
    half[0] *= 0.5
    crowded[0] **= 2
    assert fidelity(scenes(0), half).coverage < 0.85
    assert fidelity(scenes(0), crowded).ks > 0.2


def test_only_what_phi_depends_on_counts():
    made = scenes(1)
    made[3] = 0.5
    assert fidelity(scenes(0), made).ks > 0.4
    assert fidelity(scenes(0), made, [0, 1, 5]).ks < 0.12
    assert fidelity(scenes(0), made, []) == Fidelity(1.0, 0.0, 0.0, 0.0)


def test_headings_have_no_beginning():
    true, made = scenes(0), scenes(1)
    for rows in (true, made):
        rows[2] = np.random.default_rng(int(1e6 * rows[0, 0])).normal(0.0, 0.2, 600) % (2.0 * np.pi)
    moved = made.copy()
    moved[2] += 2.0 * np.pi
    assert fidelity(true, moved, [2]) == pytest.approx(fidelity(true, made, [2]), abs=1e-6) or (
        fidelity(true, moved, [2]).ks == pytest.approx(fidelity(true, made, [2]).ks, abs=1e-6)
    )


def test_the_energy_distance_is_its_definition():
    random = np.random.default_rng(5)
    a, b = random.normal(size=(40, 3)), random.normal(size=(30, 3)) + 0.5
    pooled = np.concatenate([a, b])
    values, axes = np.linalg.eigh(np.cov(pooled.T, bias=True))
    white = (pooled - pooled.mean(0)) @ (axes / np.sqrt(values))
    apart = np.linalg.norm(white[:, None] - white[None], axis=2)
    expected = 2 * apart[:40, 40:].mean() - apart[:40, :40].sum() / (40 * 39) - apart[40:, 40:].sum() / (30 * 29)
    assert energy_distance(a, b) == pytest.approx(expected, abs=1e-5)


def test_slices_do_not_depend_on_units():
    a, b = np.random.default_rng(0).normal(size=(2, 300, 1))
    assert sliced_distance(a, b) == 0.0  # one coordinate has no slices
    a, b = np.random.default_rng(0).normal(size=(2, 300, 2))
    assert 0.0 < sliced_distance(a, b) == pytest.approx(sliced_distance(10 * a, 10 * b), abs=1e-9)


def test_bad_input_is_a_diagnostic():
    with pytest.raises(DataError):
        fidelity(scenes(0, 5), scenes(1))


TWO_PI = 2.0 * np.pi


def by_hand(reference, generated, k):
    """The definition, one scene at a time."""
    truth, made = features(reference), features(generated)
    covered = 0
    for index, scene in enumerate(truth):
        others = np.delete(truth, index, axis=0)
        radius = np.sort(np.linalg.norm(others - scene, axis=1))[k - 1]
        covered += np.linalg.norm(made - scene, axis=1).min() <= radius
    return covered / len(truth)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_truth_covers_itself(seed, true_scenes):
    # Expectation 1 - 2^-5 = 0.969. Measured over 20 seeds: mean 0.970, standard deviation 0.005, 0.959 to 0.980.
    rng = np.random.default_rng(seed)
    assert 0.95 <= coverage(true_scenes(rng, 2000), true_scenes(rng, 2000)) <= 0.985


def test_a_collapsed_sample_scores_low(true_scenes):
    rng = np.random.default_rng(3)
    reference = true_scenes(rng, 1000)
    collapsed = true_scenes(rng, 5).repeat(200, axis=1)
    collapsed += 0.005 * rng.standard_normal(collapsed.shape)
    assert coverage(reference, collapsed) < 0.1


def test_agrees_with_the_definition_and_tiles_change_nothing(monkeypatch, true_scenes):
    rng = np.random.default_rng(4)
    reference, generated = true_scenes(rng, 150), rng.random((6, 90))
    for k in (1, 5):
        assert coverage(reference, generated, neighbours=k) == by_hand(reference, generated, k)
    whole = coverage(reference, generated)
    monkeypatch.setattr(module, "_STACK", 2)
    monkeypatch.setattr(module, "_WIDTH", 30)
    assert coverage(reference, generated) == whole


def test_far_from_the_origin_and_across_the_seam_of_theta(true_scenes):
    rng = np.random.default_rng(5)
    reference, generated = true_scenes(rng, 300), true_scenes(rng, 300)
    there = np.array([1e4, -1e4, 0.0] * 2)[:, None]
    turned = np.array([0.0, 0.0, TWO_PI] * 2)[:, None]
    plain = coverage(reference, generated)
    assert coverage(reference + there, generated + there) == pytest.approx(plain, abs=0.01)
    assert coverage(reference, generated + turned) == pytest.approx(plain, abs=0.01)


def test_a_reference_of_copies_is_covered_by_its_scenes():
    # Every radius is 0 here, and the rounding of sin(theta + 2 pi) must not decide.
    scenes = np.random.default_rng(6).random((6, 200))
    copies = np.repeat(scenes, 10, axis=1)
    turned = scenes + np.array([0.0, 0.0, TWO_PI] * 2)[:, None]
    assert coverage(copies, turned[:, ::-1]) == 1.0
    assert coverage(copies, scenes[:, :50]) == 0.25
    assert coverage(copies, scenes + 0.0001) == 0.0


@pytest.mark.parametrize(
    ("reference", "generated"),
    [
        (np.zeros((6, 10)), np.zeros((3, 10))),
        (np.zeros((6, 5)), np.zeros((6, 10))),
        (np.zeros((6, 10)), np.zeros((6, 0))),
        (np.zeros((5, 10)), np.zeros((5, 10))),
        (np.full((6, 10), np.nan), np.zeros((6, 10))),
    ],
)
def test_bad_input_is_a_diagnostic_coverage(reference, generated):
    with pytest.raises(DataError):
        coverage(reference, generated)


TURN = 2.0 * np.pi
values = st.lists(st.integers(0, 12), min_size=1, max_size=15).map(lambda v: np.array(v, dtype=float))


def excess(a, b):
    """F_a - F_b at every value and before the first, by the definition."""
    return [0.0] + [(a <= x).mean() - (b <= x).mean() for x in np.concatenate([a, b])]


@given(values, values)
def test_ks_statistic_with_ties_is_the_definition(a, b):
    assert kolmogorov_smirnov(a, b)[0] == pytest.approx(np.abs(excess(a, b)).max(), abs=1e-12)


def test_ks_p_is_scipys():
    rng = np.random.default_rng(0)
    for shift in (0.0, 0.02, 0.05, 0.1):
        for n, m in ((2000, 1500), (20_000, 20_000), (400, 5000)):
            a, b = rng.random(n), rng.random(m) + shift
            ours, theirs = kolmogorov_smirnov(a, b)[1], stats.ks_2samp(a, b, method="asymp").pvalue
            assert ours == pytest.approx(theirs, rel=0.03, abs=1e-4)


@given(values, values, st.floats(0.0, TURN))
def test_kuiper_does_not_depend_on_the_cut(a, b, turned):
    a, b = a * 0.5 + 0.01, b * 0.5 + 0.01
    statistic = kuiper(a, b)[0]
    assert statistic == pytest.approx(np.ptp(excess(a, b)), abs=1e-12)
    # equal angles stay equal: both sets are turned by the same rounded numbers
    assert kuiper(np.mod(a + turned, TURN), np.mod(b + turned, TURN))[0] == pytest.approx(statistic)


@pytest.mark.long
def test_p_is_uniform_under_the_null():
    rng = np.random.default_rng(1)
    for test in (kolmogorov_smirnov, kuiper):
        p = [test(*rng.random((2, 2000)))[1] for _ in range(400)]
        assert stats.kstest(p, "uniform").pvalue > 0.01
        # Small sets take Stephens' correction; 4,000 pairs of 50 put one standard deviation at 0.0034.
        low = np.mean([test(*rng.random((2, 50)))[1] < 0.05 for _ in range(4000)])
        assert 0.03 < low < 0.06


def test_columns_have_names_and_the_worst_is_first(true_scenes):
    rng = np.random.default_rng(2)
    a, b = true_scenes(rng, 1000), true_scenes(rng, 1000)
    b[0] += 0.2
    b[3] += 0.2  # both alike: differences stay true
    screen = ks_screen(a, b, ["mug", "plate"])
    alone = {f"{row}({name})" for row in ("x", "y", "theta") for name in ("mug", "plate")}
    pair = {"x(plate) - x(mug)", "y(plate) - y(mug)", "theta(plate) - theta(mug)", "dist(mug, plate)"}
    assert {column.name for column in screen.columns} == alone | pair
    assert len(screen.columns) == 10
    assert screen.worst.name in ("x(mug)", "x(plate)")
    assert screen.worst.p == min(column.p for column in screen.columns)
    assert screen.corrected == pytest.approx(min(1.0, 10 * screen.worst.p))
    by_name = {column.name: column for column in screen.columns}
    assert by_name["x(plate) - x(mug)"].p > 0.01
    assert by_name["x(mug)"].statistic == pytest.approx(stats.ks_2samp(a[0], b[0]).statistic)
    assert by_name["dist(mug, plate)"].statistic == pytest.approx(
        stats.ks_2samp(np.hypot(a[3] - a[0], a[4] - a[1]), np.hypot(b[3] - b[0], b[4] - b[1])).statistic
    )


@pytest.mark.long
def test_the_corrected_p_holds_its_level(true_scenes):
    """Right scenes fall below 0.05 in at most 5 % of screens: 200 screens, 5 % plus three standard deviations."""
    rng = np.random.default_rng(3)
    low = sum(ks_screen(true_scenes(rng, 300), true_scenes(rng, 300)).corrected < 0.05 for _ in range(200))
    assert low <= 19


@pytest.mark.long
@pytest.mark.parametrize("name", ["projected", "perturbed", "shifted", "reflected"])
def test_wrong_samplers_are_seen(name, wrong_scenes):
    right, wrong = wrong_scenes[name]
    for seed in range(5):
        rng = np.random.default_rng(seed)
        screen = ks_screen(right(rng, 2000), wrong(rng, 2000))
        assert screen.corrected < 1e-6
        if name == "reflected":
            assert screen.worst.name == "theta(2) - theta(1)"
            # each angle alone is right
            assert all(column.p > 1e-4 for column in screen.columns[1:])
        assert ks_screen(right(rng, 2000), right(rng, 2000)).corrected > 0.005


def test_angles_wrap(true_scenes):
    rng = np.random.default_rng(4)
    a, b = true_scenes(rng, 500), true_scenes(rng, 500)
    a[2], b[2] = (np.mod(0.1 * rng.standard_normal(500), TURN) for _ in range(2))
    turned = b.copy()
    turned[2::3] = np.mod(turned[2::3] + np.pi, TURN) - np.pi
    plain, other = ({c.name: c.p for c in ks_screen(a, scenes).columns} for scenes in (b, turned))
    assert plain == pytest.approx(other, rel=1e-9)


def test_columns_that_cannot_vary_are_not_counted(true_scenes):
    rng = np.random.default_rng(5)
    a, b = true_scenes(rng, 200), true_scenes(rng, 200)
    a[:3] = b[:3] = np.array([[0.5], [0.5], [0.0]])
    names = {column.name for column in ks_screen(a, b).columns}
    assert len(names) == 7
    assert "x(1)" not in names
    b[0] = 0.51
    moved = ks_screen(a, b)
    assert moved.worst.name == "x(1)"
    assert moved.worst.statistic == 1.0
    nothing = ks_screen(a[:3], a[:3])
    assert (nothing.corrected, nothing.worst.p) == (1.0, 1.0)


def test_bad_input_is_a_diagnostic_screen():
    scenes = np.zeros((6, 4))
    with pytest.raises(ValueError, match="names of shape 1 for 2 objects"):
        ks_screen(scenes, scenes, ["mug"])
    with pytest.raises(DataError):
        ks_screen(scenes, np.zeros((6, 0)))
    with pytest.raises(DataError):
        ks_screen(scenes, np.zeros((3, 4)))
