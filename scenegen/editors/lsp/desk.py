"""The open documents of one client, and the few worker processes that they share.

A document that takes long to check does not slow down the event loop, and an obsolete check is ended with its process.
A process has one document at a time, and keeps it until another one needs the process. Where all are at work, the
document that was edited or asked about last comes first; what was used before it gives way. All methods run in the
thread of the event loop.
"""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import json
import logging
import re
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from lsprotocol import types
from pygls.exceptions import JsonRpcContentModified, JsonRpcException
from pygls.uris import to_fs_path

from scenegen.editors.lsp.answers import Question, RequestRefused, failure
from scenegen.processes.process import command, environment

# --------------------------------------------------------------------------------------------------------------------
# One worker process, seen from the language server: started with the first question, can be ended at any time.


LONGEST = 1 << 30  # bytes of one answer


class LanguageProcessEnded(Exception):  # noqa: N818 - also what happens to a worker that is not needed any more
    """The process ended before it had answered."""


class LanguageProcess:
    """A worker process. It must be made, used and ended in the thread of the event loop. `idle` is called when it has
    answered all questions, and when it has ended."""

    def __init__(self, idle: Callable[[LanguageProcess], None]) -> None:
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
        """Its answer to a question about that text, the bytes of JSON. Raises RequestRefused, and LanguageProcessEnded
        if it ends before."""
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
                *command("scenegen.editors.lsp.worker"),
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
            future.set_exception(RequestRefused(json.loads(told)))
        else:
            future.set_result(told)

    def _abandon(self, how: str) -> None:
        waiting = [one for one in self.under_way.values() if not one.done()]
        self.under_way.clear()
        for future in waiting:
            future.set_exception(LanguageProcessEnded(how))
        self._idle(self)


PAUSE, LONGEST_PAUSE = 0.05, 1.0  # seconds without a further change after which a text is checked
# seconds for which work on an old text may continue, or twice the last check's: a new process also costs time
GRACE = 1.0
MOST = 4  # worker processes
LOG = logging.getLogger("scenegen.editors.lsp")

NOTHING = b"null"

_IMPORT = re.compile(r'\bimport\s*"')


class RequestFailed(JsonRpcException):
    """A client's request cannot be fulfilled, and the answer says why: not a failure of the server."""

    CODE = types.LSPErrorCodes.RequestFailed.value


@dataclass(eq=False, slots=True)
class OpenDocument:
    """A document that the client has open. `revision` counts its changes and those of what it may import."""

    uri: str
    path: Path | None
    text: str
    version: int | None
    revision: int = 0
    process: LanguageProcess | None = None
    pending: set[asyncio.Future[bytes]] = field(default_factory=set)  # answers about this revision
    check: asyncio.Task[None] | None = None
    began: float = 0.0  # when a process was last given a question about it
    took: float = 0.0  # seconds of the last check
    used: int = 0  # the higher, the later it was edited or asked about


