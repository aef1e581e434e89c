"""What a command says. Messages and tables for people go to standard error, with colours only on a terminal; data goes
to standard output. No stream is missing, every character can be written, and SIGTERM and SIGHUP end a command as
cleanly as Ctrl-C."""

from __future__ import annotations

import contextlib
import functools
import io
import os
import select
import signal
import sys
import threading
import time
from collections.abc import Iterable, Iterator, Sequence
from contextvars import ContextVar
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any, TextIO

from scenegen.errors import Diagnostic, OutputError, render_all
from scenegen.errors.files import CANNOT_WRITE
from scenegen.errors.program import OTHER_FILES
from scenegen.processes.process import END_SIGNALS, Terminated

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress

    from scenegen.api.outline import Line


def prepare() -> None:
    """Call once, before anything is printed."""
    for name in ("stdin", "stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:  # closed by the parent process: the next file that is opened must not take its place
            # Messages may be lost, data may not: a file opened the other way makes reading and writing it fail.
            mode = os.O_RDONLY if name == "stdout" else os.O_WRONLY
            file = io.FileIO(os.open(os.devnull, mode), "rb" if name == "stdin" else "wb")
            setattr(sys, name, io.TextIOWrapper(file, encoding="utf-8"))
        elif isinstance(stream, io.TextIOWrapper) and name != "stdin":
            stream.reconfigure(errors="backslashreplace")
    if threading.current_thread() is threading.main_thread():
        begun: list[int] = []
        for number in END_SIGNALS:
            if number != signal.SIGINT and signal.getsignal(number) is not signal.SIG_IGN:  # as `nohup` leaves SIGHUP
                signal.signal(number, functools.partial(_terminate, begun))


def _terminate(begun: list[int], number: int, frame: FrameType | None) -> None:
    """The first of these signals ends the program. Further ones, as terminals send them, do not disturb its cleaning
    up."""
    begun.append(number)
    if len(begun) == 1:
        raise Terminated(number)


def write_data(data: bytes) -> None:
    """Bytes on standard output, whatever its encoding."""
    sys.stdout.flush()
    buffer = getattr(sys.stdout, "buffer", None)
    if buffer is None:  # a stand-in without bytes, as in tests and notebooks
        sys.stdout.write(data.decode())
    else:
        buffer.write(data)


def check_output() -> None:
    """Refuse, before any work is done, a standard output that was closed. Raises OutputError."""
    try:
        os.write(sys.stdout.fileno(), b"")
    except io.UnsupportedOperation:  # a stand-in without a file, as in tests and notebooks
        return
    except OSError as error:
        raise OutputError(CANNOT_WRITE(reason=(error.strerror or str(error)).lower())) from error


def reader_left() -> bool:
    """After a broken pipe: whether the reader of the data has gone, as with `| head`, and not only the reader of the
    messages."""
    if not hasattr(select, "poll"):  # Windows, where pipes cannot be looked at
        return True
    look = select.poll()
    try:
        look.register(sys.stdout.fileno(), select.POLLOUT)
    except (OSError, ValueError):
        return False
    return any(found & select.POLLERR for _, found in look.poll(0))


def give_up(stream: TextIO) -> None:
    """The stream is gone or full; without this Python would report an error again when it closes the stream."""
    with contextlib.suppress(OSError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


_FLAGS = {"n": "-n", "quiet": "-q", "verbose": "-v", "kinds": "--figure", "views": "--view"}
MIN_CONSOLE_WIDTH = 72  # columns; a narrower table would be unreadable


@dataclass(frozen=True, slots=True)
class Verbosity:
    """How much a command says: -q leaves only errors and warnings, -v adds what is being done."""

    quiet: bool = False
    verbose: bool = False
    started: float = field(default_factory=time.monotonic)


USUAL_VERBOSITY = Verbosity()
voice = ContextVar("voice", default=USUAL_VERBOSITY)  # set for as long as a command runs


def seconds_elapsed() -> float:
    """Seconds since the command began."""
    return time.monotonic() - voice.get().started


def time_left(timeout: float) -> float:
    """The rest of a time limit, which counts from the start of the command; no limit stays no limit."""
    return max(timeout - seconds_elapsed(), min(timeout, 1e-3)) if 0.0 < timeout < float("inf") else timeout


def use_color() -> bool:
    """Whether standard error takes colours: a terminal does, unless NO_COLOR is set or TERM is dumb; FORCE_COLOR gives
    colours to pipes, too. Empty variables do not count, and NO_COLOR takes precedence."""
    if os.environ.get("NO_COLOR"):
        return False
    if os.environ.get("FORCE_COLOR"):
        return True
    return sys.stderr.isatty() and os.environ.get("TERM") != "dumb"


def print_error(text: str) -> None:
    """What a command did, or a note: on standard error, unless -q was given."""
    if not voice.get().quiet:
        print_message(text)


def print_columns(header: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """A small table under a header, unless -q was given; without rich, which takes a while to load."""
    widths = [max(map(len, column)) for column in zip(header, *rows, strict=True)]
    bold = use_color()
    for row in (header, *rows):
        cells = [cell.ljust(width) for cell, width in zip(row, widths, strict=True)]
        if bold and row is header:
            cells = [f"\x1b[1m{cell}\x1b[0m" for cell in cells]
        print_error(f" {'  '.join(cells)} ")


def print_json(data: Any) -> None:
    """Data as one JSON document on standard output."""
    from json import dumps

    print(dumps(data, indent=1, ensure_ascii=False))


def print_rows(header: Sequence[str], rows: Iterable[Sequence[object]], **formats: str) -> None:
    """A table on standard output: on a terminal rounded, in the format of a column if it has one, and in a pipe
    tab-separated with every digit."""
    if not sys.stdout.isatty():
        print("\n".join("\t".join(map(str, row)) for row in (header, *rows)))
        return
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(*header, box=None)
    for row in rows:
        each = (
            (formats.get(name, "{:+.6f}" if isinstance(one, float) else "{}"), one)
            for name, one in zip(header, row, strict=True)
        )
        table.add_row(*(Text(form.format(one)) for form, one in each))
    Console().print(table)


def detail(text: str) -> None:
    """What is being done, with the time so far: only where -v was given."""
    now = voice.get()
    if now.verbose:
        print_message(f"[{time.monotonic() - now.started:6.2f} s] {text}")


def print_message(text: str) -> None:
    """Text on standard error, with -q too. If it is closed the text is dropped; the exit status is enough."""
    try:
        print(text, file=sys.stderr, flush=True)
    except BrokenPipeError:
        give_up(sys.stderr)


def note_others(folder: Path, total: int, ending: str) -> None:
    """A note if the folder also has files of an earlier run with more than `total` scenes."""
    from scenegen.scenes.files import count_leftovers

    count = count_leftovers(folder, total, ending)
    if count:
        files = "another file" if count == 1 else f"{count:,} other files"
        verb = "is" if count == 1 else "are"
        note(OTHER_FILES(files=files, ending=ending, folder=folder, verb=verb))


def complain(*diagnostics: Diagnostic) -> None:
    """Diagnostics on standard error, -q or not."""
    if diagnostics:
        print_message(render_all(diagnostics, color=use_color(), spell=flag))


def note(*diagnostics: Diagnostic) -> None:
    """What is worth knowing, unless -q was given."""
    if not voice.get().quiet:
        for one in diagnostics:
            complain(one)


def flag(name: str, value: str | None = None) -> str:
    """An argument as it is typed on the command line: --timeout, or --device cpu with a value."""
    option = _FLAGS.get(name) or f"--{name.replace('_', '-')}"
    return option if value in (None, "True") else f"{option} {value}"


def console() -> Console:
    """A rich console on standard error; it prints nothing where -q was given."""
    from rich.console import Console

    screen = Console(stderr=True, highlight=False, soft_wrap=True, quiet=voice.get().quiet)
    screen.width = max(screen.width, MIN_CONSOLE_WIDTH)
    return screen


def progress_bar() -> Progress:
    """A bar that goes away when it is done; nothing at all where standard error is no terminal."""
    from rich.progress import Progress

    screen = console()
    return Progress(console=screen, transient=True, disable=not screen.is_interactive)


MAX_TREE_COLUMN = 60  # columns that a formula and its margin may each take before the next column moves
MIN_MARGIN_WIDTH = 12  # columns that are left of a margin where lines are cut to a width


def tree(lines: Sequence[Line], more: int = 0, width: int | None = None) -> Iterator[str]:
    """One line of text per sub-formula: its text, its margin, and its bounds or its value with its unit.

    With a `width`, texts and margins are shortened to it, and marked with three dots.
    """
    wide, wider = (
        min(MAX_TREE_COLUMN, max(map(len, column), default=0))
        for column in ([_text(line) for line in lines], [line.margin for line in lines])
    )
    if width is not None:
        ends = max((len(_end(line)) for line in lines), default=0)
        wider = min(wider, max(MIN_MARGIN_WIDTH, width - 4 - wide - 2 - 2 - ends))
        lines = [_cut(line, wide, wider) for line in lines]
    for line in lines:
        yield f"    {_text(line):<{wide}}  {line.margin:<{wider}}  {_end(line)}".rstrip()
    if more:
        yield f"    ... and {more} more"


def _text(line: Line) -> str:
    return f"{'  ' * line.depth}{line.text}"


def _end(line: Line) -> str:
    if line.low != line.low:  # NaN: a line that stands for others
        return ""
    unit = f" {line.unit}" if line.unit else ""
    what = f"[{line.low:.4g}, {line.high:.4g}]" if line.value is None else f"{line.value:+.6f}"
    return f"{what}{unit}{'  <- decides' if line.decides else ''}"


def _cut(line: Line, wide: int, wider: int) -> Line:
    return replace(line, text=_shorten(line.text, wide - 2 * line.depth), margin=_shorten(line.margin, wider))


def _shorten(text: str, most: int) -> str:
    return text if len(text) <= most else text[: max(0, most - 3)] + "..."
