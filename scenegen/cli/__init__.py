"""The command line: one verb per file."""

import gc
import os
import sys

GARBAGE = 200_000  # objects that are made between two searches for cycles


def main() -> None:
    """The program `scenegen`: run it and exit with its status."""
    # Loading makes a hundred thousand objects that stay; to look for garbage among them is a tenth of a small request.
    gc.set_threshold(GARBAGE)
    # Plugins of other packages have nothing to say about scene files; to look for them takes as long as a small spec.
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "1")
    try:
        # Loading takes a moment, in which Ctrl-C must not show a traceback either.
        from scenegen.cli.app import run
        from scenegen.processes.memory import keep_memory

        keep_memory()

        status = run(sys.argv[1:])
    except KeyboardInterrupt:
        status = 130
    gc.freeze()  # at the end Python would look at all objects once more: a tenth of a second
    sys.exit(status)
