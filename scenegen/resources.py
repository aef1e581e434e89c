"""The version of the package, where grammar/, specs/, suites/ and docs/ live, and the files that a command is made of:
none of what it writes may be one of them. Imports nothing, so that everything may import it.

An installed wheel carries them as scenegen/_data/ (see force-include in pyproject.toml); a checkout has them beside the
package.
"""

from __future__ import annotations

import os
from contextvars import ContextVar
from functools import cache
from pathlib import Path

__version__ = "0.2.0"

# as in pyproject.toml
PAGES = ("arms", "assets", "language", "language-models", "models", "not-here", "pictures", "priors", "time")

_PACKAGE = Path(__file__).resolve().parent
inputs: ContextVar[set[str] | None] = ContextVar("inputs", default=None)  # set for as long as a command writes


@cache
def _root() -> Path:
    packed = _PACKAGE / "_data"
    return packed if packed.is_dir() else _PACKAGE.parent


def grammar_file(name: str) -> Path:
    """The path of a file of grammar/, e.g. `spec.lark`, `prelude.spec`."""
    return _root() / "grammar" / name


def shipped_pages() -> dict[str, Path]:
    """The pages of docs/ that texts of the program point to: name without ending -> path, in alphabetical order."""
    return {path.stem: path for path in sorted((_root() / "docs").glob("*.md")) if path.stem in PAGES}


def shipped_specs() -> dict[str, Path]:
    """The specs that ship with scenegen: name without ending -> path, in alphabetical order."""
    return {path.stem: path for path in sorted((_root() / "specs").glob("*.spec"))}


def shipped_suites() -> dict[str, Path]:
    """The suites that ship with scenegen: name -> folder, in alphabetical order."""
    return {path.parent.name: path.parent for path in sorted((_root() / "suites").glob("*/suite.json"))}


def note_input(path: Path) -> None:
    """A file is read that another one names: an import, a mesh, a texture."""
    if (known := inputs.get()) is not None:
        known.add(os.path.realpath(path))


def is_input(path: Path) -> bool:
    """Whether a place to write to is an input, links followed."""
    return os.path.realpath(path) in (inputs.get() or ())
