"""The bytes of a file that is packed in memory, to be written as a whole."""

from __future__ import annotations

import hashlib
import io
from typing import Any


class Packed(io.RawIOBase):
    """A file to write to that keeps the parts in which it was written: nothing is moved when it grows, and its hash is
    known with its last byte."""

    def __init__(self) -> None:
        self.parts: list[bytes] = []
        self.size = 0
        self._hash = hashlib.sha256()

    @property
    def sha256(self) -> str:
        return self._hash.hexdigest()

    def writable(self) -> bool:
        return True

    def tell(self) -> int:
        return self.size

    def write(self, data: Any) -> int:
        part = bytes(data)  # no copy of bytes
        self.parts.append(part)
        self.size += len(part)
        self._hash.update(part)
        return len(part)
