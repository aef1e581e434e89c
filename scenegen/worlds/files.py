"""Scenes in other formats: files of scenes, of simulators and of planners."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from scenegen.api.scene_arrays import SceneArrays, rows_of
from scenegen.errors import Diagnostic, RequestError
from scenegen.errors.files import NO_FORMAT, WRONG_ENDING
from scenegen.errors.requests import NO_SCENES, OUT_OF_PLACE, UNKNOWN_CHOICE
from scenegen.errors.worlds import ONE_PROBLEM_A_FILE
from scenegen.scenes.blocks import Block, joined
from scenegen.scenes.files import check_writable, scene_name, whole_files
from scenegen.scenes.formats import registry as table
from scenegen.worlds.export import simulators
from scenegen.worlds.export.simulators import is_file
from scenegen.worlds.pddl.export import Problems, goal_labels, unsaid
from scenegen.worlds.pddl.ground import ground
from scenegen.worlds.pddl.write import vocabulary

if TYPE_CHECKING:
    from scenegen.scenes.data import SceneFile
    from scenegen.worlds.export.world import SceneLooks


PLANNERS = "pddl"
NAMES = {ending.removeprefix("."): ending for ending in table.FORMATS}  # formats of scene files


CALLED = {  # what formats are called elsewhere, mostly after what reads them
    **dict.fromkeys(("mujoco", "mjx", "mujocoplayground", "dmcontrol", "robosuite", "maniskill", "xml"), "mjcf"),
    **dict.fromkeys(("isaac", "isaacsim", "isaaclab", "omniverse", "openusd", "usda", "usdc", "usdz"), "usd"),
    **dict.fromkeys(("gazebo", "gz", "ignition", "gzsim", "world", "drake"), "sdf"),
    **dict.fromkeys(("bddl", "planner", "strips"), "pddl"),
}


def chosen(to: str | None, out: Path) -> str:
    """The format that is asked for, by its name or else by the ending of `out`. Raises RequestError."""
    known = (*simulators.SIMULATORS, PLANNERS, *NAMES)
    if to is None:
        ending = out.suffix.lower()
        if ending in table.ENDINGS:
            return table.ENDINGS[ending]
        if ending in table.FORMATS:
            return ending.removeprefix(".")
        raise RequestError(NO_FORMAT(path=out, known=known, name="", instead=table.INSTEAD.get(ending[1:])))
    if to not in known:
        name = to.casefold().translate({ord(odd): None for odd in "_-. "})
        instead = f"the format for {to} is `{CALLED[name]}`" if name in CALLED else table.INSTEAD.get(name)
        raise RequestError(UNKNOWN_CHOICE(what="format", name=to, known=known, instead=instead))
    return to


def check_export(out: Path, to: str, *inputs: Path) -> None:
    """Refuse, before any work is done, what cannot be written. Raises RequestError, OutputError."""
    if to in simulators.SIMULATORS or to == PLANNERS:
        simulators.check_out(out, to, *inputs)
        return
    if out.suffix.lower() != NAMES[to]:
        better = out.with_suffix(NAMES[to])
        raise RequestError(WRONG_ENDING(path=out, ending=NAMES[to], format=to, better=better, leave="to"))
    table.format_of(out)
    check_writable(out, *inputs)


def check_meshes(to: str, meshes: Path | None, option: str = "meshes") -> None:
    """Raises RequestError where a folder of meshes is given for a format without bodies."""
    if meshes is not None and to not in simulators.SIMULATORS:
        raise RequestError(
            OUT_OF_PLACE(option=option, rule="gives bodies to simulators", remedy="take mjcf, sdf or usd")
        )


def check_looks(out: Path, to: str, looks: str | Path | None, option: str = "looks") -> None:
    """Raises RequestError where looks are given for a format without them, or for one file."""
    if looks is None:
        return
    if to not in simulators.WITH_LOOKS:
        raise RequestError(OUT_OF_PLACE(option=option, rule="goes with mjcf and usd", remedy="leave it out"))
    if simulators.is_file(out, to):
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
    if to in simulators.SIMULATORS:
        given = None if looks is None else _dressing(scenes.file(), looks, seed)
        whole = joined(list(scenes.blocks()), scenes.header.coordinates, len(scenes.phi))
        return simulators.write_worlds(out, to, scenes.header, whole, tuple(scenes.phi), meshes, given, scenes.rest)
    scenes.refuse_rest(to)
    if to == PLANNERS:
        return of_scenes(scenes, out).problems
    return (scenes.save(out),)


def _dressing(file: SceneFile, looks: str | Path, seed: int) -> SceneLooks:
    """The looks of scenes, with the cameras of their pictures. Raises RequestError, DataError."""
    from scenegen.scenes.stage import stage_of
    from scenegen.show.looks.configuration import read_looks
    from scenegen.show.render.files import check_seed, usual_size
    from scenegen.worlds.export.world import SceneLooks

    if not file.scenes:
        raise RequestError(NO_SCENES())
    given = read_looks(looks)
    drawn = given.drawn(check_seed(seed), len(file.scenes), [item.name for item in file.objects])
    stage, size = stage_of(file), usual_size(file)
    cameras = [look.camera(stage.corners(), size) for look in drawn]
    return SceneLooks(drawn, cameras, stage, given.files, seed)


def convert(source: Path, out: Path, to: str | None = None, meshes: Path | None = None) -> tuple[int, tuple[Path, ...]]:
    """A scene file in another format: how many scenes, and the files that were written, meshes not counted.

    Scene files go through memory in blocks. Raises RequestError, DataError, OutputError.
    """
    to = chosen(to, out)
    check_export(out, to, source)
    check_meshes(to, meshes)
    reading = table.read_scenes(source)
    if to in simulators.SIMULATORS:
        scenes = reading.whole()
        files = simulators.write_worlds(out, to, reading.header, scenes, reading.labels, meshes)
        return scenes.count, files
    counts: list[int] = []
    table.write_scenes(out, reading.header, reading.labels, _counted(reading.blocks, counts))
    return sum(counts), (out,)


def _counted(blocks: Iterator[Block], counts: list[int]) -> Iterator[Block]:
    """The same blocks; `counts` is called with the number of scenes of each."""
    for block in blocks:
        counts.append(block.count)
        yield block


# --------------------------------------------------------------------------------------------------------------------
# Scenes as files of PDDL problems.


ENDING = ".pddl"
OF_SCENES = "the spec of the scenes"

Own = Mapping[str, str] | None  # predicates and formulas of a map


@dataclass(frozen=True, slots=True)
class Exported:
    """The files of planning problems: `problems` in scene order, and their `domain`."""

    problems: tuple[Path, ...]
    domain: Path | None
    warnings: tuple[Diagnostic, ...]


def of_scenes(
    scenes: SceneArrays,
    out: Path,
    facts: Sequence[str] | None = None,
    own: Own = None,
    goal: Sequence[str] | None = None,
) -> Exported:
    """The problems of scenes. Where the spec draws how many things there are, scenes with as many share their
    facts; all share the domain. Raises RequestError, DataError, OutputError."""
    if not len(scenes):
        raise RequestError(NO_SCENES())
    source = scenes.header.spec.source
    named: dict[tuple[str, int], str] = {}
    parts = [
        (ground(source, OF_SCENES, facts, own, counts=numbers, parts=named), numbers, which)
        for numbers, which in scenes.parts()
    ]
    words = vocabulary([grounded for grounded, _, _ in parts])
    made = [Problems(grounded, goal_labels(grounded, goal), words) for grounded, _, _ in parts]

    def texts() -> Iterator[tuple[int, str]]:
        for problems, (grounded, counts, which) in zip(made, parts, strict=True):
            some = scenes.only(counts, which) if counts else scenes
            comments = {place + 1: _comment(scenes, place) for place in which.tolist()}
            written = problems.of_scenes(rows_of(grounded.spec, some), comments)
            yield from zip(comments, written, strict=True)

    files = write(out, texts(), made[0].domain, len(scenes))
    return replace(files, warnings=unsaid(made))


def _comment(scenes: SceneArrays, place: int) -> str:
    phi = ", ".join(f"{name} = {values[place]:.6g}" for name, values in scenes.phi.items())
    return f"Scene {place + 1}" + (f"; phi: {phi}" if phi else "")


def numbers(count: int) -> range:
    """The numbers of scenes, from 1."""
    return range(1, count + 1)


def write(out: Path, texts: Iterable[tuple[int, str]], words: str | None, count: int) -> Exported:
    """Writes texts, which come with the numbers of their scenes."""
    together = is_file(out, "pddl")
    if together and count > 1:
        raise RequestError(ONE_PROBLEM_A_FILE(path=out, count=count))
    folder = out.parent if together else out
    domain = f"{out.stem}_domain{ENDING}" if together else f"domain{ENDING}"
    written: dict[int, Path] = {}
    with whole_files(folder) as put:
        for number, text in texts:
            name = out.name if together else f"{scene_name(number, count)}{ENDING}"
            put(name, text.encode())
            written[number] = folder / name
        if words is not None:
            put(domain, words.encode())
    return Exported(
        tuple(written[number] for number in sorted(written)), None if words is None else folder / domain, ()
    )
