"""`scenegen eval` of a spec over time: phi of trajectories, and what decides it, when."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from scenegen.errors.requests import OUT_OF_PLACE
from scenegen.errors.temporal import NO_SUCH_MOTION

if TYPE_CHECKING:
    from scenegen.api.spec import Spec
    from scenegen.lang.moments import Scored


@dataclass(frozen=True, slots=True)
class TrajectoryOptions:
    """Options of `scenegen eval` that are about trajectories."""

    resample: bool
    motion: int | None
    figure: Path | None

    @property
    def given(self) -> list[str]:
        """The names of those that are given."""
        values = {"--resample": self.resample, "--motion": self.motion is not None, "--figure": self.figure is not None}
        return [name for name, value in values.items() if value]


def evaluate_trajectories(spec: Spec, path: Path, options: TrajectoryOptions, *, json: bool) -> int:
    """Print phi of every motion and label, with the atom and the moment that decide it; the status of the program."""
    from scenegen.api.trajectory import read_trajectories, score_trajectory
    from scenegen.cli.output import note
    from scenegen.errors import RequestError

    if options.figure is not None:
        _check_figure(options.figure, path)
    motions, notes = read_trajectories(spec, path, resample=options.resample)
    if options.motion is not None:
        if options.motion not in motions:
            numbers = [number for number in motions if number is not None]
            ends = {"first": min(numbers), "last": max(numbers)} if numbers else {}
            raise RequestError(NO_SUCH_MOTION(number=options.motion, file=path, **ends))
        motions = {options.motion: motions[options.motion]}
    if options.figure is not None and len(motions) > 1:
        rule = f"draws one motion, and {path} has {len(motions):,}"
        raise RequestError(OUT_OF_PLACE(option="--figure", rule=rule, remedy="choose one with --motion"))
    assert spec.horizon is not None
    scored = {number: score_trajectory(spec, poses) for number, poses in motions.items()}
    tables = {number: _rows(one, spec.horizon.dt) for number, one in scored.items()}
    if json:
        from json import dumps

        found: dict[str, Any] = {"labels": list(spec.labels)}
        each = [{"phi": rows, "over_time": _over_time(scored[number])} for number, rows in tables.items()]
        if None in tables:
            found |= each[0]
        else:
            found["motions"] = [{"motion": number, **one} for number, one in zip(tables, each, strict=True)]
        typer.echo(dumps(found, indent=1))
    else:
        _table(tables)
    for one in notes:
        note(one)
    if options.figure is not None:
        _draw(options.figure, next(iter(scored.values())), spec)
    return 0


def _rows(scored: Scored, dt: float) -> dict[str, dict[str, Any]]:
    from scenegen.lang.core import REQUIRE

    phi: dict[str | None, float] = dict(scored.phi.items())
    if scored.required is not None:
        phi[None] = float(scored.required.min())
    rows: dict[str, dict[str, Any]] = {}
    for label, value in phi.items():
        atom, moment = scored.decides(label)
        name = REQUIRE if label is None else label
        rows[name] = {"phi": value, "decided_by": atom.text, "moment": moment, "t": moment * dt}
    return rows


def _over_time(scored: Scored) -> dict[str, list[float | None]]:
    from scenegen.lang.core import REQUIRE

    found = dict(scored.signals)
    if scored.required is not None:
        found[REQUIRE] = scored.required
    return {name: [_finite(one) for one in values.tolist()] for name, values in found.items()}


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _check_figure(figure: Path, path: Path) -> None:
    from scenegen.errors import RequestError
    from scenegen.errors.files import WRONG_ENDING
    from scenegen.formats.files import check_writable

    if figure.suffix.lower() != ".png":
        raise RequestError(WRONG_ENDING(path=figure, ending=".png", remedy="name a file such as phi.png"))
    check_writable(figure, path)


def _draw(figure: Path, scored: Scored, spec: Spec) -> None:
    from scenegen.cli.output import print_error
    from scenegen.figures.over_time import over_time
    from scenegen.formats.files import write_whole

    assert spec.horizon is not None
    times = [moment * spec.horizon.dt for moment in range(spec.horizon.moments)]
    write_whole(figure, over_time(times, {name: row.tolist() for name, row in scored.signals.items()}))
    print_error(f"phi over time in {figure}")


def _table(tables: Mapping[int | None, dict[str, dict[str, Any]]]) -> None:
    import sys

    several = None not in tables
    head = (*(("motion",) if several else ()), "label", "phi", "decided by", "moment", "t")
    lines = [(number, name, row) for number, rows in tables.items() for name, row in rows.items()]
    if not sys.stdout.isatty():
        typer.echo("\t".join(head))
        for number, name, row in lines:
            typer.echo("\t".join(map(str, (*((number,) if several else ()), name, *row.values()))))
        return
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(*head, box=None)
    for number, name, row in lines:
        cells = (name, f"{row['phi']:+.6f}", row["decided_by"], str(row["moment"]), f"{row['t']:g} s")
        table.add_row(*map(Text, (*((str(number),) if several else ()), *cells)))
    Console().print(table)
