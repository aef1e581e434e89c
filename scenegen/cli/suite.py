"""`scenegen suite`: graded starts, frozen; policies on them, and what their outcomes say."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from scenegen.cli.many import names_of, say_why
from scenegen.cli.options import WORKERS, argument, find_spec, option, seconds
from scenegen.cli.output import print_error, progress_bar
from scenegen.errors import RequestError
from scenegen.errors.requests import MISSING_ARGUMENT, OUT_OF_PLACE, UNKNOWN_CHOICE

if TYPE_CHECKING:
    from scenegen.sampling.engine.engines import JobResult
    from scenegen.sampling.request import Range

OPTIONS: dict[str, tuple[str, ...]] = {  # of each action
    "new": ("out", "bands", "log10p", "n", "seed", "success", "start", "timeout", "workers"),
    "check": (),
}


def suite(
    action: str = argument("new or check.", "ACTION"),
    places: list[str] = argument("For new: spec files. Else the suite's folder.", "PLACE..."),
    out: Path | None = option("The suite's folder.", "DIR"),
    bands: list[str] | None = option(
        "For new: how many bands, equally probable, by default 5; or a range of phi, once for each.", "K|NAME=LO:HI"
    ),
    log10p: bool = option("For new: --bands are ranges of log10 of the share of starts at least as hard."),
    n: int | None = option("For new: starts of each band of each task; default: 50.", "N"),
    seed: int | None = option("For new: the same seed gives the same suite; default: 0.", "N"),
    success: str | None = option("For new: the label of success; default: goal, or the only one.", "LABEL"),
    start: str | None = option("For new: the label that starts satisfy; default: start, if there is one.", "LABEL"),
    timeout: float | None = option(
        "For new: seconds for the starts of a band; default: 600.", "SECONDS", parser=seconds
    ),
    workers: int | None = WORKERS,
) -> None:
    """Make and check suites: graded starts of several tasks, frozen, on which policies are compared.

    \b
      scenegen suite new stack.spec sort.spec --bands 5 -n 50 --out mine/
      scenegen suite new a.spec --bands near=-0.1:0 --bands far=:-0.1 --out mine/
      scenegen suite check mine/

    A start is a scene in which the label of success does not hold. Of each task there are as many starts of each band;
    a suite knows how probable each band is. Starts are ordinary scenes files: `scenegen render mine/stack.json` draws
    them. The first line of a spec is its instruction; one `# reverse: ...` makes a reversed task of a spec with a
    label of its starts.
    """
    given = {
        "out": out, "bands": bands, "log10p": log10p, "n": n, "seed": seed, "success": success, "start": start,
        "timeout": timeout, "workers": workers,
    }  # fmt: skip
    if action not in OPTIONS:
        raise RequestError(UNKNOWN_CHOICE(what="action", name=action, known=OPTIONS))
    for name, value in given.items():
        if value and name not in OPTIONS[action]:
            of = ", ".join(f"`{one}`" for one, options in OPTIONS.items() if name in options)
            raise RequestError(OUT_OF_PLACE(argument=name, rule=f"is an option of {of}", remedy="leave it out"))
    if action == "new":
        if out is None:
            raise RequestError(MISSING_ARGUMENT(argument="out", question="which folder gets the suite?"))
        _new(
            [find_spec(Path(place)) for place in places], out, bands, log10p, 50 if n is None else n, seed or 0,
            success, start, timeout or 600.0, workers,
        )  # fmt: skip
    else:
        _check(places)


def _new(
    specs: list[Path],
    out: Path,
    bands: list[str] | None,
    log10p: bool,
    n: int,
    seed: int,
    success: str | None,
    start: str | None,
    timeout: float,
    workers: int | None,
) -> None:
    from scenegen.worlds.suites.new import new_suite

    with progress_bar() as bar:
        task = bar.add_task("tasks", total=None)

        def told(ended: JobResult, done: int, count: int) -> None:
            bar.update(task, completed=done, total=count)
            if ended.errors:
                say_why(ended)

        named = list(zip(names_of(specs), specs, strict=True))
        made = new_suite(
            named, out, bands=_bands(bands), log10p=log10p, n=n, seed=seed, success=success, start=start,
            timeout=timeout, workers=workers, told=told,
        )  # fmt: skip
    starts = sum(made.n * len(one.bands) for one in made.tasks)
    print_error(f"{starts:,} starts of {len(made.tasks)} tasks in {out}, digest {made.digest[:12]}")


def _bands(texts: list[str] | None) -> int | dict[str, Range]:
    """The number of bands, or their ranges by name. Raises RequestError with a caret."""
    from scenegen.sampling.request import parse_phi

    if not texts:
        return 5
    if len(texts) == 1 and texts[0].isdecimal():
        return int(texts[0])
    return parse_phi(texts, [text.partition("=")[0].strip() for text in texts if "=" in text] or ["band"], "bands")


def _check(places: list[str]) -> None:
    from scenegen.worlds.suites.suite import check_suite

    for place in places:
        for one in check_suite(place):
            what = "reversed tasks" if one.reverse else "tasks"
            print_error(f"{place}: {len(one):,} starts of {len(one.tasks)} {what} are as they were made: {one.digest}")
