import numpy as np
import pytest

from scenegen.errors import DataError
from scenegen.scenes.coverage import checked_pair, features

TURN = 1.0 / (2.0 * np.pi)


def test_features_of_one_scene():
    rows = np.array([[0.1], [0.2], [0.0], [0.3], [0.4], [np.pi / 2]])
    assert features(rows)[0] == pytest.approx([0.1, 0.3, 0.2, 0.4, TURN, 0.0, 0.0, TURN], abs=1e-15)


def test_too_few_scenes_are_named():
    with pytest.raises(DataError, match="3 generated scenes are too few"):
        checked_pair(np.zeros((3, 9)), np.zeros((3, 3)), (4, 4))
    with pytest.raises(DataError, match="2 objects per scene, the generated scenes 1"):
        checked_pair(np.zeros((6, 9)), np.zeros((3, 9)), (1, 1))
