"""The room of one object under clauses."""

from types import SimpleNamespace

import numpy as np
import pytest

from scenegen.sampling.growth.graph import Clause
from scenegen.sampling.growth.room import FreePoses


@pytest.mark.parametrize("branches", [1, 2, 3])
@pytest.mark.parametrize("columns", [slice(None), np.array([0, 2, 3])])
def test_ends_that_differ_by_cell_are_those_of_their_scenes(branches, columns):
    room = SimpleNamespace(places={7: 1}, scale=1.0)
    clause = Clause(7, frozenset({0}), np.array([0.1, 0.2]), np.array([0.6, 0.9]))
    cell = np.array([0, 1, 1, 0])[columns]
    low, high = np.full((2, branches, 4), 0.15), np.full((2, branches, 4), 0.8)
    FreePoses._impose(room, clause, cell, low, high, columns)
    mine = np.arange(4)[columns]
    assert low[1][:, mine] == pytest.approx(np.tile(np.array([0.15, 0.2])[cell], (branches, 1)), abs=1e-6)
    assert high[1][:, mine] == pytest.approx(np.tile(np.array([0.6, 0.8])[cell], (branches, 1)), abs=1e-6)
    assert (low[0] == 0.15).all() and (high[0] == 0.8).all()
