"""`scenegen eval`: phi of given scenes."""

from __future__ import annotations

import math
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from scenegen.cli.options import JSON, ROOT, SPEC_FILE, argument, option
from scenegen.cli.output import complain, note, print_error, print_json, print_rows, tree
from scenegen.errors import RequestError
from scenegen.errors.program import PHI_NOT_COMPARED
from scenegen.errors.requests import NO_SUCH_NUMBER, OUT_OF_PLACE
from scenegen.lang.formula.core import REQUIRE

if TYPE_CHECKING:
    from scenegen.api.outline import Line, Outline
    from scenegen.api.scenes import SceneSet
    from scenegen.api.spec import Spec
    from scenegen.lang.formula.timed import TimedValues


MAX_JSON_LINES = 10_000  # sub-formulas of a label that --json has at most


def evaluate(
    spec: Path = SPEC_FILE,
    scenes: Path = argument("Scenes of the same objects, sampled, settled or poses alone; or a trajectory.", "SCENES"),
    explain: bool = option("Name the atom that decides phi, too."),
    scene: int | None = option("With --explain: every sub-formula of this scene.", "NUMBER"),
    json: bool = JSON,
    resample: bool = option("Interpolate a trajectory whose rows are at other times."),
    motion: int | None = option("This motion of several alone.", "NUMBER"),
    figure: Path | None = option("Draw phi of a motion over time into this file, too.", "FILE"),
    root: Path | None = ROOT,
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
    from scenegen.scenes.formats.tables import is_plain

    checked = load(spec, root)
    if checked.horizon is not None:
        if scene is not None:
            rule, remedy = "shows one scene, and this is a spec of motions", "leave it out"
            raise RequestError(OUT_OF_PLACE(option="--scene", rule=rule, remedy=remedy))
        return evaluate_trajectories(checked, scenes, resample, motion, figure, json=json)
    for name, given in {"--resample": resample or None, "--motion": motion, "--figure": figure}.items():
        if given is not None:
            rule, remedy = "is for trajectories, and this is a spec of scenes", "leave it out"
            raise RequestError(OUT_OF_PLACE(option=name, rule=rule, remedy=remedy))
    found = read_scenes(scenes, spec=checked if is_plain(scenes) else None)
    check_count(found)
    note(*found.warnings)
    if scene is not None and not explain:
        raise RequestError(OUT_OF_PLACE(option="--scene", rule="shows one scene of --explain", remedy="add --explain"))
    if scene is not None and not 1 <= scene <= len(found):
        raise RequestError(NO_SUCH_NUMBER(what="scene", number=scene, file=scenes, first=1, last=len(found)))
    one = (scene or 1) if explain and (scene is not None or len(found) == 1) else None
    if json:
        print_json(as_json(checked, found, explain, one))
        return _compare(checked, found, scenes)
    if one is not None:
        _explain(checked, found, one)
        return _compare(checked, found, scenes)
    columns: dict[str, list[float] | list[str]] = {}
    atoms = why(checked.require_scenes(), found) if explain else {}
    for label, values in score(checked.require_scenes(), found).items():
        columns[label] = values.tolist()
        if explain:
            columns[f"{label} is decided by"] = atoms[label]
    for at, one_sights in enumerate(_sights(checked, found) if explain else ()):
        for sight in one_sights["seen"]:
            column = columns.setdefault(f"{sight['camera']} sees of {sight['object']}", [""] * len(found))
            column[at] = sight["words"]
    required = requirement(checked.require_scenes(), found)
    if required is not None:
        columns[REQUIRE] = required.tolist()
    print_rows(("scene", *columns), zip(range(1, len(found) + 1), *columns.values(), strict=True))
    return _compare(checked, found, scenes)


def _explain(spec: Spec, scenes: SceneSet, number: int) -> None:
    """The formulas of a scene, each sub-formula with its value."""
    outline, values = _values(spec, scenes, number)
    typer.echo(f"scene {number} of {len(scenes)}")
    for label in outline.labels:
        value = values[outline.core.labels[label]]
        met = "" if label != REQUIRE or value >= 0.0 else ", which is not met"
        typer.echo(f"\n  {label}: {'margin' if label == REQUIRE else 'phi'} = {value:.9g}{met}")
        typer.echo("\n".join(tree(*outline.lines(label, values=values))))
    (told,) = _sights(spec, scenes[number - 1 : number])
    words = [
        f"{one['object']} at {math.degrees(one['yaw']):.4g} deg: {one['robot']} has {one['room']:.3g} m of room"
        for one in told["hands"]
    ]
    words += [f"{one['camera']} sees {one['object']}: {one['words']}" for one in told["seen"]]
    if words:
        typer.echo("\n".join(["", *(f"  {line}" for line in words)]))


def _sights(spec: Spec, scenes: SceneSet) -> list[dict[str, Any]]:
    """Of each scene, as plain data: the yaw (in the object's frame, radians) at which each hand has the most room, and
    the shares that cameras see."""
    from scenegen.api.scene_arrays import parts_of
    from scenegen.lang.sights import sights_of

    found: list[dict[str, Any]] = [{"hands": [], "seen": []} for _ in range(len(scenes))]
    for part in parts_of(spec.require_scenes(), scenes):
        sights, names = sights_of(part.spec), part.spec.objects
        for grip in () if sights is None else sights.grips(part.rows):
            for place, yaw, room in zip(part.which, grip.yaw.tolist(), grip.room.tolist(), strict=True):
                one = {"object": names[grip.thing], "robot": names[grip.robot], "yaw": yaw, "room": room}
                found[place]["hands"].append(one)
        for seen in () if sights is None else sights.views(part.rows):
            for at, place in enumerate(part.which):
                share, words = float(seen.share[at]), seen.words(at)
                one = {"object": names[seen.thing], "camera": seen.camera, "share": share, "words": words}
                found[place]["seen"].append(one)
    return found


def as_json(spec: Spec, scenes: SceneSet, explain: bool = False, only: int | None = None) -> dict[str, Any]:
    """phi of every scene (of scene number `only`, from 1) as plain data; with `explain` also the atom that decides each
    label, and for a single scene every sub-formula."""
    from scenegen.api.scenes import evaluate as score
    from scenegen.api.scenes import explain as why
    from scenegen.api.scenes import requirement

    phi = score(spec.require_scenes(), scenes)
    required = requirement(spec.require_scenes(), scenes)
    atoms = why(spec.require_scenes(), scenes) if explain else {}
    sights = _sights(spec, scenes) if explain else []
    rows: list[dict[str, Any]] = []
    for number in range(1, len(scenes) + 1) if only is None else (only,):
        at = number - 1
        row: dict[str, Any] = {"scene": number, "phi": {label: float(values[at]) for label, values in phi.items()}}
        if required is not None:
            row[REQUIRE] = _finite(float(required[at]))
        if explain:
            row["decided_by"] = {label: texts[at] for label, texts in atoms.items()}
            row |= {what: some for what, some in sights[at].items() if some}
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
    return {label: outline.lines(label, most=MAX_JSON_LINES, values=values)[0] for label in outline.labels}


def _values(spec: Spec, scenes: SceneSet, number: int) -> tuple[Outline, list[float]]:
    """The formulas of the spec that a scene is of, and the value of each node."""
    from scenegen.api.outline import Outline
    from scenegen.api.scene_arrays import parts_of
    from scenegen.lang.formula.interpret import evaluate as interpret

    (part,) = parts_of(spec.require_scenes(), scenes[number - 1 : number])
    outline = Outline(part.spec)
    return outline, list(interpret(outline.core, part.rows[:, 0].tolist()))


def _compare(spec: Spec, scenes: SceneSet, path: Path) -> int:
    """0 where the stored values are those of the spec, or of another spec altogether."""
    from scenegen.api.scenes import compare

    if not scenes.phi:  # moments of motions
        return 0
    if scenes.header.spec.sha256 != spec.require_scenes().sha256:
        note(PHI_NOT_COMPARED(file=path))
        return 0
    for wrong in compare(spec.require_scenes(), scenes, path):
        complain(wrong)
        return 1
    return 0


def evaluate_trajectories(
    spec: Spec, path: Path, resample: bool, motion: int | None, figure: Path | None, *, json: bool
) -> int:
    """Print phi of every motion and label, with the atom and the moment that decide it; the status of the program."""
    from scenegen.api.monitor import read_trajectories, score_trajectory
    from scenegen.scenes.files import check_writable
    from scenegen.scenes.formats.registry import check_ending

    if figure is not None:
        check_ending(figure, ".png")
        check_writable(figure)
    motions, notes = read_trajectories(spec, path, resample=resample)
    if motion is not None:
        if motion not in motions:
            numbers = [number for number in motions if number is not None]
            ends = {"first": min(numbers), "last": max(numbers)} if numbers else {}
            raise RequestError(NO_SUCH_NUMBER(what="motion", number=motion, file=path, **ends))
        motions = {motion: motions[motion]}
    if figure is not None and len(motions) > 1:
        rule = f"draws one motion, and {path} has {len(motions):,}"
        raise RequestError(OUT_OF_PLACE(option="--figure", rule=rule, remedy="choose one with --motion"))
    assert spec.horizon is not None
    scored = {number: score_trajectory(spec, poses) for number, poses in motions.items()}
    tables = {number: _rows(one, spec.horizon.dt) for number, one in scored.items()}
    if json:
        found: dict[str, Any] = {"labels": list(spec.labels)}
        each = [{"phi": rows, "over_time": _over_time(scored[number])} for number, rows in tables.items()]
        if None in tables:
            found |= each[0]
        else:
            found["motions"] = [{"motion": number, **one} for number, one in zip(tables, each, strict=True)]
        print_json(found)
    else:
        several = None not in tables
        head = ("motion", "label", "phi", "decided by", "moment", "t")[not several :]
        lines = [(number, name, *row.values()) for number, rows in tables.items() for name, row in rows.items()]
        print_rows(head, [line[not several :] for line in lines], t="{:g} s")
    note(*notes)
    if figure is not None:
        _draw(figure, next(iter(scored.values())), spec)
    return 0


def _rows(scored: TimedValues, dt: float) -> dict[str, dict[str, Any]]:
    phi: dict[str | None, float] = dict(scored.phi.items())
    if scored.requirement is not None:
        phi[None] = float(scored.requirement.min())
    rows: dict[str, dict[str, Any]] = {}
    for label, value in phi.items():
        atom, moment = scored.decides(label)
        name = REQUIRE if label is None else label
        rows[name] = {"phi": value, "decided_by": atom.text, "moment": moment, "t": moment * dt}
    return rows


def _over_time(scored: TimedValues) -> dict[str, list[float | None]]:
    found = dict(scored.signals)
    if scored.requirement is not None:
        found[REQUIRE] = scored.requirement
    return {name: [_finite(one) for one in values.tolist()] for name, values in found.items()}


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _draw(figure: Path, scored: TimedValues, spec: Spec) -> None:
    from scenegen.pictures.figures.charts import phi_chart
    from scenegen.scenes.files import write_whole

    assert spec.horizon is not None
    times = [moment * spec.horizon.dt for moment in range(spec.horizon.moments)]
    write_whole(figure, phi_chart(times, {name: row.tolist() for name, row in scored.signals.items()}))
    print_error(f"phi over time in {figure}")
