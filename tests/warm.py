"""Python programs, each in a fork of one process that has torch and the like loaded, which takes seconds of CPU."""

from __future__ import annotations

import atexit
import contextlib
import gc
import importlib
import json
import os
import runpy
import signal
import subprocess
import sys
import tempfile
import traceback
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

LOADED = (
    "torch._dynamo",
    "gymnasium",
    "pyarrow",
    "scenegen.cli.app",
    "scenegen.lang.checker",
    "scenegen.learn.training.loop",
)


class Warm:
    """run(["-m", "scenegen", "check", "x.spec"], cwd) is what `python -m scenegen check x.spec` does there; so are
    `-c TEXT` and a file. Programs run one after the other, and see nothing of each other."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[str] | None = None

    def run(
        self, words: Sequence[str | Path], cwd: Path, env: Mapping[str, str] | None = None, timeout: int = 240
    ) -> subprocess.CompletedProcess[str]:
        """Exit status, output and errors; `env` comes on top of this process's environment."""
        if self._process is None or self._process.poll() is not None:
            command = [sys.executable, __file__]
            pipe = subprocess.PIPE
            self._process = subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True, start_new_session=True)
        assert self._process.stdin is not None and self._process.stdout is not None
        with tempfile.TemporaryDirectory() as folder:
            files = [Path(folder, name) for name in ("out", "err")]
            request = {
                "words": [str(word) for word in words],
                "cwd": str(cwd),
                "env": {**os.environ, **(env or {})},
                "files": [str(path) for path in files],
                "timeout": timeout,
            }
            self._process.stdin.write(json.dumps(request) + "\n")
            self._process.stdin.flush()
            said = self._process.stdout.readline()
            assert said, f"the process that forks has ended, with {self._process.wait()}"
            status = int(said)
            out, err = (path.read_text(encoding="utf-8") for path in files)
        return subprocess.CompletedProcess(list(request["words"]), status, out, err)

    def close(self) -> None:
        if self._process is not None:
            self._process.communicate(timeout=60)


def serve() -> dict[str, Any] | None:
    """Forks for each line of standard input. Returns the request in the fork, and None in the end."""
    while line := sys.stdin.readline():
        if not (fork := os.fork()):
            return json.loads(line)
        print(os.waitstatus_to_exitcode(os.waitpid(fork, 0)[1]), flush=True)
    return None


def work(words: list[str], cwd: str, env: dict[str, str], files: list[str], timeout: int) -> None:
    """As a Python process of its own would, from standard streams to `sys.path`."""
    signal.alarm(timeout)
    nothing = os.open(os.devnull, os.O_RDONLY)
    for number, descriptor in enumerate((nothing, *(os.open(file, os.O_WRONLY | os.O_CREAT) for file in files))):
        os.dup2(descriptor, number)
    os.environ.clear()
    os.environ.update(env)
    os.chdir(cwd)
    kind, *rest = words
    if kind == "-c":
        sys.path[0] = ""
        sys.argv = ["-c", *rest[1:]]
        exec(compile(rest[0], "<string>", "exec"), {"__name__": "__main__"})  # noqa: S102 - a test's program
    elif kind == "-m":
        sys.path[0] = cwd
        sys.argv = rest
        runpy.run_module(rest[0], run_name="__main__", alter_sys=True)
    else:
        sys.path[0] = str(Path(kind).resolve().parent)
        sys.argv = words
        runpy.run_path(kind, run_name="__main__")


def leave(program: Callable[..., None], words: dict[str, Any]) -> None:
    """Ends this process as Python would, but without taking apart what is loaded, which takes a second."""
    status = 0
    try:
        program(**words)
    except SystemExit as end:
        status = end.code if isinstance(end.code, int) else 0 if end.code is None else 1
        if not isinstance(end.code, int | None):
            print(end.code, file=sys.stderr)
    except BaseException:
        traceback.print_exc()
        status = 1
    atexit._run_exitfuncs()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(status)


if __name__ == "__main__":
    sys.path[0] = ""  # the folder of the tests is no place to import from
    for name in LOADED:
        with contextlib.suppress(ImportError):
            importlib.import_module(name)
    gc.freeze()  # what is loaded is looked at by no fork's collector, so its memory stays shared
    if wanted := serve():
        leave(work, wanted)
