"""Scenes as blocks of arrays, the input and output of all file formats; and how many things there are in each of them,
where that is drawn."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol, Self, TypeVar

import numpy as np
import numpy.typing as npt

from scenegen.arrays import Array, Index
from scenegen.errors import DataError, OutputError
from scenegen.errors.files import COLUMN_TWICE, TOO_MANY_TO_READ
from scenegen.pose import EVERY, NAMES, X, row_count, rows_along

if TYPE_CHECKING:  # with it comes pydantic, 0.1 s of every worker's start; workers that draw know no headers
    from scenegen.scenes.data import CountData, ObjectData, SceneData, SceneFile


BLOCK = 65_536  # scenes of a block, and of a row group of a Parquet file
MAX_NUMBERS = 1 << 26  # coordinates and values of phi that are read into memory at once: 537 MB


@dataclass(frozen=True, slots=True, eq=False)
class Block:
    """m scenes: `rows` (3N, m) in the order of the file's objects, metres and radians; `phi` (L, m) in label order."""

    rows: Array
    phi: Array

    @property
    def count(self) -> int:
        return int(self.rows.shape[1])

    def part(self, start: int, stop: int) -> Block:
        """The scenes from `start` up to, not including, `stop`."""
        return Block(self.rows[:, start:stop], self.phi[:, start:stop])

    def take(self, which: npt.NDArray[np.intp]) -> Block:
        """The scenes of these numbers, each row in one piece of memory, which `rows[:, which]` does not give."""
        return Block(take_columns([self.rows], which), take_columns([self.phi], which))


@dataclass(frozen=True, slots=True, eq=False)
class SceneFileReading:
    """An open scene file. `header` has no scenes in it; `blocks` gives them, once, and closes the file at its end.
    `count` is their number, if the file has it before they are read; `name` is the file's name in errors."""

    header: SceneFile
    labels: tuple[str, ...]
    blocks: Iterator[Block]
    count: int | None = None
    name: str = "this file"

    def whole(self, start: int = 0, stop: int | None = None) -> Block:
        """All scenes at once, or those from `start` up to, not including, `stop`. Raises DataError if they are too many
        for memory; before they are read, if the file has their number."""
        coordinates = self.header.coordinates
        most = MAX_NUMBERS // (coordinates + len(self.labels))
        known = self.count if stop is None else stop if self.count is None else min(stop, self.count)
        if known is not None and known - start > most:
            raise self._too_many(f"{known - start:,}", most)
        found: list[Block] = []
        done = held = 0
        for block in self.blocks:
            part = block.part(max(0, start - done), block.count if stop is None else max(0, stop - done))
            done += block.count
            held += part.count
            if held > most:
                raise self._too_many(f"more than {most:,}", most)
            found.append(part)
            if stop is not None and done >= stop:
                break
        return join_blocks(found, coordinates, len(self.labels))

    def _too_many(self, count: str, most: int) -> DataError:
        objects = len(self.header.objects)
        return DataError(TOO_MANY_TO_READ(file=self.name, count=count, objects=objects, most=most))


def take_columns(arrays: Sequence[Array], which: npt.NDArray[np.intp]) -> Array:
    """Columns of arrays that stand side by side. Row by row, which is three times as fast as all rows at once: a row
    stays in the cache. The numbers must be valid."""
    found = np.empty((len(arrays[0]), len(which)))
    for row in range(len(found)):
        line = arrays[0][row] if len(arrays) == 1 else np.concatenate([array[row] for array in arrays])
        np.take(line, which, out=found[row], mode="clip")  # "raise" would need a copy of the result
    return found


def join_blocks(blocks: Sequence[Block], coordinates: int, labels: int) -> Block:
    """Several blocks as one; (coordinates, 0) and (labels, 0) if there are none."""
    rows = np.concatenate([np.empty((coordinates, 0)), *(block.rows for block in blocks)], axis=1)
    phi = np.concatenate([np.empty((labels, 0)), *(block.phi for block in blocks)], axis=1)
    return Block(rows, phi)


