"""Scenes in other formats: files of scenes, of simulators and of planners.

`EXPORTS` is the table of simulators' formats: name -> module with

    ENDING                               of its files
    meshes(world)                        (name, bytes) of the mesh files that they need
    files(world, folder, together=...)   their bytes: one with all scenes in it, or one for each scene

These are written, never read: they store no request, and only USD has the spec and phi, which are in scene files.
Other packages add such modules by entry points of the group `scenegen.exporters`, looked up for names that are not in
the table.
"""

from __future__ import annotations

import importlib
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from scenegen.api.scene_arrays import SceneArrays
from scenegen.errors import RequestError
from scenegen.errors.declarations import ONE_FILE_MANY_NUMBERS
from scenegen.errors.files import NO_FORMAT, WRONG_ENDING
from scenegen.errors.requests import NO_SCENES, OUT_OF_PLACE, UNKNOWN_CHOICE
from scenegen.looks.look import LOOKS_FILE
from scenegen.needs import load_plugin, need, plugins
from scenegen.scenes.blocks import Block, join_blocks
from scenegen.scenes.data import SceneFile
from scenegen.scenes.files import check_writable, ending_of, scene_name, whole_files
from scenegen.scenes.formats import registry as table
from scenegen.scenes.formats.registry import FORMAT_OF_ENDING, FORMATS, check_out, is_one_file
from scenegen.things.outline import Floats
from scenegen.worlds.export.world import TEXTURES, Own, with_record, worlds_of

if TYPE_CHECKING:
    from scenegen.worlds.export.looks import SceneLooks

EXPORTS: dict[str, str] = {
    "mjcf": "scenegen.worlds.export.mjcf",
    "sdf": "scenegen.worlds.export.sdf",
    "usd": "scenegen.worlds.export.usd",
}
FORMAT_TITLES = {"mjcf": "MuJoCo", "sdf": "SDF (Gazebo)", "usd": "USD (Isaac Sim)"}  # on the page; else the name itself
NEEDS = {"usd": "pxr"}  # packages that only an extra of scenegen installs
PLANNERS, PROBLEMS = "pddl", "scenegen.planning.conversion"  # the format, and the module of it
SCENE_FORMATS = {ending.removeprefix("."): ending for ending in FORMATS}
KNOWN = (*EXPORTS, PLANNERS, *SCENE_FORMATS)
CRATES = (".usd", ".usdc")  # endings of files that are binary: `files` gives their text
EXPORTERS, WHAT = "scenegen.exporters", "export format"  # entry points of other packages: name -> such a module
CONTRACT = ("ENDING", "meshes", "files")
MESHES_FOLDER = "meshes"
WITH_LOOKS = ("mjcf", "usd")


def is_world(to: str) -> bool:
    """Whether a format is of simulators: one of `EXPORTS`, or of another package."""
    return to != PLANNERS and to not in SCENE_FORMATS


def exporter(to: str) -> Any:
    """The module of a simulator's format. Raises RequestError for one of another package that cannot be used."""
    if to in EXPORTS:
        return importlib.import_module(EXPORTS[to])
    return load_plugin(plugins(EXPORTERS, WHAT, KNOWN)[to], WHAT, CONTRACT)


def own_ending(to: str) -> str | None:
    """The ending of one file with all scenes in a format of another package; None for formats of our own, which
    `FORMAT_OF_ENDING` has."""
    if not is_world(to) or to in EXPORTS:
        return None
    ending: str = exporter(to).ENDING
    return ending


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
    module = exporter(to)
    if not scenes.count:
        raise RequestError(NO_SCENES())
    own: Own = {}
    if sources is not None:
        from scenegen.worlds.own_body import own_bodies_of

        own = own_bodies_of(header, sources, painted=to in WITH_LOOKS)
    together = is_one_file(out, to, own_ending(to))
    if together and header.counts:
        raise RequestError(ONE_FILE_MANY_NUMBERS(path=out, format=to))
    folder, meshes = (out.parent, f"{out.stem}_{MESHES_FOLDER}") if together else (out, MESHES_FOLDER)
    written: dict[int, Path] = {}
    with whole_files(folder) as put:
        put_already = set[str]()
        for bare in worlds_of(header, scenes, own):
            world = replace(with_record(bare, header, scenes, labels), dressing=dressing)
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
                put(name, module.crate(data) if together and to == "usd" and out.suffix.lower() in CRATES else data)
                written[number] = folder / name
        if dressing is not None:
            for name, data in dressing.textures():
                put(f"{TEXTURES}/{name}", data)
            put(LOOKS_FILE, dressing.record([path.name for _, path in sorted(written.items())]))
    return tuple(path for _, path in sorted(written.items()))


