"""The table of simulators' formats: name -> module with

    ENDING                               of its files
    meshes(world)                        (name, bytes) of the mesh files that they need
    files(world, folder, together=...)   their bytes: one with all scenes in it, or one for each scene

These are written, never read: they store no request, and only USD has the spec and phi, which are in scene files.
"""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from scenegen.errors import OutputError, RequestError
from scenegen.errors.declarations import ONE_FILE_MANY_NUMBERS
from scenegen.errors.files import CANNOT_WRITE, ENDING_OF_ANOTHER
from scenegen.errors.requests import NO_SCENES
from scenegen.needs import need
from scenegen.scenes.blocks import Block
from scenegen.scenes.data import SceneFile
from scenegen.scenes.files import check_folder, check_writable, reported, scene_name, whole_files
from scenegen.scenes.formats.registry import ENDINGS, FORMATS
from scenegen.show.looks.look import LOOKS
from scenegen.things.mesh import Floats
from scenegen.worlds.export.setting import Own, recorded, worlds_of
from scenegen.worlds.export.world import FOLDER as TEXTURES
from scenegen.worlds.export.world import SceneLooks

SIMULATORS: dict[str, str] = {
    "mjcf": "scenegen.worlds.export.mjcf",
    "sdf": "scenegen.worlds.export.sdf",
    "usd": "scenegen.worlds.export.usd.files",
}
NEEDS = {"usd": "pxr"}  # packages that only an extra of scenegen installs
CRATES = (".usd", ".usdc")  # endings of files that are binary: `files` gives their text
MESHES = "meshes"
WITH_LOOKS = ("mjcf", "usd")


def is_file(out: Path, to: str) -> bool:
    """Whether `out` is one file with all scenes, by its ending; else it is a folder with a file each.

    Raises RequestError for the ending of another format.
    """
    ending = out.suffix.lower()
    if ending in FORMATS or ENDINGS.get(ending, to) != to:
        other = ENDINGS.get(ending, "scene files")
        raise RequestError(ENDING_OF_ANOTHER(path=out, other=other, format=to, places=_places(to)))
    return ending in ENDINGS


def _places(to: str) -> str:
    endings = " or ".join(f"`{ending}`" for ending, name in ENDINGS.items() if name == to)
    return f"name a folder, or a file that ends in {endings}"


def check_out(out: Path, to: str, *inputs: Path) -> None:
    """Refuse, before any work is done, an `out` that cannot be written to, and a format whose library is missing.
    Raises RequestError, OutputError."""
    if to in NEEDS:
        need(NEEDS[to], f"to write {to.upper()}")
    if is_file(out, to):
        check_writable(out, *inputs)
        return
    with reported(out):
        if out.is_file():
            reason = f"it is a file, and a folder is made for {to}"
            raise OutputError(CANNOT_WRITE(path=out, reason=reason, remedy=_places(to)))
    check_folder(out)


def write_worlds(
    out: Path,
    to: str,
    header: SceneFile,
    scenes: Block,
    labels: Sequence[str],
    sources: Path | None = None,
    dressing: SceneLooks | None = None,
    rest: Floats | None = None,
) -> tuple[Path, ...]:
    """Write scenes for a simulator: a folder with `scene_0001.xml`, ... and `meshes/`, or a file with all scenes and
    `NAME_meshes/` beside it. Returns the paths of the scenes' files. They appear together or not at all.
    `labels` are those of the scenes' phi. `sources` is the folder whose files give objects of one's own their bodies
    (`own_bodies_of`), and in formats of `WITH_LOOKS` what is drawn of
    them. With a `dressing`, for a folder and a format of `WITH_LOOKS`, there are `textures/` and
    looks.jsonl, too. `rest` (n, N, 7) are places and quaternions of scenes that came to rest in a simulator.

    Raises RequestError for no scenes, DataError for objects too far from the table, OutputError.
    """
    module: Any = importlib.import_module(SIMULATORS[to])
    if not scenes.count:
        raise RequestError(NO_SCENES())
    own: Own = {}
    if sources is not None:
        from scenegen.worlds.export.world import own_bodies_of

        own = own_bodies_of(header, sources, painted=to in WITH_LOOKS)
    together = is_file(out, to)
    if together and header.counts:
        raise RequestError(ONE_FILE_MANY_NUMBERS(path=out, format=to))
    folder, meshes = (out.parent, f"{out.stem}_{MESHES}") if together else (out, MESHES)
    written: dict[int, Path] = {}
    with whole_files(folder) as put:
        put_already = set[str]()
        for bare in worlds_of(header, scenes, own):
            world = replace(recorded(bare, header, scenes, labels), dressing=dressing)
            if rest is not None:
                names = [one.name for one in header.objects]
                here = [names.index(body.name) for body in world.bodies]
                world = replace(world, rest=rest[np.array(world.scenes)[:, None] - 1, here])
            for name, data in module.meshes(world):
                if name not in put_already:  # worlds share forms
                    put_already.add(name)
                    put(f"{meshes}/{name}", data)
            numbers = world.scenes[:1] if together else world.scenes
            for number, data in zip(numbers, module.files(world, meshes, together=together), strict=True):
                name = out.name if together else f"{scene_name(number, scenes.count)}{module.ENDING}"
                put(name, _crate(data) if together and out.suffix.lower() in CRATES else data)
                written[number] = folder / name
        if dressing is not None:
            for name, data in dressing.textures():
                put(f"{TEXTURES}/{name}", data)
            put(LOOKS, dressing.record([path.name for _, path in sorted(written.items())]))
    return tuple(path for _, path in sorted(written.items()))


def _crate(text: bytes) -> bytes:
    from scenegen.worlds.export.usd.stage import crate

    return crate(text)
