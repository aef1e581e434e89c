"""Where training gets its batches from: scenes in memory, or in windows from a file that is larger.

Everything that goes to the model lives on its device. There are no workers: a batch is an index into a tensor.
"""

from __future__ import annotations

import hashlib
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from scenegen.errors import DataError, RequestError
from scenegen.errors.files import CANNOT_READ
from scenegen.errors.learning import DATA_CHANGED, TOO_FEW_IN_FILE, TOO_MANY_TO_TRAIN
from scenegen.errors.requests import NO_SCENES
from scenegen.lang.spec import CheckedSpec
from scenegen.learn.models.codec import MAX_BRANCHES, OTHER, Codec, Examples, survey, ways_of
from scenegen.learn.robustness import Robustness
from scenegen.learn.training.config import TrainConfig, dataset_maker, is_file
from scenegen.learn.training.dataset import Dataset, held_count, held_places, label_scenes, split
from scenegen.learn.training.gathering import Gathering
from scenegen.learn.training.state import Stream, stream
from scenegen.pose import row_count, rows_of
from scenegen.sampling.request import Range, parse_phi
from scenegen.scenes.arrange import as_core, check_scenes, order_of, refuse_numbers
from scenegen.scenes.blocks import Block, SceneFileReading, counts_in, element, member_of, numbers_in, regroup
from scenegen.scenes.data import SceneFile
from scenegen.scenes.formats.registry import format_of, read_scenes

# Scenes of a file as training data: `--data scenes.parquet`, .jsonl or .json.
#
# The phi that a file stores is not looked at: every scene is labelled by the spec that is trained on, so a file of
# another spec about the same objects serves as well. What fits is held in memory; a longer Parquet file is read again
# in every epoch.


# Scenes of a file that differ in how many things there are, as training data of one number: a model has one.


def of_member(reading: SceneFileReading, spec: CheckedSpec) -> tuple[SceneFileReading, str | None]:
    """The scenes with the things that `spec` has, as a file of these alone, and how many things that are, in words; a
    file whose scenes all have the same things as it is. Raises DataError where no scene of the file can have the spec's
    objects."""
    header = reading.header
    if not header.counts:
        return reading, None
    names = [one.name for one in header.objects]
    there = np.array([[name in spec.objects for name in names]])
    try:
        wanted = numbers_in(names, header.counts, there)[:, 0]
    except ValueError:
        order_of(spec, names)  # says what differs
        refuse_numbers(header, "training")
        raise
    member = member_of(header, dict(zip((one.name for one in header.counts), wanted.tolist(), strict=True)))
    here = {one.name for one in member.objects}
    rows = [row for which, name in enumerate(names) if name in here for row in rows_of(which)]
    rows += [row_count(len(names)) + which for which, one in enumerate(header.choosers) if one.name in here]

    def blocks() -> Iterator[Block]:
        for block in reading.blocks:
            mine = np.flatnonzero((counts_in(header, block.rows) == wanted[:, None]).all(axis=0))
            yield Block(block.rows[np.array(rows)[:, None], mine], block.phi[:, mine])

    counted = " and ".join(element(one, number) for one, number in zip(header.counts, wanted.tolist(), strict=True))
    return replace(reading, header=member, blocks=blocks(), count=None), counted


MEMORY_NUMBERS = 1 << 26  # coordinates and labels of scenes that are held in memory at once: 268 MB as float32


def fits(spec: CheckedSpec, scenes: int) -> bool:
    """Whether that many scenes are held in memory. It depends on the spec alone, not on the machine."""
    return scenes * (row_count(len(spec.core.objects)) + len(spec.labels)) <= MEMORY_NUMBERS


def whole_file(spec: CheckedSpec, path: Path, scenes: int | None) -> Dataset:
    """The first `scenes` scenes of a file (None: all), labelled by `spec`; of a file whose scenes differ in how many
    things there are, those with the spec's.

    Raises DataError where they are not of the spec's objects or break it, and where there are fewer; RequestError for a
    file that is no scene file by its name, or too long for memory.
    """
    reading, counted = of_member(read_scenes(path), spec)
    header = reading.header
    order = order_of(spec, [one.name for one in header.objects])
    found: list[Tensor] = []
    count = 0
    for block in limit_scenes(reading.blocks, scenes):
        found.append(storage(spec, header, block, order, count))
        count += block.count
        if not fits(spec, count):
            raise RequestError(TOO_MANY_TO_TRAIN(path=path))
    if not count:
        raise DataError(NO_SCENES(file=path, counted=counted))
    check_count(path, count, scenes, counted)
    return label_scenes(spec, torch.cat(found, dim=1))


