import numpy as np
import pytest

from experiments.metrics import error_statistics


def test_hand_computed_figures():
    phi = [[0.20, 0.18, 0.30, 0.16], [0.08, 0.10, 0.08, -0.02]]
    stats = error_statistics(phi, [0.19, 0.08], ["task", "safe"])
    task, safe = stats.labels
    assert (task.label, task.wanted, stats.scenes, stats.tolerance) == ("task", 0.19, 4, 0.025)
    assert task.mean == pytest.approx((0.01 - 0.01 + 0.11 - 0.03) / 4)
    assert task.mean_abs == pytest.approx(0.04)
    assert task.std == pytest.approx(np.std([0.01, -0.01, 0.11, -0.03]))
    assert task.within == 0.5  # 0.01 and -0.01
    assert safe.within == 0.75
    assert stats.within == 0.5  # the first two scenes alone are within on both labels


def test_within_needs_all_labels():
    stats = error_statistics([[0.0, 1.0], [1.0, 0.0]], [0.0, 0.0], ["a", "b"])
    assert [label.within for label in stats.labels] == [0.5, 0.5]
    assert stats.within == 0.0


@pytest.mark.parametrize(
    ("phi", "wanted"),
    [([[0.0]], [0.0, 1.0]), ([0.0], [0.0]), ([[]], [0.0]), ([[np.nan]], [0.0]), ([[0.0]], [np.inf])],
)
def test_bad_input_is_a_diagnostic(phi, wanted):
    with pytest.raises(ValueError, match="phi"):
        error_statistics(phi, wanted, ["task"])
