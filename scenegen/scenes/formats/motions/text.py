"""Motions as JSON (one document, a motion a line) and as JSON Lines (the header in the first line)."""

from __future__ import annotations

import json
from pathlib import Path
from typing import IO, Any

from pydantic import ValidationError

from scenegen.errors import DataError
from scenegen.errors.time import DAMAGED_MOTIONS, NOT_MOTIONS
from scenegen.scenes.files import read_bytes
from scenegen.scenes.formats.header import parse
from scenegen.scenes.formats.motions.table import MotionArrays, arrays_of
from scenegen.scenes.motions import MOTIONS_FORMAT, MotionFile

MOST_BYTES = 1 << 28  # of a file, which is read as a whole


def write(sink: IO[bytes], motions: MotionArrays, ending: str) -> None:
    """Floats are written so that they read back bit for bit."""
    header = motions.header.model_dump(mode="json", exclude={"motions"})
    lines = (_line(motions.data(number)) for number in range(len(motions)))
    if ending == ".jsonl":
        sink.write(f"{_line(header)}\n".encode())
        for line in lines:
            sink.write(f"{line}\n".encode())
        return
    head = json.dumps(header, indent=1, ensure_ascii=False, allow_nan=False).removesuffix("}").rstrip()
    sink.write(f'{head},\n "motions": ['.encode())
    between = "\n"
    for line in lines:
        sink.write(f"{between}  {line}".encode())
        between = ",\n"
    sink.write(b"\n ]\n}\n")


def _line(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False, allow_nan=False)


def read(path: Path) -> MotionArrays:
    """Raises DataError."""
    data = read_bytes(path, "a motions file", limit=MOST_BYTES, remedy="write the motions to several files")
    if path.suffix.lower() == ".jsonl":
        first, *lines = data.split(b"\n")
        raw, _ = parse(first, f"line 1 of {path}")
        if isinstance(raw, dict):
            motions = [parse(line, f"line {n} of {path}")[0] for n, line in enumerate(lines, 2) if line.strip()]
            raw = {**raw, "motions": motions}
    else:
        raw, _ = parse(data, str(path))
    return arrays_of(motion_file(raw, str(path)))


def motion_file(raw: Any, name: str) -> MotionFile:
    """The motion file from a JSON value. Raises DataError."""
    if not isinstance(raw, dict) or raw.get("format") != MOTIONS_FORMAT:
        raise DataError(NOT_MOTIONS(file=name, reason=f'its "format" is not "{MOTIONS_FORMAT}"'))
    try:
        return MotionFile.model_validate_json(json.dumps(raw))
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        place = ".".join(str(part + 1) if isinstance(part, int) else str(part) for part in first["loc"])
        raise DataError(DAMAGED_MOTIONS(file=name, place=place, reason=first["msg"].lower())) from None
