"""The `scenegen` program: its commands, and what it does with everything that can go wrong.

Exit status 0 done; 1 the spec, the data or the request is at fault; 2 an unknown option or a missing argument; 130
after an interrupt. Data goes to standard output or --out, everything else to standard error.
"""

from __future__ import annotations

import importlib
import os
import sys
from collections.abc import Callable
from typing import Any

import typer
from click import exceptions

from scenegen.cli import check, eval, render, sample, train
from scenegen.cli.output import complain, print_error
from scenegen.errors import Diagnostic, ScenegenError

HELP = """Table-top scenes from a spatial specification, at the difficulty you ask for.

\b
  scenegen check my.spec                                   what the spec means, and what phi can be
  scenegen sample my.spec --phi 0:0.2 -n 16 --render out   scenes whose phi lies in 0..0.2, as JSON and pictures
  scenegen train my.spec --model gan --out my.safetensors  a model that draws such scenes in no time

phi is the margin by which a scene satisfies the formula, in metres and radians: satisfied where it is >= 0, and the
lower, the harder. Specs that ship with scenegen are in the folder `specs`.
"""

# command -> the function that does it; each module imports what it needs only when it runs
COMMANDS: dict[str, Callable[..., Any]] = {
    "check": check.check,
    "train": train.train,
    "sample": sample.sample,
    "eval": eval.evaluate,
    "render": render.render,
}


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(importlib.import_module("scenegen").__version__)
        raise typer.Exit


def _global_options(
    debug: bool = typer.Option(False, "--debug", help="Show the traceback of an error."),
    version: bool = typer.Option(False, "--version", help="Print the version.", callback=_version, is_eager=True),
) -> None:
    del debug, version  # --debug is looked up where errors end up, --version has done its work


def build() -> typer.Typer:
    """The program, commands in the order of the table."""
    app = typer.Typer(
        help=HELP, no_args_is_help=True, add_completion=False, rich_markup_mode="rich", pretty_exceptions_enable=False
    )
    app.callback()(_global_options)
    for name, command in COMMANDS.items():
        app.command(name, no_args_is_help=True)(command)
    return app


def main(arguments: list[str] | None = None) -> None:
    """Run the program and exit with its status."""
    words = sys.argv[1:] if arguments is None else arguments
    sys.exit(run(words))


def run(words: list[str]) -> int:
    """Run the program; returns the exit status."""
    debug = "--debug" in words
    # --debug may stand anywhere: whoever sees an error adds it at the end of the line
    words = ["--debug", *(word for word in words if word != "--debug")] if debug else words
    try:
        result: Any = build()(words, prog_name="scenegen", standalone_mode=False)
        sys.stdout.flush()
    except ScenegenError as error:
        if debug:
            raise
        complain(*error.diagnostics)
        return 1
    except exceptions.NoArgsIsHelpError as error:
        print_error(error.format_message())
        return 2
    except exceptions.UsageError as error:
        return _usage(error)
    except (KeyboardInterrupt, exceptions.Abort) as error:
        print_error(str(error) or "interrupted")
        return 130
    except BrokenPipeError:
        # Whoever read our output has gone; Python would complain again when it closes the stream.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except Exception as error:
        if debug:
            raise
        title = f"scenegen itself failed: {type(error).__name__}: {error}"
        complain(Diagnostic(title, help="this is a bug; please report it with the traceback that --debug shows"))
        return 1
    return result if isinstance(result, int) else 0


def _usage(error: exceptions.UsageError) -> int:
    """A value out of its range is the request's fault (1); an option or argument wrong or missing is usage (2)."""
    bad_value = isinstance(error, exceptions.BadParameter) and not isinstance(error, exceptions.MissingParameter)
    command = error.ctx.command_path if error.ctx is not None else "scenegen"
    message = error.format_message().rstrip(".")
    complain(Diagnostic(message[:1].lower() + message[1:], help=f"see `{command} --help`"))
    return 1 if bad_value else 2
