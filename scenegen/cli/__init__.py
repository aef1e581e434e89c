"""The command line: one verb per file."""

import sys


def main() -> None:
    """The program `scenegen`: run it and exit with its status."""
    try:
        # Loading takes a moment, in which Ctrl-C must not show a traceback either.
        from scenegen.cli.app import run

        status = run(sys.argv[1:])
    except KeyboardInterrupt:
        status = 130
    sys.exit(status)
