"""Scenes as JSON: the header indented, then one scene a line, so that files can be read, grepped and diffed."""

from __future__ import annotations

import io
import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import IO

from scenegen.errors import DataError, OutputError
from scenegen.errors.files import OTHER_LABELS, TOO_LARGE_TO_WRITE
from scenegen.scenes.blocks import Block, SceneFileReading
from scenegen.scenes.data import SceneFile
from scenegen.scenes.files import read_bytes
from scenegen.scenes.formats.header import HEADING, check_objects, parse, scene_file, with_labels
from scenegen.scenes.formats.jsonl import block_of, texts

MAX_JSON_BYTES = 1 << 28  # of a file: reading it as a whole takes about thirty times as much memory
BYTES = 32  # of a number with its name, approximately
REMEDY = ".jsonl and .parquet files are read part by part, and may be of any size"


def write(sink: IO[bytes], header: SceneFile, labels: Sequence[str], blocks: Iterable[Block]) -> None:
    """Scenes block by block; floats are written so that they read back bit for bit. Raises OutputError for more than
    `read` accepts."""
    header, blocks = with_labels(header, labels, blocks)
    data = header.model_dump(mode="json", exclude={"scenes"})
    text = json.dumps(data, indent=1, ensure_ascii=False, allow_nan=False)
    head = f'{text.removesuffix("}").rstrip()},\n "scenes": ['.encode()
    sink.write(head)
    size = len(head)
    between = b"\n"
    for lines in texts(header, labels, blocks, "  ", ",\n"):
        size += len(between) + len(lines)
        if size > MAX_JSON_BYTES:
            raise OutputError(TOO_LARGE_TO_WRITE(limit=MAX_JSON_BYTES))
        sink.write(between)
        sink.write(lines)
        between = b",\n"
    sink.write(b"\n ]\n}\n" if between == b",\n" else b"]\n}\n")


def dump(file: SceneFile) -> bytes:
    """The bytes of a scene file; its scenes have the objects of the file, and the labels of the first."""
    sink = io.BytesIO()
    labels = file.label_names
    write(sink, file, labels, [block_of(file.scenes, file, labels)])
    return sink.getvalue()


def read(path: Path) -> SceneFileReading:
    """A scenes file, read as a whole, with about 6 kB of memory per scene. Raises DataError, also for more than
    MAX_JSON_BYTES."""
    file = load(read_bytes(path, "a scenes file", limit=MAX_JSON_BYTES, remedy=REMEDY), str(path))
    labels = file.label_names
    block = block_of(file.scenes, file, labels)
    return SceneFileReading(file.without_scenes(), labels, iter([block]), block.count, str(path))


def load(data: bytes, name: str) -> SceneFile:
    """The scene file in some bytes; `name` is its name in errors. Raises DataError."""
    raw, text = parse(data, name)
    raw = {key: raw.get(key) for key in HEADING} if isinstance(raw, dict) else None  # the rest is large, and not needed
    file = scene_file(raw, text, name)
    labels = set(file.label_names if file.labels is None else file.labels)
    for number, scene in enumerate(file.scenes, 1):
        check_objects(file, scene, f"scene {number} of {name}")
        if scene.phi.keys() != labels:
            whose = "scene 1" if file.labels is None else "the header"
            scene_name = f"scene {number} of {name}"
            raise DataError(OTHER_LABELS(scene=scene_name, whose=whose, labels=tuple(sorted(labels))))
    return file
