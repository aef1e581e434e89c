"""The table of scene file formats: ending -> module with `dump(file) -> bytes` and `load(bytes, name) -> file`."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import TYPE_CHECKING, Any

from scenegen.errors import Diagnostic, RequestError, suggest
from scenegen.formats.files import read_bytes, write_whole

if TYPE_CHECKING:
    from scenegen.scene.data import SceneFile

FORMATS: dict[str, str] = {
    ".json": "scenegen.formats.scenes_json",
}


def format_of(path: Path) -> Any:
    """The module for a path's ending. Raises RequestError for an ending that no format has."""
    module = FORMATS.get(path.suffix.lower())
    if module is None:
        shown = f"the ending `{path.suffix}`" if path.suffix else "no ending"
        help_ = suggest(path.suffix, FORMATS, f"use {', '.join(FORMATS)}")
        raise RequestError(Diagnostic(f"{path} has {shown}: not a format of scene files", help=help_))
    return importlib.import_module(module)


def write_scenes(path: Path, file: SceneFile) -> None:
    """Write a scene file in the format of the path's ending; whole or not at all. Raises RequestError, OutputError."""
    write_whole(path, format_of(path).dump(file))


def read_scenes(path: Path) -> SceneFile:
    """Read and validate a scene file. Raises DataError and RequestError."""
    module = format_of(path)
    file: SceneFile = module.load(read_bytes(path, "a scenes file"), str(path))
    return file
