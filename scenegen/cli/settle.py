"""`scenegen settle`: what physics makes of scenes."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated

import typer

from scenegen.errors.requests import WRONG_VALUE

LENGTHS, ANGLES = ("a length with its unit, such as 2mm", "an angle with its unit, such as 2deg")


def settle(
    scenes: Annotated[Path, typer.Argument(help="A scenes file.", metavar="SCENES", show_default=False)],
    out: Annotated[
        Path,
        typer.Option("--out", help="A .json, .jsonl or .parquet file of results.", metavar="FILE", show_default=False),
    ],
    simulator: Annotated[
        str, typer.Option("--in", help="mujoco or pybullet.", metavar="SIMULATOR", show_default=True)
    ] = "mujoco",
    seconds: Annotated[float, typer.Option("--seconds", help="Simulated seconds.")] = 2.0,
    max_shift: Annotated[
        str, typer.Option("--max-shift", help="How far an object may move.", metavar="LENGTH")
    ] = "2mm",
    max_turn: Annotated[
        str, typer.Option("--max-turn", help="By how much an object may turn, about any axis.", metavar="ANGLE")
    ] = "2deg",
    workers: Annotated[
        int | None, typer.Option("--workers", help="Processes; default: one per core.", show_default=False)
    ] = None,
) -> None:
    """Let scenes come to rest in a simulator, and write down where their objects are then.

    \b
      scenegen settle scenes.json --out settled.json
      scenegen settle scenes.parquet --in pybullet --out settled.parquet
      scenegen settle scenes.json --max-shift 5mm --max-turn 1deg --out s.jsonl

    The file has for each scene the place and the quaternion of every object, how far it moved (mm) and turned (degrees)
    against the plan, phi of every label at the settled poses, and which objects touched before the simulation, and how
    deep. A scene in which an object moved or turned too far is marked and counted, not left out: the exit status is 0.

    Objects are those of `scenegen export`: convex pieces, mass and friction, on an infinite table. What the spec holds
    in place cannot move. The file appears whole or not at all, and does not depend on --workers.
    """
    from scenegen.api.settle import settle_file
    from scenegen.cli.output import print_error, progress_bar

    limits = _quantity("max_shift", max_shift, LENGTHS), _quantity("max_turn", max_turn, ANGLES)
    with progress_bar() as bar:
        task = bar.add_task("settling", total=None)
        summary = settle_file(
            scenes, out, simulator, seconds=seconds, max_shift=limits[0], max_turn=limits[1], workers=workers,
            progress=lambda done, total: bar.update(task, completed=done, total=total),
        )  # fmt: skip
    print_error(summary.first_line)
    print_error(f"{summary.last_line} in {out}")


def _quantity(name: str, text: str, wanted: str) -> float:
    """A length in metres or an angle in degrees, above 0. Raises RequestError."""
    from scenegen.errors import RequestError
    from scenegen.primitives.units import ANGLE, LENGTH, quantity

    known = re.fullmatch(r"\s*([0-9]+(?:\.[0-9]*)?|\.[0-9]+)\s*(mm|cm|m|deg|rad|turn)\s*", text)
    value, unit = quantity(*known.groups()) if known is not None else (0.0, None)
    if unit != (ANGLE if wanted is ANGLES else LENGTH) or not value > 0.0:
        raise RequestError(WRONG_VALUE(argument=name, value=f"`{text}`", wanted=wanted))
    from math import degrees

    return degrees(value) if wanted is ANGLES else value
