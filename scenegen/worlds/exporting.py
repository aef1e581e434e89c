"""Scenes in other formats: files of scenes, of simulators and of planners.

`EXPORTS` is the table of simulators' formats: name -> module with

    ENDING                               of its files
    meshes(world)                        (name, bytes) of the mesh files that they need
    files(world, folder, together=...)   their bytes: one with all scenes in it, or one for each scene

These are written, never read: they store no request, and only USD has the spec and phi, which are in scene files.
"""

from __future__ import annotations

import importlib
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from scenegen.api.scene_arrays import SceneArrays
from scenegen.errors import OutputError, RequestError
from scenegen.errors.declarations import ONE_FILE_MANY_NUMBERS
from scenegen.errors.files import CANNOT_WRITE, ENDING_OF_ANOTHER, NO_FORMAT, WRONG_ENDING
from scenegen.errors.requests import NO_SCENES, OUT_OF_PLACE, UNKNOWN_CHOICE
from scenegen.looks.look import LOOKS
from scenegen.needs import need
from scenegen.scenes.blocks import Block, join_blocks
from scenegen.scenes.data import SceneFile
from scenegen.scenes.files import check_folder, check_writable, ending_of, report_write_errors, scene_name, whole_files
from scenegen.scenes.formats import registry as table
from scenegen.scenes.formats.registry import FORMAT_OF_ENDING, FORMATS
from scenegen.things.outline import Floats
from scenegen.worlds.export.world import FOLDER as TEXTURES
from scenegen.worlds.export.world import Own, recorded, worlds_of

if TYPE_CHECKING:
    from scenegen.worlds.export.looks import SceneLooks

EXPORTS: dict[str, str] = {
    "mjcf": "scenegen.worlds.export.mjcf",
    "sdf": "scenegen.worlds.export.sdf",
    "usd": "scenegen.worlds.export.usd",
}
TITLES = {"mjcf": "MuJoCo", "sdf": "SDF (Gazebo)", "usd": "USD (Isaac Sim)"}  # on the page; else the name itself
NEEDS = {"usd": "pxr"}  # packages that only an extra of scenegen installs
CRATES = (".usd", ".usdc")  # endings of files that are binary: `files` gives their text
MESHES = "meshes"
WITH_LOOKS = ("mjcf", "usd")


def is_file(out: Path, to: str) -> bool:
    """Whether `out` is one file with all scenes, by its ending; else it is a folder with a file each.

    Raises RequestError for the ending of another format.
    """
    ending = ending_of(out)
    if ending in FORMATS or FORMAT_OF_ENDING.get(ending, to) != to:
        other = FORMAT_OF_ENDING.get(ending, "scene files")
        raise RequestError(ENDING_OF_ANOTHER(path=out, other=other, format=to, places=_places(to)))
    return ending in FORMAT_OF_ENDING


def _places(to: str) -> str:
    endings = " or ".join(f"`{ending}`" for ending, name in FORMAT_OF_ENDING.items() if name == to)
    return f"name a folder, or a file that ends in {endings}"


def check_out(out: Path, to: str, *inputs: Path) -> None:
    """Refuse, before any work is done, an `out` that cannot be written to, and a format whose library is missing.
    Raises RequestError, OutputError."""
    if to in NEEDS:
        need(NEEDS[to], f"to write {to.upper()}")
    if is_file(out, to):
        check_writable(out, *inputs)
        return
    with report_write_errors(out):
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
    module: Any = importlib.import_module(EXPORTS[to])
    if not scenes.count:
        raise RequestError(NO_SCENES())
    own: Own = {}
    if sources is not None:
        from scenegen.worlds.own_body import own_bodies_of

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
    from scenegen.worlds.export.usd import crate

    return crate(text)


PLANNERS, PROBLEMS = "pddl", "scenegen.planning.conversion"  # the format, and the module of it
NAMES = {ending.removeprefix("."): ending for ending in FORMATS}  # formats of scene files


CALLED = {  # what formats are called elsewhere, mostly after what reads them
    **dict.fromkeys(("mujoco", "mjx", "mujocoplayground", "dmcontrol", "robosuite", "maniskill", "xml"), "mjcf"),
    **dict.fromkeys(("isaac", "isaacsim", "isaaclab", "omniverse", "openusd", "usda", "usdc", "usdz"), "usd"),
    **dict.fromkeys(("gazebo", "gz", "ignition", "gzsim", "world", "drake"), "sdf"),
    **dict.fromkeys(("bddl", "planner", "strips"), "pddl"),
}


