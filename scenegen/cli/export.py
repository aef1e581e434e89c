"""`scenegen export`: scenes for simulators, and in other formats of scene files."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def export(
    scenes: Annotated[Path, typer.Argument(help="A scenes file.", metavar="SCENES", show_default=False)],
    out: Annotated[
        Path, typer.Option("--out", help="A folder, or a file by its ending.", metavar="DIR|FILE", show_default=False)
    ],
    to: Annotated[
        str | None,
        typer.Option(
            "--to", help="mjcf, sdf, json, jsonl or parquet; default: by the ending of --out.", show_default=False
        ),
    ] = None,
) -> None:
    """Write scenes for MuJoCo (mjcf) and Gazebo (sdf), or in another format of scene files (json, jsonl, parquet).

    \b
      scenegen export scenes.json --to mjcf --out worlds
      scenegen export scenes.json --to sdf --out worlds
      scenegen export scenes.json --out all.xml
      scenegen export scenes.json --out scenes.parquet

    A folder gets a file for each scene, in scene order: scene_0001.xml (mjcf), scene_0001.sdf. A file holds all of
    them: as keyframes of one model (.xml), or as worlds (.sdf, .world). Objects stand on a table whose top is z = 0, or
    on what carries them, with mass, friction and convex pieces to collide with; what the spec holds in place cannot be
    moved. Meshes lie beside the files, as OBJ.
    """
    from scenegen.api.export import convert
    from scenegen.cli.output import note_others, print_error

    count, files = convert(scenes, out, to)
    where = f"{out}" if files == (out,) else f"{out}: {files[0].name}" + (f" to {files[-1].name}" if count > 1 else "")
    print_error(f"{count} scene{'s' * (count != 1)} in {where}")
    if files != (out,):
        note_others(out, count, files[0].suffix)
