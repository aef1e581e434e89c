"""`scenegen check`: what a spec means, or what is wrong with it."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from itertools import groupby
from math import nan
from pathlib import Path
from textwrap import shorten, wrap
from typing import TYPE_CHECKING, Any

import typer

from scenegen.api.outline import FormulaTree, Line, Outline, OutlinePart
from scenegen.api.spec import Spec
from scenegen.cli.options import COUNT, ROOT, SPEC_FILES, display_name, option, parse_counts
from scenegen.cli.output import complain, detail, flag, print_json, tree
from scenegen.errors import ScenegenError, Source, to_json
from scenegen.errors.declarations import NOT_LOOKED_AT
from scenegen.lang.check.priors import prior_text
from scenegen.lang.check.supports import area_of
from scenegen.lang.formula.core import REQUIRE
from scenegen.lang.syntax import ast
from scenegen.lang.syntax.parse import parse
from scenegen.lang.syntax.printer import print_statement
from scenegen.looks.overlay import ring_of, share_of_area
from scenegen.search.effort import Effort
from scenegen.things import Circle, Shape

if TYPE_CHECKING:
    from scenegen.api.feasibility import UnsatisfiedLabel
    from scenegen.errors import Diagnostic
    from scenegen.lang.formula.timed import Horizon


OPEN_QUESTION = "rough: a quick look found no scene {}, nor a proof that there is none"
LOOK_SECONDS = 3.0  # CPU seconds after which `check` looks no further for what satisfies a spec's labels
MEANT = "change one of the parts that clash; where it is meant so, add --allow-unsatisfiable"


def check(
    specs: list[Path] = SPEC_FILES,
    depth: int | None = option("Show formulas to this depth, on as many lines as it takes.", "N", min=0),
    full: bool = option("Show every sub-formula on a line of its own."),
    allow_unsatisfiable: bool = option("No error where no scene satisfies a formula: a warning."),
    json: bool = option("Print one JSON document instead, for editors and scripts."),
    count: list[str] | None = COUNT,
    root: Path | None = ROOT,
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

    numbers = parse_counts(count)
    reports: list[dict[str, Any]] = []
    failed = False
    for position, path in enumerate(specs):
        started = time.process_time()
        try:
            spec = load(path, root).with_counts(numbers)
        except ScenegenError as error:
            failed = True
            if not json:
                complain(*error.diagnostics)
            reports.append(
                {"file": display_name(path), "ok": False, "diagnostics": [_as_json(one) for one in error.diagnostics]}
            )
            continue
        detail(f"parsed and checked {path}: {len(spec.definition.core.nodes):,} nodes")
        looking = _Looking(started + LOOK_SECONDS)
        found = doubts(spec.definition, looking.effort)
        detail("looked for what satisfies the labels")
        problems = [*spec.warnings, *_problems(found, allow_unsatisfiable), *idle(spec.definition, looking.effort)]
        if looking.ended:
            problems.append(NOT_LOOKED_AT(file=display_name(path), seconds=LOOK_SECONDS))
        ok = all(one.severity != "error" for one in problems)
        failed = failed or not ok
        if not json:
            if position:
                typer.echo("")
            _print(path, spec, found, ok, depth, full)
            complain(*problems)
        diagnostics = [_as_json(one) for one in problems]
        reports.append(
            {"file": display_name(path), "ok": ok, "diagnostics": diagnostics, **(_facts(spec) if json else {})}
        )
    if json:
        print_json(reports)
    return int(failed)


class _Looking:
    """The search for what satisfies the labels, which ends by this process's clock of CPU seconds."""

    def __init__(self, until: float) -> None:
        self.ended = False
        self.until = until
        self.effort = Effort(self._is_over)

    def _is_over(self) -> bool:
        self.ended = self.ended or time.process_time() > self.until
        return self.ended


def _problems(found: list[UnsatisfiedLabel], allowed: bool) -> list[Diagnostic]:
    """Proved findings are errors, unless they are allowed."""
    return [
        replace(one.problem.but(meant=MEANT), severity="error") if one.proved and not allowed else one.problem
        for one in found
        if one.problem is not None
    ]


def _print(path: Path, spec: Spec, found: list[UnsatisfiedLabel], ok: bool, depth: int | None, full: bool) -> None:
    import shutil
    import sys

    typer.echo(f"{display_name(path)}: {'ok' if ok else 'cannot be satisfied'}")
    rough = {
        one.label: OPEN_QUESTION.format("that meets it" if one.label == REQUIRE else "with phi >= 0")
        for one in found
        if one.problem is None
    }
    width = shutil.get_terminal_size().columns if sys.stdout.isatty() else PAGE_WIDTH
    if spec.horizon is not None:
        for line in timed_page(spec, spec.horizon, full=full or depth is not None, width=width):
            typer.echo(line)
        return
    for line in page(spec, rough, depth=depth, full=full, width=width):
        typer.echo(line)


