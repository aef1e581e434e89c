"""The files that a command is made of: none of what it writes may be one of them. Imports nothing, so that everything
that reads may import it."""

from __future__ import annotations

import os
from contextvars import ContextVar
from pathlib import Path

inputs: ContextVar[set[str] | None] = ContextVar("inputs", default=None)  # set for as long as a command writes


def note_input(path: Path) -> None:
    """A file is read that another one names: an import, a mesh, a texture."""
    if (known := inputs.get()) is not None:
        known.add(os.path.realpath(path))


def is_input(path: Path) -> bool:
    """Whether a place to write to is an input, links followed."""
    return os.path.realpath(path) in (inputs.get() or ())
