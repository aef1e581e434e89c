"""The specs of the folder that was opened: listed, read and saved. Nothing outside it is touched."""

from __future__ import annotations

import hashlib
import json
import os
import stat
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from scenegen.resources import shipped_specs
from scenegen.scenes.files import write_whole
from scenegen.show.view.limits import MAX_FILES, MAX_TEXT

MOST_NAME = 255  # bytes of the name of a file or folder
MOST_DRAFTS = 200  # that are kept; the oldest go
DEPTH = 3  # folders below the opened one that are looked into


class FileRefused(Exception):  # noqa: N818 - the client learns why: no failure
    """What a page wants with a file cannot be done; `status` is that of HTTP."""

    def __init__(self, status: int, reason: str) -> None:
        super().__init__(reason)
        self.status = status


@dataclass(frozen=True, slots=True)
class Folder:
    """`root` is resolved: a path is inside it where it is so with all links followed."""

    root: Path

    def inside(self, path: str) -> Path:
        """The file of a path relative to the folder. Raises FileRefused for any other, and for what is no spec."""
        if not path.isprintable() or not 0 < len(path) <= 1000 or Path(path).is_absolute() or "\\" in path:
            raise FileRefused(400, "name a file of the opened folder by its path in there")
        try:
            found = (self.root / path).resolve()
        except (OSError, RuntimeError, ValueError):
            raise FileRefused(400, "this is no path of a file") from None
        if not found.is_relative_to(self.root):
            raise FileRefused(403, "this file lies outside the folder that was opened")
        if found.suffix.lower() != ".spec":
            raise FileRefused(400, "the page opens and saves files that end in .spec")
        parts = found.relative_to(self.root).parts
        if any(part.startswith(".") for part in parts):
            raise FileRefused(400, "the page opens no hidden files")
        if any(len(os.fsencode(part)) > MOST_NAME for part in parts):
            raise FileRefused(400, "this name is too long for a file")
        return found

    def relative(self, path: Path) -> str:
        return path.relative_to(self.root).as_posix()

    def specs(self) -> list[str]:
        """The specs of the folder and of those below it, hidden ones left out."""
        found: list[str] = []
        for at, folders, names in os.walk(self.root):
            here = Path(at)
            deep = len(here.relative_to(self.root).parts)
            folders[:] = sorted(one for one in folders if not one.startswith(".")) if deep < DEPTH else []
            found += [self.relative(here / name) for name in sorted(names) if name.lower().endswith(".spec")]
            if len(found) >= MAX_FILES:
                break
        return found[:MAX_FILES]

    def read(self, path: str) -> tuple[str, str]:
        """The text of a spec and its hash. Raises FileRefused."""
        return _read(self.inside(path))

    def save(self, path: str, text: str, was: str | None) -> str:
        """Write a spec; returns its hash. `was` is the hash of what the page believes to be there, None for nothing.
        Raises FileRefused, also where something else is there meanwhile."""
        file = self.inside(path)
        data = text.encode()
        if len(data) > MAX_TEXT:
            raise FileRefused(413, f"a spec on the page has at most {MAX_TEXT // 1024} kB")
        if not file.parent.is_dir():
            raise FileRefused(404, "there is no such folder in the opened one")
        there = _read(file)[1] if file.exists() else None
        if there != was and there != digest(data):
            raise FileRefused(409, "the file has changed on the disk since the page read it")
        try:
            write_whole(file, data)
        except OSError as error:
            raise FileRefused(403, f"the file cannot be written: {error.strerror or 'no permission'}") from None
        return digest(data)

    def draft(self, name: str) -> dict[str, Any] | None:
        """What was written for a file, or for a spec without one, and never saved: its `text`, and in `was` the hash of
        the file that it began with. None where there is nothing."""
        try:
            found = json.loads(self._draft(name).read_bytes())
        except (OSError, ValueError):
            return None
        return found if isinstance(found, dict) and isinstance(found.get("text"), str) else None

    def keep_draft(self, name: str, text: str | None, was: str | None) -> None:
        """Keep what is not saved, or with None for `text` forget it. Raises FileRefused."""
        if text is not None and len(text.encode()) > MAX_TEXT:
            raise FileRefused(413, f"a spec on the page has at most {MAX_TEXT // 1024} kB")
        file = self._draft(name)
        try:
            if text is None:
                file.unlink(missing_ok=True)
                return
            file.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            write_whole(file, json.dumps({"text": text, "was": was, "of": str(self.root / name)}).encode())
            for old in sorted(file.parent.glob("*.json"), key=lambda one: one.stat().st_mtime)[:-MOST_DRAFTS]:
                old.unlink(missing_ok=True)
        except OSError as error:
            raise FileRefused(403, f"what is not saved cannot be kept: {error.strerror or 'no permission'}") from None

    def _draft(self, name: str) -> Path:
        state = Path(os.environ.get("XDG_STATE_HOME") or "~/.local/state").expanduser()
        return state / "scenegen" / "drafts" / f"{digest(os.fsencode(self.root / name))}.json"


def digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def _read(file: Path) -> tuple[str, str]:
    try:
        # a pipe would hold its reader up for ever, and another file may have taken the place of one that was looked at
        handle = os.open(file, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0))
        try:
            if not stat.S_ISREG(os.fstat(handle).st_mode):
                raise FileRefused(400, "this is no regular file")
            data = _at_most(handle, MAX_TEXT + 1)
        finally:
            os.close(handle)
        if len(data) > MAX_TEXT:
            raise FileRefused(413, f"a spec on the page has at most {MAX_TEXT // 1024} kB")
        return data.decode("utf-8-sig"), digest(data)
    except FileNotFoundError:
        raise FileRefused(404, "there is no such file") from None
    except (OSError, UnicodeDecodeError):
        raise FileRefused(400, "this file cannot be read as text") from None


def _at_most(handle: int, size: int) -> bytes:
    """What can be read, up to a size."""
    parts: list[bytes] = []
    while size and (part := os.read(handle, size)):
        parts.append(part)
        size -= len(part)
    return b"".join(parts)


def shipped() -> list[dict[str, str]]:
    """Name, title and text of the specs that ship with scenegen."""
    found = []
    for name, path in shipped_specs().items():
        text = path.read_text(encoding="utf-8")
        head = text.partition("\n")[0]
        found.append({"name": name, "title": head.lstrip("# ").strip() if head.startswith("#") else "", "text": text})
    return found
