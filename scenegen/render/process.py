"""Programs that work for this one: a job as a line of JSON on standard input, what they make on standard output.

Workers are programs of their own, not multiprocessing children: those would run the caller's main module again, which
breaks a script without `if __name__ == "__main__"`, and forking a program that has loaded torch is not safe. A worker
also keeps pybullet, its banner and its memory out of the caller.
"""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from typing import IO, Any

from scenegen.errors import Diagnostic, ScenegenError

# An interrupt from the keyboard reaches the whole group: the parent answers it and ends its workers.
_PROGRAM = (
    "import importlib, json, signal, sys; signal.signal(signal.SIGINT, signal.SIG_IGN);"
    " job = json.loads(sys.stdin.buffer.readline()); sys.path[:] = job['path'];"
    " importlib.import_module(job['program']).main(job)"
)
_SINGLE = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")


class Process:
    """Runs `main(job)` of the module `program`; `task` completes "a process that ..." in what people are told.

    Its standard error, pybullet's chatter included, goes to a file that is read only if it fails.
    """

    def __init__(self, program: str, job: Mapping[str, Any], task: str, help_: str) -> None:
        self._task, self._help = task, help_
        self._errors: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115 - closed in `end`
        try:
            self._process = subprocess.Popen(
                [sys.executable, "-c", _PROGRAM],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self._errors,
                env={**os.environ, **_SINGLE},
            )
        except OSError as error:
            self._errors.close()
            raise ScenegenError(Diagnostic(f"cannot start a process that {task}: {error.strerror}")) from error
        assert self._process.stdin is not None and self._process.stdout is not None
        self._input, self._output = self._process.stdin, self._process.stdout
        self.send(json.dumps({**job, "path": sys.path, "program": program}).encode() + b"\n")

    def send(self, data: bytes) -> None:
        """Give it something to read. One that has died is noticed, with its reason, when something is read from it."""
        with contextlib.suppress(OSError):
            self._input.write(data)
            self._input.flush()

    def read(self, size: int) -> bytes:
        """The next `size` bytes that it writes. Raises ScenegenError where they do not come."""
        data = self._output.read(size)
        if len(data) < size:
            raise self._failure()
        return data

    def end(self) -> None:
        """End it, whatever it is doing."""
        self._process.kill()
        for pipe in (self._input, self._output):
            with contextlib.suppress(OSError):  # what it has not read is of no use any more
                pipe.close()
        self._process.wait()
        self._errors.close()

    def _failure(self) -> ScenegenError:
        status = self._process.wait()
        self._errors.seek(0)
        said = self._errors.read().decode(errors="replace").strip().splitlines()
        return ScenegenError(
            Diagnostic(
                f"a process that {self._task} ended early (exit status {status})",
                help=f"was there enough memory? try {self._help}" if status < 0 else "",
                note=said[-1] if said else "",
            )
        )


def cores() -> int:
    """How many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
