"""Which locations are sets of scenes, and which are single files: without loading anything for it."""

from __future__ import annotations

import re
from pathlib import Path


def is_url(text: str) -> bool:
    """Whether a location is a URL, not a path."""
    return re.match(r"[a-z][a-z0-9+]*://", text) is not None


def as_location(path: str | Path) -> str:
    """A location as its user wrote it. A Path of a URL has lost a slash: it is put back."""
    text = str(path)
    return text if is_url(text) or isinstance(path, str) else re.sub(r"^([a-z][a-z0-9+]+):/(?=[^/])", r"\1://", text)


def names_set(location: str | Path) -> bool:
    """Whether a place to write to is one for a set: a URL, or a path that ends in a slash."""
    text = as_location(location)
    return is_url(text) or text.endswith("/")


def is_set(location: str | Path) -> bool:
    """Whether a place to read from is a set: as above, or a folder that exists."""
    text = as_location(location)
    if names_set(location):
        return True
    try:
        return Path(text).is_dir()
    except (OSError, ValueError):
        return False


def inside(location: str, name: str) -> str:
    """A folder in a folder, as a place to write a set to; the query part of a URL stays at its end."""
    folder, mark, query = location.partition("?") if is_url(location) else (location, "", "")
    return f"{folder.rstrip('/')}/{name}/{mark}{query}"
