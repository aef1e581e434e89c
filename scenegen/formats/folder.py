"""Several files that appear together or not at all, and the names of scenes' files."""

from __future__ import annotations

import contextlib
import errno
import os
import re
import shutil
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

from scenegen.formats.files import ensure_folder, put_in_place, reported, write_whole

MANY = 100  # for more files, flushing all buffers of the machine is faster than flushing them one by one


@contextlib.contextmanager
def whole_files(folder: Path) -> Iterator[Callable[[str, bytes], None]]:
    """put(name, data): files below `folder` (made if its parent exists) that appear, in the order of the calls, when
    the block ends without an error. A name may contain a folder, as in `meshes/mug.obj`.

    Raises OutputError and leaves nothing behind.
    """
    with reported(folder):
        made = not folder.exists()
    ensure_folder(folder)
    names: list[str] = []
    below: set[Path] = set()  # folders that this call made
    with reported(folder):
        waiting = Path(tempfile.mkdtemp(dir=folder, prefix=".export.", suffix=".part"))

    def put(name: str, data: bytes) -> None:
        with reported(folder / name):
            (waiting / name).parent.mkdir(exist_ok=True)
            _write(waiting / name, data)
        names.append(name)

    try:
        yield put
        _flush([waiting / name for name in names])
        for name in names:
            with reported(folder / name):
                if not (folder / name).parent.exists():
                    (folder / name).parent.mkdir()
                    below.add((folder / name).parent)
                if (folder / name).is_dir():
                    raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
        for name in names:
            with reported(folder / name):
                _move(waiting / name, folder / name)
    except BaseException:
        shutil.rmtree(waiting, ignore_errors=True)
        for new in (*below, *([folder] if made else [])):
            with contextlib.suppress(OSError):
                new.rmdir()
        raise
    shutil.rmtree(waiting, ignore_errors=True)


def _write(path: Path, data: bytes) -> None:
    with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o666), "wb") as file:
        file.write(data)


def _flush(paths: list[Path]) -> None:
    """Wait until files are on disk: one by one, or if there are many, all buffers of the machine at once."""
    if len(paths) > MANY and hasattr(os, "sync"):
        os.sync()
        return
    for path in paths:
        with reported(path), path.open("rb") as file:
            os.fsync(file.fileno())


def _move(source: Path, target: Path) -> None:
    """Move a file to its final path. If that is a link, the link stays and its target is replaced."""
    if target.is_symlink():
        write_whole(target, source.read_bytes())
    else:
        put_in_place(source, target)


def scene_name(number: int, total: int) -> str:
    """`scene_0001`: the beginning of the names of a scene's files; the first of `total` has the number 1."""
    return f"scene_{number:0{max(4, len(str(total)))}d}"


def others(folder: Path, total: int, ending: str) -> int:
    """How many scenes' files with that ending a folder has in addition to those of `total` scenes, from an earlier
    run."""
    found = (re.match(r"(scene_(\d{4,}))[_.]", path.name) for path in folder.glob(f"scene_*{ending}"))
    return sum(
        match[1] != scene_name(int(match[2]), total) or not 1 <= int(match[2]) <= total for match in found if match
    )