def limit_scenes(blocks: Iterator[Block], scenes: int | None) -> Iterator[Block]:
    """The first `scenes` scenes of some blocks."""
    left = scenes
    for block in blocks:
        if left is not None and block.count >= left:
            yield block.part(0, left)
            return
        yield block
        left = None if left is None else left - block.count


def storage(spec: CheckedSpec, header: SceneFile, block: Block, order: list[int], before: int) -> Tensor:
    """A block's scenes as (3N, m) float32 in the spec's order of objects, then the switches of choices, checked. Raises
    DataError."""
    rows = as_core(spec, header, block.rows, order)
    check_scenes(spec, rows, before)
    return torch.from_numpy(rows).to(torch.float32)


def check_count(path: Path, found: int, scenes: int | None, counted: str | None = None) -> None:
    """Raises DataError where a file holds fewer scenes than were asked for; `counted` says of which numbers of
    things."""
    if scenes is not None and found < scenes:
        raise DataError(TOO_FEW_IN_FILE(path=path, found=found, wanted=scenes, counted=counted))


# A Parquet file of scenes that is larger than memory: looked through once, then read window by window in every epoch.
#
# The first pass labels and checks every scene, and keeps what training has to know of all of them: the checksum, how
# often each atom decides, the held-out scenes, and an even choice of the others with the extremes among them, of
# which ranges and ranks are taken. An epoch takes the row groups in random order and its scenes in windows of a fixed
# size.


CHOSEN = 1 << 23  # coordinates and labels of the scenes that ranges and ranks are taken from

Way = tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Streamed:
    """What one pass over the file found. `scenes` of them train; `chosen` are some of these, `held` are not among
    them; `ways` counts what makes their branches (scenegen.learn.models.codec) of those that train."""

    spec: CheckedSpec
    path: Path
    scenes: int
    chosen: Dataset
    held: Dataset
    ways: Mapping[Way, int]
    sha256: str
    _header: SceneFile
    _order: tuple[int, ...]
    _starts: tuple[int, ...]
    _out: Tensor
    _stamp: tuple[int, int]

    def windows(self, generator: torch.Generator, size: int) -> Iterator[Tensor]:
        """The scenes of one epoch as (3N, size) float32, the last window smaller; `generator` orders the row groups.
        Raises DataError where the file is no longer what it was."""
        if _stamp(self.path) != self._stamp:
            raise DataError(DATA_CHANGED(path=self.path))
        places = torch.randperm(len(self._starts) - 1, generator=generator).tolist()
        blocks = (self._training(block, at) for block, at in zip(_read(self.path, places), places, strict=True))
        for window in regroup(blocks, size):
            yield torch.from_numpy(window.rows).to(torch.float32)

    def _training(self, block: Block, group: int) -> Block:
        start, stop = self._starts[group : group + 2]
        keep = ~_inside(self._out, start, stop).numpy()
        rows = as_core(self.spec, self._header, block.rows[:, : stop - start], self._order)
        return Block(rows[:, keep], np.empty((0, int(keep.sum()))))


