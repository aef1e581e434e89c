"""`scenegen eval` of a spec over time: phi of a trajectory, and what decides it, when."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

if TYPE_CHECKING:
    from scenegen.api.spec import Spec


def evaluate_trajectory(spec: Spec, path: Path, *, resample: bool, json: bool) -> int:
    """Print phi of every label, with the atom and the moment that decide it; the status of the program."""
    from scenegen.api.trajectory import read_trajectory, score_trajectory
    from scenegen.cli.output import note
    from scenegen.lang.core import REQUIRE

    poses, notes = read_trajectory(spec, path, resample=resample)
    scored = score_trajectory(spec, poses)
    assert spec.horizon is not None
    dt = spec.horizon.dt
    phi: dict[str | None, float] = dict(scored.phi.items())
    required = scored.required
    if required is not None:
        phi[None] = float(required.min())
    rows: dict[str, dict[str, Any]] = {}
    for label, value in phi.items():
        atom, moment = scored.decides(label)
        name = REQUIRE if label is None else label
        rows[name] = {"phi": value, "decided_by": atom.text, "moment": moment, "t": moment * dt}
    if json:
        from json import dumps

        over_time = {name: [_finite(one) for one in values.tolist()] for name, values in scored.signals.items()}
        if required is not None:
            over_time[REQUIRE] = [_finite(one) for one in required.tolist()]
        typer.echo(dumps({"labels": list(spec.labels), "phi": rows, "over_time": over_time}, indent=1))
    else:
        _table(rows)
    for one in notes:
        note(one)
    return 0


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _table(rows: dict[str, dict[str, Any]]) -> None:
    import sys

    head = ("label", "phi", "decided by", "moment", "t")
    if not sys.stdout.isatty():
        typer.echo("\t".join(head))
        for name, row in rows.items():
            typer.echo("\t".join(map(str, (name, *row.values()))))
        return
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(*head, box=None)
    for name, row in rows.items():
        cells = (name, f"{row['phi']:+.6f}", row["decided_by"], str(row["moment"]), f"{row['t']:g} s")
        table.add_row(*map(Text, cells))
    Console().print(table)
