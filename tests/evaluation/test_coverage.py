import numpy as np
import pytest

from scenegen.errors import DataError
from scenegen.scenes import coverage as module
from scenegen.scenes.coverage import coverage, features

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
def test_bad_input_is_a_diagnostic(reference, generated):
    with pytest.raises(DataError):
        coverage(reference, generated)
