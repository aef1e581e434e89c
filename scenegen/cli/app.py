"""The `scenegen` program: its commands, and its handling of all errors.

Exit status 0 done; 1 the spec, the data or the request is at fault; 2 an unknown option or a missing argument; 130
after Ctrl-C, 143 after SIGTERM, 129 after SIGHUP. Data goes to standard output or --out, everything else to standard
error.
"""

from __future__ import annotations

import contextlib
import functools
import importlib
import inspect
import itertools
import os
import re
import sys
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import typer

from scenegen.cli.options import QUIET, VERBOSE, as_typed, option_called
from scenegen.cli.output import Verbosity, complain, flag, give_up, prepare, print_message, reader_left, voice
from scenegen.errors import Diagnostic, RequestError, ScenegenError
from scenegen.errors.files import CANNOT_WRITE
from scenegen.errors.program import COMMAND_LINE, INTERNAL_ERROR, INTERRUPTED, OUT_OF_MEMORY
from scenegen.errors.requests import CONFLICTING_ARGUMENTS
from scenegen.processes.process import cannot_start, exit_status, is_limit
from scenegen.resources import inputs

WRITTEN = ("out", "render", "png", "figure", "export", "log_dir")  # parameters that name places to write to
SET_COMMANDS = ("sample", "data", "dataset")  # commands whose --out may be a set, which refuses what is there already

# click's exceptions: newer versions of typer contain their own copy of click
exceptions: Any = sys.modules[typer.BadParameter.__module__]

HELP = """Table-top scenes from a spatial specification, at the difficulty you ask for.

\b
  # a spec to start from
  scenegen new my.spec
  # what the spec means, and what phi can be
  scenegen check my.spec
  # scenes whose phi lies in 0..0.2, as JSON and as pictures
  scenegen sample my.spec --phi 0:0.2 -n 16 --out s.json --render out
  # a model that draws such scenes in no time
  scenegen train my.spec --out my.safetensors

phi is the margin by which a scene satisfies the formula, in metres and radians: satisfied where it is >= 0, and the
lower, the harder. `scenegen specs` lists the specs that ship with scenegen: wherever a command takes a SPEC, the name
of one will do, as in `scenegen check table_setting`.
"""

# command -> its module and function; each module imports what it needs only when it runs
COMMANDS: dict[str, str] = {
    "new": "scenegen.cli.specs:new",
    "specs": "scenegen.cli.specs:specs",
    "import": "scenegen.cli.specs:import_",
    "check": "scenegen.cli.check:check",
    "fmt": "scenegen.cli.fmt:fmt",
    "range": "scenegen.cli.range:range_",
    "train": "scenegen.cli.train:train",
    "info": "scenegen.cli.info:info",
    "sample": "scenegen.cli.sample:sample",
    "pairs": "scenegen.cli.pairs:pairs",
    "eval": "scenegen.cli.eval:evaluate",
    "render": "scenegen.cli.render:render",
    "export": "scenegen.cli.export:export",
    "settle": "scenegen.cli.settle:settle",
    "libero": "scenegen.cli.libero:libero",
    "suite": "scenegen.cli.suite:suite",
    "stage": "scenegen.cli.stage:stage",
    "fit": "scenegen.cli.fit:fit",
    "assets": "scenegen.cli.assets:assets",
    "arm": "scenegen.cli.arm:arm",
    "data": "scenegen.cli.data:data",
    "dataset": "scenegen.cli.data:dataset",
    "grammar": "scenegen.cli.grammar:grammar",
    "relations": "scenegen.cli.explain:relations",
    "explain": "scenegen.cli.explain:explain",
    "view": "scenegen.cli.servers:view",
    "lsp": "scenegen.cli.servers:lsp",
}
WITHOUT_ARGUMENTS = (
    "assets",
    "explain",
    "lsp",
    "relations",
    "specs",
    "view",
)  # others show their help


COMPLETE = "_SCENEGEN_COMPLETE"  # set by the shell's function that typer installs


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(importlib.import_module("scenegen").__version__)
        raise typer.Exit