def _facts(spec: Spec) -> dict[str, Any]:
    return {
        "objects": list(spec.objects),
        "shapes": {name: _shape(shape) for name, shape in zip(spec.objects, spec.definition.shapes, strict=True)},
        "workspace": {"x": list(spec.workspace.x), "y": list(spec.workspace.y)},
        "labels": {name: list(bounds) for name, bounds in spec.bounds().items()},
        "source": spec.source,
        **_time(spec),
        **({"usually": told} if (told := _priors(spec, None)) else {}),
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
    found = to_json(problem, flag)
    return {"title": found["message"], **found}


PAGE_LINES = 40  # of a page, at most
PAGE_WIDTH = 110  # columns of a page that goes to no terminal
NAME_LINES = 3  # lines of names
SHAPE_LINES = 8  # lines of shapes and sizes
HEAD_LINES = 3  # lines of a label: a blank one, its bounds, and its formula
MAX_FULL_LINES = 100_000  # lines of `--full`: a formula whose definitions use each other twice can have 2^50


@dataclass(slots=True)
class _ShownPart:
    """A part on the page: the parts shown below it, and how many are left out."""

    part: OutlinePart
    depth: int
    below: list[_ShownPart] = field(default_factory=list)
    hidden: int = 0


def page(spec: Spec, rough: Mapping[str, str], *, depth: int | None, full: bool, width: int) -> Iterator[str]:
    """The lines of text. `rough` has a remark for labels whose bounds are too loose; `depth` is how deep formulas are
    shown, with any number of lines; `full` folds and leaves out nothing."""
    everything = full or depth is not None
    head = list(_head(spec, None if full else width))
    yield from head
    outline = Outline(spec.definition.members[-1] if spec.counts else spec.checked)
    labels = outline.labels
    bounds = spec.bounds() if spec.counts else {}
    titles = {name: _title(outline, name, rough.get(name, ""), bounds.get(name)) for name in labels}
    left = MAX_FULL_LINES if everything else PAGE_LINES - len(head) - 2
    if left < HEAD_LINES * len(labels):  # no space for formulas
        left = max(left, HEAD_LINES)
        yield ""
        yield from (titles[name] for name in labels[: left - 1])
        if len(labels) > left - 1:
            yield f"  ... and {len(labels) - left + 1:,} labels more"
        yield "\n  Only a page of it: --depth 1 shows the formulas of all labels, --full everything."
        return
    folded = FormulaTree(outline, fold=not full)
    roots = [_ShownPart(folded.root(name), 0) for name in labels]
    whole = _unfold(folded, roots, left - HEAD_LINES * len(roots), depth)
    for name, root in zip(labels, roots, strict=True):
        yield ""
        yield titles[name]
        yield from tree(list(_lines(root)), width=None if full else width)
    if not whole and depth is None:
        yield "\n  Only a page of it: --depth N shows more, --full everything."


def timed_page(spec: Spec, horizon: Horizon, *, full: bool, width: int) -> Iterator[str]:
    """The lines of text for a spec over time: how long it lasts, and its formulas as they are written."""
    yield from _head(spec, None if full else width)
    step = f"{horizon.dt:g} s each, {horizon.seconds:g} s in all"
    yield f"  time       {horizon.steps:,} steps, {step}; moves {spec.moves}"
    module = parse(Source(spec.definition.name, spec.source))
    shown = [one for one in module.statements if isinstance(one, ast.Require | ast.Label)]
    bounds = spec.bounds()
    for statement in shown[: None if full else PAGE_LINES]:
        yield ""
        for line in print_statement(statement).splitlines():
            yield f"  {line}"
        if isinstance(statement, ast.Label):
            low, high = bounds[statement.name.id]
            yield f"    phi in [{low:.4g}, {high:.4g}]"
    if not full and len(shown) > PAGE_LINES:
        yield f"\n  ... and {len(shown) - PAGE_LINES:,} more: --full shows everything."


def _head(spec: Spec, width: int | None) -> Iterator[str]:
    checked, (x, y) = spec.definition, (spec.workspace.x, spec.workspace.y)
    if checked.title:
        yield f"  {checked.title}"
    yield f"  workspace  [{x[0]:g}, {x[1]:g}] x [{y[0]:g}, {y[1]:g}] m"
    held = [
        f"{name} at ({', '.join(f'{number:g}' for number in checked.fixed[index])})"
        for index, name in enumerate(spec.objects)
        if index in checked.fixed
    ]
    free = [name for index, name in enumerate(spec.objects) if index not in checked.fixed]
    if checked.counts:
        weighed = [(one, f" as {' : '.join(map(str, one.weights))}" if one.weights else "") for one in checked.counts]
        drawn = ", ".join(f"{one.words} {one.name}{often}" for one, often in weighed if not one.assets)
        kinds = "; ".join(f"{one.name} is {' or '.join(one.assets)}{often}" for one, often in weighed if one.assets)
        if drawn:
            yield f"  numbers    {drawn}: {len(checked.members)} specs; what follows is that of the most"
        if kinds:
            yield f"  assets     {kinds}: {len(checked.members)} specs; what follows is that of the last"
    regions = [one.name for one in checked.regions]
    yield from _name_lines("objects", free if width is None else arrays(free), width)
    for number, line in enumerate(_sizes(spec, width)):
        yield f"  {'' if number else 'sizes':<9}  {line}"
    for kind, names in (("fixed", held), ("regions", regions)):
        yield from _name_lines(kind, names, width)
    more = {"surfaces": _choices(spec), "robots": _robots(spec), "cameras": _cameras(spec)}
    more |= {"usually": _priors(spec, width)}
    for kind, lines in more.items():
        most = len(lines) if width is None or len(lines) <= SHAPE_LINES else SHAPE_LINES - 1
        rest = [] if most == len(lines) else [f"... and {len(lines) - most:,} more"]
        for number, line in enumerate([*lines[:most], *rest]):
            yield f"  {'' if number else kind:<9}  {line}"


def _choices(spec: Spec) -> list[str]:
    """What objects stand on that have a choice, and how often each is drawn."""
    names: dict[str, list[str]] = {}
    for which, choice in spec.definition.choices.items():
        upper = spec.definition.shapes[which].footprint
        sizes = [  # places of the switch, and on the surface
            (high - low) * area_of(upper, one)
            for low, high, one in zip((0.0, *choice.ends[:-1]), choice.ends, choice.options, strict=True)
        ]
        each = [
            f"{one.name} {100.0 * size / sum(sizes):.3g} %" for one, size in zip(choice.options, sizes, strict=True)
        ]
        names.setdefault(" or ".join(each), []).append(spec.objects[which])
    return [f"{', '.join(arrays(some))} on {places}" for places, some in names.items()]


def _robots(spec: Spec) -> list[str]:
    """What the hand of each robot reaches."""
    foot = spec.definition.heights or (0.0,) * len(spec.objects)
    found = []
    for name, shape, height in zip(spec.objects, spec.definition.shapes, foot, strict=True):
        if shape.arm is not None:
            ring = ring_of(shape.arm, height or 0.0)
            turn = (
                ""
                if ring.bearing is None
                else f", {' to '.join(f'{math.degrees(one):.0f}' for one in ring.bearing)} deg"
            )
            reach = f"{ring.nearest:.3g} to {ring.farthest:.3g} m{turn} at the table"
            found.append(f"{name}: {shape.arm.name} reaches {reach}, opens {shape.arm.hand.opening:g} m")
    return found


def _cameras(spec: Spec) -> list[str]:
    """Where cameras are, and how much of the workspace each pictures."""
    area = (spec.workspace.x[0], spec.workspace.y[0], spec.workspace.x[1], spec.workspace.y[1])
    found = []
    for one in spec.definition.cameras:
        shape = Fraction(one.aspect).limit_denominator(100)
        lens = f"{math.degrees(one.field):.3g} deg, {shape.numerator}:{shape.denominator}"
        place = ", ".join(f"{number:g}" for number in one.eye)
        found.append(
            f"{one.name} at ({place}), {lens}, pictures {100.0 * share_of_area(one, area):.0f} % of the workspace"
        )
    return found


def _priors(spec: Spec, width: int | None) -> list[str]:
    """What each `usually` statement says."""
    objects, found = spec.definition.core.objects, []
    for prior in spec.definition.priors:
        names = [objects[which] for which in prior.things]
        told = prior_text(prior, names if width is None else arrays(names), objects)
        found.append(told if width is None else shorten(told, max(20, width - 13), placeholder=" ..."))
    return found


def _name_lines(kind: str, names: Sequence[str], width: int | None) -> Iterator[str]:
    """A kind of things and their names."""
    if names:
        lines = [", ".join(names)] if width is None else _wrap_names(names, max(20, width - 13))
        for number, line in enumerate(lines):
            yield f"  {'' if number else kind:<9}  {line}"


def _sizes(spec: Spec, width: int | None) -> Iterator[str]:
    """A line for each shape: the objects that have it, what it is, and its size in metres."""
    names: dict[Shape, list[str]] = {}
    for name, shape in zip(spec.objects, spec.definition.shapes, strict=True):
        names.setdefault(shape, []).append(name)
    for number, (shape, objects) in enumerate(names.items()):
        if width is not None and number == SHAPE_LINES - 1 and len(names) > SHAPE_LINES:
            yield f"... and {len(names) - number:,} shapes more"
            return
        told = ": ".join((", ".join(objects if width is None else arrays(objects)), size_text(shape)))
        if width is not None and len(told) > width - 13:
            told = f"{objects[0]} and {len(objects) - 1:,} more: {size_text(shape)}"
        yield told


def size_text(shape: Shape) -> str:
    """What a shape is, and how large, in metres."""
    length, width = shape.footprint.extent
    of_file = f" {shape.path}" if shape.path else ""
    size = f"{length:.4g} x {width:.4g} x {shape.height:.4g} m"
    if isinstance(shape.footprint, Circle):
        size = f"radius {length / 2.0:.4g}, height {shape.height:.4g} m"
    color = f", {shape.color}" if shape.color else ""
    return f"{shape.asset}{of_file}, {size}{color}"


def _wrap_names(names: Sequence[str], width: int) -> list[str]:
    """Names on at most NAMES lines; the last line says how many are left out."""
    for count in range(min(len(names), NAME_LINES * width), 0, -1):
        rest = [] if count == len(names) else [f"... and {len(names) - count:,} more"]
        lines = wrap(", ".join([*names[:count], *rest]), width, break_on_hyphens=False)
        if len(lines) <= NAME_LINES:
            return lines
    return [f"{len(names):,} names"]


def arrays(names: Sequence[str]) -> list[str]:
    """Names with the elements of an array that follow each other as one: `block[1..30]`."""
    found: list[str] = []
    for array, group in groupby(names, key=lambda name: name.partition("[")[0] if name.endswith("]") else name):
        elements = list(group)
        if len(elements) < 3:
            found += elements
        else:
            first, last = (name.partition("[")[2].rstrip("]") for name in (elements[0], elements[-1]))
            found.append(f"{array}[{first}..{last}]")
    return found


def _title(outline: Outline, label: str, remark: str, bounds: tuple[float, float] | None) -> str:
    """`bounds` are those over all numbers of things, where these are drawn."""
    top = outline.line(outline.core.labels[label], margin=False)
    what = "margin" if label == REQUIRE else "phi"
    low, high = bounds or (top.low, top.high)
    return f"  {label}: {what} in [{low:.4g}, {high:.4g}]" + (f"; {remark}" if remark else "")


def _unfold(folded: FormulaTree, roots: list[_ShownPart], left: int, depth: int | None) -> bool:
    """Show what is below the roots, level by level, in `left` lines, down to a depth; returns whether that is all."""
    waiting = deque(roots)
    whole = True
    while waiting:
        one = waiting.popleft()
        parts = folded.children(one.part)
        if not parts:
            continue
        count = len(parts)
        if depth is not None and one.depth >= depth:
            count = 0
        elif count > left:
            # a formula that is too wide for the page shows its first parts; one further down none
            others = sum(other.depth == 0 for other in waiting)
            count = left // (others + 1) - 1 if one.depth == 0 else 0
        if count < len(parts):
            whole = False
            one.hidden = len(parts) - max(0, count)
        one.below = [_ShownPart(part, one.depth + 1) for part in parts[: max(0, count)]]
        left -= len(one.below) + (0 < count < len(parts))
        waiting.extend(one.below)
    return whole


def _lines(root: _ShownPart) -> Iterator[Line]:
    stack: list[_ShownPart | Line] = [root]
    while stack:
        one = stack.pop()
        if isinstance(one, Line):
            yield one
            continue
        line = one.part.line
        text = f"{one.part.count} x {line.text}" if one.part.count else line.text
        if one.hidden and not one.below:
            text += " ..."
        yield replace(line, depth=one.depth, text=text)
        if one.hidden and one.below:
            stack.append(Line(one.depth + 1, f"... and {one.hidden:,} more", "", "", nan, nan))
        stack.extend(reversed(one.below))
