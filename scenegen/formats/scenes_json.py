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
from scenegen.formats.header import labelled, odd_objects, parse, scene_file
from scenegen.formats.lines import SceneLines, block_of
from scenegen.scene.data import SceneFile


def write(sink: IO[bytes], header: SceneFile, labels: Sequence[str], blocks: Iterable[Block]) -> None:
    """Scenes block by block; floats are written so that they read back bit for bit."""
    header, blocks = labelled(header, labels, blocks)
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
    labels = file.label_names
    write(sink, file, labels, [block_of(file.scenes, [one.name for one in file.objects], labels)])
    return sink.getvalue()


def read(path: Path) -> Reading:
    """A scenes file, all of it at once, at about 6 kB of memory a scene. Raises DataError."""
    file = load(read_bytes(path, "a scenes file"), str(path))
    labels = file.label_names
    block = block_of(file.scenes, [one.name for one in file.objects], labels)
    return Reading(file.without_scenes(), labels, iter([block]))


def load(data: bytes, name: str) -> SceneFile:
    """The scene file in some bytes; `name` is what errors call it. Raises DataError."""
    file = scene_file(*parse(data, name), name)
    names = [one.name for one in file.objects]
    labels = set(file.label_names if file.labels is None else file.labels)
    for number, scene in enumerate(file.scenes, 1):
        if scene.poses.keys() != set(names):
            raise DataError(odd_objects(f"scene {number} of {name}", set(scene.poses), names))
        if scene.phi.keys() != labels:
            whose = "scene 1" if file.labels is None else "the file's `labels`"
            title = f"scene {number} of {name} has other labels than {whose}"
            raise DataError(Diagnostic(title, help=f"these are {quoted(sorted(labels))}"))
    return file

