"""Names of files, as descriptions write them."""

from __future__ import annotations

from pathlib import PurePosixPath


def ending_of(name: str) -> str:
    """`.obj` of `Meshes\\Vase.OBJ`."""
    return PurePosixPath(name.replace("\\", "/")).suffix.lower()


def local_name(name: str) -> str:
    """The path that a description means by a file's name, relative to itself: packages lie beside it."""
    plain = name.removeprefix("file://")
    if plain.startswith("package://"):  # package://name/meshes/a.stl
        plain = plain.removeprefix("package://").partition("/")[2]
    return plain
