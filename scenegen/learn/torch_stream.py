"""Batches of a stored set as a torch IterableDataset. Loads torch: import it where a stream is asked for."""

from __future__ import annotations

from collections.abc import Iterator

import torch
import torch.distributed
from torch.utils.data import IterableDataset, get_worker_info

from scenegen.api.batches import SceneBatches
from scenegen.errors import RequestError
from scenegen.errors.requests import OUT_OF_RANGE


class SceneStream(IterableDataset[tuple[torch.Tensor, torch.Tensor]]):
    """Each iteration is an epoch; `set_epoch` chooses the next one, for learners that go on from a checkpoint.

    Raises RequestError for a `rank` that is not from 0 to `ranks` - 1.
    """

    def __init__(self, batches: SceneBatches, rank: int | None, ranks: int | None, dtype: torch.dtype | None) -> None:
        if ranks is None and torch.distributed.is_available() and torch.distributed.is_initialized():
            rank, ranks = torch.distributed.get_rank(), torch.distributed.get_world_size()
        self._batches, self._rank, self._ranks = batches, rank or 0, ranks or 1
        self._dtype = torch.float32 if dtype is None else dtype
        self._epoch = 0
        if not 0 <= self._rank < self._ranks:
            raise RequestError(OUT_OF_RANGE(argument="rank", value=self._rank, wanted=f"from 0 to {self._ranks - 1}"))

    def set_epoch(self, epoch: int) -> None:
        """The number of the next epoch, from 0."""
        self._epoch = epoch

    def __iter__(self) -> Iterator[tuple[torch.Tensor, torch.Tensor]]:
        info = get_worker_info()
        worker, workers = (0, 1) if info is None else (info.id, info.num_workers)
        own = self._batches.for_reader(self._rank * workers + worker, self._ranks * workers, self._epoch)
        self._epoch += 1
        for poses, phi in own:
            yield torch.from_numpy(poses).to(self._dtype), torch.from_numpy(phi).to(self._dtype)
