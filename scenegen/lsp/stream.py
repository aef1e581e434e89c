"""The frames of a stream: headers with a `Content-Length`, an empty line, and a body of so many bytes.

If a header is wrong, the end of its body is unknown. The reader reports this once and continues at the next valid
header: the message is lost, the session is not.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import BinaryIO

MOST = 1 << 28  # bytes of one body
LINE = 1 << 26  # bytes of one line of a header, or of what is skipped

_LENGTH = re.compile(rb"Content-Length:[ \t]*(\d{1,9})[ \t]*\r?\n", re.IGNORECASE)
_HEADER = re.compile(rb"[A-Za-z][A-Za-z-]*:[^\r\n]*\r?\n")


class Fault(ValueError):  # noqa: N818 - is not raised but stands among the frames
    """Bytes that are not a frame, and the reason."""


def frames(stream: BinaryIO) -> Iterator[bytes | Fault]:
    """The bodies of a stream in order, and a Fault in place of unreadable ones; ends with the stream."""
    lost = False  # looking for a header, after a fault
    length = -1
    while line := stream.readline(LINE):
        wanted = (_LENGTH.search if lost else _LENGTH.fullmatch)(line)
        if wanted is not None and wanted.end() == len(line) and int(wanted[1]) <= MOST:
            length, lost = int(wanted[1]), False
        elif line in (b"\r\n", b"\n"):
            if length < 0:
                continue  # blank lines between messages do no harm
            body = stream.read(length)
            if len(body) < length:
                return
            length = -1
            yield body
        elif not lost and (_HEADER.fullmatch(line) is None or b"content-length:" in line.lower()):
            tail = _LENGTH.search(line)
            length = int(tail[1]) if tail is not None and int(tail[1]) <= MOST else -1
            lost = length < 0
            yield Fault(f"this is no header of a message: {line[:60].decode(errors='replace').strip()!r}")
