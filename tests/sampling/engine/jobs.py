"""Jobs for worker processes, in a module of their own that these can import. No torch: workers start in no time."""

from __future__ import annotations

import ctypes
import os
import signal
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from scenegen.errors import Kind, RequestError, Source, Span


@dataclass(frozen=True)
class Numbers:
    """Random rows (6, m), where m and how long it takes depend on the piece; and who made them.

    With a folder to meet in, nobody makes any before two processes are there: on a busy machine one may start late.
    """

    seed: int = 0
    slow: float = 0.0
    meet: str = ""

    def __call__(self, piece):
        if self.meet:
            (Path(self.meet) / str(os.getpid())).touch()
            end = time.monotonic() + 60.0
            while len(list(Path(self.meet).iterdir())) < 2 and time.monotonic() < end:
                time.sleep(0.01)
        source = np.random.default_rng([self.seed, piece])
        time.sleep(self.slow * source.random())
        return source.random((6, 100 + piece % 7)), os.getpid()


@dataclass(frozen=True)
class Large:
    """A result of `size` bytes."""

    size: int

    def __call__(self, piece):
        return np.full(self.size // 8, float(piece))


@dataclass(frozen=True)
class Fails:
    """Fails at one piece: in some way, as many times as there is no file yet to count them."""

    at: int
    how: str
    times: int
    folder: str

    def __call__(self, piece):
        if piece == self.at:
            before = len(list(Path(self.folder).iterdir()))
            if before < self.times:
                (Path(self.folder) / str(before)).touch()
                self.fail()
        return piece * piece

    def fail(self):
        if self.how == "diagnostic":
            raise RequestError(Kind("no-good", "no good", "this", "do that")(Span(Source("here", "text"), 1, 3)))
        if self.how == "odd":
            raise _OddError(1, 2)
        if self.how == "exit":
            os._exit(3)
        if self.how == "crash":
            ctypes.string_at(0)
        os.kill(os.getpid(), signal.SIGKILL)


class _OddError(Exception):
    """Pickles, but cannot be read back."""

    def __init__(self, one, two):
        super().__init__(one + two)


class Unloadable:
    def __call__(self, piece):
        return piece

    def __setstate__(self, state):
        raise RuntimeError("not today")

    def __getstate__(self):
        return {"a": 1}


@dataclass(frozen=True)
class Any_:  # noqa: N801
    """Arrays of any layout and type, none of them, nested."""

    def __call__(self, piece):
        grid = np.arange(60.0).reshape(5, 12)
        return [(grid[:, ::2], grid.T, np.empty((3, 0))), {"n": np.arange(5) > 2}, None, b"x" * 100][piece]


@dataclass(frozen=True)
class Picky:
    """Squares of numbers; refuses `bad`, and ends its process at `deadly`."""

    bad: int = -1
    deadly: int = -1

    def __call__(self, number):
        if number == self.deadly:
            os._exit(3)
        if number == self.bad:
            raise RequestError(Kind("no-good", "no good")())
        return number * number


@dataclass
class AfterOthers:
    """Returns the item; item 0 waits until so many others are done."""

    folder: str
    others: int

    def __call__(self, k: int) -> int:
        until = time.monotonic() + 30
        while k == 0 and len(list(Path(self.folder).iterdir())) < self.others:
            if time.monotonic() > until:
                raise AssertionError("the others wait, too")
            time.sleep(0.01)
        if k:
            (Path(self.folder) / str(k)).touch()
        return k