def regroup(blocks: Iterable[Block], size: int = BLOCK) -> Iterator[Block]:
    """The same scenes in blocks of exactly `size`, except the last one; at most `size` scenes are held in memory."""
    waiting: list[Block] = []
    count = 0
    for block in blocks:
        start = 0
        while count + block.count - start >= size:
            stop = start + size - count
            waiting.append(block.part(start, stop))
            yield _merge(waiting)
            waiting, count, start = [], 0, stop
        if start < block.count:
            waiting.append(block.part(start, block.count))
            count += block.count - start
    if waiting:
        yield _merge(waiting)


def _merge(blocks: list[Block]) -> Block:
    return blocks[0] if len(blocks) == 1 else join_blocks(blocks, len(blocks[0].rows), len(blocks[0].phi))


def check_finite(header: SceneFile, block: Block) -> None:
    """Files never contain infinities or NaN, and samplers never return them, but for the rows of objects that are not
    there. Raises ValueError: a bug, not a user's mistake."""
    if not (np.isfinite(block.phi).all() and (header.counts or np.isfinite(block.rows).all())):
        raise ValueError("a scene with a number that is not finite was to be written")
    if header.counts:
        counts_in(header, block.rows)


def counts_in(header: SceneFile, rows: Array) -> npt.NDArray[np.intp]:
    """(C, m): how many things there are in scenes, rows (3N + ..., m), NaN in those of objects that are not there.
    Raises ValueError where other rows are not finite, or are of objects that should not be there."""
    names = [one.name for one in header.objects]
    finite = np.isfinite(rows)
    found = numbers_in(names, header.counts, finite[: row_count(len(names))][rows_along(X)].T)
    there = present(names, header.counts, found).T
    choosers = [names.index(one.name) for one in header.choosers]
    wanted = np.concatenate([np.repeat(there, len(EVERY), axis=0), there[choosers]])
    if (finite != wanted).any() or np.isinf(rows).any():
        raise ValueError(f"scene {int(np.flatnonzero((finite != wanted).any(axis=0))[0]) + 1}")
    return found


PHI = "phi."
COUNT_PREFIX = "count."
RARITY = "log10p."  # after phi, in data sets: how rare each scene's phi is


def columns(header: SceneFile, labels: Sequence[str]) -> list[str]:
    """The names of the columns, in their order: the 3N coordinates `mug.x`, ..., then `mug.on` of each object that
    stands on one of several surfaces (its number in the header, counted from 1), then `count.block` of each array whose
    number of elements is drawn, then phi of each label.

    Raises OutputError if an object `phi` and a label `x` would share one.
    """
    places = [f"{one.name}.{axis}" for one in header.objects for axis in NAMES]
    more = [*(f"{one.name}.on" for one in header.choosers), *(f"{COUNT_PREFIX}{one.name}" for one in header.counts)]
    names = [*places, *more, *(f"{PHI}{label}" for label in labels)]
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise OutputError(COLUMN_TWICE(name=twice))
    return names


# How many things there are in a scene, where that is drawn: absent objects have no pose, and NaN in arrays of poses.
#
# Of an array with counts the first elements are there, `block[1]` to `block[5]`: numbers and poses say the same.


Mask = npt.NDArray[np.bool_]


class DrawnCount(Protocol):
    """An array of objects whose number of elements is drawn, `least` to `most`, of these only those that are `values`,
    if any are; or, with `assets`, an object that is there as one of them: `mug:red` or `mug:blue`, counted from 1."""

    @property
    def name(self) -> str: ...
    @property
    def least(self) -> int: ...
    @property
    def most(self) -> int: ...
    @property
    def assets(self) -> Sequence[str]: ...
    @property
    def values(self) -> Sequence[int]: ...


class Header(Protocol):
    """What files of scenes and of motions say of their objects."""

    objects: list[ObjectData]
    counts: list[CountData]

    def model_copy(self, *, update: Mapping[str, Any] | None = None) -> Self: ...


