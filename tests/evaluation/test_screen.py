import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from experiments.metrics import kolmogorov_smirnov, ks_screen, kuiper
from scenegen.errors import DataError

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


def test_bad_input_is_a_diagnostic():
    scenes = np.zeros((6, 4))
    with pytest.raises(ValueError, match="names of shape 1 for 2 objects"):
        ks_screen(scenes, scenes, ["mug"])
    with pytest.raises(DataError):
        ks_screen(scenes, np.zeros((6, 0)))
    with pytest.raises(DataError):
        ks_screen(scenes, np.zeros((3, 4)))
