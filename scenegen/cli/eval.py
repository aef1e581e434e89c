"""`scenegen eval`: phi of given scenes."""

from __future__ import annotations

import sys
from dataclasses import asdict
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from scenegen.cli.options import Root, SpecFile
from scenegen.errors.program import PHI_NOT_COMPARED
from scenegen.errors.requests import NO_SUCH_SCENE_NUMBER, OUT_OF_PLACE

if TYPE_CHECKING:
    from scenegen.api.outline import Line, Outline
    from scenegen.api.scenes import SceneSet
    from scenegen.api.spec import Spec

REQUIRED = "require"  # lang.core.REQUIRE, which is loaded only when the command runs
EVERY = 10_000  # sub-formulas of a label that --json has at most


def evaluate(
    spec: SpecFile,
    scenes: Annotated[
        Path,
        typer.Argument(
            help="Scenes of the same objects, sampled, settled or poses alone; or a trajectory.",
            metavar="SCENES",
            show_default=False,
        ),
    ],
    explain: Annotated[bool, typer.Option("--explain", help="Name the atom that decides phi, too.")] = False,
    scene: Annotated[
        int | None, typer.Option("--scene", help="With --explain: every sub-formula of this scene.", metavar="NUMBER")
    ] = None,
    json: Annotated[
        bool, typer.Option("--json", help="Print one JSON document instead, with every digit.", show_default=False)
    ] = False,
    resample: Annotated[
        bool, typer.Option("--resample", help="Interpolate a trajectory whose rows are at other times.")
    ] = False,
    motion: Annotated[
        int | None, typer.Option("--motion", help="This motion of several alone.", metavar="NUMBER")
    ] = None,
    figure: Annotated[
        Path | None,
        typer.Option("--figure", help="Draw phi of a motion over time into this file, too.", metavar="FILE"),
    ] = None,
    root: Root = None,
) -> int:
    """Print phi of every scene and label, computed by the exact spec in float64.

    \b
      scenegen eval my.spec scenes.json
      scenegen eval my.spec scenes.json --explain
      scenegen eval my.spec scenes.json --explain --scene 3
      scenegen eval my.spec scenes.json --json
      scenegen eval my.spec scenes.json | cut -f 2 | sort -g
      scenegen eval my.spec poses.csv
      scenegen eval over_time.spec trajectory.csv --figure phi.png
      scenegen eval over_time.spec motions.jsonl --motion 3

    On a terminal the table is rounded; in a pipe it is tab-separated with every digit. Where the file was made from
    this very spec, its stored values are compared, and the exit status is 1 if any is off by more than 1e-9.

    Files of poses alone are read, too: tables with the columns mug.x, mug.y and mug.theta of every object (.csv,
    .jsonl, .parquet; metres and radians), and scenes with poses by name (.json, .jsonl). Of settled scenes each object
    counts at x, y and the heading of its nearest upright attitude.

    With --scene (or where the file holds a single scene), --explain prints the value of every sub-formula of that scene
    and marks the atom that decides phi: it alone would have to change for phi to change.

    A spec over time takes trajectories instead: a .csv, .jsonl or .parquet file with the columns t, mug.x, mug.y,
    mug.theta and so on (seconds, metres, radians), one row a moment, and motion where there are several; or a file of
    motions that scenegen wrote. What decides phi is printed with its moment.
    """
    from scenegen.api.reading import read_scenes
    from scenegen.api.scenes import check_count, requirement
    from scenegen.api.scenes import evaluate as score
    from scenegen.api.scenes import explain as why
    from scenegen.api.spec import load
    from scenegen.cli.output import note
    from scenegen.cli.trajectory import TrajectoryOptions, evaluate_trajectories
    from scenegen.errors import RequestError
    from scenegen.formats.plain import is_plain
    from scenegen.lang.core import REQUIRE

    checked, options = load(spec, root), TrajectoryOptions(resample, motion, figure)
    if checked.horizon is not None:
        if scene is not None:
            rule, remedy = "shows one scene, and this is a spec of motions", "leave it out"
            raise RequestError(OUT_OF_PLACE(option="--scene", rule=rule, remedy=remedy))
        return evaluate_trajectories(checked, scenes, options, json=json)
    for option in options.given:
        rule, remedy = "is for trajectories, and this is a spec of scenes", "leave it out"
        raise RequestError(OUT_OF_PLACE(option=option, rule=rule, remedy=remedy))
    found = read_scenes(scenes, spec=checked if is_plain(scenes) else None)
    check_count(found)
    for warning in found.warnings:
        note(warning)
    if scene is not None and not explain:
        raise RequestError(OUT_OF_PLACE(option="--scene", rule="shows one scene of --explain", remedy="add --explain"))
    if scene is not None and not 1 <= scene <= len(found):
        raise RequestError(NO_SUCH_SCENE_NUMBER(number=scene, file=scenes, count=len(found)))
    one = (scene or 1) if explain and (scene is not None or len(found) == 1) else None
    if json:
        from json import dumps

        typer.echo(dumps(as_json(checked, found, explain, one), indent=1, ensure_ascii=False))
        return _compare(checked, found, scenes)
    if one is not None:
        _explain(checked, found, one)
        return _compare(checked, found, scenes)
    columns: dict[str, list[float] | list[str]] = {}
    atoms = why(checked.drawn, found) if explain else {}
    for label, values in score(checked.drawn, found).items():
        columns[label] = values.tolist()
        if explain:
            columns[f"{label} is decided by"] = atoms[label]
    required = requirement(checked.drawn, found)
    if required is not None:
        columns[REQUIRE] = required.tolist()
    if sys.stdout.isatty():
        _table(columns)
    else:
        lines = ["\t".join(["scene", *columns])]
        for number, row in enumerate(zip(*columns.values(), strict=True), 1):
            lines.append("\t".join([str(number), *map(str, row)]))
        typer.echo("\n".join(lines))
    return _compare(checked, found, scenes)


