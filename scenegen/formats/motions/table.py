"""The table of motion file formats, and motions as arrays: what all formats write and read."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from scenegen.errors import DataError, RequestError
from scenegen.errors.motions import NO_HEADER_IN_CSV, UNKNOWN_MOTION_ENDING
from scenegen.errors.requests import NOT_INSTALLED
from scenegen.formats.blocks import Block, Reading
from scenegen.formats.files import whole_file
from scenegen.pose import NAMES, as_rows
from scenegen.scene.data import RAISED, VERSION, RequestData, SceneFile
from scenegen.scene.motions import FORMAT, MotionData, MotionFile

Array = npt.NDArray[np.float64]

FORMATS: dict[str, str] = {
    ".json": "scenegen.formats.motions.text",
    ".jsonl": "scenegen.formats.motions.text",
    ".parquet": "scenegen.formats.motions.parquet",
    ".csv": "scenegen.formats.motions.csv",
}


@dataclass(frozen=True, slots=True, eq=False)
class MotionArrays:
    """n motions: `poses` (n, T + 1, N, 3), and by name `phi` and `facts`, (n,) each. `header` is the file without its
    motions."""

    header: MotionFile
    poses: Array
    phi: Mapping[str, Array]
    facts: Mapping[str, Array]

    @property
    def objects(self) -> tuple[str, ...]:
        return tuple(one.name for one in self.header.objects)

    def __len__(self) -> int:
        return len(self.poses)

    def data(self, number: int) -> dict[str, Any]:
        """Motion `number`, from 0, as files have it."""
        places = self.poses[number].transpose(1, 0, 2).tolist()
        found: dict[str, Any] = {
            "poses": dict(zip(self.objects, places, strict=True)),
            "phi": {name: float(values[number]) for name, values in self.phi.items()},
        }
        if self.facts:
            found["facts"] = {name: float(values[number]) for name, values in self.facts.items()}
        return found


def arrays_of(file: MotionFile) -> MotionArrays:
    """The motions of a file as arrays."""
    objects = [one.name for one in file.objects]
    shape = (len(file.motions), len(objects), file.time.steps + 1, len(NAMES))
    poses = np.array([[one.poses[name] for name in objects] for one in file.motions], dtype=np.float64).reshape(shape)
    header = file.model_copy(update={"motions": []})
    return MotionArrays(header, poses.transpose(0, 2, 1, 3), *(_columns(file.motions, kind) for kind in KINDS))


KINDS = ("phi", "facts")


def _columns(motions: list[MotionData], kind: str) -> dict[str, Array]:
    names = getattr(motions[0], kind) if motions else ()
    return {name: np.array([getattr(one, kind)[name] for one in motions]) for name in names}


def columns(motions: MotionArrays) -> list[tuple[str, Array]]:
    """Motions as a table with a row for each moment: `motion` (from 1), `t` in seconds, the poses `mug.x`, `mug.y`,
    `mug.theta`, ..., then `phi.NAME` and the facts, the same in every row of a motion."""
    count, moments = motions.poses.shape[:2]
    steps = np.tile(np.arange(moments, dtype=np.float64), count)
    found = [("motion", np.repeat(np.arange(1.0, count + 1.0), moments)), ("t", steps * motions.header.time.dt)]
    flat = motions.poses.reshape(count * moments, -1, len(NAMES))
    for thing, name in enumerate(motions.objects):
        found += [(f"{name}.{axis}", np.ascontiguousarray(flat[:, thing, k])) for k, axis in enumerate(NAMES)]
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
                return f'"{FORMAT}"'.encode() in file.read(PEEK)
        if ending == ".parquet" and path.is_file():
            return bool(format_of(path).names_motions(path))
    except (OSError, RequestError):
        pass
    return False


def scenes_header(file: MotionFile) -> SceneFile:
    """The header of a scene file for moments of motions."""
    version = RAISED if any(one.support is not None for one in file.objects) else VERSION
    return SceneFile(
        version=version, spec=file.spec, workspace=file.workspace, objects=file.objects, regions=file.regions,
        sampler=dict(file.sampler), request=RequestData(phi={}, n=file.request.n), scenes=[],
    )  # fmt: skip


def moments(path: Path) -> Reading:
    """All moments of all motions of a file as scenes without phi: those of the first motion, then those of the second.
    Raises DataError, RequestError."""
    found = read_motions(path)
    rows = as_rows(found.poses.reshape(-1, *found.poses.shape[2:]))
    block = Block(rows, np.empty((0, rows.shape[1])))
    return Reading(scenes_header(found.header), (), iter([block]), block.count, str(path))
