"""The table of simulators' formats: name -> module with

    ENDING                               of its files
    meshes(world)                        (name, bytes) of the mesh files that they need
    files(world, folder, together=...)   their bytes: one with all scenes in it, or one for each scene

These are written, never read: what a scene is of, its spec and its request, is in scene files.
"""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

from scenegen.errors import Diagnostic, OutputError, RequestError
from scenegen.formats.blocks import Block
from scenegen.formats.files import check_folder, check_writable, reported
from scenegen.formats.folder import scene_name, whole_files
from scenegen.formats.setting import world_of
from scenegen.formats.table import ENDINGS, FORMATS
from scenegen.scene.data import SceneFile

SIMULATORS: dict[str, str] = {
    "mjcf": "scenegen.formats.mjcf",
    "sdf": "scenegen.formats.sdf",
}
MESHES = "meshes"


def is_file(out: Path, to: str) -> bool:
    """Whether `out` is to be one file with all scenes, by its ending; else it is a folder for a file each.

    Raises RequestError for the ending of another format.
    """
    ending = out.suffix.lower()
    if ending in FORMATS or ENDINGS.get(ending, to) != to:
        title = f"{out} has the ending of {ENDINGS.get(ending, 'scene files')}, and {to} was asked for"
        raise RequestError(Diagnostic(title, help=_places(to)))
    return ending in ENDINGS


def _places(to: str) -> str:
    endings = " or ".join(f"`{ending}`" for ending, name in ENDINGS.items() if name == to)
    return f"name a folder, or a file that ends in {endings}"


def check_out(out: Path, to: str, *inputs: Path) -> None:
    """Refuse, before any work is done, an `out` that cannot be written to. Raises RequestError, OutputError."""
    if is_file(out, to):
        check_writable(out, *inputs)
        return
    with reported(out):
        if out.is_file():
            title = f"cannot write {out}: it is a file, and a folder is made for {to}"
            raise OutputError(Diagnostic(title, help=_places(to)))
    check_folder(out)


def write_worlds(out: Path, to: str, header: SceneFile, scenes: Block) -> tuple[Path, ...]:
    """Write scenes for a simulator: a folder with `scene_0001.xml`, ... and `meshes/`, or a file with all scenes and
    `NAME_meshes/` beside it. Returns the paths of the scenes' files. They appear together or not at all.

    Raises RequestError for no scenes, DataError for scenes that no table holds, OutputError.
    """
    module: Any = importlib.import_module(SIMULATORS[to])
    if not scenes.count:
        raise RequestError(Diagnostic("there are no scenes to export", help="sample some first"))
    world = world_of(header, scenes)
    together = is_file(out, to)
    folder, meshes = (out.parent, f"{out.stem}_{MESHES}") if together else (out, MESHES)
    written = []
    with whole_files(folder) as put:
        for name, data in module.meshes(world):
            put(f"{meshes}/{name}", data)
        for number, data in enumerate(module.files(world, meshes, together=together), start=1):
            name = out.name if together else f"{scene_name(number, scenes.count)}{module.ENDING}"
            put(name, data)
            written.append(folder / name)
    return tuple(written)
