"""The bytes of a file that is packed in memory, to be written as a whole."""

from __future__ import annotations

import hashlib
import io
from concurrent.futures import ThreadPoolExecutor
from typing import Any


class Packed(io.RawIOBase):
    """A file to write to that keeps the parts in which it was written: nothing is moved when it grows, and its hash is
    known with its last byte. `beside`: the hash is computed by a thread of its own, and waited for at the end."""

    def __init__(self, *, beside: bool = False) -> None:
        self.parts: list[bytes] = []
        self.size = 0
        self._hash = hashlib.sha256()
        self._thread = ThreadPoolExecutor(1) if beside else None

    @property
    def sha256(self) -> str:
        """Of all parts; nothing can be written after that."""
        if self._thread is not None:
            self._thread.shutdown()
        return self._hash.hexdigest()

    def writable(self) -> bool:
        return True

    def tell(self) -> int:
        return self.size

    def write(self, data: Any) -> int:
        part = bytes(data)  # no copy of bytes
        self.parts.append(part)
        self.size += len(part)
        if self._thread is None:
            self._hash.update(part)
        else:
            self._thread.submit(self._hash.update, part)
        return len(part)
