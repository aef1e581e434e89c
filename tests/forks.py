"""Worker processes of pools, forked from one process that has numpy, pybullet and the samplers loaded: starting Python
and importing them takes half a second of CPU each time, and the tests start hundreds. What runs in them is the same.

Tests of the processes themselves (`REAL` in tests/conftest.py, and whatever starts a program) start real ones.
"""

from __future__ import annotations

import contextlib
import gc
import importlib
import json
import os
import signal
import socket
import struct
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import IO, Any

LOADED = ("pybullet", "scenegen.processes.process", "scenegen.sampling.engine.writer", "scenegen.sampling.plans")
LOADED += ("scenegen.worlds.physics.settling", "scenegen.pictures.render.painter", "scenegen.pictures.render.worker")
NUMBER = struct.Struct("<q")
LARGEST = 1 << 20  # bytes of a request: the environment
PIPE = subprocess.PIPE


class Server:
    """The process that forks; it starts with the first fork."""

    def __init__(self) -> None:
        self._control: socket.socket | None = None
        self._process: subprocess.Popen[bytes] | None = None

    @property
    def pid(self) -> int | None:
        """None before the first fork."""
        return None if self._process is None else self._process.pid

    def send(self, request: Mapping[str, Any], files: Sequence[int]) -> None:
        """Ask for a fork. If the server has died, it is started once more."""
        try:
            self._send(request, files)
        except OSError:
            self._control = None
            self._send(request, files)

    def _send(self, request: Mapping[str, Any], files: Sequence[int]) -> None:
        if self._control is None:
            self._control, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
            for one in (self._control, theirs):
                one.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, LARGEST)
            command = [sys.executable, __file__, str(theirs.fileno())]
            silent = subprocess.DEVNULL  # pybullet says when it was built
            path = os.pathsep.join(filter(None, map(str, sys.path)))
            self._process = subprocess.Popen(
                command,
                pass_fds=[theirs.fileno()],
                stdin=silent,
                stdout=silent,
                stderr=silent,
                env={**os.environ, "PYTHONPATH": path, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
                start_new_session=True,
            )
            theirs.close()
        socket.send_fds(self._control, [json.dumps(request).encode()], files)

    def close(self) -> None:
        if self._control is not None and self._process is not None:
            self._control.close()
            self._process.wait(timeout=60)


class Forked:
    """As much of subprocess.Popen as scenegen.processes.process uses, for `python -c PROGRAM`."""

    def __init__(
        self, server: Server, command: Sequence[str], stderr: IO[bytes], env: Mapping[str, str], **_: object
    ) -> None:
        *_, option, program = command
        assert option == "-c"
        (their_input, ours), (output, theirs) = os.pipe(), os.pipe()
        self._status, status = socket.socketpair()
        request = {"program": program, "env": dict(env), "cwd": str(Path.cwd())}
        server.send(request, [their_input, theirs, stderr.fileno(), status.fileno()])
        for one in (their_input, theirs):
            os.close(one)
        status.close()
        self.stdin, self.stdout = open(ours, "wb", buffering=0), open(output, "rb", buffering=0)  # noqa: SIM115, PTH123
        self.returncode: int | None = None
        self.pid = NUMBER.unpack(self._status.recv(NUMBER.size))[0]

    def poll(self) -> int | None:
        if self.returncode is None:
            self._status.setblocking(False)
            with contextlib.suppress(BlockingIOError):
                self.wait()
                return self.returncode
            self._status.setblocking(True)
        return self.returncode

    def wait(self, timeout: float | None = None) -> int:
        if self.returncode is None:
            self.returncode = NUMBER.unpack(self._status.recv(NUMBER.size))[0]
            self._status.close()
        return self.returncode

    def send_signal(self, number: int) -> None:
        if self.returncode is None:
            with contextlib.suppress(ProcessLookupError):
                os.kill(self.pid, number)

    def kill(self) -> None:
        self.send_signal(signal.SIGKILL)


def serve(control: socket.socket) -> None:
    """Forks for each request: a process that waits, and below it the one that works."""
    while True:
        data, files, _, _ = socket.recv_fds(control, LARGEST, 4)
        if not data:
            return
        if not os.fork():
            control.close()
            _watch(json.loads(data), files)
        for one in files:
            os.close(one)
        with contextlib.suppress(ChildProcessError):
            while os.waitpid(-1, os.WNOHANG)[0]:
                pass


def _watch(request: dict[str, Any], files: list[int]) -> None:
    status = files.pop()
    worker = os.fork()
    if not worker:
        os.close(status)
        _work(request, files)
    for one in files:
        os.close(one)
    os.write(status, NUMBER.pack(worker))
    ended = os.waitstatus_to_exitcode(os.waitpid(worker, 0)[1])
    with contextlib.suppress(OSError):  # nobody wants to know
        os.write(status, NUMBER.pack(ended))
    os._exit(0)


def _work(request: dict[str, Any], files: list[int]) -> None:
    for number, one in enumerate(files):
        os.dup2(one, number)
        os.close(one)
    os.environ.clear()
    os.environ.update(request["env"])
    os.chdir(request["cwd"])
    sys.stdin, sys.stdout, sys.stderr = (open(number, "w" if number else "r") for number in range(3))  # noqa: SIM115, PTH123
    ended = 1
    try:
        exec(request["program"], {"__name__": "__main__"})  # noqa: S102 - a program of scenegen
        ended = 0
    except BaseException:
        sys.excepthook(*sys.exc_info())
    finally:
        with contextlib.suppress(OSError):
            sys.stdout.flush()
            sys.stderr.flush()
        os._exit(ended)


if __name__ == "__main__":
    sys.path.pop(0)  # the folder of the tests is no place to import from
    for name in LOADED:
        importlib.import_module(name)
    gc.freeze()  # what is loaded is looked at by no fork's collector, so its memory stays shared
    serve(socket.socket(fileno=int(sys.argv[1])))
