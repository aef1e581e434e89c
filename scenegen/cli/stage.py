"""`scenegen stage`: the starts of a suite on a real table."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from scenegen.cli.options import argument, choices, option
from scenegen.cli.output import print_error
from scenegen.errors import RequestError
from scenegen.errors.requests import MISSING_ARGUMENT, OUT_OF_PLACE, OUT_OF_RANGE, UNKNOWN_CHOICE

if TYPE_CHECKING:
    from scenegen.play.suites.suite import GradedStart, Suite

STAGE_OPTIONS = {  # of each action: those that must be given, and the others
    "mat": (("out",), ("paper", "grid")),
    "sheet": ((), ("out", "paper", "grid", "episodes", "reverse")),
}


def lengths(text: str | float) -> float:
    """A length as typed: 2cm or 0.02 m, in metres. Raises typer.BadParameter."""
    import re

    import typer

    from scenegen.geometry.primitives import LENGTH, quantity

    found = re.fullmatch(r"\s*([\d.]+)\s*(mm|cm|m)\s*", str(text))
    try:
        value, unit = quantity(*found.groups()) if found else (float(text), LENGTH)
    except ValueError:
        unit = None
    if unit != LENGTH:
        raise typer.BadParameter(f"'{text}' is no length; write 2cm or 20mm")
    return value


def stage(
    action: str = argument("mat or sheet.", "ACTION", autocompletion=choices(*STAGE_OPTIONS)),
    suite: str = argument("The suite's folder, or the name of a shipped suite.", "SUITE"),
    out: Path | None = option("mat: .pdf. sheet: .pdf; without it, cards are printed.", "FILE"),
    paper: str | None = option("mat and sheet: a4, a3, a2, a1, a0 or letter; default: a4.", "SIZE"),
    grid: float | None = option("From line to line; default: 2cm.", "LENGTH", parser=lengths),
    episodes: str | None = option("sheet: some of them, or one; default: all.", "FIRST:END|N"),
    reverse: bool = option("The reversed tasks."),
) -> None:
    """Set the starts of a suite on a real table: a mat, sheets and cards to print.

    \b
      scenegen stage mat tabletop --out mat.pdf --paper a3
      scenegen stage sheet tabletop --episodes 0:10 --out sheets.pdf
      scenegen stage sheet tabletop --episodes 7

    The mat has a tag at each corner, a grid with names, and a ruler: print it at 100 %. Behind it are the tags of all
    objects, one to be glued onto each. A sheet has the outlines of one start; a card says the same in words.
    """
    given = {name: value for name, value in locals().items() if value is not None and value is not False}
    del given["action"], given["suite"]
    if action not in STAGE_OPTIONS:
        raise RequestError(UNKNOWN_CHOICE(what="action", name=action, known=STAGE_OPTIONS))
    needed, others = STAGE_OPTIONS[action]
    for name in given:
        if name not in (*needed, *others):
            of = ", ".join(f"`{one}`" for one, names in STAGE_OPTIONS.items() if name in (*names[0], *names[1]))
            raise RequestError(OUT_OF_PLACE(argument=name, rule=f"is an option of {of}", remedy="leave it out"))
    for name in needed:
        if name not in given:
            raise RequestError(MISSING_ARGUMENT(argument=name, question=f"see `scenegen stage --help` on {action}"))
    actions: dict[str, Any] = {"mat": _mat, "sheet": _sheet}
    actions[action](suite, **given)


def _mat(place: str, out: Path, paper: str = "a4", **given: Any) -> None:
    from scenegen.play.stage.mat import draw_mat, draw_tags
    from scenegen.play.stage.pdf import write_pdf
    from scenegen.play.stage.stage import Stage
    from scenegen.play.suites.suite import Suite
    from scenegen.scenes.files import write_whole

    _check_paper(out, paper)
    suite = Suite.load(place)
    stage = Stage.of(suite, *given.values())
    write_whole(out, write_pdf([draw_mat(stage, suite.name, paper), *draw_tags(stage, suite.name)]))
    width, height = (100.0 * side for side in stage.size)
    print_error(f"a mat of {width:.1f} x {height:.1f} cm and {len(stage.things)} tags of things in {out}")


def _sheet(place: str, out: Path | None = None, paper: str = "a4", grid: float | None = None, **given: Any) -> None:
    from scenegen.play.stage.pdf import write_pdf
    from scenegen.play.stage.sheet import draw_start, write_card
    from scenegen.play.stage.stage import Stage
    from scenegen.scenes.files import write_whole

    if out is not None:
        _check_paper(out, paper)
    suite, starts = _starts(place, **given)
    stage = Stage.of(suite, *([] if grid is None else [grid]))
    if out is None:
        print("\n".join(write_card(stage, one) for one in starts), end="")
        return
    write_whole(out, write_pdf(draw_start(stage, one, paper) for one in starts))
    print_error(f"{len(starts):,} sheets in {out}")


def _check_paper(out: Path, paper: str) -> None:
    from scenegen.play.stage.pdf import PAPERS
    from scenegen.scenes.formats.registry import check_ending

    check_ending(out, ".pdf")
    if paper not in PAPERS:
        raise RequestError(UNKNOWN_CHOICE(what="paper", name=paper, known=PAPERS))


def _starts(place: str, episodes: str | None = None, reverse: bool = False) -> tuple[Suite, list[GradedStart]]:
    """A suite and some of its starts. Raises RequestError."""
    from scenegen.play.suites.suite import Suite

    suite = Suite.load(place, reverse=reverse)
    first, colon, end = (episodes or ":").partition(":")
    if not all(one.isdecimal() or not one for one in (first, end)) or not (first or colon):
        wanted = "FIRST:END, or a number"
        raise RequestError(OUT_OF_RANGE(argument="episodes", value=episodes, wanted=wanted))
    last = int(end) if end else None if colon else int(first) + 1
    return suite, [suite[number] for number in suite.part(int(first or 0), last)]
