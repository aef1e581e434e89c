"""The conversation with one page over its WebSocket, and the worker processes that work for it.

The page sends `{"id": 7, "job": "sample", ...}` and hears `{"id": 7, "part": ...}` any number of times, then `done`,
`refused` (what the user can mend), `failed`, or `ended` (a newer job of that kind took its place). `{"stop": "sample"}`
ends the job of that kind. Workers are forked within milliseconds (worker.py), and ended at any time. All of it runs in
the thread of the event loop.
"""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import json
import socket
from collections import defaultdict
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError
from starlette.websockets import WebSocket, WebSocketDisconnect

from scenegen.page.limits import JOB_SECONDS, MAX_PAGE_SCENES, MAX_PAGE_WORKERS, MAX_TEXT, MAX_WAITING
from scenegen.page.project import FileRefused, Folder
from scenegen.page.worker import END, FORK, MAX_MESSAGE_BYTES, WORKER_ORDER, dumps
from scenegen.processes.process import cannot_start, command, environment


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
                    *command("scenegen.page.worker"), stdin=theirs.fileno(), env=environment()
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
        if len(self.alive) >= MAX_PAGE_WORKERS:
            raise TooManyWorkers("this server has as many requests under way as it takes; try again in a moment")
        await self.start()
        assert self._control is not None
        ours, theirs = socket.socketpair()
        number = next(self._numbers)
        try:
            socket.send_fds(self._control, [WORKER_ORDER.pack(FORK, number)], [theirs.fileno()])
        except OSError as error:
            ours.close()
            raise PageWorkerEnded("the program that workers are forked from ended") from error
        finally:
            theirs.close()
        reader, writer = await asyncio.open_unix_connection(sock=ours, limit=MAX_MESSAGE_BYTES)
        worker = PageWorker(self, number, reader, writer)
        self.alive.add(worker)
        return worker

    def end(self, worker: PageWorker) -> None:
        """End a worker, whatever it is doing."""
        self.alive.discard(worker)
        if self._control is not None:
            with contextlib.suppress(OSError):
                self._control.sendall(WORKER_ORDER.pack(END, worker.number))

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
            self._writer.write(dumps(message) + b"\n")
            await self._writer.drain()
            while True:
                line = await self._reader.readuntil()
                kind = line[2 : line.index(b'"', 2)].decode()
                yield kind, line[len(kind) + 4 : -2]
                if kind != "part":
                    return
        except (asyncio.IncompleteReadError, asyncio.LimitOverrunError, OSError) as error:
            self.end()
            raise PageWorkerEnded(
                "the process that worked on this is gone, perhaps for lack of memory: change the spec, or try again"
            ) from error

    def end(self) -> None:
        if not self.ended:
            self.ended = True
            self._workers.end(self)
            self._writer.close()


OLD_JOB_SECONDS = 0.03  # seconds that an older job still gets: cheaper than a new process, where it is about to end


class Lane:
    """Work of one kind for one page, in a worker process, one job at a time. A newer job ends the older one: what a
    person waits for is not held up by what nobody waits for any more."""

    def __init__(self, workers: Workers) -> None:
        self._workers = workers
        self._worker: PageWorker | None = None
        self._task: asyncio.Task[None] | None = None
        self._turn = asyncio.Lock()
        self._newest = 0

    async def run(self, message: dict[str, Any], say: Callable[[str, bytes], None]) -> None:
        """Do a job, in the place of the one under way; `say` takes each answer. Raises PageWorkerEnded where it took
        too long or its process died, and asyncio.CancelledError where a newer one took its place."""
        self._newest += 1
        mine = self._newest
        if self._task is not None and not self._task.done():
            await asyncio.wait([self._task], timeout=OLD_JOB_SECONDS)
            if mine == self._newest and self._task is not None and not self._task.done():
                self._task.cancel()
        async with self._turn:
            if mine != self._newest:
                raise asyncio.CancelledError
            self._task = asyncio.ensure_future(self._do(message, say))
            try:
                await self._task
            finally:
                self._task = None

    async def _do(self, message: dict[str, Any], say: Callable[[str, bytes], None]) -> None:
        seconds = JOB_SECONDS[message["job"]]
        finished = False
        try:
            async with asyncio.timeout(seconds):
                if self._worker is None or self._worker.ended:
                    self._worker = await self._workers.worker()
                answers: AsyncIterator[tuple[str, bytes]] = self._worker.do(message)
                async for kind, value in answers:
                    say(kind, value)
            finished = True
        except TimeoutError:
            raise PageWorkerEnded(
                f"this takes more than {seconds:g} s, which is as long as it may take: make the spec smaller"
            ) from None
        finally:
            if not finished:
                self.close()

    def close(self) -> None:
        """End the worker; the lane can be used again."""
        if self._worker is not None:
            self._worker.end()
            self._worker = None

    def stop(self) -> None:
        """End the job under way, if there is one."""
        self._newest += 1
        if self._task is not None:
            self._task.cancel()  # its worker ends with it; one that has nothing to do stays


