"""Scenes as JSON Lines: the header in the first line, then one scene a line; written and read block by block."""

from __future__ import annotations

from collections.abc import Generator, Iterable, Iterator, Sequence
from pathlib import Path
from typing import IO

from pydantic import ValidationError

from scenegen.errors import DataError, Diagnostic, quoted
from scenegen.formats.blocks import BLOCK, Block, Reading
from scenegen.formats.files import opened
from scenegen.formats.header import dump_header, first_problem, labelled, load_header, not_scenes, odd_objects, parse
from scenegen.formats.lines import SceneLines, block_from, numbers_of
from scenegen.scene.data import SceneData, SceneFile

LONGEST = 1 << 26  # bytes of a line: tens of thousands of objects

Lines = Iterator[tuple[int, bytes]]


def write(sink: IO[bytes], header: SceneFile, labels: Sequence[str], blocks: Iterable[Block]) -> None:
    """The header, then the scenes block by block; floats are written so that they read back bit for bit."""
    header, blocks = labelled(header, labels, blocks)
    sink.write(dump_header(header).encode() + b"\n")
    lines = SceneLines([one.name for one in header.objects], labels)
    for block in blocks:
        sink.write("".join(f"{line}\n" for line in lines.of(block)).encode())


def read(path: Path) -> Reading:
    """Open a file of scenes. The first scene tells the labels. Raises DataError, and so does the iterator of blocks
    where a later line is damaged. A file cut exactly between two lines cannot be told from a shorter one."""
    lines = _lines(path)
    number, first = next(lines, (1, b""))
    if not first.strip():
        raise DataError(not_scenes(str(path), "its first line is empty"))
    header = load_header(first, f"line {number} of {path}")
    objects = [one.name for one in header.objects]
    head = next(lines, None)
    named = header.labels
    header, labels = header.without_scenes(), header.label_names
    if head is None:
        return Reading(header, labels, iter(()), 0, str(path))
    if named is None:
        labels = tuple(_scene(head[1], f"line {head[0]} of {path}", objects, None).phi)
    return Reading(header, labels, _blocks(path, head, lines, objects, labels), None, str(path))


def _lines(path: Path) -> Generator[tuple[int, bytes], None, None]:
    with opened(path, "a scenes file") as file:
        number = 0
        while line := file.readline(LONGEST + 1):
            number += 1
            if len(line) > LONGEST:
                title = f"line {number} of {path} is longer than {LONGEST:,} bytes"
                raise DataError(Diagnostic(title, help="every line after the first is a scene"))
            yield number, line


def _blocks(
    path: Path, head: tuple[int, bytes], rest: Lines, objects: list[str], labels: tuple[str, ...]
) -> Iterator[Block]:
    text = SceneLines(objects, labels)
    found: list[list[float]] = []

    def numbers(number: int, line: bytes) -> list[float]:
        known = text.numbers(line.decode(errors="replace").rstrip("\r\n"))
        if known is None:
            known = numbers_of(_scene(line, f"line {number} of {path}", objects, labels), objects, labels)
        return known

    found.append(numbers(*head))
    for number, line in rest:
        if len(found) == BLOCK:
            yield block_from(found, len(objects), len(labels))
            found = []
        found.append(numbers(number, line))
    yield block_from(found, len(objects), len(labels))


def _scene(line: bytes, name: str, objects: list[str], labels: tuple[str, ...] | None) -> SceneData:
    """A line read with care, whatever its layout. Raises DataError."""
    if not line.strip():
        raise DataError(Diagnostic(f"{name} is empty", help="every line after the first is a scene"))
    _, text = parse(line, name)
    try:
        scene = SceneData.model_validate_json(text)
    except ValidationError as error:
        raise DataError(first_problem(name, error)) from None
    if scene.poses.keys() != set(objects):
        raise DataError(odd_objects(name, set(scene.poses), objects))
    if labels is not None and scene.phi.keys() != set(labels):
        help_ = f"the first scene, or the header, has {quoted(labels)}"
        raise DataError(Diagnostic(f"{name} has other labels than the scenes before", help=help_))
    return scene
