import numpy as np
import pytest

from scenegen.errors import DataError
from scenegen.metrics import coverage as module
from scenegen.metrics.coverage import coverage, features

TWO_PI = 2.0 * np.pi


def exp1_truth(rng, n, wanted=(0.19, 0.08), half_width=0.0125):
    """Experiment 1 (mug, plate) by plain rejection, written out here: (6, n) with |phi - wanted| < half_width."""
    kept, found = [], 0
    while found < n:
        mx, my, px, py = rng.random((4, 500_000))
        task = np.minimum(px - mx, my - py)
        safe = np.hypot(mx - px, my - py) - 0.25
        hit = (np.abs(task - wanted[0]) < half_width) & (np.abs(safe - wanted[1]) < half_width)
        # phi does not look at theta here, so it may be drawn afterwards.
        theta = rng.random((2, int(hit.sum()))) * TWO_PI
        kept.append(np.stack([mx[hit], my[hit], theta[0], px[hit], py[hit], theta[1]]))
        found += kept[-1].shape[1]
    return np.concatenate(kept, axis=1)[:, :n]


def by_hand(reference, generated, k):
    """The definition, one scene at a time."""
    truth, made = features(reference), features(generated)
    covered = 0
    for index, scene in enumerate(truth):
        others = np.delete(truth, index, axis=0)
        radius = np.sort(np.linalg.norm(others - scene, axis=1))[k - 1]
        covered += np.linalg.norm(made - scene, axis=1).min() <= radius
    return covered / len(truth)


def test_features_of_one_scene():
    rows = np.array([[0.1], [0.2], [0.0], [0.3], [0.4], [np.pi / 2]])
    turn = 1.0 / TWO_PI
    assert features(rows)[0] == pytest.approx([0.1, 0.3, 0.2, 0.4, turn, 0.0, 0.0, turn], abs=1e-15)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_truth_covers_itself(seed):
    # Expectation 1 - 2^-5 = 0.969. Measured over 20 seeds: mean 0.970, standard deviation 0.005, 0.959 to 0.980.
    rng = np.random.default_rng(seed)
    assert 0.95 <= coverage(exp1_truth(rng, 2000), exp1_truth(rng, 2000)) <= 0.985


def test_a_collapsed_sample_scores_low():
    rng = np.random.default_rng(3)
    reference = exp1_truth(rng, 1000)
    collapsed = exp1_truth(rng, 5).repeat(200, axis=1)
    collapsed += 0.005 * rng.standard_normal(collapsed.shape)
    assert coverage(reference, collapsed) < 0.1


def test_agrees_with_the_definition_and_blocks_change_nothing(monkeypatch):
    rng = np.random.default_rng(4)
    reference, generated = exp1_truth(rng, 150), rng.random((6, 90))
    for k in (1, 5):
        assert coverage(reference, generated, neighbours=k) == by_hand(reference, generated, k)
    whole = coverage(reference, generated)
    monkeypatch.setattr(module, "_BLOCK", 700)
    assert coverage(reference, generated) == whole


def test_far_from_the_origin_and_across_the_seam_of_theta():
    rng = np.random.default_rng(5)
    reference, generated = exp1_truth(rng, 300), exp1_truth(rng, 300)
    there = np.array([1e4, -1e4, 0.0] * 2)[:, None]
    turned = np.array([0.0, 0.0, TWO_PI] * 2)[:, None]
    plain = coverage(reference, generated)
    assert coverage(reference + there, generated + there) == pytest.approx(plain, abs=0.01)
    assert coverage(reference, generated + turned) == pytest.approx(plain, abs=0.01)


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
def test_bad_input_is_a_diagnostic(reference, generated):
    with pytest.raises(DataError):
        coverage(reference, generated)
