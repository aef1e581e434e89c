"""The table of motion file formats, and motions as arrays: what all formats write and read."""

from __future__ import annotations

import importlib
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from scenegen.errors import DataError, RequestError
from scenegen.errors.requests import NOT_INSTALLED
from scenegen.errors.time import NO_HEADER_IN_CSV, UNKNOWN_MOTION_ENDING
from scenegen.pose import NAMES, X, as_rows
from scenegen.scenes.blocks import COUNT, Block, SceneFileReading
from scenegen.scenes.data import RAISED, VERSION, RequestData, SceneFile
from scenegen.scenes.files import whole_file
from scenegen.scenes.motions import MOTIONS_FORMAT, MotionData, MotionFile
from scenegen.scenes.numbers import member_of, numbers_in

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.intp]

FORMATS: dict[str, str] = {
    ".json": "scenegen.scenes.formats.motions.text",
    ".jsonl": "scenegen.scenes.formats.motions.text",
    ".parquet": "scenegen.scenes.formats.motions.parquet",
    ".csv": "scenegen.scenes.formats.motions.csv",
}


@dataclass(frozen=True, slots=True, eq=False)
class MotionArrays:
    """n motions: `poses` (n, T + 1, N, 3), and by name `phi` and `facts`, (n,) each. `header` is the file without its
    motions. Objects that are not there have NaN, where the number of things is drawn."""

    header: MotionFile
    poses: Array
    phi: Mapping[str, Array]
    facts: Mapping[str, Array]

    @property
    def objects(self) -> tuple[str, ...]:
        return tuple(one.name for one in self.header.objects)

    def __len__(self) -> int:
        return len(self.poses)

    @property
    def numbers(self) -> Index:
        """(C, n): how many things there are, where that is drawn. Raises ValueError for poses that no numbers have."""
        there = np.array(np.isfinite(self.poses).all(axis=(1, 3)))
        if (np.isnan(self.poses).all(axis=(1, 3)) == there).any():
            raise ValueError("an object is there at some moments alone")
        return numbers_in(self.objects, self.header.counts, there)

    def counts(self, number: int) -> dict[str, int]:
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
        header = member_of(self.header, self.counts(number)) if self.header.counts else self.header
        there = ~np.isnan(self.poses[number, 0, :, X])
        return MotionArrays(header, self.poses[part][:, :, there], phi, facts)

    def data(self, number: int) -> dict[str, Any]:
        """Motion `number`, from 0, as files have it."""
        places = zip(self.objects, self.poses[number].transpose(1, 0, 2).tolist(), strict=True)
        found: dict[str, Any] = {"counts": self.counts(number)} if self.header.counts else {}
        found |= {
            "poses": {name: points for name, points in places if not math.isnan(points[0][X])},
            "phi": {name: float(values[number]) for name, values in self.phi.items()},
        }
        if self.facts:
            found["facts"] = {name: float(values[number]) for name, values in self.facts.items()}
        return found


def arrays_of(file: MotionFile) -> MotionArrays:
    """The motions of a file as arrays."""
    objects = [one.name for one in file.objects]
    shape = (len(file.motions), len(objects), file.time.steps + 1, len(NAMES))
    absent = [(math.nan,) * len(NAMES)] * (file.time.steps + 1)
    places = [[one.poses.get(name, absent) for name in objects] for one in file.motions]
    poses = np.array(places, dtype=np.float64).reshape(shape)
    header = file.model_copy(update={"motions": []})
    return MotionArrays(header, poses.transpose(0, 2, 1, 3), *(_columns(file.motions, kind) for kind in KINDS))


KINDS = ("phi", "facts")


def _columns(motions: list[MotionData], kind: str) -> dict[str, Array]:
    names = getattr(motions[0], kind) if motions else ()
    return {name: np.array([getattr(one, kind)[name] for one in motions]) for name in names}