def _global_options(
    debug: bool = typer.Option(False, "--debug", help="Show the traceback of an error."),
    version: bool = typer.Option(False, "--version", help="Print the version.", callback=_version, is_eager=True),
) -> None:
    del debug, version  # --debug is read where errors are handled, --version was handled before


def _speaking(name: str, command: Callable[..., Any]) -> Callable[..., Any]:
    """The command with -q and -v, outputs that are checked, and interrupts that typer does not swallow."""

    @functools.wraps(command)
    def run_command(*args: Any, quiet: bool, verbose: bool, **options: Any) -> Any:
        if quiet and verbose:
            raise RequestError(CONFLICTING_ARGUMENTS(one="quiet", other="verbose"))
        before, known = voice.set(Verbosity(quiet, verbose)), inputs.set(None)
        try:
            refuse_overwriting(name, options)
            return command(*args, **options)
        except KeyboardInterrupt as error:
            raise _Interrupted(*error.args) from error
        except BrokenPipeError as error:
            raise _OutputClosed from error
        finally:
            voice.reset(before)
            inputs.reset(known)

    signature = inspect.signature(command, eval_str=True)
    more = [
        inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=bool)
        for name, default in (("quiet", QUIET), ("verbose", VERBOSE))
    ]
    every = map(as_typed, [*signature.parameters.values(), *more])
    run_command.__signature__ = signature.replace(parameters=list(every))  # type: ignore[attr-defined]
    return run_command


def refuse_overwriting(command: str, given: Mapping[str, Any]) -> None:
    """Before a command is called with these values of its parameters: raises OutputError where it would write over what
    it reads, or into a suite or a set. What it finds out later, such as imports, it does not write over either."""
    places = [one for name in WRITTEN if isinstance(one := given.get(name), str | Path)]
    if not places:
        return
    from scenegen.scenes.files import refuse_place
    from scenegen.scenes.locations import is_url, names_set

    read = [path for name, value in given.items() if name not in WRITTEN for path in _files(value)]
    inputs.set({os.path.realpath(path) for path in read})
    for place in (one for one in places if not is_url(str(one))):
        a_set = command in SET_COMMANDS and isinstance(place, str) and names_set(place)
        refuse_place(Path(place), read, a_set=a_set)


def _files(value: Any) -> Iterator[Path]:
    """The files that a value names: paths, texts such as `policy.py:act`, and specs without their ending."""
    for text in value if isinstance(value, list) else [value]:
        if isinstance(text, str | Path):
            for path in (f"{text}", f"{text}.spec", f"{text}".rpartition(":")[0]):
                with contextlib.suppress(OSError, ValueError):  # what reads it says what is wrong with it
                    if Path(path).is_file():
                        yield Path(path)


