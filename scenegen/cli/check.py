"""`scenegen check`: what a spec means, or what is wrong with it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from scenegen.cli.options import Counts, Root, SpecFiles, named, parse_counts

if TYPE_CHECKING:
    from scenegen.api.feasibility import Doubt
    from scenegen.api.spec import Spec
    from scenegen.assets import Shape
    from scenegen.errors import Diagnostic

OPEN = "rough: a quick look found no scene {}, nor a proof that there is none"
MEANT = "change one of the parts that clash; where it is meant so, add --allow-unsatisfiable"


def check(
    specs: SpecFiles,
    depth: Annotated[
        int | None,
        typer.Option("--depth", help="Show formulas to this depth, on as many lines as it takes.", metavar="N", min=0),
    ] = None,
    full: Annotated[bool, typer.Option("--full", help="Show every sub-formula on a line of its own.")] = False,
    allow_unsatisfiable: Annotated[
        bool,
        typer.Option("--allow-unsatisfiable", help="No error where no scene satisfies a formula: a warning."),
    ] = False,
    json: Annotated[
        bool, typer.Option("--json", help="Print one JSON document instead, for editors and scripts.")
    ] = False,
    count: Counts = None,
    root: Root = None,
) -> int:
    """Check specs: print the formula of each label, the objects, and what phi can be.

    \b
      scenegen check table_setting
      scenegen check specs/*.spec
      scenegen check my.spec --full
      scenegen check my.spec --json

    Each line below a label is a sub-formula: its margin, the unit of phi, and bounds of phi. phi never leaves them, but
    they may be loose: `scenegen range` measures what is reached. Sub-formulas that differ only in objects and numbers
    share a line, as in `45 x gap(item\\[i], item\\[j]) >= 0`, and what does not fit on a page is left out.

    A spec with mistakes gets one message per mistake, with the place and what to do; the exit status is then 1. The
    same goes for a label that no scene satisfies and a requirement that none meets, where bounds prove it.
    """
    from scenegen.api.feasibility import doubts, idle
    from scenegen.api.spec import load
    from scenegen.cli.output import complain, detail
    from scenegen.errors import ScenegenError

    numbers = parse_counts(count)
    reports: list[dict[str, Any]] = []
    failed = False
    for position, path in enumerate(specs):
        try:
            spec = load(path, root).with_counts(numbers)
        except ScenegenError as error:
            failed = True
            if not json:
                complain(*error.diagnostics)
            reports.append(
                {"file": named(path), "ok": False, "diagnostics": [_as_json(one) for one in error.diagnostics]}
            )
            continue
        detail(f"parsed and checked {path}: {len(spec.declared.core.nodes):,} nodes")
        found = doubts(spec.declared)
        detail("looked for what satisfies the labels")
        problems = [*spec.warnings, *_problems(found, allow_unsatisfiable), *idle(spec.declared)]
        ok = all(one.severity != "error" for one in problems)
        failed = failed or not ok
        if not json:
            if position:
                typer.echo("")
            _print(path, spec, found, ok, depth, full)
            complain(*problems)
        diagnostics = [_as_json(one) for one in problems]
        reports.append({"file": named(path), "ok": ok, "diagnostics": diagnostics, **_facts(spec)})
    if json:
        from json import dumps

        typer.echo(dumps(reports, indent=1, ensure_ascii=False))
    return int(failed)


def _problems(found: list[Doubt], allowed: bool) -> list[Diagnostic]:
    """Proved findings are errors, unless they are allowed."""
    return [
        replace(one.problem.but(meant=MEANT), severity="error") if one.proved and not allowed else one.problem
        for one in found
        if one.problem is not None
    ]


def _print(path: Path, spec: Spec, found: list[Doubt], ok: bool, depth: int | None, full: bool) -> None:
    import shutil
    import sys

    from scenegen.cli.page import WIDTH, page, timed_page
    from scenegen.lang.core import REQUIRE

    typer.echo(f"{named(path)}: {'ok' if ok else 'cannot be satisfied'}")
    rough = {
        one.label: OPEN.format("that meets it" if one.label == REQUIRE else "with phi >= 0")
        for one in found
        if one.problem is None
    }
    width = shutil.get_terminal_size().columns if sys.stdout.isatty() else WIDTH
    if spec.horizon is not None:
        for line in timed_page(spec, spec.horizon, full=full or depth is not None, width=width):
            typer.echo(line)
        return
    for line in page(spec, rough, depth=depth, full=full, width=width):
        typer.echo(line)


def _facts(spec: Spec) -> dict[str, Any]:
    return {
        "objects": list(spec.objects),
        "shapes": {name: _shape(shape) for name, shape in zip(spec.objects, spec.declared.shapes, strict=True)},
        "workspace": {"x": list(spec.workspace.x), "y": list(spec.workspace.y)},
        "labels": {name: list(bounds) for name, bounds in spec.bounds().items()},
        "source": spec.source,
        **_time(spec),
        **({"counts": {name: list(ends) for name, ends in spec.counts.items()}} if spec.counts else {}),
    }


def _shape(shape: Shape) -> dict[str, Any]:
    """What an object looks like, and how large it is: length along the heading, width across it, height; metres."""
    length, width = shape.footprint.extent
    kind = type(shape.footprint).__name__.lower()
    more = {name: text for name, text in (("path", shape.path), ("color", shape.color)) if text}
    return {"asset": shape.asset, **more, "footprint": kind, "length": length, "width": width, "height": shape.height}


def _time(spec: Spec) -> dict[str, Any]:
    if spec.horizon is None:
        return {}
    return {"time": {"steps": spec.horizon.steps, "dt": spec.horizon.dt, "moves": spec.moves}}


def _as_json(problem: Diagnostic) -> dict[str, Any]:
    """A diagnostic as data; `title` is what `message` was called at first."""
    from scenegen.cli.output import flag
    from scenegen.errors import to_json

    found = to_json(problem, flag)
    return {"title": found["message"], **found}
