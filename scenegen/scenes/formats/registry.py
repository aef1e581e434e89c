"""The table of scene file formats: ending -> module with

    write(sink, header, labels, blocks)   scenes into an open binary file, block by block
    read(path) -> Reading                 the header, then the scenes, block by block

Both have only a few blocks in memory for files of any length, except JSON, which is read as a whole. Formats of
HEADER_LAST can be written before the whole of the header is known: their `write` takes `final`, which gives it. Those
of TEXT take `each`, a `map` of several processes.
"""

from __future__ import annotations

import importlib
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from scenegen.errors import DataError, RequestError
from scenegen.errors.files import NOT_SCENES, UNKNOWN_ENDING
from scenegen.errors.requests import NOT_INSTALLED
from scenegen.scenes.files import whole_file

if TYPE_CHECKING:
    from scenegen.scenes.blocks import Block, SceneFileReading
    from scenegen.scenes.data import SceneFile

FORMATS: dict[str, str] = {
    ".json": "scenegen.scenes.formats.scenes_json",
    ".jsonl": "scenegen.scenes.formats.jsonl",
    ".parquet": "scenegen.scenes.formats.parquet",
}

HEADER_LAST = {".parquet"}
TEXT = {".json", ".jsonl"}

# Endings of simulators' and planners' files (see `export`): for these, the error of `sample` suggests `export`.
ENDINGS: dict[str, str] = {
    ".xml": "mjcf",
    ".sdf": "sdf",
    ".world": "sdf",
    ".usd": "usd",
    ".usda": "usd",
    ".usdc": "usd",
    ".pddl": "pddl",
}

_TABLE = "write .parquet, which pandas and polars read; in Python: scenes.to_pandas().to_csv(FILE), or scenes.poses"
_MESHES = "`mjcf` and `sdf` write meshes of the objects beside the scenes"
_PYBULLET = "in Python scenegen.load_pybullet(scenes[0]); files that PyBullet reads are `sdf`"
INSTEAD = {  # what is no format here, by name or ending, and what does it
    **dict.fromkeys(("pybullet", "bullet"), _PYBULLET),
    **dict.fromkeys(("csv", "tsv", "xlsx", "excel", "pandas", "numpy", "npy", "npz", "hdf5", "h5", "feather"), _TABLE),
    **dict.fromkeys(("png", "jpg", "jpeg", "svg", "pdf", "gif", "mp4", "image"), "`scenegen render` draws pictures"),
    **dict.fromkeys(("urdf", "xacro"), "scenes for a robot's world are `mjcf`, `sdf` or `usd`"),
    **dict.fromkeys(("obj", "stl", "mesh"), _MESHES),
}

EXTRAS = {"pyarrow": "parquet"}  # libraries that only an extra of scenegen installs


def format_of(path: Path) -> Any:
    """The module for a path's ending. Raises RequestError for an ending that no format has, and if the library that the
    format needs is not installed."""
    module = FORMATS.get(path.suffix.lower())
    if module is None:
        export = path.with_suffix(".json") if path.suffix.lower() in ENDINGS else None
        raise RequestError(
            UNKNOWN_ENDING(
                path=path, name=path.suffix, known=FORMATS, scenes=export, instead=INSTEAD.get(path.suffix.lower()[1:])
            )
        )
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        library = (error.name or "").partition(".")[0]
        if library not in EXTRAS:
            raise
        purpose, command = f"for {path.suffix} files", f'pip install "scenegen[{EXTRAS[library]}]"'
        raise RequestError(NOT_INSTALLED(package=library, purpose=purpose, command=command)) from error


def write_scenes(path: Path, header: SceneFile, labels: Sequence[str], blocks: Iterable[Block]) -> None:
    """Write scenes in the format of the path's ending; the file appears whole or not at all.

    `header` is the scene file without scenes, `labels` name the rows of the blocks' phi. Raises RequestError,
    OutputError.
    """
    module = format_of(path)
    with whole_file(path) as sink:
        module.write(sink, header, labels, blocks)


def read_scenes(path: Path) -> SceneFileReading:
    """Open a scene file, or a file of motions: its scenes are the moments. Raises DataError and RequestError; `blocks`
    of the result raises DataError for later damage."""
    from scenegen.scenes.formats.motions.table import is_motions, moments

    if is_motions(path):
        return moments(path)
    if path.suffix.lower() == ".csv":
        raise DataError(NOT_SCENES(file=path, reason="a .csv file has no place for spec and shapes", poses=True))
    reading: SceneFileReading = format_of(path).read(path)
    return reading