Name = Literal["check", "assist", "evaluate", "sample", "first", "spread", "range"]


class PageMessage(BaseModel):
    """What a page may send; which fields count depends on the job."""

    model_config = ConfigDict(extra="forbid", strict=True)

    id: int = Field(ge=0, le=1 << 53)
    job: Name
    text: str = ""
    path: str | None = None
    feature: str = Field("", max_length=20)
    line: int = Field(0, ge=0, le=10_000_000)
    character: int = Field(0, ge=0, le=10_000_000)
    poses: list[Any] = Field(default=[], max_length=MAX_PAGE_SCENES)
    on: list[Any] | None = Field(None, max_length=MAX_PAGE_SCENES)
    why: bool = False
    watch: bool = False
    have: list[str] | None = Field(None, max_length=2000)
    request: dict[str, Any] = Field(default={}, max_length=20)
    counts: dict[str, int] = Field(default={}, max_length=64)
    timeout: float | None = Field(None, gt=0, le=60)


class StopMessage(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True)

    stop: Name


class PageSession:
    """One page, as long as its WebSocket is open."""

    def __init__(self, socket: WebSocket, workers: Workers, folder: Folder, model: Path | None) -> None:
        self._socket, self._folder, self._model = socket, folder, model
        self._lanes: dict[str, Lane] = defaultdict(lambda: Lane(workers))
        self._tasks = set[asyncio.Task[None]]()
        self._out: asyncio.Queue[str] = asyncio.Queue(maxsize=4 * MAX_WAITING)
        self._left = False

    async def converse(self) -> None:
        """Serve the page until it goes; then free all that works for it."""
        sender = asyncio.ensure_future(self._send())
        try:
            while True:
                event = await self._socket.receive()
                if event["type"] == "websocket.disconnect":
                    return
                text = event.get("text")
                if text is None:
                    self._say('{"error":"send text, not bytes"}')
                    continue
                self._receive(text)
        except (WebSocketDisconnect, RuntimeError):  # dropped in the midst of a message
            return
        finally:
            sender.cancel()
            for task in list(self._tasks):
                task.cancel()
            for lane in self._lanes.values():
                lane.close()

    def _receive(self, text: str) -> None:
        try:
            data = json.loads(text)
            if isinstance(data, dict) and "stop" in data:
                self._lanes[StopMessage.model_validate(data).stop].stop()
                return
            message = PageMessage.model_validate(data)
        except (ValueError, RecursionError, ValidationError):
            number = _number(text)
            self._say(f'{{"id":{number},"failed":"this message is not one that the server knows"}}')
            return
        problem = self._problem(message)
        if problem:
            self._say(f'{{"id":{message.id},"failed":{json.dumps(problem)}}}')
            return
        task = asyncio.ensure_future(self._do(message))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    def _problem(self, message: PageMessage) -> str:
        if len(self._tasks) >= MAX_WAITING:
            return "too many messages wait for their turn; try again in a moment"
        if len(message.text.encode("utf-8", "replace")) > MAX_TEXT:
            return f"a spec on the page has at most {MAX_TEXT // 1024} kB"
        try:
            if message.path is not None:
                self._folder.inside(message.path)
        except FileRefused as reason:
            return str(reason)
        return ""

    async def _do(self, message: PageMessage) -> None:
        head = f'{{"id":{message.id},"'

        def say(kind: str, value: bytes) -> None:
            self._say(f'{head}{kind}":{value.decode()}}}')

        job = {
            **message.model_dump(exclude={"id"}),
            "root": str(self._folder.root),
            "model": None if self._model is None else str(self._model),
        }
        try:
            await self._lanes[message.job].run(job, say)
        except asyncio.CancelledError:
            self._say(f'{head}ended":null}}')
            raise
        except (TooManyWorkers, PageWorkerEnded) as reason:
            self._say(f'{head}failed":{json.dumps(str(reason))}}}')

    def _say(self, text: str) -> None:
        try:
            self._out.put_nowait(text)
        except asyncio.QueueFull:  # a page that does not read what it is sent: it opens another socket when it does
            if not self._left:
                self._left = True
                asyncio.ensure_future(self._leave())  # noqa: RUF006 - ends with the socket

    async def _leave(self) -> None:
        with contextlib.suppress(RuntimeError, WebSocketDisconnect):
            await self._socket.close(1013, "the page does not read what it is sent")

    async def _send(self) -> None:
        with contextlib.suppress(WebSocketDisconnect, RuntimeError):
            while True:
                await self._socket.send_text(await self._out.get())


def _number(text: str) -> int:
    """The id of a message that is wrong otherwise, as far as it can be told."""
    with contextlib.suppress(ValueError, RecursionError, AttributeError, TypeError):
        found = json.loads(text).get("id")
        return found if isinstance(found, int) and not isinstance(found, bool) and 0 <= found < 1 << 53 else -1
    return -1
