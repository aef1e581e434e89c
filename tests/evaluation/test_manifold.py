import numpy as np
import pytest

from experiments.metrics import precision_recall
from scenegen.errors import DataError
from scenegen.scenes.coverage import coverage, features


def by_hand(points, queries, k):
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
    assert figures.precision == by_hand(truth, made, k)
    assert figures.recall == by_hand(made, truth, k)
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


def test_bad_input_is_a_diagnostic():
    with pytest.raises(DataError):
        precision_recall(np.zeros((3, 3)), np.zeros((3, 10)))
    with pytest.raises(DataError):
        precision_recall(np.zeros((3, 10)), np.zeros((3, 3)))
    with pytest.raises(ValueError, match=r"least|from 0"):
        precision_recall(np.zeros((3, 10)), np.zeros((3, 10)), neighbours=0)
