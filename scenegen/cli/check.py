"""`scenegen check`: what a spec means, or what is wrong with it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from scenegen.cli.options import Root

if TYPE_CHECKING:
    from scenegen.api.spec import Spec
    from scenegen.errors import Diagnostic


def check(
    specs: Annotated[list[Path], typer.Argument(help="Spec files.", metavar="SPEC", show_default=False)],
    json: Annotated[
        bool, typer.Option("--json", help="Print one JSON document instead, for editors and scripts.")
    ] = False,
    root: Root = None,
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
            spec = load(path, root)
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
        warnings = [*spec.checked.warnings, *spec.hopeless()]
        if not json:
            complain(*warnings)
        found = [_as_json(one) for one in warnings]
        reports.append({"file": str(path), "ok": True, "diagnostics": found, **_facts(spec)})
    if json:
        from json import dumps

        typer.echo(dumps(reports, indent=1, ensure_ascii=False))
    return int(failed)


def _print(path: Path, spec: Spec) -> None:
    from scenegen.api.outline import Outline
    from scenegen.cli.tree import tree
    from scenegen.lang.core import REQUIRE

    x, y = spec.workspace.x, spec.workspace.y
    checked = spec.checked
    typer.echo(f"{path}: ok")
    if checked.title:
        typer.echo(f"  {checked.title}")
    typer.echo(f"  workspace  [{x[0]:g}, {x[1]:g}] x [{y[0]:g}, {y[1]:g}] m")
    held = [
        f"{name} at ({', '.join(f'{number:g}' for number in checked.fixed[index])})"
        for index, name in enumerate(spec.objects)
        if index in checked.fixed
    ]
    free = [name for index, name in enumerate(spec.objects) if index not in checked.fixed]
    for kind, names in (("objects", free), ("fixed", held), ("regions", [one.name for one in checked.regions])):
        if names:
            typer.echo(f"  {kind:<9}  {', '.join(names)}")
    outline = Outline(spec)
    for label in outline.labels:
        lines, more = outline.lines(label)
        top = lines[0]
        typer.echo(f"\n  {label}: {'margin' if label == REQUIRE else 'phi'} in [{top.low:.4g}, {top.high:.4g}]")
        typer.echo("\n".join(tree(lines, more)))


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
