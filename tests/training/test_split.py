import pytest
import torch

from scenegen.errors import DataError
from scenegen.learn.training.dataset import held_count, held_places, split
from scenegen.learn.training.paper import uniform


@pytest.mark.parametrize("total", [2, 3, 10, 11, 57, 2049, 20_481, 1_000_003])
def test_places_are_distinct_and_evenly_spread(total):
    places = held_places(total, held_count(total))
    assert len(places) == held_count(total) < total
    assert int(places[0]) >= 0 and int(places[-1]) < total
    gaps = places.diff()
    assert len(gaps) == 0 or (int(gaps.min()) > 0 and int(gaps.max() - gaps.min()) <= 1)


def test_too_few():
    for total in (0, 1):
        with pytest.raises(DataError, match="too few"):
            held_places(total, held_count(total))


def test_a_split_loses_nothing(exp1):
    data = uniform(exp1, 101, torch.Generator().manual_seed(0))
    training, held = split(data, 10)
    assert (len(training), len(held)) == (91, 10)
    both = torch.cat([training.rows, held.rows], dim=1)
    assert torch.equal(torch.unique(both, dim=1), torch.unique(data.rows, dim=1))
    assert held.phi.shape == (2, 10)