def chosen(to: str | None, out: Path) -> str:
    """The format that is asked for, by its name or else by the ending of `out`. Raises RequestError."""
    known = (*EXPORTS, PLANNERS, *NAMES)
    if to is None:
        ending = ending_of(out)
        if ending in FORMAT_OF_ENDING:
            return FORMAT_OF_ENDING[ending]
        if ending in FORMATS:
            return ending.removeprefix(".")
        raise RequestError(NO_FORMAT(path=out, known=known, name="", instead=table.INSTEAD.get(ending[1:])))
    if to not in known:
        name = to.casefold().translate({ord(odd): None for odd in "_-. "})
        instead = f"the format for {to} is `{CALLED[name]}`" if name in CALLED else table.INSTEAD.get(name)
        raise RequestError(UNKNOWN_CHOICE(what="format", name=to, known=known, instead=instead))
    return to


def check_export(out: Path, to: str, *inputs: Path) -> None:
    """Refuse, before any work is done, what cannot be written. Raises RequestError, OutputError."""
    if to in EXPORTS or to == PLANNERS:
        check_out(out, to, *inputs)
        return
    if ending_of(out) != NAMES[to]:
        better = out.with_suffix(NAMES[to])
        raise RequestError(WRONG_ENDING(path=out, ending=NAMES[to], format=to, better=better, leave="to"))
    table.format_of(out)
    check_writable(out, *inputs)


def check_meshes(to: str, meshes: Path | None, option: str = "meshes") -> None:
    """Raises RequestError where a folder of meshes is given for a format without bodies."""
    if meshes is not None and to not in EXPORTS:
        raise RequestError(
            OUT_OF_PLACE(option=option, rule="gives bodies to simulators", remedy="take mjcf, sdf or usd")
        )


def check_looks(out: Path, to: str, looks: str | Path | None, option: str = "looks") -> None:
    """Raises RequestError where looks are given for a format without them, or for one file."""
    if looks is None:
        return
    if to not in WITH_LOOKS:
        raise RequestError(OUT_OF_PLACE(option=option, rule="goes with mjcf and usd", remedy="leave it out"))
    if is_file(out, to):
        rule = "gives each scene a file of its own"
        raise RequestError(OUT_OF_PLACE(option=option, rule=rule, remedy="name a folder"))


def export(
    scenes: SceneArrays,
    out: Path,
    to: str | None,
    meshes: Path | None = None,
    looks: str | Path | None = None,
    seed: int = 0,
) -> tuple[Path, ...]:
    """See `SceneSet.export`."""
    to = chosen(to, out)
    check_export(out, to)
    check_meshes(to, meshes)
    check_looks(out, to, looks)
    if to in EXPORTS:
        from scenegen.worlds.export.looks import dressing_of

        given = None if looks is None else dressing_of(scenes.file(), looks, seed)
        whole = join_blocks(list(scenes.blocks()), scenes.header.coordinates, len(scenes.phi))
        return write_worlds(out, to, scenes.header, whole, tuple(scenes.phi), meshes, given, scenes.rest)
    scenes.refuse_rest(to)
    if to == PLANNERS:
        return tuple(importlib.import_module(PROBLEMS).of_scenes(scenes, out).problems)
    return (scenes.save(out),)


def convert(source: Path, out: Path, to: str | None = None, meshes: Path | None = None) -> tuple[int, tuple[Path, ...]]:
    """A scene file in another format: how many scenes, and the files that were written, meshes not counted.

    Scene files go through memory in blocks. Raises RequestError, DataError, OutputError.
    """
    to = chosen(to, out)
    check_export(out, to, source)
    check_meshes(to, meshes)
    reading = table.read_scenes(source)
    if to in EXPORTS:
        scenes = reading.whole()
        files = write_worlds(out, to, reading.header, scenes, reading.labels, meshes)
        return scenes.count, files
    counts: list[int] = []
    table.write_scenes(out, reading.header, reading.labels, _counted(reading.blocks, counts))
    return sum(counts), (out,)


def _counted(blocks: Iterator[Block], counts: list[int]) -> Iterator[Block]:
    """The same blocks; `counts` is called with the number of scenes of each."""
    for block in blocks:
        counts.append(block.count)
        yield block