AnyHeader = TypeVar("AnyHeader", bound=Header)


def element(one: DrawnCount, number: int) -> str:
    """The name of an object that there can be, counted from 1."""
    return f"{one.name}:{one.assets[number - 1]}" if one.assets else f"{one.name}[{number}]"


def possible_numbers(one: DrawnCount) -> Sequence[int]:
    """Every number of elements, or of an asset, that there can be."""
    return one.values or range(one.least, one.most + 1)


def _there(one: DrawnCount, number: int) -> range:
    """Which of the objects that there can be are there."""
    return range(number, number + 1) if one.assets else range(1, number + 1)


def elements(objects: Sequence[str], one: DrawnCount) -> list[int]:
    """The places of an array's elements among the objects, in order. Raises KeyError where one is not there."""
    place = {name: number for number, name in enumerate(objects)}
    return [place[element(one, k)] for k in range(1, one.most + 1)]


def present(objects: Sequence[str], counts: Sequence[DrawnCount], numbers: Index) -> Mask:
    """(n, N): which objects are there in scenes with these numbers of things, (C, n)."""
    there = np.ones((numbers.shape[1], len(objects)), dtype=bool)
    for one, number in zip(counts, numbers, strict=True):
        which = np.arange(1, one.most + 1)
        there[:, elements(objects, one)] = which == number[:, None] if one.assets else which <= number[:, None]
    return there


def numbers_in(objects: Sequence[str], counts: Sequence[DrawnCount], there: Mask) -> Index:
    """(C, n): how many of each array there are in scenes where these objects are there, (n, N). Raises ValueError for a
    scene that lacks other objects than the last elements of arrays, or has too few or too many of them."""
    found = np.array([_number(one, there[:, elements(objects, one)]) for one in counts], dtype=np.intp)
    found = found.reshape(len(counts), len(there))
    bad = (present(objects, counts, found) != there).any(axis=1)
    for one, number in zip(counts, found, strict=True):
        bad |= ~np.isin(number, possible_numbers(one))
    if bad.any():
        raise ValueError(f"scene {int(np.flatnonzero(bad)[0]) + 1}")
    return found


def _number(one: DrawnCount, there: Mask) -> Index:
    """(n,): how many are there, or which asset; (n, most)."""
    found: Index = there.argmax(axis=1) + 1 if one.assets else there.sum(axis=1)
    return found


def member_of(header: AnyHeader, numbers: Mapping[str, int]) -> AnyHeader:
    """The header of the scenes or motions with these numbers of things, without the objects that are not there."""
    names = [one.name for one in header.objects]
    found = np.array([[numbers[one.name]] for one in header.counts], dtype=np.intp)
    there = present(names, header.counts, found)[0]
    objects = [one for one, here in zip(header.objects, there, strict=True) if here]
    return header.model_copy(update={"objects": objects, "counts": []})


def check_counts(header: SceneFile, scene: SceneData) -> None:
    """A scene says how many things there are where that is drawn, and only there. Raises ValueError."""
    check_numbers(header.counts, scene.counts or {})


def check_numbers(counts: Sequence[DrawnCount], numbers: Mapping[str, int]) -> None:
    """Numbers of things are those that a header's `counts` has. Raises ValueError."""
    if numbers.keys() != {one.name for one in counts}:
        raise ValueError(
            "the numbers are not those of the header's `counts`" if counts else "the header has no `counts`"
        )
    for one in counts:
        if numbers[one.name] not in possible_numbers(one):
            what = f"asset {numbers[one.name]}" if one.assets else str(numbers[one.name])
            raise ValueError(f"there cannot be {what} of `{one.name}`")


def objects_of(header: Header, numbers: Mapping[str, int]) -> list[str]:
    """The names of the objects that are there with these numbers of things."""
    absent = {
        element(one, k)
        for one in header.counts
        for k in range(1, one.most + 1)
        if k not in _there(one, numbers[one.name])
    }
    return [one.name for one in header.objects if one.name not in absent]
