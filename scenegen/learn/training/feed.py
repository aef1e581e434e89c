"""Where training gets its batches from: scenes in memory, or in windows from a file that is larger.

Everything that goes to the model lives on its device. There are no workers: a batch is an index into a tensor.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from scenegen.lang.spec import CheckedSpec
from scenegen.learn.models.codec import MOST, OTHER, Codec, Examples, survey, ways_of
from scenegen.learn.models.registry import model_class
from scenegen.learn.robustness import Robustness
from scenegen.learn.training.config import TrainConfig, dataset_maker, is_file
from scenegen.learn.training.dataset import Dataset, held_count, split
from scenegen.learn.training.gathering import Gathering
from scenegen.learn.training.scenefile import Streamed, fits, look_through, whole_file
from scenegen.learn.training.state import Stream, stream
from scenegen.pose import row_count
from scenegen.sampling.request import Range, parse_phi
from scenegen.scenes.formats.registry import format_of, read_scenes

WINDOW = 1 << 24  # coordinates and labels of the scenes of a window


class Feed(ABC):
    """`scenes` train; `fitting` are those that the model takes ranges from, `held` those it never trains on, both as
    examples on the CPU; `table` (K, L) says what each branch is; `regions` how phi is distributed
    (scenegen.learn.models.checkpoint.TrainedModel); `sha256` is of all scenes."""

    scenes: int
    fitting: Examples
    held: Examples
    table: Tensor
    regions: tuple[npt.NDArray[np.float64], ...]
    sha256: str

    def __init__(self, config: TrainConfig) -> None:
        self.size = config.batch_size
        self.seed = config.seed
        self.device = torch.device(config.device)

    @property
    def steps(self) -> int:
        """Batches of an epoch."""
        return -(-self.scenes // self.size)

    @abstractmethod
    def batches(self, epoch: int, step: int) -> Iterator[Examples]:
        """The batches of an epoch from batch `step` on; their order follows from the seed."""

    def _cut(self, examples: Examples, first: int, *key: int) -> Iterator[Examples]:
        """Examples in the order of a key, in batches from batch `first` on."""
        order = torch.randperm(len(examples), generator=stream(self.seed, Stream.ORDER, *key)).to(self.device)
        shuffled = examples.take(order)
        for start in range(first * self.size, len(shuffled), self.size):
            yield shuffled.take(slice(start, start + self.size))


class MemoryFeed(Feed):
    """All scenes at once, on the device."""

    def __init__(self, spec: CheckedSpec, config: TrainConfig, data: Dataset, held: int) -> None:
        super().__init__(config)
        self.sha256 = data.sha256
        codec = Codec(spec.workspace, len(spec.core.objects))
        training, out = split(data, held)
        self.regions = regions_of(data)
        branch, self.table = None, _one_branch(spec)
        if model_class(config.model, config.recipe).branched:
            branch, self.table = survey(spec, training.rows)
        self.scenes = len(training)
        self.fitting, self.held = _plain(codec, training, branch), _plain(codec, out)
        self._examples = self.fitting.to(self.device)

    def batches(self, epoch: int, step: int) -> Iterator[Examples]:
        return self._cut(self._examples, step, epoch)


class Windows(Feed):
    """A file, window by window."""

    def __init__(self, spec: CheckedSpec, config: TrainConfig, data: Streamed) -> None:
        super().__init__(config)
        self.sha256, self.scenes = data.sha256, data.scenes
        self._data = data
        self.regions = regions_of(data.chosen)
        self._codec = Codec(spec.workspace, len(spec.core.objects))
        self._robustness = Robustness(spec.core)
        self._branched = model_class(config.model, config.recipe).branched
        self._spec = spec
        self.table = ranked(data.ways) if self._branched else _one_branch(spec)
        self.fitting = self._examples(data.chosen.rows)
        self.held = _plain(self._codec, data.held)
        many = WINDOW // (row_count(len(spec.core.objects)) + len(spec.labels)) // self.size
        self._batches = max(1, many)  # of a window

    def batches(self, epoch: int, step: int) -> Iterator[Examples]:
        windows = self._data.windows(stream(self.seed, Stream.ORDER, epoch, 0), self._batches * self.size)
        for number, rows in enumerate(windows):
            first = step - number * self._batches
            if first < self._batches:
                yield from self._cut(self._examples(rows).to(self.device), max(0, first), epoch, 1 + number)

    def _examples(self, rows: Tensor) -> Examples:
        branch = torch.zeros(rows.shape[1], dtype=torch.int64)
        if self._branched:
            branch = sorted_into(self._spec, rows, self.table)
        return Examples(self._codec.encode(rows), self._robustness.rows(rows).T.contiguous(), branch)


def make_feed(spec: CheckedSpec, config: TrainConfig, gathering: Gathering | None = None) -> Feed:
    """The scenes of a run; `gathering` hears of each step of gathering them. Raises RequestError, also where it says
    that time is up, and DataError."""
    gathering = gathering or Gathering()
    if not is_file(config.data):
        assert config.scenes is not None
        held = held_count(config.scenes)
        make = dataset_maker(config.data)
        if config.phi:
            from scenegen.learn.training.balanced import balanced

            asked = parse_phi([f"{label}={one}" for label, one in config.phi.items()], spec.labels)
            make = partial(balanced, phi=asked)
        data: Dataset = make(spec, config.scenes + held, stream(config.seed, Stream.DATA), gathering)
        gathering.save(long_ones=True)
        return MemoryFeed(spec, config, data, held)
    path = Path(config.data)
    if path.suffix.lower() == ".parquet" and not read_scenes(path).header.counts:
        sizes: tuple[int, ...] = format_of(path).group_sizes(path)
        if not fits(spec, sum(sizes) if config.scenes is None else min(config.scenes, sum(sizes))):
            return Windows(spec, config, look_through(spec, path, config.scenes, sizes, gathering))
    gathering.begin(f"reading {path}")
    data = whole_file(spec, path, config.scenes)
    gathering.check()
    return MemoryFeed(spec, config, data, held_count(len(data)))


def regions_of(data: Dataset) -> tuple[npt.NDArray[np.float64], ...]:
    """How phi is distributed, as a model file says it: in the regions of a data set, or among all of its scenes."""
    found = []
    for ranges, phi in data.regions or (({}, data.phi),):
        wanted = [ranges.get(label, Range()) for label in data.labels]
        low = [-math.inf if one.low is None else one.low for one in wanted]
        high = [math.inf if one.high is None else one.high for one in wanted]
        found.append(torch.cat([torch.tensor([low, high]).T, phi], dim=1).double().numpy())
    return tuple(found)


def ranked(ways: Mapping[tuple[int, ...], int]) -> Tensor:
    """The table of branches, as scenegen.learn.models.codec.survey makes it, from how often each was met."""
    order = sorted(ways, key=lambda way: (-ways[way], way))
    table = torch.tensor(order, dtype=torch.int64)
    return table if len(table) <= MOST else torch.cat([table[: MOST - 1], torch.full_like(table[:1], OTHER)])


def sorted_into(spec: CheckedSpec, rows: Tensor, table: Tensor) -> Tensor:
    """The branch of each scene of (3N, m) storage, (m,) int64; the last where the table does not name it."""
    nodes = ways_of(spec, rows)
    branch = torch.full((rows.shape[1],), len(table) - 1)
    for index, way in enumerate(table):
        branch[(nodes == way[:, None]).all(dim=0)] = index
    return branch


def _plain(codec: Codec, data: Dataset, branch: Tensor | None = None) -> Examples:
    branch = torch.zeros(len(data), dtype=torch.int64) if branch is None else branch
    return Examples(codec.encode(data.rows), data.phi.T.contiguous(), branch, data.balanced)


def _one_branch(spec: CheckedSpec) -> Tensor:
    return torch.full((1, len(spec.labels)), OTHER)