def _explain(spec: Spec, scenes: SceneSet, number: int) -> None:
    """The formulas of a scene, each sub-formula with its value."""
    from scenegen.cli.tree import tree
    from scenegen.lang.core import REQUIRE

    outline, values = _values(spec, scenes, number)
    typer.echo(f"scene {number} of {len(scenes)}")
    for label in outline.labels:
        value = values[outline.core.labels[label]]
        met = "" if label != REQUIRE or value >= 0.0 else ", which is not met"
        typer.echo(f"\n  {label}: {'margin' if label == REQUIRE else 'phi'} = {value:.9g}{met}")
        typer.echo("\n".join(tree(*outline.lines(label, values=values))))


def as_json(spec: Spec, scenes: SceneSet, explain: bool = False, only: int | None = None) -> dict[str, Any]:
    """phi of every scene (of scene number `only`, from 1) as plain data; with `explain` also the atom that decides each
    label, and for a single scene every sub-formula."""
    from scenegen.api.scenes import evaluate as score
    from scenegen.api.scenes import explain as why
    from scenegen.api.scenes import requirement

    phi = score(spec.drawn, scenes)
    required = requirement(spec.drawn, scenes)
    atoms = why(spec.drawn, scenes) if explain else {}
    rows: list[dict[str, Any]] = []
    for number in range(1, len(scenes) + 1) if only is None else (only,):
        at = number - 1
        row: dict[str, Any] = {"scene": number, "phi": {label: float(values[at]) for label, values in phi.items()}}
        if required is not None:
            row[REQUIRED] = float(required[at]) if isfinite(required[at]) else None
        if explain:
            row["decided_by"] = {label: texts[at] for label, texts in atoms.items()}
        rows.append(row)
    found: dict[str, Any] = {"labels": list(phi), "scenes": rows}
    if explain and only is not None:
        found["formulas"] = {
            label: [asdict(line) for line in lines] for label, lines in _formulas(spec, scenes, only).items()
        }
    return found


def _formulas(spec: Spec, scenes: SceneSet, number: int) -> dict[str, list[Line]]:
    """Every sub-formula of a scene, by label, each with its value."""
    outline, values = _values(spec, scenes, number)
    return {label: outline.lines(label, most=EVERY, values=values)[0] for label in outline.labels}


def _values(spec: Spec, scenes: SceneSet, number: int) -> tuple[Outline, list[float]]:
    """The formulas of the spec that a scene is of, and the value of each node."""
    from scenegen.api.outline import Outline
    from scenegen.api.scene_arrays import parts_of
    from scenegen.api.spec import Spec
    from scenegen.lang.interpret import evaluate as interpret

    (part,) = parts_of(spec.drawn, scenes[number - 1 : number])
    outline = Outline(Spec(part.spec))
    return outline, list(interpret(outline.core, part.rows[:, 0].tolist()))


def _table(columns: dict[str, list[float] | list[str]]) -> None:
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table("scene", *columns, box=None)
    for number, row in enumerate(zip(*columns.values(), strict=True), 1):
        cells = (cell if isinstance(cell, str) else f"{cell:+.6f}" for cell in row)
        table.add_row(str(number), *map(Text, cells))
    Console().print(table)


def _compare(spec: Spec, scenes: SceneSet, path: Path) -> int:
    """0 where the stored values are those of the spec, or of another spec altogether."""
    from scenegen.api.scenes import compare
    from scenegen.cli.output import complain, note

    if not scenes.phi:  # moments of motions
        return 0
    if scenes.header.spec.sha256 != spec.drawn.sha256:
        note(PHI_NOT_COMPARED(file=path))
        return 0
    for wrong in compare(spec.drawn, scenes, path):
        complain(wrong)
        return 1
    return 0
