"""One worker process, seen from the language server: started with the first question, can be ended at any time."""

from __future__ import annotations

import asyncio
import contextlib
import json
from collections.abc import Callable
from typing import Any

from scenegen.lsp.answers import Question, Refusal
from scenegen.processes.process import command, environment

LONGEST = 1 << 30  # bytes of one answer


class Gone(Exception):  # noqa: N818 - also what happens to a worker that is not needed any more
    """The process ended before it had answered."""


class Process:
    """A worker process. It must be made, used and ended in the thread of the event loop. `idle` is called when it has
    answered all questions, and when it has ended."""

    def __init__(self, idle: Callable[[Process], None]) -> None:
        self._idle = idle
        self.revision = -1  # of the text that it has
        self.ended = False
        self.under_way: dict[int, asyncio.Future[bytes]] = {}  # questions that it has not answered, the oldest first
        self._number = 0
        self._process: asyncio.subprocess.Process | None = None
        self._unsent: list[bytes] = []
        self._task = asyncio.get_running_loop().create_task(self._live())

    def tell(self, message: dict[str, Any]) -> None:
        """Give it a new text."""
        self.revision = message["revision"]
        self._send(message)

    def ask(self, question: Question) -> asyncio.Future[bytes]:
        """Its answer to a question about that text, the bytes of JSON. Raises Refusal, and Gone if it ends before."""
        self._number += 1
        future: asyncio.Future[bytes] = asyncio.get_running_loop().create_future()
        self.under_way[self._number] = future
        place = {"line": question.line, "character": question.character, "name": question.name}
        self._send({"ask": self._number, "revision": self.revision, "feature": question.feature, **place})
        return future

    def end(self) -> None:
        """End it, whatever it is doing."""
        self.ended = True
        if self._process is not None:
            with contextlib.suppress(ProcessLookupError):
                self._process.kill()
        self._abandon("ended")

    def _send(self, message: dict[str, Any]) -> None:
        line = json.dumps(message).encode() + b"\n"
        if self._process is None:
            self._unsent.append(line)
        elif self._process.stdin is not None:
            self._process.stdin.write(line)  # asyncio logs nothing where the process has died: `_live` notices

    async def _live(self) -> None:
        try:
            process = await asyncio.create_subprocess_exec(
                *command("scenegen.lsp.worker"),
                stdin=asyncio.subprocess.PIPE,
                stdout=asyncio.subprocess.PIPE,
                limit=LONGEST,
                env=environment(),
            )
        except (OSError, RuntimeError) as error:  # no more processes, files or threads
            self.ended = True
            self._abandon(f"cannot start: {getattr(error, 'strerror', None) or error}")
            return
        assert process.stdin is not None and process.stdout is not None
        self._process = process
        process.stdin.writelines(self._unsent)
        if self.ended:  # before it had begun
            process.kill()
        async for line in process.stdout:
            self._hear(line)
        status = await process.wait()
        self.ended = True
        self._abandon(f"was killed by signal {-status}" if status < 0 else f"ended with status {status}")

    def _hear(self, line: bytes) -> None:
        number, kind, told = line.rstrip(b"\n").split(b" ", 2)
        future = self.under_way.pop(int(number))
        if not self.under_way:
            self._idle(self)
        if future.done():  # cancelled by the client, or the text has changed
            return
        if kind == b"refused":
            future.set_exception(Refusal(json.loads(told)))
        else:
            future.set_result(told)

    def _abandon(self, how: str) -> None:
        waiting = [one for one in self.under_way.values() if not one.done()]
        self.under_way.clear()
        for future in waiting:
            future.set_exception(Gone(how))
        self._idle(self)