def build(words: list[str] | None = None) -> typer.Typer:
    """The program, commands in the order of the table; of what `words` call, the one command that they name."""
    called = next((word for word in words or () if word != "--debug"), "")
    wanted = {called: COMMANDS[called]} if called in COMMANDS else COMMANDS  # to make all takes 40 ms
    app = typer.Typer(
        help=_paragraphs(HELP),
        rich_markup_mode="rich",
        pretty_exceptions_enable=False,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    app.callback()(_global_options)
    for name, path in wanted.items():
        module, _, function = path.partition(":")
        command = getattr(importlib.import_module(module), function)
        app.command(name, help=_paragraphs(inspect.getdoc(command) or ""))(_speaking(name, command))
    return app


def _paragraphs(text: str) -> str:
    """A help text with each paragraph on one line, for the terminal to wrap; examples (after \\b) stay as they are."""
    parts = text.strip().split("\n\n")
    return "\n\n".join(part if part.startswith("\b") else part.replace("\n", " ") for part in parts)


class _Interrupted(Exception):  # noqa: N818 - no error
    """Carries Ctrl-C through typer, which would drop its message."""


class _OutputClosed(Exception):  # noqa: N818 - no error
    """Carries a broken pipe through typer, which would exit with status 1."""


def run(words: list[str]) -> int:
    """Run the program; returns the exit status."""
    prepare()
    if COMPLETE in os.environ:  # a shell that completes a command line: typer answers it, and exits
        with contextlib.suppress(BrokenPipeError):
            build()([], prog_name="scenegen", standalone_mode=False)
        give_up(sys.stdout)
        return 0
    debug = "--debug" in words
    # --debug may be anywhere: users who see an error add it at the end of the line
    words = ["--debug", *(word for word in words if word != "--debug")] if debug else words
    words = _behind_command(words)
    try:
        if not words or (len(words) == 1 and words[0] in COMMANDS and words[0] not in WITHOUT_ARGUMENTS):
            with contextlib.redirect_stdout(sys.stderr):  # help that was not requested is not data
                build(words)([*words, "--help"], prog_name="scenegen", standalone_mode=False)
            return 2
        result: Any = build(words)(words, prog_name="scenegen", standalone_mode=False)
        sys.stdout.flush()
    except ScenegenError as error:
        if debug:
            raise
        complain(*error.diagnostics)
        return 1
    except exceptions.UsageError as error:
        return _usage(error)
    except (_Interrupted, KeyboardInterrupt, typer.Abort) as error:
        said = error.args[0] if error.args else INTERRUPTED()
        with contextlib.suppress(OSError):  # the terminal is gone
            print_message(said.text("title", flag) if isinstance(said, Diagnostic) else str(said))
        return exit_status(error)
    except (_OutputClosed, BrokenPipeError, SystemExit) as error:
        # `scenegen check x.spec | head -1`: the reader of the data needs no more. This is not a failure (nor is it for
        # ripgrep); with `set -o pipefail`, 1 (or 141, the status after SIGPIPE) would make it one. If the reader of the
        # *messages* has gone, the run ended before its work was done, and fails. rich, which prints help, exits itself.
        helped = isinstance(error, SystemExit) and not {"--help", "-h"}.isdisjoint(words)
        status = 0 if helped or reader_left() else getattr(error, "code", 1)
        give_up(sys.stdout)
        give_up(sys.stderr)
        return status
    except MemoryError:
        if debug:
            raise
        complain(OUT_OF_MEMORY())
        return 1
    except Exception as error:
        if debug:
            raise
        if is_limit(error):
            complain(*cannot_start("a process or thread", error).diagnostics)
            return 1
        if "allocate memory" in str(error) or "failed to map segment" in str(error):  # as torch and the linker say it
            complain(OUT_OF_MEMORY())
            return 1
        if isinstance(error, OSError) and error.errno and error.filename is None:  # others are no system's
            give_up(sys.stdout)
            reason = (error.strerror or str(error)).lower()
            complain(CANNOT_WRITE(reason=reason))
            return 1
        complain(INTERNAL_ERROR(error=f"{type(error).__name__}: {error}"))
        return 1
    return result if isinstance(result, int) else 0


def _behind_command(words: list[str]) -> list[str]:
    """-q and -v may stand before the command, too."""
    flags = list(itertools.takewhile(lambda word: word in ("-q", "--quiet", "-v", "--verbose"), words))
    rest = words[len(flags) :]
    return [rest[0], *flags, *rest[1:]] if rest and rest[0] in COMMANDS else words


def _usage(error: Any) -> int:
    """A value out of its range is the request's fault (1); an option or argument wrong or missing is usage (2)."""
    bad_value = isinstance(error, exceptions.BadParameter) and not isinstance(error, exceptions.MissingParameter)
    command = error.ctx.command_path if error.ctx is not None else "scenegen"
    message = error.format_message().rstrip(".")
    unexpected = re.search(r"unexpected extra argument\S* \((\S+?)[ )]", message)
    option = unexpected and option_called(unexpected[1], error.ctx)
    message += f"; an option begins with a dash: {option}" if option else ""
    complain(COMMAND_LINE(message=message[:1].lower() + message[1:], command=command))
    return 1 if bad_value else 2
