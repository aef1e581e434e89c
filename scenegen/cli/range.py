"""`scenegen range`: what phi can be reached, and how rare it is."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from scenegen.cli.options import COUNT, JSON, ROOT, SPEC_FILE, display_name, option, parse_counts, seconds
from scenegen.cli.output import complain, detail, print_error, print_json, time_left, use_color

if TYPE_CHECKING:
    from scenegen.api.rarity import Band, LabelRarity, RarityLevel, SpecRarity
    from scenegen.sampling.report import Estimate


NEARLY_ALL = 0.005  # share of scenes that are not there, at most, for digits to say less than words
TOO_RARE = "too rare to tell"
PLOT_FLOOR = -1  # the axis of a plot extends at least down to this log10


def range_(
    spec: Path = SPEC_FILE,
    label: str | None = option("This label alone.", "NAME"),
    seed: int = option("The same seed gives the same numbers.", default=0),
    png: Path | None = option("Draw the curves into this file, too.", "FILE"),
    json: bool = JSON,
    timeout: float | None = option(
        "Seconds after which to end with what is known; default: none.", "SECONDS", parser=seconds
    ),
    count: list[str] | None = COUNT,
    root: Path | None = ROOT,
) -> None:
    """Say what phi can be reached and how rare it is, before you ask for scenes.

    \b
      scenegen range table_setting
      scenegen range my.spec --label safe --png rarity.png
      scenegen range my.spec --json

    Of every label: the bounds that no scene exceeds, what a search reached, and for a dozen values of phi how many
    scenes lie at or above it and at or below it, as log10 of their share with half of its 95 % interval; then the
    commands that ask for a hard, a medium and an easy part. Shares are those among scenes that meet what the spec
    requires.
    """
    from scenegen.api.rarity import rarity
    from scenegen.api.spec import load
    from scenegen.scenes.files import check_writable, write_whole
    from scenegen.scenes.formats.registry import check_ending

    checked = load(spec, root).with_counts(parse_counts(count))
    detail(f"parsed and checked {spec}")
    if png is not None:
        check_ending(png, ".png")
        check_writable(png)
    found = rarity(checked, label, seed=seed, timeout=None if timeout is None else time_left(timeout))
    detail(f"measured {len(found.labels)} labels in {found.evaluations:,} evaluations")
    if json:
        print_json(as_json(display_name(spec), found))
    else:
        what = "scene" if checked.over_time is None else "motion"
        _print(spec, found, what, count or [], checked.definition.declares_heights)
    complain(*found.warnings)
    if png is not None:
        from scenegen.pictures.figures.charts import RarityPanel, plot

        panels = [
            RarityPanel(one.label, one.bounds, _points(one.curve, "above"), _points(one.curve, "below"))
            for one in found.labels
        ]
        write_whole(png, plot(panels, spec.name))
        print_error(f"curves in {png}")


def _print(spec: Path, found: SpecRarity, what: str, counts: list[str], stands: bool) -> None:
    title = f"{display_name(spec)}: rarity of phi from {found.evaluations:,} evaluations, seed {found.seed}"
    typer.echo(title)
    if found.requirement is not None:
        many, exactly = one_in(found.requirement.log10, what), _estimate(found.requirement)
        if stands:
            typer.echo("  a thing that stands on something is counted as if its centre were anywhere in the workspace:")
        typer.echo(f"  what the spec requires is met by {many} (log10 P = {exactly}); what follows is about these")
    for one in found.labels:
        typer.echo("")
        for line in _lines(spec, one, what, counts):
            typer.echo(line)


def _lines(spec: Path, one: LabelRarity, what: str, counts: list[str]) -> list[str]:
    import shlex

    (low, high), (least, most) = one.bounds, one.reached
    lines = [f"{one.label}: phi in [{low:.4g}, {high:.4g}]; reached {least:.5g} .. {most:.5g}"]
    at_zero = next((level for level in one.levels if level.phi == 0.0), None)
    if most < 0.0:
        lines.append(f"  no {what} that satisfies it was found")
    elif least >= 0.0:
        lines.append(f"  every {what} that was looked at satisfies it")
    elif at_zero is not None:
        share = (
            f"so few {what}s that their share cannot be told"
            if at_zero.above is None
            else one_in(at_zero.above.log10, what)
        )
        lines.append(f"  satisfied (phi >= 0) by {share}")
    lines += ["", f"  {'phi':>9}  {'log10 P(<= phi)':>20}  {'log10 P(>= phi)':>20}"]
    lines += [
        f"  {level.phi:>9.4g}  {_estimate(level.below):>20}  {_estimate(level.above):>20}" for level in one.levels
    ]
    if not all(one.whole):
        where = " and ".join(end for end, whole in zip(("lower", "upper"), one.whole, strict=True) if not whole)
        lines.append(f"  the search towards the {where} end was cut off: phi may reach further")
    lines += ["", *_plot(one)] if one.curve else []
    if one.bands:
        lines += ["", "  ask for"]
        for band in one.bands:
            share = TOO_RARE if band.log10 is None else one_in(band.log10, what)
            command = f"scenegen sample {shlex.quote(display_name(spec))} --phi {_option(one, band)}"
            command += "".join(f" --count {shlex.quote(text)}" for text in counts)
            lines.append(f"    {band.name:<10} {share:<22} {command}")
    return lines


def _plot(one: LabelRarity) -> list[str]:
    """Both curves, as wide as the terminal."""
    import shutil
    import sys

    fancy = sys.stdout.isatty() and (sys.stdout.encoding or "").lower().startswith("utf")
    above, below = _points(one.curve, "above"), _points(one.curve, "below")
    floor = float(min(PLOT_FLOOR, *(math.floor(y) for _, y in above + below)))
    columns = shutil.get_terminal_size().columns - 3
    color = fancy and use_color()
    drawn = curves([below, above], "<>", ends=one.reached, floor=floor, columns=columns, fancy=fancy, color=color)
    head = (
        "log10 P: of (>= phi) it falls to the right, of (<= phi) to the left"
        if fancy
        else "log10 P, drawn > where it is of (>= phi) and < where it is of (<= phi)"
    )
    return [f"  {line}" for line in (head, *drawn)]


def _points(curve: tuple[RarityLevel, ...], side: str) -> list[tuple[float, float]]:
    found = [(level.phi, level.above if side == "above" else level.below) for level in curve]
    return [(phi, estimate.log10) for phi, estimate in found if estimate is not None]


def one_in(log10: float, what: str = "scene") -> str:
    """A share for people: `1 scene in 102,000`, `37 % of scenes`."""
    if log10 > -0.95:
        share = 10.0**log10
        return f"nearly every {what}" if share > 0.995 else f"{share:.0%} of {what}s".replace("%", " %")
    many = 10.0**-log10
    if log10 < -9.0:
        return f"1 {what} in 10^{-log10:.0f}"
    digits = max(0, int(-log10) - 1)
    return f"1 {what} in {round(many, -digits):,.0f}"


def _estimate(estimate: Estimate | None) -> str:
    if estimate is None:
        return TOO_RARE
    missing = 1.0 - 10.0 ** (estimate.log10 - estimate.error)  # at most, at 95 %
    if missing < NEARLY_ALL:
        if missing <= 0.0:
            return "all"
        size = 10.0 ** math.floor(-math.log10(missing))
        return f"all but < 1 in {size * math.floor(1.0 / missing / size):,.0f}"
    digits = 3 if estimate.error < 0.01 else 2
    return f"{estimate.log10 + 0.0:.{digits}f} +- {estimate.error:.{digits}f}"


def as_json(name: str, found: SpecRarity) -> dict[str, Any]:
    """The findings as plain data."""
    return {
        "file": name,
        "seed": found.seed,
        "evaluations": found.evaluations,
        "requirement": _pair(found.requirement),
        "labels": {one.label: _label(one) for one in found.labels},
        "warnings": [warning.title for warning in found.warnings],
    }


def _label(one: LabelRarity) -> dict[str, Any]:
    return {
        "bounds": list(one.bounds),
        "reached": list(one.reached),
        "whole": list(one.whole),
        "levels": [_level(level) for level in one.levels],
        "curve": [_level(level) for level in one.curve],
        "bands": [
            {"name": band.name, "phi": [band.low, band.high], "log10": band.log10, "phi_option": _option(one, band)}
            for band in one.bands
        ],
    }


def _option(one: LabelRarity, band: Band) -> str:
    return f"{one.label}={band.low:g}:{band.high:g}"


def _level(level: RarityLevel) -> dict[str, Any]:
    return {"phi": level.phi, "above": _pair(level.above), "below": _pair(level.below)}


def _pair(estimate: Estimate | None) -> dict[str, float] | None:
    return None if estimate is None else {"log10": estimate.log10, "error": estimate.error}


Point = tuple[float, float]

ROWS = 9  # lines of text of a plot
WIDEST, NARROWEST = 100, 40  # columns
_DOTS = ((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80))  # of a braille character, by row and column (Unicode)
_COLORS = ("\x1b[36m", "\x1b[33m")


def curves(
    lines: Sequence[Sequence[Point]], marks: str, *, ends: Point, floor: float, columns: int, fancy: bool, color: bool
) -> list[str]:
    """A plot of up to two lines of points (x, y): x over `ends`, y from `floor` up to 0, as lines of text no wider than
    `columns`. A plain plot shows each line by its character of `marks`; where they meet, the later one wins."""
    gutter = len(f"{floor / 2.0:g}") + 2
    width = max(NARROWEST, min(columns, WIDEST)) - gutter - 1
    across, down = (2, 4) if fancy else (1, 1)
    grid = [[0] * width for _ in range(ROWS)]
    owner = [[-1] * width for _ in range(ROWS)]
    for number, line in enumerate(lines):
        for x, y in _trace(line, ends, floor, width * across, ROWS * down):
            row, column = y // down, x // across
            grid[row][column] |= _DOTS[y % down][x % across] if fancy else 1
            owner[row][column] = number
    text = []
    for row in range(ROWS):
        tick = f"{floor * row / (ROWS - 1) + 0.0:g}" if row % 4 == 0 else ""
        cells = []
        for dots, mine in zip(grid[row], owner[row], strict=True):
            char = " " if not dots else chr(0x2800 + dots) if fancy else marks[mine]
            cells.append(f"{_COLORS[mine]}{char}\x1b[0m" if color and dots else char)
        bar = "\u2502" if fancy else "|"
        text.append(f"{tick:>{gutter - 1}} {bar}{''.join(cells)}".rstrip())
    text.append(" " * gutter + ("\u2514" + "\u2500" * width if fancy else "+" + "-" * width))
    text.append(" " * (gutter + 1) + _axis(ends, width))
    return text


def _trace(line: Sequence[Point], ends: Point, floor: float, width: int, height: int) -> list[tuple[int, int]]:
    """The dots of a line, one or more for every column that it crosses; x from the left, y from the top."""
    dots: list[tuple[int, int]] = []
    places = [
        ((x - ends[0]) / (ends[1] - ends[0]) * (width - 1), min(y / floor, 1.0) * (height - 1))
        for x, y in line
        if y >= floor
    ]
    for (x0, y0), (x1, y1) in pairwise(places):
        steps = max(1, math.ceil(max(abs(x1 - x0), abs(y1 - y0))))
        for step in range(steps + 1):
            share = step / steps
            dots.append((round(x0 + share * (x1 - x0)), round(y0 + share * (y1 - y0))))
    return dots


def _axis(ends: Point, width: int) -> str:
    """The numbers below the axis: both ends, and 0 if there is space for it."""
    left, right = f"{ends[0]:.4g}", f"{ends[1]:.4g}"
    line = [" "] * width
    if ends[0] < 0.0 < ends[1]:
        place = round(-ends[0] / (ends[1] - ends[0]) * (width - 1))
        if len(left) + 1 < place < width - len(right) - 2:
            line[place] = "0"
    line[: len(left)] = left
    line[width - len(right) :] = right
    return "".join(line)
