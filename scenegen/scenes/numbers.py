"""How many things there are in a scene, where that is drawn: absent objects have no pose, and NaN in arrays of poses.

Of an array with counts the first elements are there, `block[1]` to `block[5]`: numbers and poses say the same.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Protocol, Self, TypeVar

import numpy as np
import numpy.typing as npt

from scenegen.scenes.data import CountData, ObjectData, SceneData, SceneFile

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.intp]
Mask = npt.NDArray[np.bool_]


class DrawnCount(Protocol):
    """An array of objects whose number of elements is drawn, `least` to `most`; or, with `assets`, an object that is
    there as one of them: `mug:red` or `mug:blue`, counted from 1."""

    @property
    def name(self) -> str: ...
    @property
    def least(self) -> int: ...
    @property
    def most(self) -> int: ...
    @property
    def assets(self) -> Sequence[str]: ...


class Header(Protocol):
    """What files of scenes and of motions say of their objects."""

    objects: list[ObjectData]
    counts: list[CountData]

    def model_copy(self, *, update: Mapping[str, Any] | None = None) -> Self: ...


AnyHeader = TypeVar("AnyHeader", bound=Header)


def element(one: DrawnCount, number: int) -> str:
    """The name of an object that there can be, counted from 1."""
    return f"{one.name}:{one.assets[number - 1]}" if one.assets else f"{one.name}[{number}]"


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
        bad |= (number < one.least) | (number > one.most)
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
        if not one.least <= numbers[one.name] <= one.most:
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