def look_through(
    spec: CheckedSpec, path: Path, scenes: int | None, sizes: tuple[int, ...], gathering: Gathering
) -> Streamed:
    """The first pass over the first `scenes` scenes of a file (None: all) whose row groups have these sizes. Raises
    DataError where they are not of the spec's objects, or break it."""
    stamp = _stamp(path)
    header = read_scenes(path).header
    order = order_of(spec, [one.name for one in header.objects])
    check_count(path, sum(sizes), scenes)
    total = sum(sizes) if scenes is None else scenes
    starts = [0]
    for size in sizes:
        if starts[-1] < total:
            starts.append(min(total, starts[-1] + size))
    out = held_places(total, held_count(total))
    every = -(-total * (row_count(len(spec.core.objects)) + len(spec.labels)) // CHOSEN)
    digest, ways = hashlib.sha256(), Counter[Way]()
    held: list[Dataset] = []
    chosen: list[Dataset] = []
    extremes: Dataset | None = None
    groups = range(len(starts) - 1)
    gathering.begin(f"reading {path}", total)
    for index, block in zip(groups, _read(path, groups), strict=True):
        start, stop = starts[index], starts[index + 1]
        data = label_scenes(spec, storage(spec, header, block.part(0, stop - start), order, start))
        digest.update(bytes.fromhex(data.sha256))
        away = _inside(out, start, stop)
        held.append(data.take(away))
        mine = data.take(~away)
        chosen.append(mine.take(slice(0, None, every)))
        extremes = _extremes(mine if extremes is None else join_datasets([extremes, mine]))
        ways.update(_count(ways_of(spec, mine.rows)))
        gathering.reach(stop)
    assert extremes is not None
    return Streamed(
        spec,
        path,
        total - len(out),
        join_datasets([*chosen, extremes]),
        join_datasets(held),
        ways,
        digest.hexdigest(),
        header,
        tuple(order),
        tuple(starts),
        out,
        stamp,
    )


def _read(path: Path, groups: Sequence[int]) -> Iterator[Block]:
    blocks: Iterator[Block] = format_of(path).read_groups(path, groups)
    return blocks


def join_datasets(parts: list[Dataset]) -> Dataset:
    """Several data sets as one."""
    first = parts[0]
    rows, phi = (torch.cat([getattr(part, name) for part in parts], dim=1) for name in ("rows", "phi"))
    return Dataset(first.objects, first.labels, rows, phi)


def _extremes(data: Dataset) -> Dataset:
    """The scenes with the least and the greatest value of each coordinate and label."""
    if not len(data):
        return data
    table = torch.cat([data.rows, data.phi])
    return data.take(torch.unique(torch.cat([table.argmin(dim=1), table.argmax(dim=1)])))


def _count(nodes: Tensor) -> dict[Way, int]:
    found, counts = torch.unique(nodes.T, dim=0, return_counts=True)
    return {tuple(way): count for way, count in zip(found.tolist(), counts.tolist(), strict=True)}


def _inside(places: Tensor, start: int, stop: int) -> Tensor:
    """Which of start .. stop - 1 are among the places, as (stop - start,) truth values."""
    mask = torch.zeros(stop - start, dtype=torch.bool)
    mask[places[(places >= start) & (places < stop)] - start] = True
    return mask


def _stamp(path: Path) -> tuple[int, int]:
    try:
        found = path.stat()
    except OSError as error:
        raise DataError(CANNOT_READ(path=path, reason=(error.strerror or "").lower())) from error
    return found.st_size, found.st_mtime_ns


# Batches.


WINDOW_NUMBERS = 1 << 24  # coordinates and labels of the scenes of a window


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
        self._spec = spec
        self.table = rank_branches(data.ways)
        self.fitting = self._examples(data.chosen.rows)
        self.held = _plain(self._codec, data.held)
        many = WINDOW_NUMBERS // (row_count(len(spec.core.objects)) + len(spec.labels)) // self.size
        self._batches = max(1, many)  # of a window

    def batches(self, epoch: int, step: int) -> Iterator[Examples]:
        windows = self._data.windows(stream(self.seed, Stream.ORDER, epoch, 0), self._batches * self.size)
        for number, rows in enumerate(windows):
            first = step - number * self._batches
            if first < self._batches:
                yield from self._cut(self._examples(rows).to(self.device), max(0, first), epoch, 1 + number)

    def _examples(self, rows: Tensor) -> Examples:
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
            from scenegen.learn.training.balanced import draw_balanced

            asked = parse_phi([f"{label}={one}" for label, one in config.phi.items()], spec.labels)
            make = partial(draw_balanced, phi=asked)
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
        ends = torch.tensor([ranges.get(label, Range()).ends for label in data.labels])
        found.append(torch.cat([ends, phi], dim=1).double().numpy())
    return tuple(found)


def rank_branches(ways: Mapping[tuple[int, ...], int]) -> Tensor:
    """The table of branches, as scenegen.learn.models.codec.survey makes it, from how often each was met."""
    order = sorted(ways, key=lambda way: (-ways[way], way))
    table = torch.tensor(order, dtype=torch.int64)
    return (
        table
        if len(table) <= MAX_BRANCHES
        else torch.cat([table[: MAX_BRANCHES - 1], torch.full_like(table[:1], OTHER)])
    )


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
