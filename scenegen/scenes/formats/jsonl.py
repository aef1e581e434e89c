"""Scenes as JSON Lines: the header in the first line, then one scene a line; written and read block by block."""

from __future__ import annotations

from collections.abc import Generator, Iterable, Iterator, Sequence
from pathlib import Path
from typing import IO

from pydantic import ValidationError

from scenegen.errors import DataError
from scenegen.errors.files import EMPTY_LINE, LONG_LINE, OTHER_LABELS
from scenegen.scenes.blocks import BLOCK, Block, SceneFileReading
from scenegen.scenes.data import SceneData, SceneFile
from scenegen.scenes.files import opened
from scenegen.scenes.formats.header import (
    check_objects,
    dump_header,
    first_problem,
    labelled,
    load_header,
    not_scenes,
    parse,
)
from scenegen.scenes.formats.lines import block_from, lines_of, numbers_of, texts

LONGEST = 1 << 26  # bytes of a line: tens of thousands of objects

Lines = Iterator[tuple[int, bytes]]


def write(sink: IO[bytes], header: SceneFile, labels: Sequence[str], blocks: Iterable[Block]) -> None:
    """The header, then the scenes block by block; floats are written so that they read back bit for bit."""
    header, blocks = labelled(header, labels, blocks)
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
    with opened(path, "a scenes file") as file:
        number = 0
        while line := file.readline(LONGEST + 1):
            number += 1
            if len(line) > LONGEST:
                raise DataError(LONG_LINE(line=f"line {number} of {path}", limit=LONGEST))
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
        raise DataError(EMPTY_LINE(line=name))
    _, text = parse(line, name)
    try:
        scene = SceneData.model_validate_json(text)
    except ValidationError as error:
        raise DataError(first_problem(name, error)) from None
    check_objects(header, scene, name)
    if labels is not None and scene.phi.keys() != set(labels):
        raise DataError(OTHER_LABELS(scene=name, whose="the first scene, or the header,", labels=tuple(labels)))
    return scene
