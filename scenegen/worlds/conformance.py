"""What a format of simulators has to do, checked on a few small scenes: for a test of the format's author."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import PurePosixPath
from typing import Any

import numpy as np

from scenegen.arrays import Array
from scenegen.scenes.blocks import join_blocks
from scenegen.worlds.export.world import World, with_record, worlds_of
from scenegen.worlds.exporting import CONTRACT, MESHES_FOLDER

SPECS = (
    """object mug, bowl, banana
object tray = box(0.30, 0.20, 0.02)
object lamp = cylinder(0.05, 0.30) at (0.85, 0.85)
region mat = rect(0.1, 0.1, 0.4, 0.4)
task: inside(mug, mat)
""",
    """object cup[1..3], plate
task: leftOf(cup[1], plate)
""",
)
SCENES_EACH = 3  # scenes of each
DIGITS, NEAR = 1e-4, 1e-6  # by which numbers in files may differ from those of the world, as a share and beside it
NUMBER = re.compile(rb"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")


def check_exporter(module: Any, *, masses: bool = True, places: bool = True) -> None:
    """Check an export format: a module with `ENDING`, `meshes(world)` and `files(world, folder, together=...)`
    (docs/extending.md). Its files are made twice for some scenes, as text they name every object, and the masses and
    the places (x, y) are among their numbers, those of meshes included; leave out `masses` or `places` for a format
    that does not hold them, and both for one that is not text. Raises AssertionError, which says what is wrong.
    """
    for name in CONTRACT:
        _check(hasattr(module, name), f"the module has no `{name}`")
    ending = module.ENDING
    _check(isinstance(ending, str) and re.fullmatch(r"\.\w+", ending) is not None, f"ENDING is {ending!r}, not `.name`")
    for world in _worlds():
        meshes = list(module.meshes(world))
        for name, data in meshes:
            plain = isinstance(name, str) and name not in ("", ".", "..") and PurePosixPath(name).name == name
            _check(plain, f"a mesh file is named {name!r}: it needs a plain file name")
            _check(isinstance(data, bytes), f"the mesh {name} is not bytes")
        names = [name.casefold() for name, _ in meshes]
        _check(len(set(names)) == len(names), "two mesh files have one name")
        _check(meshes == list(module.meshes(world)), "meshes of the same world differ from call to call")
        for together in (False, True):
            files = list(module.files(world, MESHES_FOLDER, together=together))
            wanted = 1 if together else len(world.poses)
            _check(len(files) == wanted, f"together={together}: {len(files)} files of {len(world.poses)} scenes")
            _check(all(isinstance(one, bytes) and one for one in files), f"together={together}: a file is not bytes")
            again = list(module.files(world, MESHES_FOLDER, together=together))
            _check(files == again, f"together={together}: files of the same world differ from call to call")
            for number, data in enumerate(files):
                shown = range(len(world.poses)) if together else (number,)
                _check_text(world, shown, data, b"\n".join(one for _, one in meshes), masses, places)


def _check_text(
    world: World, scenes: range | tuple[int, ...], data: bytes, meshes: bytes, masses: bool, places: bool
) -> None:
    if not (masses or places):
        return
    what = f"the file of scene {scenes[0] + 1}" if len(scenes) == 1 else "the file of all scenes"
    numbers = _numbers(data)
    everything = np.union1d(numbers, _numbers(meshes))
    for index, body in enumerate(world.bodies):
        spelt = re.sub(r"\W+", "[^A-Za-z0-9]+", body.name)  # cup[1] may be cup_1_, where a format allows no brackets
        _check(re.search(spelt.encode(), data) is not None, f"{what} does not name {body.name}")
        if masses:
            _check(_holds(everything, body.mass), f"neither {what} nor a mesh has the mass of {body.name}, {body.mass}")
        for scene in scenes if places else ():
            for axis in (0, 1):
                value = float(world.poses[scene, index, axis])
                _check(_holds(numbers, value), f"{what} has no {'xy'[axis]} = {value:.6g} of {body.name}")


def _numbers(data: bytes) -> Array:
    return np.array([float(one) for one in NUMBER.findall(data)])


def _holds(numbers: Array, value: float) -> bool:
    return bool(np.isclose(numbers, value, rtol=DIGITS, atol=NEAR).any())


def _worlds() -> Iterator[World]:
    """Small worlds: library and plain shapes, one held in place, a region; and numbers of things that are drawn."""
    from scenegen.api.sample import sample
    from scenegen.api.spec import parse

    for text in SPECS:
        scenes = sample(parse(text), n=SCENES_EACH, seed=0, workers=1)
        whole = join_blocks(list(scenes.blocks()), scenes.header.coordinates, len(scenes.phi))
        for bare in worlds_of(scenes.header, whole):
            yield replace(with_record(bare, scenes.header, whole, tuple(scenes.phi)))


def _check(holds: bool, message: str) -> None:
    if not holds:
        raise AssertionError(message)
