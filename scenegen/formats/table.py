"""The table of scene file formats: ending -> module with

    write(sink, header, labels, blocks)   scenes into an open binary file, block by block
    read(path) -> Reading                 the header, then the scenes, block by block

Both hold a few blocks in memory however long the file is; JSON, which has no lines, is read as a whole.
"""

from __future__ import annotations

import importlib
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from scenegen.errors import Diagnostic, RequestError, suggest
from scenegen.formats.files import whole_file

if TYPE_CHECKING:
    from scenegen.formats.blocks import Block, Reading
    from scenegen.scene.data import SceneFile

FORMATS: dict[str, str] = {
    ".json": "scenegen.formats.scenes_json",
    ".jsonl": "scenegen.formats.jsonl",
    ".parquet": "scenegen.formats.parquet",
}

# Of simulators' files (see `simulators`): `sample` knows them in order to say where they come from.
ENDINGS: dict[str, str] = {
    ".xml": "mjcf",
    ".sdf": "sdf",
    ".world": "sdf",
}

EXTRAS = {"pyarrow": "parquet"}  # libraries that come with an extra of scenegen only


def format_of(path: Path) -> Any:
    """The module for a path's ending. Raises RequestError for an ending that no format has, and where the library that
    the format needs is not installed."""
    module = FORMATS.get(path.suffix.lower())
    if module is None:
        shown = f"the ending `{path.suffix}`" if path.suffix else "no ending"
        help_ = suggest(path.suffix, FORMATS, f"use {', '.join(FORMATS)}")
        if path.suffix.lower() in ENDINGS:
            scenes = path.with_suffix(".json")
            help_ = f"sample to {scenes.name}, then: scenegen export {scenes} --out {path}"
        raise RequestError(Diagnostic(f"{path} has {shown}: not a format of scene files", help=help_))
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        library = (error.name or "").partition(".")[0]
        if library not in EXTRAS:
            raise
        title = f"{path.suffix} files need {library}, which is not installed"
        raise RequestError(Diagnostic(title, help=f'pip install "scenegen[{EXTRAS[library]}]"')) from error


def write_scenes(path: Path, header: SceneFile, labels: Sequence[str], blocks: Iterable[Block]) -> None:
    """Write scenes in the format of the path's ending; the file appears whole or not at all.

    `header` is the scene file without scenes, `labels` name the rows of the blocks' phi. Raises RequestError,
    OutputError.
    """
    module = format_of(path)
    with whole_file(path) as sink:
        module.write(sink, header, labels, blocks)


def read_scenes(path: Path) -> Reading:
    """Open a scene file. Raises DataError and RequestError; `blocks` of the result raises DataError for damage further
    on."""
    reading: Reading = format_of(path).read(path)
    return reading
