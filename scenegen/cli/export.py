"""`scenegen export`: scenes for simulators and planners, and in other formats of scene files."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from scenegen.cli.options import MESHES_OPTION, POSES_OF, argument, option
from scenegen.cli.output import complain, flag, note, note_others, print_error
from scenegen.errors import RequestError
from scenegen.errors.requests import OUT_OF_PLACE

if TYPE_CHECKING:
    from scenegen.api.scenes import SceneSet


def export(
    scenes: Path = argument("A scenes file.", "SCENES"),
    out: Path = option("A folder, or a file by its ending.", "DIR|FILE", default=...),
    to: str | None = option("mjcf, sdf, usd, pddl, json, jsonl or parquet; default: by the ending of --out."),
    spec: Path | None = POSES_OF,
    mirrored: bool = option("Write each scene as in a mirror, left and right exchanged."),
    meshes: Path | None = MESHES_OPTION,
    looks: str | None = option(
        "mjcf, usd: random, or a TOML file, as of scenegen render: another look for each scene.", "LOOKS"
    ),
    seed: int = option("With --looks: the same seed gives the same looks, and those of render.", default=0),
    facts: str | None = option("pddl: these relations, as in leftOf,on.", "RELATION,..."),
    goal: list[str] | None = option("pddl: the label that is the goal; again for more.", "LABEL"),
    whole_goal: bool = option("pddl: the goal of a pair is all that holds in its goal scene."),
    table: Path | None = option("pddl: predicates of your own.", "TOML", flags="--map"),
    problem: Path | None = option(
        "pddl: the problem that the spec was imported from: facts and goal in its words.", "PROBLEM"
    ),
    domain: Path | None = option("pddl: the domain of that problem.", "DOMAIN"),
) -> None:
    """Write scenes for MuJoCo (mjcf), Gazebo (sdf) and Isaac Sim (usd), for planners (pddl), or in another format of
    scene files (json, jsonl, parquet).

    \b
      scenegen export scenes.json --to mjcf --out worlds
      scenegen export scenes.json --to sdf --out worlds
      scenegen export scenes.json --to usd --out stages
      scenegen export scenes.json --to mjcf --out worlds --looks random --seed 3
      scenegen export scenes.json --out all.xml
      scenegen export scenes.json --to pddl --out problems
      scenegen export starts.json --to pddl --out problems --problem task.bddl
      scenegen export scenes.json --out scenes.parquet
      scenegen export poses.csv --spec my.spec --out scenes.json
      scenegen export settled.json --to mjcf --out worlds
      scenegen export scenes.json --mirrored --out mirrored.json

    A folder gets a file for each scene, in scene order: scene_0001.xml (mjcf), scene_0001.sdf, scene_0001.usda. A file
    holds all of them: as keyframes of one model (.xml), as worlds (.sdf, .world), or as variants of one stage (.usda;
    .usd and .usdc are binary). Objects stand on a table whose top is z = 0, or on what carries them, with mass,
    friction and convex pieces to collide with; what the spec holds in place cannot be moved. Meshes lie beside the
    files, as OBJ or USD. With --meshes, objects of mesh, urdf and asset have the convex pieces, mass and friction of
    their files; without it they are prisms over their outlines. USD needs usd-core: pip install "scenegen\\[usd]".

    With --looks, every scene of a folder has another table, floor, walls, light and colours, and the camera `look`:
    those of its picture by scenegen render with the same --looks and --seed. looks.jsonl says what they are.

    Settled scenes go to simulators as they came to rest, with heights and attitudes. Mirrored scenes have x counted
    from the other side of the workspace, headings turned with it, and phi as the spec gives it there.

    For planners a folder gets scene_0001.pddl, ... and domain.pddl: types and predicates, no actions. :init has what
    holds in the scene, phi >= 0, of all relations of one or two things, or of those of --facts, or of the predicates
    of --map. The goal is the label `goal`, else all labels, else those of --goal. Of pairs and motions the goal is what
    these ask for, as it is in the goal scene. With --problem, the file that the spec was imported from, facts and goal
    are in its own words, so that its own domain reads them.
    """
    from scenegen.worlds.exporting import PLANNERS, check_export, check_looks, check_meshes, convert, export_format

    if seed and looks is None:
        raise RequestError(OUT_OF_PLACE(option="--seed", rule="goes with --looks", remedy="leave it out"))
    kind = export_format(to, out)
    check_meshes(kind, meshes, "--meshes")
    check_looks(out, kind, looks, "--looks")
    of_problems = {"goal": goal or None, "whole_goal": whole_goal, "table": table, "problem": problem, "domain": domain}
    if kind == PLANNERS:
        _export_problems(scenes, out, facts, _scenes_in_memory(scenes, spec, mirrored), **of_problems)
        return
    for name, value in {"facts": facts, **of_problems}.items():
        if value:
            option = "--map" if name == "table" else flag(name)
            raise RequestError(OUT_OF_PLACE(option=option, rule="is for planning problems", remedy="add --to pddl"))
    found = _scenes_in_memory(scenes, spec, mirrored, whole=looks is not None)
    if found is None:
        count, files = convert(scenes, out, to, meshes)
    else:
        check_export(out, kind)
        count, files = len(found), found.export(out, to, meshes=meshes, looks=looks, seed=seed)
    _say_where(out, "scene", files, count)


def _scenes_in_memory(path: Path, spec: Path | None, mirrored: bool, whole: bool = False) -> SceneSet | None:
    """The scenes of a file in memory, where they are not as a file of scenes holds them, or `whole` says so."""
    from scenegen.api.reading import read_scenes
    from scenegen.api.spec import load
    from scenegen.scenes.formats.settled import is_settled

    if not (spec or mirrored or whole or is_settled(path)):
        return None
    found = read_scenes(path, spec=None if spec is None else load(spec))
    note(*found.warnings)
    return found.mirrored() if mirrored else found


def _export_problems(scenes: Path, out: Path, facts: str | None, read: SceneSet | None, **given: Any) -> None:
    """Write the scenes or pairs of a file as planning problems, and say where they are; `read` are its scenes, if they
    have been read, `given` the other arguments of `export_problems`."""
    from scenegen.planning import conversion
    from scenegen.worlds.exporting import PLANNERS, check_export

    check_export(out, PLANNERS)
    names = None if facts is None else [one.strip() for one in facts.split(",") if one.strip()]
    if given["domain"] is not None and given["problem"] is None:
        raise RequestError(OUT_OF_PLACE(option="--domain", rule="is that of a problem", remedy="add --problem"))
    found = conversion.read_for_planning(scenes) if read is None else read
    made = conversion.export_problems(found, out, facts=names, **given)
    complain(*made.warnings)
    domain = "" if made.domain is None else f", and {made.domain.name}"
    _say_where(out, "problem", made.problems, len(made.problems), domain)


def _say_where(out: Path, what: str, files: Sequence[Path], count: int, more: str = "") -> None:
    where = f"{out}" if files == (out,) else f"{out}: {files[0].name}" + (f" to {files[-1].name}" if count > 1 else "")
    print_error(f"{count} {what}{'s' * (count != 1)} in {where}{more}")
    if files != (out,):
        note_others(out, count, files[0].suffix)
