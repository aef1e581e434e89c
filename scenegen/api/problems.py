"""Scenes as files of PDDL problems."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from scenegen.api.scene_arrays import SceneArrays, rows_of
from scenegen.errors import Diagnostic, RequestError
from scenegen.errors.planning import ONE_PROBLEM_A_FILE
from scenegen.errors.requests import NO_SCENES
from scenegen.export.simulators import is_file
from scenegen.formats.folder import scene_name, whole_files
from scenegen.pddl.export import Problems, goal_labels
from scenegen.pddl.ground import ground
from scenegen.pddl.unsaid import unsaid
from scenegen.pddl.write import vocabulary

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