OTHER_NAMES = {  # what formats are called elsewhere, mostly after what reads them
    **dict.fromkeys(("mujoco", "mjx", "mujocoplayground", "dmcontrol", "robosuite", "maniskill", "xml"), "mjcf"),
    **dict.fromkeys(("isaac", "isaacsim", "isaaclab", "omniverse", "openusd", "usda", "usdc", "usdz"), "usd"),
    **dict.fromkeys(("gazebo", "gz", "ignition", "gzsim", "world", "drake"), "sdf"),
    **dict.fromkeys(("bddl", "planner", "strips"), "pddl"),
}


def export_format(to: str | None, out: Path) -> str:
    """The format that is asked for, by its name or else by the ending of `out`. Raises RequestError."""
    if to is None:
        ending = ending_of(out)
        if ending in FORMAT_OF_ENDING:
            return FORMAT_OF_ENDING[ending]
        if ending in FORMATS:
            return ending.removeprefix(".")
        known = (*KNOWN, *plugins(EXPORTERS, WHAT, KNOWN))
        raise RequestError(NO_FORMAT(path=out, known=known, name="", instead=table.INSTEAD.get(ending[1:])))
    others = plugins(EXPORTERS, WHAT, KNOWN) if to not in KNOWN else {}
    if to not in (*KNOWN, *others):
        name = to.casefold().translate({ord(odd): None for odd in "_-. "})
        instead = f"the format for {to} is `{OTHER_NAMES[name]}`" if name in OTHER_NAMES else table.INSTEAD.get(name)
        raise RequestError(UNKNOWN_CHOICE(what="format", name=to, known=(*KNOWN, *others), instead=instead))
    return to


def check_export(out: Path, to: str, *inputs: Path) -> None:
    """Refuse, before any work is done, what cannot be written. Raises RequestError, OutputError."""
    if to not in SCENE_FORMATS:
        if to in NEEDS:
            need(NEEDS[to], f"to write {to.upper()}")
        check_out(out, to, *inputs, own=own_ending(to))
        return
    if ending_of(out) != SCENE_FORMATS[to]:
        better = out.with_suffix(SCENE_FORMATS[to])
        raise RequestError(WRONG_ENDING(path=out, ending=SCENE_FORMATS[to], format=to, better=better, leave="to"))
    table.format_of(out)
    check_writable(out, *inputs)


def check_meshes(to: str, meshes: Path | None, option: str = "meshes") -> None:
    """Raises RequestError where a folder of meshes is given for a format without bodies."""
    if meshes is not None and not is_world(to):
        raise RequestError(
            OUT_OF_PLACE(option=option, rule="gives bodies to simulators", remedy="take mjcf, sdf or usd")
        )


def check_looks(out: Path, to: str, looks: str | Path | None, option: str = "looks") -> None:
    """Raises RequestError where looks are given for a format without them, or for one file."""
    if looks is None:
        return
    if to not in WITH_LOOKS:
        raise RequestError(OUT_OF_PLACE(option=option, rule="goes with mjcf and usd", remedy="leave it out"))
    if is_one_file(out, to):
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
    to = export_format(to, out)
    check_export(out, to)
    check_meshes(to, meshes)
    check_looks(out, to, looks)
    if is_world(to):
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
    to = export_format(to, out)
    check_export(out, to, source)
    check_meshes(to, meshes)
    reading = table.read_scenes(source)
    if is_world(to):
        scenes = reading.whole()
        files = write_worlds(out, to, reading.header, scenes, reading.labels, meshes)
        return scenes.count, files
    count = 0

    def blocks() -> Iterator[Block]:
        nonlocal count
        for block in reading.blocks:
            count += block.count
            yield block

    table.write_scenes(out, reading.header, reading.labels, blocks())
    return count, (out,)
