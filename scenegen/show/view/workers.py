"""Worker processes as the server sees them: forked within milliseconds, ended at any time.

All of it runs in the thread of the event loop.
"""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import socket
from collections.abc import AsyncIterator
from typing import Any

from scenegen.processes.process import cannot_start, command, environment
from scenegen.show.view.forker import END, FORK, ORDER
from scenegen.show.view.limits import MAX_WORKERS
from scenegen.show.view.worker import LARGEST, SIZE, packed


class PageWorkerEnded(Exception):  # noqa: N818 - also what happens to a worker that is not needed any more
    """The worker ended before it had answered."""


class TooManyWorkers(Exception):  # noqa: N818 - the client learns why: no failure
    """There are as many workers as there may be."""


class Workers:
    """All worker processes of one server."""

    def __init__(self) -> None:
        self._control: socket.socket | None = None
        self._process: asyncio.subprocess.Process | None = None
        self._numbers = itertools.count()
        self._starting = asyncio.Lock()
        self.alive: set[PageWorker] = set()

    async def start(self) -> None:
        """Start the program that workers are forked from, unless it runs. Takes about a second. Raises
        ScenegenError if it cannot start."""
        async with self._starting:
            if self._process is not None and self._process.returncode is None:
                return
            ours, theirs = socket.socketpair()
            try:
                self._process = await asyncio.create_subprocess_exec(
                    *command("scenegen.show.view.forker"), stdin=theirs.fileno(), env=environment()
                )
            except (OSError, RuntimeError) as error:  # no more files, processes or threads
                ours.close()
                raise cannot_start("a worker process", error) from error
            finally:
                theirs.close()
            ours.setblocking(False)
            if not await asyncio.get_running_loop().sock_recv(ours, 1):
                raise PageWorkerEnded("the program that workers are forked from ended")
            ours.setblocking(True)
            self._control = ours

    async def worker(self) -> PageWorker:
        """A new worker process. Raises TooManyWorkers."""
        if len(self.alive) >= MAX_WORKERS:
            raise TooManyWorkers("this server has as many requests under way as it takes; try again in a moment")
        await self.start()
        assert self._control is not None
        ours, theirs = socket.socketpair()
        number = next(self._numbers)
        try:
            socket.send_fds(self._control, [ORDER.pack(FORK, number)], [theirs.fileno()])
        except OSError as error:
            ours.close()
            raise PageWorkerEnded("the program that workers are forked from ended") from error
        finally:
            theirs.close()
        reader, writer = await asyncio.open_unix_connection(sock=ours, limit=1 << 20)
        worker = PageWorker(self, number, reader, writer)
        self.alive.add(worker)
        return worker

    def end(self, worker: PageWorker) -> None:
        """End a worker, whatever it is doing."""
        self.alive.discard(worker)
        if self._control is not None:
            with contextlib.suppress(OSError):
                self._control.sendall(ORDER.pack(END, worker.number))

    async def close(self) -> None:
        """End everything."""
        for worker in list(self.alive):
            worker.end()
        if self._control is not None:
            self._control.close()
        if self._process is not None:
            try:
                await asyncio.wait_for(self._process.wait(), 2.0)
            except TimeoutError:
                self._process.kill()


class PageWorker:
    """One worker process, which does one job at a time."""

    def __init__(
        self, workers: Workers, number: int, reader: asyncio.StreamReader, writer: asyncio.StreamWriter
    ) -> None:
        self.number = number
        self.ended = False
        self._workers, self._reader, self._writer = workers, reader, writer

    async def do(self, message: dict[str, Any]) -> AsyncIterator[tuple[str, bytes]]:
        """The answers to a job: ("part", JSON) any number of times, then one of another kind. Raises
        PageWorkerEnded."""
        try:
            self._writer.write(packed(message))
            await self._writer.drain()
            while True:
                (size,) = SIZE.unpack(await self._reader.readexactly(SIZE.size))
                if size > LARGEST:
                    raise PageWorkerEnded("it sent more than it may")
                body = await self._reader.readexactly(size)
                kind = body[2 : body.index(b'"', 2)].decode()
                yield kind, body[len(kind) + 4 : -1]
                if kind != "part":
                    return
        except (asyncio.IncompleteReadError, ConnectionError, OSError) as error:
            self.end()
            raise PageWorkerEnded(
                "the process that worked on this is gone, perhaps for lack of memory: change the spec, or try again"
            ) from error

    def end(self) -> None:
        if not self.ended:
            self.ended = True
            self._workers.end(self)
            self._writer.close()
