import numpy as np
import pytest
from scipy.spatial.distance import cdist

from experiments.metrics import training_distances
from scenegen.errors import DataError
from scenegen.scenes.coverage import features


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


def test_bad_input_is_a_diagnostic():
    scenes = np.zeros((3, 2))
    for levels in ((), (0.5, 1.1), (-0.1,), (float("nan"),)):
        with pytest.raises(ValueError, match=r"least|from 0"):
            training_distances(scenes, scenes, levels=levels)
    with pytest.raises(DataError):
        training_distances(scenes, np.zeros((3, 0)))
