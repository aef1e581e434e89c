"""What takes long to find out about a text, asked of other processes: such a process can be ended at any time.

A process takes questions as lines of JSON, one after the other, and answers each with a line. It keeps the last text.
The text comes with every question, so that any process can answer it.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import os
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any

from scenegen.editors.lsp.answers import Page, Question, answer
from scenegen.editors.lsp.document import Document
from scenegen.processes.process import command, environment

PROCESSES = 4  # processes, and questions at a time
MAX_QUESTION_SECONDS = 60.0  # seconds for one question
LATE_ANSWER_SECONDS = 1.0  # that a question nobody waits for may still take: a new process costs time, too
MAX_ANSWER_BYTES = 1 << 30  # bytes of one answer


class AnalysisEnded(Exception):  # noqa: N818 - a text can take too long, or more memory than there is
    """There is no answer, and why: completes "the process that analyses this document ..."."""


class AnalysisProcesses:
    """The processes of one language server, each started when it is needed. All methods run in the event loop."""

    def __init__(self) -> None:
        self._turns = asyncio.Semaphore(PROCESSES)
        self._alive: list[_AnalysisProcess] = []  # the one that was idle for longest first

    async def ask(self, text: dict[str, Any], question: Question) -> Any:
        """The answer to a question about a text (the fields of `_page`). Raises AnalysisEnded. To stop waiting
        ends the process, unless it is about to answer."""
        async with self._turns:
            process = self._acquire(text["uri"])
            asking = asyncio.ensure_future(process.ask({"text": text, "question": asdict(question)}))
            try:
                await asyncio.wait([asking], timeout=MAX_QUESTION_SECONDS)
            except asyncio.CancelledError:
                await asyncio.wait([asking], timeout=LATE_ANSWER_SECONDS)
                raise
            finally:
                process.busy = False
                if not asking.done() or asking.cancelled() or asking.exception() is not None:
                    asking.cancel()
                    self._alive.remove(process)
                    process.end()
            if asking.cancelled() or not asking.done():
                raise AnalysisEnded(f"was ended after {MAX_QUESTION_SECONDS:g} s")
            return asking.result()

    def _acquire(self, uri: str) -> _AnalysisProcess:
        """An idle process: the one that has had the document, else a new one, or the one that was idle for longest."""
        idle = [one for one in self._alive if not one.busy]
        found = next((one for one in idle if one.uri == uri), None)
        if found is not None:
            self._alive.remove(found)
        else:
            found = _AnalysisProcess() if len(self._alive) < PROCESSES else self._alive.pop(self._alive.index(idle[0]))
        self._alive.append(found)
        found.busy, found.uri = True, uri
        return found

    def close(self) -> None:
        """End all processes."""
        for process in self._alive:
            process.end()


class _AnalysisProcess:
    def __init__(self) -> None:
        self.busy = False
        self.uri = ""  # of the text that it has
        self._process: asyncio.subprocess.Process | None = None

    async def ask(self, message: dict[str, Any]) -> Any:
        if self._process is None:
            pipe = asyncio.subprocess.PIPE
            try:
                self._process = await asyncio.create_subprocess_exec(
                    *command(__name__), stdin=pipe, stdout=pipe, limit=MAX_ANSWER_BYTES, env=environment()
                )
            except (OSError, RuntimeError) as error:  # no more processes, files or threads
                raise AnalysisEnded(f"cannot start: {getattr(error, 'strerror', None) or error}") from error
        assert self._process.stdin is not None and self._process.stdout is not None
        with contextlib.suppress(ConnectionError):  # it has died: there is no answer
            self._process.stdin.write(json.dumps(message).encode() + b"\n")
            await self._process.stdin.drain()
        line = await self._process.stdout.readline()
        if not line:
            status = await self._process.wait()
            raise AnalysisEnded(f"was killed by signal {-status}" if status < 0 else f"ended with status {status}")
        return json.loads(line)

    def end(self) -> None:
        """End it, whatever it is doing."""
        if self._process is not None:
            with contextlib.suppress(ProcessLookupError):
                self._process.kill()


def main() -> None:
    """Answer the questions of standard input until it ends."""
    logging.basicConfig(level=logging.WARNING, format="%(name)s: %(message)s")
    out = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # other output on standard output would break the protocol
    text, page = None, None
    for line in sys.stdin.buffer:
        message = json.loads(line)
        if page is None or message["text"] != text:
            text, page = message["text"], _page(**message["text"])
        with contextlib.suppress(OSError):  # the server has gone: standard input ends as well
            out.write(json.dumps(answer(page, Question(**message["question"]))).encode() + b"\n")
            out.flush()


def _page(uri: str, text: str, path: str | None, open_texts: dict[str, str], root: str | None, encoding: str) -> Page:
    texts = {Path(one): other for one, other in open_texts.items()}
    document = Document(text, None if path is None else Path(path), uri, texts, None if root is None else Path(root))
    return Page(document, uri, encoding)
