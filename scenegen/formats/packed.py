"""The bytes of a file that is packed in parts, and their hash."""

from __future__ import annotations

import hashlib
import io
from collections import deque
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any, Protocol

AHEAD = 8  # parts, of 4 MB in files of scenes, that may wait for a slow disk


class Sink(Protocol):
    """Takes the parts of a file."""

    def write(self, part: bytes | memoryview, /) -> object: ...


class Parts:
    """Keeps the parts of a file as they are: nothing is moved when it grows."""

    def __init__(self) -> None:
        self.parts: list[bytes | memoryview] = []

    def write(self, part: bytes | memoryview) -> None:
        self.parts.append(part)


class Packed(io.RawIOBase):
    """A file to write to that passes its parts on to a sink; its hash is known with its last byte. `beside`: a thread
    of its own does both, at most AHEAD parts behind, and is waited for at the end. What the sink raises is raised by a
    later `write`, or then."""

    def __init__(self, sink: Sink, *, beside: bool = False) -> None:
        self.size = 0
        self._sink, self._hash = sink, hashlib.sha256()
        self._thread = ThreadPoolExecutor(1) if beside else None
        self._behind: deque[Future[None]] = deque()  # parts that the thread has been given, in order

    @property
    def sha256(self) -> str:
        """Of all parts so far, once the sink has them. Raises what the sink raises."""
        self._wait(0)
        return self._hash.hexdigest()

    def writable(self) -> bool:
        return True

    def tell(self) -> int:
        return self.size

    def write(self, data: Any) -> int:
        part = bytes(data)  # no copy of bytes
        self.size += len(part)
        if self._thread is None:
            self._pass(part)
        else:
            self._behind.append(self._thread.submit(self._pass, part))
            self._wait(AHEAD)
        return len(part)

    def close(self) -> None:
        """The thread has nothing left to do after this."""
        if self._thread is not None:
            self._thread.shutdown(cancel_futures=True)
        super().close()

    def _pass(self, part: bytes) -> None:
        self._sink.write(part)
        self._hash.update(part)

    def _wait(self, most: int) -> None:
        """Until the thread is at most so many parts behind."""
        while len(self._behind) > most:
            self._behind.popleft().result()
