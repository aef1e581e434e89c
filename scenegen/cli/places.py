"""One rule for all commands: what a command writes is none of what it reads, and lies in no suite and no set."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from scenegen.inputs import inputs
from scenegen.scenes.locations import is_url, names_set

WRITTEN = ("out", "render", "png", "figure", "export", "log_dir")  # parameters that name places to write to
SETS = ("sample", "data", "dataset")  # commands whose --out may be a set, which refuses what is there already


def refuse_overwriting(command: str, given: Mapping[str, Any]) -> None:
    """Before a command is called with these values of its parameters: raises OutputError where it would write over what
    it reads, or into a suite or a set. What it finds out later, such as imports, it does not write over either."""
    places = [one for name in WRITTEN if isinstance(one := given.get(name), str | Path) and not is_url(str(one))]
    if not places:
        return
    from scenegen.scenes.files import refuse_place

    read = [path for name, value in given.items() if name not in WRITTEN for path in _files(value)]
    inputs.set({os.path.realpath(path) for path in read})
    for place in places:
        a_set = command in SETS and isinstance(place, str) and names_set(place)
        refuse_place(Path(place), read, a_set=a_set)


def _files(value: Any) -> Iterator[Path]:
    """The files that a value names: paths, texts such as `policy.py:act`, and specs without their ending."""
    for text in value if isinstance(value, list) else [value]:
        if isinstance(text, str | Path):
            for path in (f"{text}", f"{text}.spec", f"{text}".rpartition(":")[0]):
                with contextlib.suppress(OSError, ValueError):  # what reads it says what is wrong with it
                    if Path(path).is_file():
                        yield Path(path)
