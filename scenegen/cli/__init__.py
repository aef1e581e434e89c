"""The command line: one verb per file."""

import gc
import os
import sys

FEW_PROCESSES = 1024  # processes and threads of a user


def main() -> None:
    """The program `scenegen`: run it and exit with its status."""
    # Plugins of other packages have nothing to say about scene files; to look for them takes as long as a small spec.
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "1")
    if not _may_start_many():
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # it interrupts the program if it cannot start its threads
    os.environ["PYTHONSAFEPATH"] = "1"  # Pythons that libraries start import nothing from the working folder
    try:
        # Loading takes a moment, in which Ctrl-C must not show a traceback either.
        from scenegen.processes.process import keep_memory, raise_gc_threshold

        raise_gc_threshold()
        keep_memory()
        from scenegen.cli.app import run

        status = run(sys.argv[1:])
    except KeyboardInterrupt:
        status = 130
    gc.freeze()  # at the end Python would look at all objects once more: a tenth of a second
    sys.exit(status)


def _may_start_many() -> bool:
    """Whether the user may have many processes and threads at a time."""
    try:
        import resource
    except ImportError:  # Windows
        return True
    most = resource.getrlimit(resource.RLIMIT_NPROC)[0]
    return most == resource.RLIM_INFINITY or most >= FEW_PROCESSES
