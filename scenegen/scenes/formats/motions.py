"""Motions as arrays and in files: JSON (one document, a motion a line), JSON Lines, CSV; `motions_parquet` has Parquet.

A motion is stored as a scene is, as a column of a block: x at every moment, y and theta of one object after the other,
then its facts; (3N (T + 1) + F, m). `header` is the motion file without its motions.
"""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, NamedTuple

import numpy as np
from pydantic import ValidationError

from scenegen.arrays import Array, Index
from scenegen.errors import DataError
from scenegen.errors.files import DAMAGED_MOTIONS, NO_HEADER_IN_CSV, NOT_MOTIONS
from scenegen.pose import NAMES, X, as_rows
from scenegen.scenes.blocks import COUNT_PREFIX, Block, member_of, numbers_in
from scenegen.scenes.data import SCENES_VERSION, VERSION_WITH_HEIGHTS, RequestData, SceneFile
from scenegen.scenes.files import ending_of, read_bytes
from scenegen.scenes.formats.header import parse
from scenegen.scenes.motions import MOTIONS_FORMAT, MotionData, MotionFile

MOTION_FACTS = ("moved", "way")  # of sampled motions: how many objects ever move, and the metres that all go together
VALUE_KINDS = ("phi", "facts")
MAX_MOTIONS_BYTES = 1 << 28  # of a text file, which is read as a whole


@dataclass(frozen=True, slots=True, eq=False)
class MotionArrays:
    """n motions of N objects over T steps: `poses` (n, T + 1, N, 3), x and y in metres and theta in radians, objects in
    the order of `objects`; by name `phi` and `facts`, (n,) each. `header` is the motion file without motions. Objects
    that are not there have NaN, where the number of things is drawn."""

    poses: Array
    phi: Mapping[str, Array]
    facts: Mapping[str, Array]
    header: MotionFile

    def __len__(self) -> int:
        return len(self.poses)

    @property
    def objects(self) -> tuple[str, ...]:
        return tuple(one.name for one in self.header.objects)

    @property
    def numbers(self) -> Index:
        """(C, n): how many things there are, where that is drawn. Raises ValueError for poses that no numbers have."""
        there = np.array(np.isfinite(self.poses).all(axis=(1, 3)))
        if (np.isnan(self.poses).all(axis=(1, 3)) == there).any():
            raise ValueError("an object is there at some moments alone")
        return numbers_in(self.objects, self.header.counts, there)

    def numbers_of(self, number: int) -> dict[str, int]:
        """How many things there are in motion `number`, from 0, where that is drawn."""
        if not self.header.counts:
            return {}
        there = ~np.isnan(self.poses[number : number + 1, 0, :, X])
        found = numbers_in(self.objects, self.header.counts, there)
        return dict(zip((one.name for one in self.header.counts), found[:, 0].tolist(), strict=True))

    def alone(self, number: int) -> MotionArrays:
        """Motion `number`, from 0, with the objects that are there, as a set in which no number is drawn."""
        part = slice(number, number + 1)
        phi, facts = ({name: values[part] for name, values in each.items()} for each in (self.phi, self.facts))
        header = member_of(self.header, self.numbers_of(number)) if self.header.counts else self.header
        there = ~np.isnan(self.poses[number, 0, :, X])
        return MotionArrays(self.poses[part][:, :, there], phi, facts, header)

    def data(self, number: int) -> dict[str, Any]:
        """Motion `number`, from 0, as files have it."""
        places = zip(self.objects, self.poses[number].transpose(1, 0, 2).tolist(), strict=True)
        found: dict[str, Any] = {"counts": self.numbers_of(number)} if self.header.counts else {}
        found |= {
            "poses": {name: points for name, points in places if not math.isnan(points[0][X])},
            "phi": {name: float(values[number]) for name, values in self.phi.items()},
        }
        if self.facts:
            numbers = {name: float(values[number]) for name, values in self.facts.items()}
            found["facts"] = {name: None if math.isnan(value) else value for name, value in numbers.items()}
        return found

    def block(self) -> Block:
        """The motions as a block."""
        rows = self.poses.transpose(2, 3, 1, 0).reshape(-1, len(self))
        facts, phi = (np.array([*each.values()]).reshape(len(each), len(self)) for each in (self.facts, self.phi))
        return Block(np.concatenate([rows, facts]), phi)


