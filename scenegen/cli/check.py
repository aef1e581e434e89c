"""`scenegen check`: what a spec means, or what is wrong with it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from scenegen.api.spec import Spec
    from scenegen.errors import Diagnostic


def check(
    specs: Annotated[list[Path], typer.Argument(help="Spec files.", metavar="SPEC", show_default=False)],
    json: Annotated[
        bool, typer.Option("--json", help="Print one JSON document instead, for editors and scripts.")
    ] = False,
) -> int:
    """Check specs: print the formula of each label, the objects, and what phi can be.

    \b
      scenegen check specs/table_setting.spec
      scenegen check specs/*.spec
      scenegen check my.spec --json

    Each line below a label is a sub-formula: its margin, the unit of phi, and bounds of phi anywhere in the workspace.
    A spec with mistakes gets one message per mistake, with the place and what to do; the exit status is then 1.
    """
    from scenegen.api.spec import load
    from scenegen.cli.output import complain
    from scenegen.errors import ScenegenError

    reports: list[dict[str, Any]] = []
    failed = False
    for position, path in enumerate(specs):
        try:
            spec = load(path)
        except ScenegenError as error:
            failed = True
            if not json:
                complain(*error.diagnostics)
            reports.append(
                {"file": str(path), "ok": False, "diagnostics": [_as_json(one) for one in error.diagnostics]}
            )
            continue
        if not json:
            if position:
                typer.echo("")
            _print(path, spec)
        warnings = list(_hopeless(path, spec))
        if not json:
            complain(*warnings)
        found = [_as_json(one) for one in warnings]
        reports.append({"file": str(path), "ok": True, "diagnostics": found, **_facts(spec)})
    if json:
        from json import dumps

        typer.echo(dumps(reports, indent=1, ensure_ascii=False))
    return int(failed)


def _print(path: Path, spec: Spec) -> None:
    from scenegen.api.outline import outline

    x, y = spec.workspace.x, spec.workspace.y
    typer.echo(f"{path}: ok")
    if spec.checked.title:
        typer.echo(f"  {spec.checked.title}")
    typer.echo(f"  workspace  [{x[0]:g}, {x[1]:g}] x [{y[0]:g}, {y[1]:g}] m")
    typer.echo(f"  objects    {', '.join(spec.objects)}")
    for label in spec.labels:
        lines, more = outline(spec, label)
        top = lines[0]
        typer.echo(f"\n  {label}: phi in [{top.low:.4g}, {top.high:.4g}]")
        texts = [f"{'  ' * line.depth}{line.text}" for line in lines]
        margins = [line.margin for line in lines]
        wide, wider = (min(60, max(map(len, column))) for column in (texts, margins))
        for line, text in zip(lines, texts, strict=True):
            unit = f" {line.unit}" if line.unit else ""
            typer.echo(f"    {text:<{wide}}  {line.margin:<{wider}}  [{line.low:.4g}, {line.high:.4g}]{unit}".rstrip())
        if more:
            typer.echo(f"    ... and {more} more")


def _hopeless(path: Path, spec: Spec) -> Iterator[Diagnostic]:
    """A warning for each label that no scene can satisfy, as far as interval bounds can tell."""
    from scenegen.errors import Diagnostic

    for label, (_, highest) in spec.bounds().items():
        if highest < 0.0:
            title = f"{path}: `{label}` can never be satisfied: phi is at most {highest:.4g}"
            yield Diagnostic(title, help="look for a part of it whose bounds are negative", severity="warning")


def _facts(spec: Spec) -> dict[str, Any]:
    return {
        "objects": list(spec.objects),
        "workspace": {"x": list(spec.workspace.x), "y": list(spec.workspace.y)},
        "labels": {name: list(bounds) for name, bounds in spec.bounds().items()},
        "source": spec.source,
    }


def _as_json(problem: Diagnostic) -> dict[str, Any]:
    """A diagnostic as data; `title` is what `message` was called at first."""
    from scenegen.errors import to_json

    return {"title": problem.title, **to_json(problem)}
