"""Worker processes, and their pictures in scene order.

Workers are programs of their own, not multiprocessing children: those would run the caller's main module again, which
breaks a script without `if __name__ == "__main__"`, and forking a program that has loaded torch is not safe. A worker
also keeps pybullet, its banner and its memory out of the caller.
"""

from __future__ import annotations

import contextlib
import dataclasses
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Generator
from typing import IO, Any

import numpy as np
import numpy.typing as npt

from scenegen.errors import Diagnostic, ScenegenError
from scenegen.render.stage import Stage
from scenegen.render.worker import LENGTH

# An interrupt from the keyboard reaches the whole group: the parent answers it and ends its workers.
_PROGRAM = (
    "import json, signal, sys; signal.signal(signal.SIGINT, signal.SIG_IGN); job = json.loads(sys.stdin.readline());"
    " sys.path[:] = job['path']; from scenegen.render.worker import main; main(job)"
)
_SINGLE = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")


class _Worker:
    """One process. Its standard error, pybullet's chatter included, goes to a file that is read only if it fails."""

    def __init__(self, job: dict[str, Any]) -> None:
        self.errors: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115 - closed in `end`
        try:
            self.process = subprocess.Popen(
                [sys.executable, "-c", _PROGRAM],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self.errors,
                env={**os.environ, **_SINGLE},
            )
        except OSError as error:
            self.errors.close()
            raise ScenegenError(Diagnostic(f"cannot start a process that draws: {error.strerror}")) from error
        assert self.process.stdin is not None and self.process.stdout is not None
        self.output = self.process.stdout
        # A worker that died at once is noticed, with its reason, when its first picture does not come.
        with contextlib.suppress(OSError), self.process.stdin as job_input:
            job_input.write(json.dumps(job).encode() + b"\n")

    def picture(self) -> bytes:
        head = self.output.read(LENGTH.size)
        data = self.output.read(LENGTH.unpack(head)[0]) if len(head) == LENGTH.size else b""
        if not data or len(data) < LENGTH.unpack(head)[0]:
            raise self._failure()
        return data

    def _failure(self) -> ScenegenError:
        status = self.process.wait()
        self.errors.seek(0)
        said = self.errors.read().decode(errors="replace").strip().splitlines()
        return ScenegenError(
            Diagnostic(
                f"a process that draws ended early (exit status {status})",
                help="was there enough memory? try a smaller size or fewer workers" if status < 0 else "",
                note=said[-1] if said else "",
            )
        )

    def end(self) -> None:
        self.process.kill()
        self.output.close()
        self.process.wait()
        self.errors.close()


def draw(
    stage: Stage, poses: npt.NDArray[np.float64], views: tuple[str, ...], size: tuple[int, int], workers: int
) -> Generator[dict[str, bytes], None, None]:
    """View -> PNG file of every scene, in order; `poses` is (scenes, objects, 3). The same bytes for any `workers`.

    Close the generator to end the processes early. Raises ScenegenError where one of them fails.
    """
    common = {"path": sys.path, "stage": dataclasses.asdict(stage), "views": views, "size": size}
    crew: list[_Worker] = []
    try:
        for number in range(workers):
            crew.append(_Worker({**common, "poses": poses[number::workers].tolist()}))
        for scene in range(len(poses)):
            worker = crew[scene % workers]
            yield {view: worker.picture() for view in views}
    finally:
        for worker in crew:
            worker.end()