def motions_of(header: MotionFile, labels: Sequence[str], facts: Sequence[str], block: Block) -> MotionArrays:
    """The motions of a block as arrays."""
    shape = (len(header.objects), len(NAMES), header.time.steps + 1, block.count)
    poses = np.ascontiguousarray(block.rows[: math.prod(shape[:-1])].reshape(shape).transpose(3, 2, 0, 1))
    more = block.rows[math.prod(shape[:-1]) :]
    phi, numbers = (dict(zip(names, rows, strict=True)) for names, rows in ((labels, block.phi), (facts, more)))
    return MotionArrays(poses, phi, numbers, header)


def facts_of(poses: Array) -> dict[str, Array]:
    """FACTS of motions (n, T + 1, N, 3), (n,) each."""
    far = np.hypot(*np.moveaxis(np.diff(poses[..., :2], axis=1), -1, 0))
    moved = (far > 0.0).any(axis=1).sum(axis=1).astype(np.float64)
    return dict(zip(MOTION_FACTS, (moved, far.sum(axis=(1, 2))), strict=True))


def arrays_of(file: MotionFile) -> MotionArrays:
    """The motions of a file as arrays."""
    objects = [one.name for one in file.objects]
    shape = (len(file.motions), len(objects), file.time.steps + 1, len(NAMES))
    absent = [(math.nan,) * len(NAMES)] * (file.time.steps + 1)
    places = [[one.poses.get(name, absent) for name in objects] for one in file.motions]
    poses = np.array(places, dtype=np.float64).reshape(shape)
    header = file.model_copy(update={"motions": []})
    phi, facts = (_columns(file.motions, kind) for kind in VALUE_KINDS)
    return MotionArrays(poses.transpose(0, 2, 1, 3), phi, facts, header)


def _columns(motions: list[MotionData], kind: str) -> dict[str, Array]:
    names = getattr(motions[0], kind) if motions else ()
    return {name: np.array([getattr(one, kind)[name] for one in motions], dtype=np.float64) for name in names}


def columns(motions: MotionArrays, first: int = 1) -> list[tuple[str, Array]]:
    """Motions as a table with a row for each moment: `motion` (from `first`), `t` in seconds, the poses `mug.x`,
    `mug.y`, `mug.theta`, ..., NaN for what is not there; then, the same in every row of a motion, `count.block` of each
    array whose number of elements is drawn, `phi.NAME` and the facts."""
    count, moments = motions.poses.shape[:2]
    steps = np.tile(np.arange(moments, dtype=np.float64), count)
    numbered = np.arange(float(first), first + count)
    found = [("motion", np.repeat(numbered, moments)), ("t", steps * motions.header.time.dt)]
    flat = motions.poses.reshape(count * moments, len(motions.objects), len(NAMES))
    for thing, name in enumerate(motions.objects):
        found += [(f"{name}.{axis}", np.ascontiguousarray(flat[:, thing, k])) for k, axis in enumerate(NAMES)]
    numbers = motions.numbers if motions.header.counts else ()
    found += [
        (f"{COUNT_PREFIX}{one.name}", np.repeat(each.astype(np.float64), moments))
        for one, each in zip(motions.header.counts, numbers, strict=True)
    ]
    found += [(f"phi.{name}", np.repeat(values, moments)) for name, values in motions.phi.items()]
    return found + [(name, np.repeat(values, moments)) for name, values in motions.facts.items()]


Blocks = Iterable[Block]


def _lines(header: MotionFile, labels: Sequence[str], blocks: Blocks, facts: Sequence[str]) -> Iterator[str]:
    for block in blocks:
        motions = motions_of(header, labels, facts, block)
        yield from (_line(motions.data(number)) for number in range(len(motions)))


