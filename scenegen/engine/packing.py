"""A file that a thread packs while its scenes are still being drawn: little of it is left after the last one."""

from __future__ import annotations

import contextlib
import queue
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, ThreadPoolExecutor
from typing import Generic, TypeVar

from scenegen.formats.blocks import Block

T = TypeVar("T")

AHEAD = 1 << 26  # bytes of blocks that wait to be packed
WAIT = 0.5  # seconds after which a thread that waits looks whether all is over


class Room:
    """For blocks that wait: at most AHEAD bytes, or a single block."""

    def __init__(self) -> None:
        self._taken = 0
        self._changed = threading.Condition()

    def take(self, size: int) -> bool:
        """Whether there is room for so many bytes; waits for it for a moment."""
        with self._changed:
            if not self._changed.wait_for(lambda: not self._taken or self._taken + size <= AHEAD, WAIT):
                return False
            self._taken += size
            return True

    def leave(self, size: int) -> None:
        with self._changed:
            self._taken -= size
            self._changed.notify_all()


class Packing(Generic[T]):
    """`work` gets the blocks in a thread, as they are added. Several can share the room for those that wait."""

    def __init__(self, threads: ThreadPoolExecutor, room: Room, work: Callable[[Iterator[Block]], T]) -> None:
        self._room = room
        self._blocks: queue.SimpleQueue[Block | None] = queue.SimpleQueue()
        self._current: Block | None = None  # is being packed
        self._over = threading.Event()  # by an error, or by giving up
        self._result = threads.submit(self._run, work)

    def add(self, block: Block) -> None:
        """One more block. Raises what the work has raised."""
        while not self._over.is_set():
            if self._room.take(_size(block)):
                self._blocks.put(block)
                break
        if self._over.is_set():  # it may have ended since
            self._empty()
        if self._result.done():  # before its last block: it has failed
            self._result.result()

    def finish(self) -> None:
        """There are no more blocks."""
        self._blocks.put(None)

    @property
    def done(self) -> bool:
        return self._result.done()

    def result(self) -> T:
        """What the work returns, once that is known. Raises what it raises."""
        return self._result.result()

    def give_up(self) -> None:
        """The work is not to be completed: its iterator of blocks raises CancelledError."""
        self._over.set()
        self._result.cancel()

    def _run(self, work: Callable[[Iterator[Block]], T]) -> T:
        """Runs in the thread."""
        try:
            return work(self._added())
        finally:
            self._over.set()
            self._leave(self._current)
            self._empty()

    def _added(self) -> Iterator[Block]:
        while True:
            try:
                block = self._blocks.get(timeout=WAIT)
            except queue.Empty:
                if self._over.is_set():
                    raise CancelledError from None
                continue
            if block is None:
                return
            self._current = block
            yield block
            self._current = None
            self._leave(block)

    def _empty(self) -> None:
        """Blocks that nobody will take leave their room to those of others."""
        with contextlib.suppress(queue.Empty):
            while True:
                self._leave(self._blocks.get_nowait())

    def _leave(self, block: Block | None) -> None:
        if block is not None:
            self._room.leave(_size(block))


def _size(block: Block) -> int:
    return block.rows.nbytes + block.phi.nbytes
