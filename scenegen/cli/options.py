"""Arguments and options that several commands share."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated

import typer

from scenegen.errors.files import SPEC_NOT_FOUND

Root = Annotated[
    Path | None,
    typer.Option("--root", help="The folder that imports may read from; the spec's own if left out.", metavar="DIR"),
]
Counts = Annotated[
    list[str] | None,
    typer.Option(
        "--count",
        help="How many there are of things whose number the spec draws, or which asset; repeat for more.",
        metavar="NAME=N",
        show_default=False,
    ),
]
PosesOf = Annotated[
    Path | None,
    typer.Option(
        "--spec",
        help="The spec of a file that holds poses alone: .csv, .parquet, .json or .jsonl.",
        metavar="SPEC",
        show_default=False,
        callback=lambda path: None if path is None else find_spec(path),
        autocompletion=lambda incomplete: spec_names(incomplete),
    ),
]
Meshes = Annotated[
    Path | None,
    typer.Option(
        "--meshes",
        help="The folder of the spec's meshes, assets and URDF files: objects as they are in these.",
        metavar="DIR",
        show_default=False,
    ),
]


def parse_counts(options: list[str] | None) -> dict[str, str]:
    """The numbers of `--count` options as typed, e.g. ["block=5"], or assets, ["mug=025_mug"]: the spec knows which.
    Raises RequestError with a caret."""
    from scenegen.errors import RequestError, Source, Span
    from scenegen.errors.counts import COUNT_SYNTAX, COUNT_TWICE

    found: dict[str, str] = {}
    for text in options or ():
        here = Span(Source("count", text, argument=True), 0, len(text))
        name, _, number = (part.strip() for part in text.partition("="))
        if not name or not number:
            raise RequestError(COUNT_SYNTAX(here))
        if name in found:
            raise RequestError(COUNT_TWICE(here, name=name))
        found[name] = number
    return found


def whole(text: str | int) -> int:
    """A number of things as typed: 1000000, 1_000_000 or 1e6. Raises typer.BadParameter."""
    try:
        return int(text)
    except ValueError:
        value = float(text) if re.fullmatch(r"\d+(\.\d+)?[eE]\+?\d{1,2}", str(text)) else 0.5
        if not value.is_integer():
            raise typer.BadParameter(f"'{text}' is not a whole number") from None
        return int(value)


def spec_names(incomplete: str) -> list[str]:
    """What a shell completes a spec's name to: shipped ones, where no file begins like that (it completes files)."""
    from scenegen.resources import shipped_specs

    start = Path(incomplete + "x")
    try:
        if any(start.parent.glob(f"{start.name[:-1]}*")) and incomplete:
            return []
    except (OSError, ValueError):
        return []
    return [name for name in shipped_specs() if name.startswith(incomplete)]


def find_spec(path: Path) -> Path:
    """The file that a spec's name stands for: the file of that name, NAME.spec, or else the shipped spec NAME.

    Raises DataError if there is none.
    """
    from scenegen.errors import DataError
    from scenegen.formats.files import is_stream
    from scenegen.resources import shipped_specs

    if is_stream(path):
        return path
    try:
        if path.exists() or path.is_symlink() or path.suffix:
            return path
        own = path.with_name(f"{path.name}.spec")
        if own.is_file():
            return own
    except (OSError, ValueError):  # not a valid file name: opening it gives the error
        return path
    shipped = shipped_specs()
    if path.name != str(path):
        return path
    if path.name in shipped:
        return shipped[path.name]
    from scenegen.formats.files import missing_help

    remedy = missing_help(path, "a spec")
    raise DataError(SPEC_NOT_FOUND(path=path, name=path.name, known=shipped, remedy=remedy))


def named(path: Path) -> str:
    """A spec's file as people name it: a shipped one by its name alone."""
    from scenegen.formats.files import is_stream
    from scenegen.resources import shipped_specs

    if is_stream(path):
        return "<stdin>"
    return path.stem if path.is_absolute() and shipped_specs().get(path.stem) == path else str(path)


def _found(path: Path) -> Path:
    return find_spec(path)


def all_found(paths: list[Path]) -> list[Path]:
    return [find_spec(path) for path in paths]


SpecFile = Annotated[
    Path,
    typer.Argument(
        help="A spec file, the name of a shipped spec, or - for standard input.",
        metavar="SPEC",
        show_default=False,
        callback=_found,
        autocompletion=spec_names,
    ),
]
SpecFiles = Annotated[
    list[Path],
    typer.Argument(
        help="Spec files, names of shipped specs, or - for standard input.",
        metavar="SPEC",
        show_default=False,
        callback=all_found,
        autocompletion=spec_names,
    ),
]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Say nothing but errors and warnings.")]
Verbose = Annotated[bool, typer.Option("--verbose", "-v", help="Say what is being done, and how long it takes.")]
