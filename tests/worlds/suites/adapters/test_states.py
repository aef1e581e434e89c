"""Files of init states, without LIBERO."""

import pickle

import numpy as np
import pytest

from scenegen.worlds.libero.states import SettledStates
from scenegen.worlds.suites.adapters.libero import read_states

STATES = np.random.default_rng(0).random((3, 5))


def test_states_are_read_as_they_were_written(tmp_path):
    pytest.importorskip("torch")
    path = SettledStates(STATES, {}, {}, np.zeros(3), None, 3, 3, 3, {}).save(tmp_path / "task.pruned_init")
    assert np.array_equal(read_states(path), STATES)
    np.savez(f"{path}.npz", states=STATES[:2])
    assert np.array_equal(read_states(path), STATES[:2])


def test_a_file_of_states_runs_no_code(tmp_path):
    torch = pytest.importorskip("torch")
    torch.save(print, tmp_path / "task.pruned_init")
    with pytest.raises(pickle.UnpicklingError, match="print"):
        read_states(tmp_path / "task.pruned_init")
