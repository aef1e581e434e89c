"""The work of one page, in lanes: each lane has one worker process and does one job at a time, and a newer job of a
lane ends the older one. What a person waits for is so never held up by what nobody waits for any more."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from typing import Any

from scenegen.view.limits import SECONDS
from scenegen.view.workers import Gone, Worker, Workers

GRACE = 0.03  # seconds that an older job still gets: cheaper than a new process, where it is about to end


class Lane:
    """`seconds` is the time that a job may take, which depends on its kind."""

    def __init__(self, workers: Workers) -> None:
        self._workers = workers
        self._worker: Worker | None = None
        self._task: asyncio.Task[None] | None = None
        self._turn = asyncio.Lock()
        self._newest = 0

    async def run(self, message: dict[str, Any], say: Callable[[str, bytes], None]) -> None:
        """Do a job, in the place of the one under way; `say` takes each answer. Raises Gone where it took too long or
        its process died, and asyncio.CancelledError where a newer one took its place."""
        self._newest += 1
        mine = self._newest
        if self._task is not None and not self._task.done():
            await asyncio.wait([self._task], timeout=GRACE)
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
        seconds = SECONDS[message["job"]]
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
            raise Gone(
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
