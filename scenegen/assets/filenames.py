"""Names of files, as descriptions write them."""

from __future__ import annotations

import contextlib
from pathlib import Path, PurePosixPath


def ending_of(name: str) -> str:
    """`.obj` of `Meshes\\Vase.OBJ`."""
    return PurePosixPath(name.replace("\\", "/")).suffix.lower()


def beside(name: str, other: str) -> str:
    """The name of a file that the file `name` names, as `name` is written."""
    folder = name.replace("\\", "/").rpartition("/")[0]
    return f"{folder}/{other}" if folder else other


def local_name(name: str, folder: Path, root: Path) -> str:
    """The path, relative to `folder`, that a description in that folder means by a file's name.

    `package://name/meshes/a.stl` is looked for in the folder's ancestors, itself included, but not beyond `root`: in
    one that is called as the package is, in a package that lies in one, and in the ancestor itself. `model://` is read
    alike. Where there is no such file, it is the path below `folder`.
    """
    scheme, found, path = name.replace("\\", "/").partition("://")
    if not found or scheme not in ("package", "model"):
        return path if scheme == "file" else name.replace("\\", "/")
    package, *parts = [part for part in path.split("/") if part] or [""]
    inner = "/".join(parts)
    above = [one for one in (folder, *folder.parents) if one.is_relative_to(root)]
    ups = ["../" * steps for steps in range(len(above))]
    named = [up for up, one in zip(ups, above, strict=True) if one.name == package]
    for path in [f"{up}{inner}" for up in named] + [
        f"{up}{within}" for up in ups for within in (f"{package}/{inner}", inner)
    ]:
        with contextlib.suppress(OSError, ValueError):  # a name that no file can have
            if (folder / path).is_file():
                return path
    return inner
