"""The tables of file formats: ending -> module, or what a module has by a name, with

    write(sink, header, labels, blocks)   scenes, or motions, into an open binary file, block by block
    read(path)                            an open file of scenes, or all motions of a file

Both have only a few blocks in memory for files of any length, except JSON, which is read as a whole. A format
with HEADER_LAST can be written before the whole of the header is known: its `write` takes `final`, which gives it.
"""

from __future__ import annotations

import importlib
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from scenegen.errors import DataError, OutputError, RequestError
from scenegen.errors.files import CANNOT_WRITE, ENDING_OF_ANOTHER, NOT_SCENES, UNKNOWN_ENDING, WRONG_ENDING
from scenegen.errors.requests import NOT_INSTALLED
from scenegen.scenes.files import TABS, check_folder, check_writable, ending_of, report_write_errors, whole_file

if TYPE_CHECKING:
    from scenegen.scenes.blocks import Block, SceneFileReading
    from scenegen.scenes.data import SceneFile
    from scenegen.scenes.formats.motions import MotionArrays

FORMATS: dict[str, str] = {
    ".json": "scenegen.scenes.formats.scenes_json",
    ".jsonl": "scenegen.scenes.formats.jsonl",
    ".parquet": "scenegen.scenes.formats.parquet",
}

MOTION_FORMATS: dict[str, str] = {
    ".json": "scenegen.scenes.formats.motions:JSON_FORMAT",
    ".jsonl": "scenegen.scenes.formats.motions:JSON_LINES",
    ".parquet": "scenegen.scenes.formats.motions_parquet",
    ".csv": "scenegen.scenes.formats.motions:CSV",
}

SCENES, MOTIONS = "scenegen/scenes", "scenegen/motions"  # what the headers of files call their formats

# Endings of simulators' and planners' files (see `export`): for these, the error of `sample` suggests `export`.
FORMAT_OF_ENDING: dict[str, str] = {
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


def format_of(path: Path, kind: str = SCENES) -> Any:
    """What writes and reads files with a path's ending, of scenes or of motions. Raises RequestError for an ending that
    no format has, and if the library that the format needs is not installed."""
    ending = ending_of(path)
    known = FORMATS if kind == SCENES else MOTION_FORMATS
    if ending not in known or path.suffix.lower() == TABS:
        if kind == MOTIONS:
            raise RequestError(UNKNOWN_ENDING(path=path, name=path.suffix, what="motion", known=known))
        export = path.with_suffix(".json") if ending in FORMAT_OF_ENDING else None
        facts = {
            "what": "scene",
            "name": path.suffix,
            "known": known,
            "scenes": export,
            "instead": INSTEAD.get(ending[1:]),
        }
        raise RequestError(UNKNOWN_ENDING(path=path, **facts))
    module, _, name = known[ending].partition(":")
    try:
        found = importlib.import_module(module)
    except ModuleNotFoundError as error:
        library = (error.name or "").partition(".")[0]
        if library not in EXTRAS:
            raise
        purpose, command = f"for {path.suffix} files", f'pip install "scenegen-dsl[{EXTRAS[library]}]"'
        raise RequestError(NOT_INSTALLED(package=library, purpose=purpose, command=command)) from error
    return getattr(found, name) if name else found


def is_one_file(out: Path, to: str, own: str | None = None) -> bool:
    """Whether `out` is one file with all scenes in a format of simulators or planners, by its ending; else it is a
    folder with a file each. `own` is the ending of a format that is not in `FORMAT_OF_ENDING`.

    Raises RequestError for the ending of another format.
    """
    ending = ending_of(out)
    if ending == own:
        return True
    if ending in FORMATS or FORMAT_OF_ENDING.get(ending, to) != to:
        other = FORMAT_OF_ENDING.get(ending, "scene files")
        raise RequestError(ENDING_OF_ANOTHER(path=out, other=other, format=to, places=_places(to, own)))
    return ending in FORMAT_OF_ENDING


def _places(to: str, own: str | None) -> str:
    endings = [ending for ending, name in FORMAT_OF_ENDING.items() if name == to] if own is None else [own]
    return "name a folder, or a file that ends in " + " or ".join(f"`{ending}`" for ending in endings)


def check_out(out: Path, to: str, *inputs: Path, own: str | None = None) -> None:
    """Refuse, before any work is done, an `out` that a format of simulators or planners cannot be written to; `own` as
    in `is_one_file`. Raises RequestError, OutputError."""
    if is_one_file(out, to, own):
        check_writable(out, *inputs)
        return
    with report_write_errors(out):
        if out.is_file():
            reason = f"it is a file, and a folder is made for {to}"
            raise OutputError(CANNOT_WRITE(path=out, reason=reason, remedy=_places(to, own)))
    check_folder(out)


def check_ending(path: Path, *endings: str) -> None:
    """Refuse a place to write to that has another ending than these. Raises RequestError."""
    if path.suffix.lower() not in endings:
        better = path.parent / f"{path.stem}{endings[0]}"
        raise RequestError(WRONG_ENDING(path=path, ending=endings[0], better=better))


def write_scenes(path: Path, header: SceneFile, labels: Sequence[str], blocks: Iterable[Block]) -> None:
    """Write scenes in the format of the path's ending; the file appears whole or not at all.

    `header` is the scene file without scenes, `labels` name the rows of the blocks' phi. Raises RequestError,
    OutputError.
    """
    module = format_of(path)
    with whole_file(path) as sink:
        module.write(sink, header, labels, blocks)


def write_motions(path: Path, motions: MotionArrays) -> None:
    """Write motions in the format of the path's ending; the file appears whole or not at all. Raises RequestError,
    OutputError."""
    module = format_of(path, MOTIONS)
    with whole_file(path) as sink:
        module.write(sink, motions.header, tuple(motions.phi), [motions.block()], tuple(motions.facts))


def read_scenes(path: Path) -> SceneFileReading:
    """Open a scene file, or a file of motions: its scenes are all moments of all motions. Raises DataError and
    RequestError; `blocks` of the result raises DataError for later damage."""
    if is_motions(path):
        from scenegen.scenes.blocks import SceneFileReading
        from scenegen.scenes.formats.motions import moments, scenes_header

        found = read_motions(path)
        block = moments(found)
        return SceneFileReading(scenes_header(found.header), (), iter([block]), block.count, str(path))
    if ending_of(path) == ".csv":
        raise DataError(
            NOT_SCENES(file=path, reason=f"a {path.suffix} file has no place for spec and shapes", poses=True)
        )
    reading: SceneFileReading = format_of(path).read(path)
    return reading


def read_motions(path: Path) -> MotionArrays:
    """The motions of a .json, .jsonl or .parquet file. Raises DataError, RequestError."""
    found: MotionArrays = format_of(path, MOTIONS).read(path)
    return found


FORMAT_NAME_BYTES = 256  # bytes at the start of a file within which it names its format


def is_motions(path: Path) -> bool:
    """Whether a .json, .jsonl or .parquet file is one of motions; False where it cannot be read."""
    ending, named = ending_of(path), f'"{MOTIONS}"'.encode()
    try:
        if ending in (".json", ".jsonl") and path.is_file():
            with path.open("rb") as file:
                return named in file.read(FORMAT_NAME_BYTES)
        if ending == ".parquet" and path.is_file():
            return named in format_of(path, MOTIONS).header_bytes(path)[:FORMAT_NAME_BYTES]
    except (OSError, RequestError):
        pass
    return False
