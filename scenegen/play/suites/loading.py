"""Worlds and policies by what a user calls them: a name, MODULE:NAME, or FILE.py:NAME.

Names are those of `WORLDS`, and those that other packages register as entry points of the groups `scenegen.worlds` and
`scenegen.policies`; an entry point is loaded only when its name is asked for.
"""

from __future__ import annotations

import contextlib
import importlib
import importlib.metadata
import importlib.util
import sys
from pathlib import Path
from typing import Any, Literal

from scenegen.errors import RequestError, quote_names
from scenegen.errors.requests import WRONG_VALUE
from scenegen.needs import load_plugin, plugins
from scenegen.resources import __version__

Role = Literal["world", "policy"]

WORLDS = {
    "table": "scenegen.play.suites.adapters.table:make",
    "libero": "scenegen.play.suites.adapters.libero:make",
    "libero-pictures": "scenegen.play.suites.adapters.libero:seeing",
}
HAND, HAND_WORLD = (
    "hand:",
    "scenegen.play.stage.hand:load_hand",
)  # begins the name of a world that a person is, and of what that person starts by hand
ENTRY_POINT_GROUPS: dict[Role, str] = {"world": "scenegen.worlds", "policy": "scenegen.policies"}


def check_name(role: Role, text: str) -> None:
    """Raises RequestError for what names no world or policy, and for a name that two packages have; nothing is
    loaded."""
    if text.startswith(HAND) or (role == "policy" and text.startswith("http://")):
        return
    where, _, name = text.rpartition(":")
    if where and name.isidentifier():
        return
    own = WORLDS if role == "world" else {}
    known = [] if ":" in text else sorted({*own, *plugins(ENTRY_POINT_GROUPS[role], role, own)})
    if text not in known:
        known += [HAND] if role == "world" and known else []
        forms = "MODULE:NAME or FILE.py:NAME" + (", or http://HOST:PORT" if role == "policy" else "")
        wanted = f"{forms}, or one of {quote_names(known)}" if known else forms
        raise RequestError(WRONG_VALUE(argument=role, value=f"`{text}`", wanted=wanted))


def load_named(role: Role, text: str) -> Any:
    """The world or policy of that name. Raises RequestError for an entry point of no use, and what an import raises."""
    if text.startswith(HAND):
        return load_named("world", HAND_WORLD)(role, text.removeprefix(HAND))
    text = WORLDS.get(text, text) if role == "world" else text
    where, _, name = text.rpartition(":")
    if not where:
        return load_plugin(plugins(ENTRY_POINT_GROUPS[role], role, WORLDS if role == "world" else ())[text], role, ())
    if not where.endswith(".py"):
        return getattr(importlib.import_module(where), name)
    key = str(Path(where).resolve())  # no name of another module
    if key not in sys.modules:
        spec = importlib.util.spec_from_file_location(key, key)
        assert spec is not None and spec.loader is not None
        sys.modules[key] = module = importlib.util.module_from_spec(spec)
        sys.path.append(str(Path(key).parent))  # for modules of the same folder
        spec.loader.exec_module(module)
    return getattr(sys.modules[key], name)


def versions_of(world: str) -> dict[str, str]:
    """That of scenegen, and that of the package which a world is of; scenegen's own need robosuite."""
    versions = {"scenegen": __version__}
    where = WORLDS.get(world, world).rpartition(":")[0]
    package = where.partition(".")[0]
    if not where:
        dist = plugins(ENTRY_POINT_GROUPS["world"], "world", WORLDS)[world].dist
        package = "" if dist is None else dist.name
    if package and not where.endswith(".py"):
        with contextlib.suppress(importlib.metadata.PackageNotFoundError):
            package = "robosuite" if package == "scenegen" else package
            versions[package] = importlib.metadata.version(package)
    return versions
