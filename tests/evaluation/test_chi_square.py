import numpy as np
import pytest
from scipy import stats

from experiments.metrics import chi_square


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
