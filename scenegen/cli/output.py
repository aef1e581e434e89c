"""Words and tables for people: standard error, colours only on a terminal."""

from __future__ import annotations

import os
import sys
import time
from contextvars import ContextVar
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from scenegen.cli.streams import give_up
from scenegen.errors import Diagnostic, render_all

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress


NARROWEST = 72  # columns; a table cropped to fewer says nothing any more


@dataclass(frozen=True, slots=True)
class Voice:
    """How much a command says: -q leaves only errors and warnings, -v adds what is being done."""

    quiet: bool = False
    verbose: bool = False
    started: float = field(default_factory=time.monotonic)


voice: ContextVar[Voice] = ContextVar("voice")  # set for as long as a command runs


def _voice() -> Voice:
    return voice.get(Voice())


def use_color() -> bool:
    """Whether standard error takes colours: a terminal does, unless NO_COLOR is set or it is a dumb one; FORCE_COLOR
    gives colours to pipes, too. Either variable counts unless it is empty, and NO_COLOR outdoes the other."""
    if os.environ.get("NO_COLOR"):
        return False
    if os.environ.get("FORCE_COLOR"):
        return True
    return sys.stderr.isatty() and os.environ.get("TERM") != "dumb"


def print_error(text: str) -> None:
    """What a command did, or a note: on standard error, unless -q was given."""
    if not _voice().quiet:
        print_message(text)


def detail(text: str) -> None:
    """What is being done, with the time so far: only where -v was given."""
    now = _voice()
    if now.verbose:
        print_message(f"[{time.monotonic() - now.started:6.2f} s] {text}")


def print_message(text: str) -> None:
    """Text on standard error, with -q too. Where nobody reads it any more it goes nowhere: the exit status says
    enough."""
    try:
        print(text, file=sys.stderr, flush=True)
    except BrokenPipeError:
        give_up(sys.stderr)


def note_others(folder: Path, total: int, ending: str) -> None:
    """Say so where the files of `total` scenes lie among those of an earlier run with more of them."""
    from scenegen.formats.folder import others

    count = others(folder, total, ending)
    if count:
        files = "another file" if count == 1 else f"{count:,} other files"
        verb = "is" if count == 1 else "are"
        print_error(f"note: {files} scene_*{ending} in {folder} {verb} not of these scenes")


def complain(*diagnostics: Diagnostic) -> None:
    """Diagnostics on standard error, -q or not."""
    if diagnostics:
        print_message(render_all(diagnostics, color=use_color()))


def console() -> Console:
    """A rich console on standard error; it prints nothing where -q was given."""
    from rich.console import Console

    screen = Console(stderr=True, highlight=False, soft_wrap=True, quiet=_voice().quiet)
    screen.width = max(screen.width, NARROWEST)
    return screen


def progress_bar() -> Progress:
    """A bar that goes away when it is done; nothing at all where standard error is no terminal."""
    from rich.progress import Progress

    screen = console()
    return Progress(console=screen, transient=True, disable=not screen.is_interactive)
