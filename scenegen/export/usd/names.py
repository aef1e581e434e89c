"""Names of prims: identifiers of USD, made from names of any kind."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable

# Newer versions of USD allow more letters; those of Isaac Sim before 5 do not.
_IDENTIFIER = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_OTHER = re.compile(r"[^A-Za-z0-9_]+")


def identifiers(names: Iterable[str]) -> dict[str, str]:
    """An identifier for each of different names, no two alike: the name itself if it is one, as `mug`, else the name
    with underscores, as `block_1` for `block[1]`, and a number where that is taken."""
    wanted = list(names)
    kept = {name for name in wanted if _IDENTIFIER.fullmatch(name)}
    used, found = set(kept), {}
    for name in wanted:
        found[name] = name if name in kept else free(_plain(name), used)
        used.add(found[name])
    return found


def free(wish: str, used: Collection[str]) -> str:
    """`wish`, or with the least number from 2 that makes it different from all that are used."""
    name, number = wish, 1
    while name in used:
        number += 1
        name = f"{wish}_{number}"
    return name


def _plain(name: str) -> str:
    """An identifier with the letters and digits of a name."""
    word = _OTHER.sub("_", name).strip("_") or "object"
    return f"_{word}" if word[0].isdigit() else word
