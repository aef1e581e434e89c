"""`asset("ycb/025_mug")`: an entry of the index of a folder of assets, beside the spec or below it."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from dataclasses import replace
from pathlib import PurePosixPath
from typing import TYPE_CHECKING

from scenegen.assets import Shape
from scenegen.assets.library import INDEX
from scenegen.errors import Span, SpecError
from scenegen.errors.declarations import (
    ASSET_SIZE,
    BAD_ASSET_INDEX,
    NO_ASSET_INDEX,
    UNKNOWN_INDEXED_ASSET,
    UNUSABLE_SHAPE_FILE,
)
from scenegen.lang.imports import Project

if TYPE_CHECKING:
    from scenegen.assets.indexed import Entry

SHOWN = 8  # names that a help line lists


def index_of(path: str) -> tuple[str, str]:
    """Where the index of `ycb/025_mug` is, and the name in it."""
    folder, _, name = path.replace("\\", "/").rpartition("/")
    return f"{folder}/{INDEX}" if folder else INDEX, name


def entries_of(path: str, here: Span, project: Project) -> Mapping[str, Entry]:
    """The entries of the index that `path` names. Raises SpecError."""
    from scenegen.assets.indexed import IndexFileError, read_index

    where, name = index_of(path)
    file = project.find(where, here)
    with contextlib.suppress(OSError):  # of a folder that is closed to us, which reading names
        if not file.exists():
            raise SpecError(NO_ASSET_INDEX(here, path=where, name=name))
    try:
        return read_index(project.read(where, here, "an index of assets"))
    except IndexFileError as error:
        raise SpecError(BAD_ASSET_INDEX(here, path=where, reason=str(error))) from None


def indexed(path: str, here: Span, project: Project) -> Shape:
    """What the asset looks like: its outline and height, scaled and turned upright. Raises SpecError."""
    where, name = index_of(path)
    key = project.find(where, here), name
    if key not in project.shapes:
        project.shapes[key] = _read(path, here, project)
    return replace(project.shapes[key], path=path)


def _read(path: str, here: Span, project: Project) -> Shape:
    from scenegen.assets.indexed import AssetSizeError, fitted
    from scenegen.assets.urdf_tree import UrdfError

    where, name = index_of(path)
    entries = entries_of(path, here, project)
    entry = entries.get(name)
    if entry is None:
        some, more = list(entries)[:SHOWN], max(0, len(entries) - SHOWN)
        raise SpecError(UNKNOWN_INDEXED_ASSET(here, path=where, name=name, known=entries, some=some, more=more or None))
    file = str(PurePosixPath(where).parent / entry.file.replace("\\", "/"))

    def beside(other: str) -> bytes:
        return project.read_beside(file, other, here)

    try:
        kind = "a URDF file" if entry.is_robot else "a mesh file"
        found = fitted(entry, project.read(file, here, kind), beside)
    except AssetSizeError as error:
        raise SpecError(ASSET_SIZE(here, name=name, size=error.size, hint=error.hint or None)) from None
    except UrdfError as error:
        raise SpecError(UNUSABLE_SHAPE_FILE(here, path=file, reason=str(error))) from None
    return Shape("asset", found.footprint, found.height, path)
