"""Several files that appear together or not at all."""

from __future__ import annotations

import contextlib
import shutil
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

from scenegen.formats.files import ensure_folder, reported


@contextlib.contextmanager
def whole_files(folder: Path) -> Iterator[Callable[[str, bytes], None]]:
    """put(name, data): files below `folder` (made if its parent is there) that appear, in the order in which they were
    put, when the block ends without an error. A name may have a folder of its own, as in `meshes/mug.obj`.

    Raises OutputError and leaves nothing behind.
    """
    made = not folder.exists()
    ensure_folder(folder)
    names: list[str] = []
    with reported(folder):
        waiting = Path(tempfile.mkdtemp(dir=folder, prefix=".export.", suffix=".part"))

    def put(name: str, data: bytes) -> None:
        with reported(folder / name):
            (waiting / name).parent.mkdir(exist_ok=True)
            (waiting / name).write_bytes(data)
        names.append(name)

    try:
        yield put
        for name in names:
            with reported(folder / name):
                (folder / name).parent.mkdir(exist_ok=True)
                (waiting / name).replace(folder / name)
    except BaseException:
        shutil.rmtree(waiting, ignore_errors=True)
        if made:
            with contextlib.suppress(OSError):
                folder.rmdir()
        raise
    shutil.rmtree(waiting, ignore_errors=True)
