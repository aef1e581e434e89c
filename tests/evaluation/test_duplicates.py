import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from experiments import metrics as module
from experiments.metrics import duplicates
from scenegen.errors import DataError

TURN = 2.0 * np.pi


def by_hand(rows, tolerance):
    """Scenes with an earlier one within the tolerance in every coordinate, pair by pair."""
    count = 0
    for later in range(rows.shape[1]):
        for earlier in range(later):
            apart = np.abs(rows[:, later] - rows[:, earlier])
            apart[2::3] = np.minimum(np.mod(apart[2::3], TURN), TURN - np.mod(apart[2::3], TURN))
            if (apart <= tolerance).all():
                count += 1
                break
    return count / rows.shape[1]


@given(st.integers(0, 2**32), st.integers(1, 40), st.sampled_from([3, 8, 40]), st.sampled_from([1, 16]))
def test_agrees_with_all_pairs(seed, scenes, levels, small):
    """Coordinates on a lattice finer than the tolerance, some jittered: chains, ties, the seam of theta."""
    rng = np.random.default_rng(seed)
    rows = (rng.integers(levels, size=(6, scenes)) - levels // 2) * 0.005
    rows *= rng.integers(2, size=6)[:, None]  # few coordinates vary: long chains
    rows = rows + 0.0004 * rng.random(rows.shape) * rng.integers(2, size=scenes)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "_SMALL", small)
        found = duplicates(rows, tolerance=0.0127)
    rows[2::3] = np.mod(rows[2::3], TURN)
    assert found.exact == by_hand(rows, 0.0)
    assert found.near == by_hand(rows, 0.0127)


def test_definition():
    one = np.array([[0.5], [0.5], [0.0]])
    rows = np.repeat(one, 5, axis=1)
    rows[0, 1] += 4e-7  # near
    rows[0, 2] += 0.1  # another
    rows[2, 3] = TURN  # the same heading
    rows[2, 4] = TURN - 4e-7  # near, across the seam
    found = duplicates(rows)
    assert (found.exact, found.near, found.tolerance) == (0.2, 0.6, 1e-6)


def test_many_scenes():
    rng = np.random.default_rng(0)
    rows = rng.random((6, 100_000))
    assert duplicates(rows).near == 0.0
    rows[:, 60_000:] = rows[:, rng.integers(60_000, size=40_000)]
    rows[0, 80_000:] += 5e-7
    found = duplicates(rows[:, rng.permutation(100_000)])
    assert found.near == 0.4
    distinct = len(np.unique(rows, axis=1).T)
    assert found.exact == pytest.approx(1.0 - distinct / 100_000, abs=1e-12)


def test_a_collapsed_set_and_one_with_fixed_objects_are_quick():
    rng = np.random.default_rng(1)
    rows = np.repeat(rng.random((6, 1)), 50_000, axis=1)
    assert duplicates(rows).exact == 1.0 - 1 / 50_000
    near = rows + 1e-8 * rng.standard_normal(rows.shape)
    assert (duplicates(near).exact, duplicates(near).near) == (0.0, 1.0 - 1 / 50_000)
    rows[3:] = rng.random((3, 50_000))
    assert duplicates(rows).near == 0.0


def test_bad_input_is_a_diagnostic():
    for tolerance in (-1e-9, 1.0, float("nan")):
        with pytest.raises(ValueError, match=r"least|from 0"):
            duplicates(np.zeros((3, 2)), tolerance=tolerance)
    with pytest.raises(DataError):
        duplicates(np.full((3, 2), np.nan))
    assert duplicates(np.zeros((3, 0))).exact == 0.0
