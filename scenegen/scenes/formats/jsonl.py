"""Scenes as JSON Lines: the header, then one scene a line; and these lines, which .json files have, too.

Formatting a template takes a few microseconds per scene, a general JSON encoder several times as much; matching a line
with the same template saves as much time in reading.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Generator, Iterable, Iterator, Mapping, Sequence
from operator import attrgetter
from pathlib import Path
from typing import IO

import numpy as np
from pydantic import ValidationError

from scenegen.arrays import Array
from scenegen.errors import DataError
from scenegen.errors.files import BAD_LINE, OTHER_LABELS
from scenegen.pose import NAMES, row_count, rows_of
from scenegen.scenes.blocks import (
    BLOCK,
    Block,
    SceneFileReading,
    check_finite,
    counts_in,
    member_of,
    possible_numbers,
    regroup,
)
from scenegen.scenes.data import SceneData, SceneFile, chosen_surface
from scenegen.scenes.files import open_input
from scenegen.scenes.formats.header import (
    check_objects,
    dump_header,
    first_problem,
    load_header,
    not_scenes,
    parse,
    with_labels,
)

# Numbers that are finite for any digits; others are left to the strict reader.
_NUMBER_PATTERN = r"(-?(?:0|[1-9][0-9]{0,16})(?:\.[0-9]+)?(?:[eE][+-]?[0-9]{1,2})?)"
_pose_numbers = attrgetter(*NAMES)
_HOLE = "\0"  # cannot occur in JSON text


class SceneLines:
    """The text of scenes of a file. `numbers` is how many things there are in all of them, if that is drawn."""

    def __init__(self, header: SceneFile, labels: Sequence[str], numbers: Mapping[str, int] | None = None) -> None:
        self._header = header
        self._names = {
            header.objects.index(one): [_text(surface.on) for surface in one.support.any]
            for one in header.choosers
            if one.support is not None
        }
        place = ", ".join(f"{_text(axis)}: {_HOLE}" for axis in NAMES)
        more = f', "on": {_HOLE}'
        poses = (
            f"{_text(one.name)}: {{{place}{more if number in self._names else ''}}}"
            for number, one in enumerate(header.objects)
        )
        phi = ", ".join(f"{_text(label)}: {_HOLE}" for label in labels)
        every = ", ".join(poses)
        counts = f'"counts": {json.dumps(numbers, ensure_ascii=False)}, ' if numbers else ""
        parts = f'{{{counts}"poses": {{{every}}}, "phi": {{{phi}}}}}'.split(_HOLE)
        order: list[int] = []  # of the numbers in a line, as they stand in a block
        kinds: list[list[str] | None] = []  # of each number in a line, the texts that stand for 1, 2, ...
        for number in range(len(header.objects)):
            order.extend(rows_of(number))
            if number in self._names:
                order.append(row_count(len(header.objects)) + list(self._names).index(number))
        order.extend(range(header.coordinates, header.coordinates + len(labels)))
        chosen = dict(zip(range(row_count(len(header.objects)), header.coordinates), self._names.values(), strict=True))
        kinds = [chosen.get(row) for row in order]
        self._order, self._kinds = (order, kinds) if self._names else ([], [])
        self._template = "%r".join(part.replace("%", "%%") for part in parts)
        self._pattern = re.compile(_NUMBER_PATTERN.join(map(re.escape, parts)))
        if self._names:
            holes = ["%r" if kind is None else "%s" for kind in kinds]
            wanted = [_NUMBER_PATTERN if kind is None else f"({'|'.join(map(re.escape, kind))})" for kind in kinds]
            self._template = "".join(
                part.replace("%", "%%") + hole for part, hole in zip(parts, [*holes, ""], strict=True)
            )
            self._pattern = re.compile(
                "".join(re.escape(part) + hole for part, hole in zip(parts, [*wanted, ""], strict=True))
            )

    def lines_of(self, block: Block) -> list[str]:
        """A line for each scene of a block; floats are written so that they read back bit for bit."""
        check_finite(self._header, block)
        numbers: list[list[float]] = np.concatenate([block.rows, block.phi]).T.tolist()
        if not self._names:
            return [self._template % tuple(scene) for scene in numbers]
        return [
            self._template
            % tuple(
                scene[row] if kind is None else kind[int(scene[row]) - 1]
                for row, kind in zip(self._order, self._kinds, strict=True)
            )
            for scene in numbers
        ]

    def numbers(self, line: str) -> list[float] | None:
        """The numbers of a scene, in the order of a block, in a line as `of` writes it; None for any other text."""
        match = self._pattern.fullmatch(line)
        if match is None:
            return None
        if not self._names:
            return [float(number) for number in match.groups()]
        found = [0.0] * len(self._order)
        for row, kind, text in zip(self._order, self._kinds, match.groups(), strict=True):
            found[row] = float(text) if kind is None else 1.0 + kind.index(text)
        return found


def _text(name: str) -> str:
    return json.dumps(name, ensure_ascii=False)


def numbers_of(scene: SceneData, header: SceneFile, labels: Sequence[str], name: str = "a scene") -> list[float]:
    """The numbers of a scene of these objects and labels, in the order of a block; `name` is that of the scene in
    errors. Raises DataError for an object on a surface that the header does not have."""
    absent = (math.nan,) * len(NAMES)
    poses = (scene.poses.get(one.name) for one in header.objects)
    places = [value for pose in poses for value in (absent if pose is None else _pose_numbers(pose))]
    on = (
        chosen_surface(name, one, scene.poses[one.name]) if one.name in scene.poses else math.nan
        for one in header.choosers
    )
    return [*places, *on, *(scene.phi[label] for label in labels)]


def block_from(numbers: Sequence[Sequence[float]], coordinates: int, labels: int) -> Block:
    """Scenes as a block, from the coordinates and L values of phi of each."""
    table: Array = np.array(numbers, dtype=np.float64).reshape(len(numbers), coordinates + labels).T
    return Block(np.ascontiguousarray(table[:coordinates]), np.ascontiguousarray(table[coordinates:]))


def block_of(scenes: Sequence[SceneData], header: SceneFile, labels: Sequence[str]) -> Block:
    """Scenes as a block; every one has the objects of the header, and these labels. Raises DataError as `numbers_of`
    does."""
    numbers = [numbers_of(scene, header, labels, f"scene {number}") for number, scene in enumerate(scenes, 1)]
    return block_from(numbers, header.coordinates, len(labels))


SCENES_AT_A_TIME = 8192  # scenes whose text is in memory at a time

Index = tuple[int, ...]


def lines_of(header: SceneFile, labels: Sequence[str]) -> SceneLines | NumberedLines:
    """The text of scenes of a file."""
    return NumberedLines(header, labels) if header.counts else SceneLines(header, labels)


def texts(
    header: SceneFile, labels: Sequence[str], blocks: Iterable[Block], before: str, between: str
) -> Iterator[bytes]:
    """The lines of some scenes at a time, with something before each, and something between two."""
    lines = lines_of(header, labels)
    for block in regroup(blocks, SCENES_AT_A_TIME):
        yield between.join(f"{before}{line}" for line in lines.lines_of(block)).encode()


class NumberedLines:
    """The text of scenes of a file in which numbers of things are drawn."""

    def __init__(self, header: SceneFile, labels: Sequence[str]) -> None:
        self._header, self._labels = header, labels
        self._members: dict[Index, tuple[SceneLines, list[int]]] = {}
        self._heads: dict[str, tuple[SceneLines, list[int]]] = {}
        numbers = ", ".join(
            f"{re.escape(json.dumps(one.name, ensure_ascii=False))}: ([0-9]{{1,5}})" for one in header.counts
        )
        self._pattern = re.compile(rf'\{{"counts": \{{{numbers}\}}')

    def lines_of(self, block: Block) -> list[str]:
        """A line for each scene of a block; floats are written so that they read back bit for bit."""
        found = counts_in(self._header, block.rows)
        lines = [""] * block.count
        for numbers in np.unique(found, axis=1).T:
            mine = np.flatnonzero((found == numbers[:, None]).all(axis=0))
            text, rows = self._member(tuple(numbers.tolist()))
            some = Block(block.rows[np.array(rows)[:, None], mine], block.phi[:, mine])
            for place, line in zip(mine, text.lines_of(some), strict=True):
                lines[place] = line
        return lines

    def numbers(self, line: str) -> list[float] | None:
        """The numbers of a scene, in the order of a block, in a line as `of` writes it; None for any other text."""
        head = line[: line.find("}") + 1]
        known = self._heads.get(head) or self._read_head(head)
        if known is None:
            return None
        text, rows = known
        found = text.numbers(line)
        if found is None:
            return None
        whole = [math.nan] * self._header.coordinates
        for row, value in zip(rows, found, strict=False):  # phi comes after the coordinates
            whole[row] = value
        return whole + found[len(rows) :]

    def _read_head(self, head: str) -> tuple[SceneLines, list[int]] | None:
        """The member that the beginning of a line names, kept for later lines."""
        match = self._pattern.fullmatch(head)
        counts = () if match is None else tuple(map(int, match.groups()))
        drawn = self._header.counts
        if match is None or any(many not in possible_numbers(one) for one, many in zip(drawn, counts, strict=True)):
            return None
        self._heads[head] = self._member(counts)
        return self._heads[head]

    def _member(self, counts: Index) -> tuple[SceneLines, list[int]]:
        """The text of scenes with these numbers of things, and the rows of their objects among those of all."""
        if counts not in self._members:
            header = self._header
            numbers = dict(zip((one.name for one in header.counts), counts, strict=True))
            member = member_of(header, numbers)
            here = {one.name for one in member.objects}
            rows = [row for which, one in enumerate(header.objects) if one.name in here for row in rows_of(which)]
            first = row_count(len(header.objects))
            rows += [first + which for which, one in enumerate(header.choosers) if one.name in here]
            self._members[counts] = SceneLines(member, self._labels, numbers), rows
        return self._members[counts]


MAX_LINE_BYTES = 1 << 26  # bytes of a line: tens of thousands of objects

Lines = Iterator[tuple[int, bytes]]


def write(sink: IO[bytes], header: SceneFile, labels: Sequence[str], blocks: Iterable[Block]) -> None:
    """The header, then the scenes block by block; floats are written so that they read back bit for bit."""
    header, blocks = with_labels(header, labels, blocks)
    sink.write(dump_header(header).encode() + b"\n")
    for text in texts(header, labels, blocks, "", "\n"):
        sink.write(text)
        sink.write(b"\n")


def read(path: Path) -> SceneFileReading:
    """Open a file of scenes. The labels are those of the first scene. Raises DataError, and so does the iterator of
    blocks if a later line is damaged. A file that was cut exactly between two lines cannot be distinguished from a
    shorter one."""
    lines = _lines(path)
    number, first = next(lines, (1, b""))
    if not first.strip():
        raise DataError(not_scenes(str(path), "its first line is empty"))
    header = load_header(first, f"line {number} of {path}")
    head = next(lines, None)
    named = header.labels
    header, labels = header.without_scenes(), header.label_names
    if head is None:
        return SceneFileReading(header, labels, iter(()), 0, str(path))
    if named is None:
        labels = tuple(_scene(head[1], f"line {head[0]} of {path}", header, None).phi)
    return SceneFileReading(header, labels, _blocks(path, head, lines, header, labels), None, str(path))


def _lines(path: Path) -> Generator[tuple[int, bytes], None, None]:
    with open_input(path, "a scenes file") as file:
        number = 0
        while line := file.readline(MAX_LINE_BYTES + 1):
            number += 1
            if len(line) > MAX_LINE_BYTES:
                raise DataError(BAD_LINE(line=f"line {number} of {path}", limit=MAX_LINE_BYTES))
            yield number, line


def _blocks(
    path: Path, head: tuple[int, bytes], rest: Lines, header: SceneFile, labels: tuple[str, ...]
) -> Iterator[Block]:
    text = lines_of(header, labels)
    found: list[list[float]] = []

    def numbers(number: int, line: bytes) -> list[float]:
        known = text.numbers(line.decode(errors="replace").rstrip("\r\n"))
        if known is None:
            name = f"line {number} of {path}"
            known = numbers_of(_scene(line, name, header, labels), header, labels, name)
        return known

    found.append(numbers(*head))
    for number, line in rest:
        if len(found) == BLOCK:
            yield block_from(found, header.coordinates, len(labels))
            found = []
        found.append(numbers(number, line))
    yield block_from(found, header.coordinates, len(labels))


def _scene(line: bytes, name: str, header: SceneFile, labels: tuple[str, ...] | None) -> SceneData:
    """A line in any layout, read strictly. Raises DataError."""
    if not line.strip():
        raise DataError(BAD_LINE(line=name))
    _, text = parse(line, name)
    try:
        scene = SceneData.model_validate_json(text)
    except ValidationError as error:
        raise DataError(first_problem(name, error)) from None
    check_objects(header, scene, name)
    if labels is not None and scene.phi.keys() != set(labels):
        raise DataError(OTHER_LABELS(scene=name, whose="the first scene, or the header,", labels=tuple(labels)))
    return scene
