"""Scenes as JSON: the header indented, then one scene a line, so that files can be read, grepped and diffed."""

from __future__ import annotations

import io
import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import IO

from scenegen.errors import DataError, Diagnostic, quoted
from scenegen.formats.blocks import Block, Reading
from scenegen.formats.files import read_bytes
from scenegen.formats.header import odd_objects, parse, scene_file
from scenegen.formats.lines import SceneLines, block_of
from scenegen.scene.data import SceneFile


def write(sink: IO[bytes], header: SceneFile, labels: Sequence[str], blocks: Iterable[Block]) -> None:
    """Scenes block by block; floats are written so that they read back bit for bit."""
    data = header.model_dump(mode="json", exclude={"scenes"})
    text = json.dumps(data, indent=1, ensure_ascii=False, allow_nan=False)
    sink.write(f'{text.removesuffix("}").rstrip()},\n "scenes": ['.encode())
    lines = SceneLines([one.name for one in header.objects], labels)
    between = "\n"
    for block in blocks:
        if block.count:
            sink.write((between + ",\n".join(f"  {line}" for line in lines.of(block))).encode())
            between = ",\n"
    sink.write(b"\n ]\n}\n" if between == ",\n" else b"]\n}\n")


def dump(file: SceneFile) -> bytes:
    """The bytes of a scene file; its scenes have the objects of the file, and the labels of the first."""
    sink = io.BytesIO()
    labels = _labels(file)
    write(sink, file, labels, [block_of(file.scenes, [one.name for one in file.objects], labels)])
    return sink.getvalue()


def read(path: Path) -> Reading:
    """A scenes file, all of it at once, at about 6 kB of memory a scene. Raises DataError."""
    file = load(read_bytes(path, "a scenes file"), str(path))
    labels = _labels(file)
    block = block_of(file.scenes, [one.name for one in file.objects], labels)
    return Reading(file.model_copy(update={"scenes": []}), labels, iter([block]))


def load(data: bytes, name: str) -> SceneFile:
    """The scene file in some bytes; `name` is what errors call it. Raises DataError."""
    file = scene_file(*parse(data, name), name)
    names = [one.name for one in file.objects]
    for number, scene in enumerate(file.scenes, 1):
        if scene.poses.keys() != set(names):
            raise DataError(odd_objects(f"scene {number} of {name}", set(scene.poses), names))
        if scene.phi.keys() != file.scenes[0].phi.keys():
            help_ = f"scene 1 has {quoted(file.scenes[0].phi)}"
            raise DataError(Diagnostic(f"scene {number} of {name} has other labels than scene 1", help=help_))
    return file


def _labels(file: SceneFile) -> tuple[str, ...]:
    return tuple(file.scenes[0].phi) if file.scenes else ()
