"""Scenes in other formats: files of scenes, and files of simulators."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from scenegen.errors import Diagnostic, RequestError, suggest
from scenegen.formats import simulators, table
from scenegen.formats.blocks import Block, joined
from scenegen.formats.files import check_writable

if TYPE_CHECKING:
    from scenegen.api.scene_arrays import SceneArrays

NAMES = {ending.removeprefix("."): ending for ending in table.FORMATS}  # formats of scene files


def chosen(to: str | None, out: Path) -> str:
    """The format that is asked for, by its name or else by the ending of `out`. Raises RequestError."""
    known = (*simulators.SIMULATORS, *NAMES)
    if to is None:
        ending = out.suffix.lower()
        if ending in table.ENDINGS:
            return table.ENDINGS[ending]
        if ending in table.FORMATS:
            return ending.removeprefix(".")
        title = f"no format was asked for, and {out} does not tell it by its ending"
        raise RequestError(Diagnostic(title, help=f"say which with --to: {', '.join(known)}"))
    if to not in known:
        help_ = suggest(to, known, f"the formats are {', '.join(known)}")
        raise RequestError(Diagnostic(f"unknown format `{to}`", help=help_))
    return to


def check_export(out: Path, to: str, *inputs: Path) -> None:
    """Refuse, before any work is done, what cannot be written. Raises RequestError, OutputError."""
    if to in simulators.SIMULATORS:
        simulators.check_out(out, to, *inputs)
        return
    if out.suffix.lower() != NAMES[to]:
        title = f"{out} does not end in {NAMES[to]}, and {to} was asked for"
        raise RequestError(Diagnostic(title, help=f"name it {out.with_suffix(NAMES[to])}, or leave --to out"))
    table.format_of(out)
    check_writable(out, *inputs)


def export(scenes: SceneArrays, out: Path, to: str | None) -> tuple[Path, ...]:
    """See `SceneSet.export`."""
    to = chosen(to, out)
    check_export(out, to)
    if to in simulators.SIMULATORS:
        coordinates = 3 * len(scenes.objects)
        return simulators.write_worlds(
            out, to, scenes.header, joined(list(scenes.blocks()), coordinates, len(scenes.phi))
        )
    return (scenes.save(out),)


def convert(source: Path, out: Path, to: str | None = None) -> tuple[int, tuple[Path, ...]]:
    """A scene file in another format: how many scenes, and the files that were written, meshes not counted.

    Scene files go through memory in blocks. Raises RequestError, DataError, OutputError.
    """
    to = chosen(to, out)
    check_export(out, to, source)
    reading = table.read_scenes(source)
    if to in simulators.SIMULATORS:
        scenes = reading.whole()
        return scenes.count, simulators.write_worlds(out, to, reading.header, scenes)
    counts: list[int] = []
    table.write_scenes(out, reading.header, reading.labels, _counted(reading.blocks, counts))
    return sum(counts), (out,)


def _counted(blocks: Iterator[Block], counts: list[int]) -> Iterator[Block]:
    """The same blocks; `counts` is told how many scenes each has."""
    for block in blocks:
        counts.append(block.count)
        yield block