class DiagnosticsService:
    """`publish` sends the diagnostics of a document; nothing outside `root` is read (default: each file's folder)."""

    def __init__(self, publish: Callable[[str, int | None, bytes], None], root: Path | None = None) -> None:
        self.encoding = "utf-16"
        self._publish = publish
        self._root = root
        self._open: dict[str, OpenDocument] = {}
        self._clock = itertools.count(1)
        self._processes: dict[LanguageProcess, OpenDocument] = {}  # with the document that each has
        self._waiting: dict[asyncio.Future[None], OpenDocument] = {}  # for a process

    # ---- notifications

    def opened(self, uri: str, text: str, version: int | None) -> None:
        """A text was opened, or has changed: what was under way for the old one is cancelled, the new one checked."""
        one = self._open.get(uri)
        known = one is not None
        if one is None:
            one = self._open[uri] = OpenDocument(uri, _path(uri), text, version)
        one.text, one.version, one.used = text, version, next(self._clock)
        self._revise(one)
        if known or not _is_saved(one):
            self._revise_importers(one)

    def saved(self, uri: str) -> None:
        """Files that no editor has open may have changed as well."""
        if uri in self._open:
            self._revise(self._open[uri])

    def closed(self, uri: str) -> None:
        one = self._open.pop(uri, None)
        if one is None:
            return
        self._cancel(one)
        if one.process is not None and one.process.under_way:
            one.process.end()
        self._publish(uri, None, b"[]")
        self._revise_importers(one)

    def close(self) -> None:
        """End every process."""
        for process in list(self._processes):
            process.end()

    # ---- requests

    async def ask(self, uri: str, question: Question) -> bytes:
        """The answer about an open document as the bytes of JSON, null for one that is not open.

        Raises JsonRpcException: the text has changed meanwhile, the request is refused, or its process died.
        """
        one = self._open.get(uri)
        if one is None:
            return NOTHING
        one.used = next(self._clock)
        try:
            return await self._ask(one, question)
        except RequestRefused as reason:
            raise RequestFailed(str(reason)) from None
        except LanguageProcessEnded as how:
            raise RequestFailed(f"the process that analyses this document {how}") from None

    async def _ask(self, one: OpenDocument, question: Question) -> bytes:
        while True:
            process = await self._process(one)
            one.began = asyncio.get_running_loop().time()
            future = process.ask(question)
            one.pending.add(future)
            try:
                return await future
            except LanguageProcessEnded:
                if one.process is process:  # it died by itself, and would do so again
                    one.process = None
                    raise
            finally:
                one.pending.discard(future)

    async def _process(self, one: OpenDocument) -> LanguageProcess:
        """The process of a document, which has its newest text; waits for one."""
        while (process := self._free(one)) is None:
            turn = asyncio.get_running_loop().create_future()
            self._waiting[turn] = one
            try:
                await asyncio.wait_for(turn, GRACE)
            except TimeoutError:
                self._make_way(one)
            finally:
                del self._waiting[turn]
        if process.revision != one.revision:
            imports = _IMPORT.search(one.text) is not None
            texts = {str(other.path): other.text for other in self._open.values() if other.path is not None}
            message = {"text": one.text, "revision": one.revision, "uri": one.uri, "encoding": self.encoding}
            message |= {"path": _written(one.path), "root": _written(self._root), "open": texts if imports else {}}
            process.tell(message)
        return process

    def _free(self, one: OpenDocument) -> LanguageProcess | None:
        """The process that a document has, else the one that was idle for longest, or a new one."""
        if one.process is not None and not one.process.ended:
            return one.process
        idle = [process for process in self._processes if not process.under_way]
        if idle and len(self._processes) >= MOST:
            one.process = min(idle, key=lambda process: self._processes[process].used)
            self._processes[one.process].process = None
            one.process.revision = -1
        elif len(self._processes) < MOST:
            one.process = LanguageProcess(self._turn)
        else:
            return None
        self._processes[one.process] = one
        return one.process

    def _turn(self, process: LanguageProcess) -> None:
        """A process has nothing more to do, or has ended: the first that waits gets it, or a new one."""
        if process.ended:
            self._processes.pop(process, None)
        turns = [turn for turn in self._waiting if not turn.done()]
        if turns:
            max(turns, key=lambda turn: self._waiting[turn].used).set_result(None)

    def _make_way(self, one: OpenDocument) -> None:
        """End the process of the document that was used longest ago, if that is longer ago than for the first of those
        that wait. It is asked again when its turn comes."""
        first = max(waiting.used for waiting in self._waiting.values())
        for process, other in sorted(self._processes.items(), key=lambda held: held[1].used)[:1]:
            if other.used < one.used == first:
                other.process = None
                process.end()

    # ---- changes

    def _revise_importers(self, changed: OpenDocument) -> None:
        for other in self._open.values():
            if other is not changed and _IMPORT.search(other.text) is not None:
                self._revise(other)

    def _revise(self, one: OpenDocument) -> None:
        one.revision += 1
        self._cancel(one)
        if one.process is not None and one.process.under_way:
            oldest = next(iter(one.process.under_way))
            grace = max(GRACE, 2.0 * one.took)
            asyncio.get_running_loop().call_later(grace, self._break_off, one, one.process, oldest)
        one.check = asyncio.get_running_loop().create_task(self._check(one))

    def _cancel(self, one: OpenDocument) -> None:
        if one.check is not None:
            one.check.cancel()
        for future in one.pending:
            if not future.done():
                future.set_exception(JsonRpcContentModified("the text has changed"))

    def _break_off(self, one: OpenDocument, process: LanguageProcess, question: int) -> None:
        """End a process that still works on a text that has changed."""
        if one.process is process and question in process.under_way:
            one.process = None  # questions about the new text go to another one
            process.end()

    async def _check(self, one: OpenDocument) -> None:
        """Send the diagnostics of a text, unless it changes soon: the longer a check takes, the later it begins."""
        await asyncio.sleep(min(max(PAUSE, one.took / 2.0), LONGEST_PAUSE))
        try:
            found = await self._ask(one, Question("diagnostics"))
        except LanguageProcessEnded as how:
            LOG.error("the process that analyses %s %s", one.uri, how)
            found = json.dumps(failure(f"the process that analyses this document {how}")).encode()
        one.took = asyncio.get_running_loop().time() - one.began
        self._publish(one.uri, one.version, found)


def _path(uri: str) -> Path | None:
    """The file of a URI, None if there is none: for unsaved texts and invalid file names."""
    try:
        found = to_fs_path(uri) if uri.startswith("file:") else None
        return Path(found).resolve() if found else None
    except (OSError, RuntimeError, ValueError):  # a NUL, a circle of links, half of a character
        return None


def _is_saved(one: OpenDocument) -> bool:
    """Whether the text is that of its file, as when an editor opens it."""
    try:
        return one.path is not None and one.path.read_text(encoding="utf-8") == one.text
    except (OSError, ValueError):
        return False


def _written(path: Path | None) -> str | None:
    return None if path is None else str(path)
