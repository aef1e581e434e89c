"""All kinds of problems with what `scenegen explain` says about them.

The explanations are data, in explanations/*.toml, and read only here. An example is the text of a spec; or, where it
opens with `$`, lines of a shell; or, with `>>>`, lines of Python. `untried` says why there is no example to run.
"""

from __future__ import annotations

import importlib
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from scenegen.errors.diagnostic import Kind, names

GROUPS = {
    "language": "Text, names, values, lists and time of a spec",
    "declarations": "Objects, their numbers, regions and statements of a spec",
    "priors": "Where things usually are",
    "requests": "Requests for scenes, motions and pairs",
    "files": "Files, trajectories, sets of scenes, stores and clusters",
    "worlds": "Planning problems, and environments of other libraries",
    "learning": "Training, models, metrics, environments and curricula",
    "program": "The program, the page and the machine",
}
EXPLANATIONS = Path(__file__).parent / "explanations"


@dataclass(frozen=True, slots=True)
class CatalogEntry:
    """A kind with its explanation. `example` triggers it, `mended` does not; both are empty where it is `untried`."""

    kind: Kind
    group: str
    means: str
    example: str = ""
    mended: str = ""
    untried: str = ""

    @property
    def facts(self) -> list[str]:
        """The names of its facts."""
        return names(self.kind)


def kinds(group: str) -> Iterator[Kind]:
    """The kinds of a group, in the order of its module."""
    found = vars(importlib.import_module(f"scenegen.errors.{group}")).values()
    return (one for one in found if isinstance(one, Kind))


def catalog() -> dict[str, CatalogEntry]:
    """All entries by code, group by group."""
    entries = {}
    for group in GROUPS:
        said = tomllib.loads((EXPLANATIONS / f"{group}.toml").read_text(encoding="utf-8"))
        for kind in kinds(group):
            entries[kind.code] = CatalogEntry(
                kind, group, **{name: text.strip("\n") for name, text in said[kind.code].items()}
            )
    return entries