def columns(motions: MotionArrays) -> list[tuple[str, Array]]:
    """Motions as a table with a row for each moment: `motion` (from 1), `t` in seconds, the poses `mug.x`, `mug.y`,
    `mug.theta`, ..., NaN for what is not there; then, the same in every row of a motion, `count.block` of each array
    whose number of elements is drawn, `phi.NAME` and the facts."""
    count, moments = motions.poses.shape[:2]
    steps = np.tile(np.arange(moments, dtype=np.float64), count)
    found = [("motion", np.repeat(np.arange(1.0, count + 1.0), moments)), ("t", steps * motions.header.time.dt)]
    flat = motions.poses.reshape(count * moments, -1, len(NAMES))
    for thing, name in enumerate(motions.objects):
        found += [(f"{name}.{axis}", np.ascontiguousarray(flat[:, thing, k])) for k, axis in enumerate(NAMES)]
    numbers = motions.numbers if motions.header.counts else ()
    found += [
        (f"{COUNT}{one.name}", np.repeat(each.astype(np.float64), moments))
        for one, each in zip(motions.header.counts, numbers, strict=True)
    ]
    found += [(f"phi.{name}", np.repeat(values, moments)) for name, values in motions.phi.items()]
    return found + [(name, np.repeat(values, moments)) for name, values in motions.facts.items()]


def format_of(path: Path) -> Any:
    """The module for a path's ending. Raises RequestError for an ending that no format has, and if the library that the
    format needs is not installed."""
    module = FORMATS.get(path.suffix.lower())
    if module is None:
        raise RequestError(UNKNOWN_MOTION_ENDING(path=path, name=path.suffix, known=FORMATS))
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] != "pyarrow":
            raise
        facts = {"package": "pyarrow", "purpose": f"for {path.suffix} files"}
        raise RequestError(NOT_INSTALLED(**facts, command='pip install "scenegen[parquet]"')) from error


def write_motions(path: Path, motions: MotionArrays) -> None:
    """Write motions in the format of the path's ending; the file appears whole or not at all. Raises RequestError,
    OutputError."""
    module = format_of(path)
    with whole_file(path) as sink:
        module.write(sink, motions, path.suffix.lower())


def read_motions(path: Path) -> MotionArrays:
    """The motions of a .json, .jsonl or .parquet file. Raises DataError, RequestError."""
    module = format_of(path)
    if not hasattr(module, "read"):
        raise DataError(NO_HEADER_IN_CSV(path=path))
    found: MotionArrays = module.read(path)
    return found


PEEK = 256  # bytes at the start of a file within which it names its format


def is_motions(path: Path) -> bool:
    """Whether a .json, .jsonl or .parquet file is one of motions; False where it cannot be read."""
    ending = path.suffix.lower()
    try:
        if ending in (".json", ".jsonl") and path.is_file():
            with path.open("rb") as file:
                return f'"{MOTIONS_FORMAT}"'.encode() in file.read(PEEK)
        if ending == ".parquet" and path.is_file():
            return bool(format_of(path).names_motions(path))
    except (OSError, RequestError):
        pass
    return False


def scenes_header(file: MotionFile) -> SceneFile:
    """The header of a scene file for moments of motions."""
    version = RAISED if any(one.support is not None for one in file.objects) else VERSION
    return SceneFile(
        version=version, spec=file.spec, workspace=file.workspace, objects=file.objects, counts=file.counts,
        regions=file.regions, sampler=dict(file.sampler), request=RequestData(phi={}, n=file.request.n), scenes=[],
    )  # fmt: skip


def moments(path: Path) -> SceneFileReading:
    """All moments of all motions of a file as scenes without phi: those of the first motion, then those of the second.
    Raises DataError, RequestError."""
    found = read_motions(path)
    rows = as_rows(found.poses.reshape(-1, *found.poses.shape[2:]))
    block = Block(rows, np.empty((0, rows.shape[1])))
    return SceneFileReading(scenes_header(found.header), (), iter([block]), block.count, str(path))