def _line(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False, allow_nan=False)


def write_json(
    sink: IO[bytes], header: MotionFile, labels: Sequence[str], blocks: Blocks, facts: Sequence[str] = MOTION_FACTS
) -> None:
    data = header.model_dump(mode="json", exclude={"motions"})
    head = json.dumps(data, indent=1, ensure_ascii=False, allow_nan=False).removesuffix("}").rstrip()
    sink.write(f'{head},\n "motions": ['.encode())
    for between, line in zip(itertools.chain(["\n"], itertools.repeat(",\n")), _lines(header, labels, blocks, facts)):  # noqa: B905
        sink.write(f"{between}  {line}".encode())
    sink.write(b"\n ]\n}\n")


def write_json_lines(
    sink: IO[bytes], header: MotionFile, labels: Sequence[str], blocks: Blocks, facts: Sequence[str] = MOTION_FACTS
) -> None:
    sink.write(f"{_line(header.model_dump(mode='json', exclude={'motions'}))}\n".encode())
    for line in _lines(header, labels, blocks, facts):
        sink.write(f"{line}\n".encode())


def write_csv(
    sink: IO[bytes], header: MotionFile, labels: Sequence[str], blocks: Blocks, facts: Sequence[str] = MOTION_FACTS
) -> None:
    """Numbers alone, a row for each moment, without spec and shapes: other tools read it, and scenegen reads its
    columns `t`, `mug.x`, ... as a trajectory. Cells of objects that are not there are empty."""
    done = 0
    for block in blocks:
        found = columns(motions_of(header, labels, facts, block), done + 1)
        if not done:
            sink.write(",".join(name for name, _ in found).encode() + b"\n")
        done += block.count
        whole = [name == "motion" or name.startswith(COUNT_PREFIX) for name, _ in found]
        for row in np.array([values for _, values in found]).T.tolist():
            cells = (_cell(x, is_whole) for x, is_whole in zip(row, whole, strict=True))
            sink.write((",".join(cells) + "\n").encode())


def _cell(value: float, whole: bool) -> str:
    return str(int(value)) if whole else "" if math.isnan(value) else repr(value)


def read_text(path: Path) -> MotionArrays:
    """The motions of a .json or .jsonl file. Raises DataError."""
    data = read_bytes(path, "a motions file", limit=MAX_MOTIONS_BYTES, remedy="write the motions to several files")
    if ending_of(path) == ".jsonl":
        first, *lines = data.split(b"\n")
        raw, _ = parse(first, f"line 1 of {path}")
        if isinstance(raw, dict):
            motions = [parse(line, f"line {n} of {path}")[0] for n, line in enumerate(lines, 2) if line.strip()]
            raw = {**raw, "motions": motions}
    else:
        raw, _ = parse(data, str(path))
    return arrays_of(motion_file(raw, str(path)))


def read_csv(path: Path) -> MotionArrays:
    raise DataError(NO_HEADER_IN_CSV(path=path))


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


class TextFormat(NamedTuple):
    """What the table of formats has: see `registry`."""

    write: Any
    read: Any


JSON_FORMAT = TextFormat(write_json, read_text)
JSON_LINES = TextFormat(write_json_lines, read_text)
CSV = TextFormat(write_csv, read_csv)


def scenes_header(file: MotionFile) -> SceneFile:
    """The header of a scene file for moments of motions."""
    version = VERSION_WITH_HEIGHTS if any(one.support is not None for one in file.objects) else SCENES_VERSION
    return SceneFile(
        version=version, spec=file.spec, workspace=file.workspace, objects=file.objects, counts=file.counts,
        regions=file.regions, sampler=dict(file.sampler), request=RequestData(phi={}, n=file.request.n), scenes=[],
    )  # fmt: skip


def moments(motions: MotionArrays) -> Block:
    """All moments as scenes without phi: those of the first motion, then those of the second."""
    rows = as_rows(motions.poses.reshape(-1, *motions.poses.shape[2:]))
    return Block(rows, np.empty((0, rows.shape[1])))
