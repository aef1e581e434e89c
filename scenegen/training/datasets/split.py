"""Held-out scenes: which of a data set never train."""

from __future__ import annotations

import torch
from torch import Tensor

from scenegen.errors import DataError
from scenegen.errors.models import TOO_FEW_TO_SPLIT
from scenegen.training.datasets.dataset import Dataset

HELD = 2048  # scenes that are held out at most: the mean error is then known to some percent
SHARE = 10  # one scene in so many, where that is fewer


def held_count(scenes: int) -> int:
    """How many scenes are held out beside, or of, that many."""
    return min(HELD, max(1, scenes // SHARE))


def held_places(total: int, held: int) -> Tensor:
    """(held,) int64 indices of the held-out scenes among `total`, evenly spread and ascending: file order may mean
    something. Raises DataError where nothing would be left to train on."""
    if not 0 < held < total:
        raise DataError(TOO_FEW_TO_SPLIT(count=total))
    return (torch.arange(held) * total + total // 2) // held


def split(data: Dataset, held: int) -> tuple[Dataset, Dataset]:
    """The scenes that train and `held` that do not, both in the order they had. Raises DataError, see above."""
    out = torch.zeros(len(data), dtype=torch.bool)
    out[held_places(len(data), held)] = True
    return data.take(~out), data.take(out)
